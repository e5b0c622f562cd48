"""Weights on disk come back as they were, say what they are, and are refused in a sentence where they do not fit."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import torch

from interp import weights
from interp.networks import make, names
from vid2ev import DataError, UsageError


@pytest.mark.parametrize("name", names())
def test_networks_come_back_from_the_disk(name: str, tmp_path: Path) -> None:
    path = tmp_path / "trained.safetensors"
    network = make(name, "tiny")
    weights.save(path, name, network, {"steps": "100"})
    loaded = weights.load(path)
    assert type(loaded) is type(network) and loaded.spec == network.spec and not loaded.training
    mine, theirs = network.state_dict(), loaded.state_dict()
    assert mine.keys() == theirs.keys() and all(torch.equal(mine[key], theirs[key]) for key in mine)
    assert list(tmp_path.iterdir()) == [path]


def test_the_same_network_gives_the_same_bytes_and_16_bits_take_half_of_them(tmp_path: Path) -> None:
    network, about = make("firenet"), {str(k): "said" for k in range(8)}
    for number in range(3):
        weights.save(tmp_path / f"{number}.safetensors", "firenet", network, about)
    whole = {(tmp_path / f"{number}.safetensors").read_bytes() for number in range(3)}
    assert len(whole) == 1
    weights.save(tmp_path / "half.safetensors", "firenet", network, about, half=True)
    parameters = sum(each.numel() for each in network.parameters())
    assert len(whole.pop()) - (tmp_path / "half.safetensors").stat().st_size == pytest.approx(2 * parameters, abs=64)
    loaded = weights.load(tmp_path / "half.safetensors")
    for name, tensor in loaded.state_dict().items():
        assert tensor.dtype == torch.float32
        torch.testing.assert_close(tensor, network.state_dict()[name], rtol=2**-11, atol=1e-7)


def test_options_come_back_too(tmp_path: Path) -> None:
    path = tmp_path / "trained.safetensors"
    options = {"depths": (3, 3, 3, 3), "candidate": "softmax", "colours": 1, "flow_scale": 5.0}
    weights.save(path, "rrin_events", make("rrin_events", "small", **options))
    spec = weights.load(path).spec
    assert {key: getattr(spec, key) for key in options} == options and spec.size == "small"


@pytest.mark.parametrize("wrapper", ["module.", "_orig_mod.", "module._orig_mod."])
def test_names_that_wrappers_change_are_understood(wrapper: str, tmp_path: Path) -> None:
    from safetensors.torch import save_file

    network = make("firenet")
    tensors = {wrapper + key: tensor for key, tensor in network.state_dict().items()}
    path = tmp_path / "wrapped.safetensors"
    save_file(tensors, path, {"network": "firenet", "spec": network.spec.model_dump_json()})  # type: ignore[operator, union-attr]
    torch.testing.assert_close(weights.load(path).state_dict(), network.state_dict())


def test_a_part_takes_the_weights_of_a_network_trained_for_itself(tmp_path: Path) -> None:
    flow, fire = make("flow", zero_heads=False), make("firenet")
    weights.save(tmp_path / "flow.safetensors", "flow", flow)
    weights.save(tmp_path / "fire.safetensors", "firenet", fire)
    network = make("rrin_slomo_events", flow="pretrained", reconstruct="firenet", reconstruct_weights="pretrained")
    weights.load_part(network, "flow", tmp_path / "flow.safetensors")
    weights.load_part(network, "reconstruct", tmp_path / "fire.safetensors")
    frames = torch.rand(2, 1, 3, 16, 16)
    torch.testing.assert_close(network.flow(*frames), flow(*frames).detach())  # type: ignore[operator]
    torch.testing.assert_close(network.get_submodule("reconstruct.module").state_dict(), fire.state_dict())
    with pytest.raises(UsageError, match="weights of another network, firenet"):
        weights.load_part(network, "flow", tmp_path / "fire.safetensors")
    with pytest.raises(UsageError, match="no part 'flows'"):
        weights.load_part(network, "flows", tmp_path / "flow.safetensors")


@pytest.mark.parametrize(
    ("part", "name", "options"),
    [("flow", "flow", {"flow_scale": 20.0}), ("reconstruct", "firenet", {"output": "linear"})],
)
def test_weights_that_mean_something_else_in_a_part_are_refused(
    part: str, name: str, options: dict[str, Any], tmp_path: Path
) -> None:
    """Shapes do not tell that flows are in other units, or pictures not between 0 and 1."""
    weights.save(tmp_path / "other.safetensors", name, make(name, **options))
    network = make("rrin_slomo_events", flow="pretrained", reconstruct="firenet")
    (key, value), *_ = options.items()
    with pytest.raises(UsageError, match=f"with {key} = {value}, and {part} of this one has"):
        weights.load_part(network, part, tmp_path / "other.safetensors")


@pytest.mark.parametrize("part", ["flow", "refine"])
def test_parts_that_are_not_trained_for_themselves_take_no_weights(part: str, tmp_path: Path) -> None:
    path, network = tmp_path / "whole.safetensors", make("rrin_events")
    weights.save(path, "rrin_events", network)
    with pytest.raises(UsageError, match=f"no part '{part}'; it has none that is trained for itself"):
        weights.load_part(network, part, path)


def test_what_is_not_weights_is_refused_in_a_sentence(tmp_path: Path) -> None:
    from safetensors.torch import save_file

    network = make("firenet")
    spec = network.spec.model_dump_json()  # type: ignore[operator, union-attr]
    (tmp_path / "text").write_text("hello, this is not a file of tensors")
    torch.save(network.state_dict(), tmp_path / "pickle")
    save_file(network.state_dict(), tmp_path / "silent")
    save_file(network.state_dict(), tmp_path / "unknown", {"network": "other", "spec": spec})
    save_file(network.state_dict(), tmp_path / "no-spec", {"network": "firenet", "spec": "{"})
    save_file(network.state_dict(), tmp_path / "later", {"network": "firenet", "spec": '{"size": "tiny", "new": 1}'})
    save_file({"out.bias": torch.zeros(1)}, tmp_path / "part", {"network": "firenet", "spec": spec})
    for name in ("none", "text", "pickle", "silent", "unknown", "no-spec", "later", "part"):
        with pytest.raises(DataError, match=name) as refused:
            weights.load(tmp_path / name)
        assert "\n" not in str(refused.value)
    with pytest.raises(DataError, match=r"is a checkpoint of torch, not weights in safetensors; give the run's folder"):
        weights.load(tmp_path / "pickle")


def test_a_disk_that_cannot_take_it_leaves_what_was_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "trained.safetensors"
    weights.save(path, "firenet", make("firenet"))
    before = path.read_bytes()

    def full(_handle: int) -> None:
        raise OSError("No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(OSError, match="No space"):
        weights.save(path, "firenet", make("firenet"))
    assert path.read_bytes() == before and list(tmp_path.iterdir()) == [path]
