"""Monocular depth: a tiny model of random weights, saved and loaded as a real one is."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from vid2ev.errors import DataError, UsageError
from vid2ev.rig.depth import open_depth
from vid2ev.rig.intrinsics import Intrinsics

transformers = pytest.importorskip("transformers")
pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::FutureWarning")

SOURCE = Intrinsics.of_field((48, 36), 60)
LIGHT = np.random.default_rng(0).random((36, 48), np.float32)


@pytest.fixture(scope="module", params=["relative", "metric"])
def folder(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A Depth Anything of three tiny layers, as `save_pretrained` writes it."""
    import torch

    torch.manual_seed(0)
    backbone = transformers.Dinov2Config(
        image_size=28, patch_size=14, hidden_size=16, num_hidden_layers=4, num_attention_heads=2, intermediate_size=16,
        out_features=["stage1", "stage2", "stage3", "stage4"], reshape_hidden_states=False, apply_layernorm=True,
    )  # fmt: skip
    config = transformers.DepthAnythingConfig(
        backbone_config=backbone, patch_size=14, reassemble_hidden_size=16, neck_hidden_sizes=[4, 8, 8, 8],
        fusion_hidden_size=8, head_hidden_size=4, depth_estimation_type=request.param,
        max_depth=20 if request.param == "metric" else 1,
    )  # fmt: skip
    path = tmp_path_factory.mktemp("model") / request.param
    model = transformers.DepthAnythingForDepthEstimation(config)
    with torch.no_grad():
        model.head.conv3.bias.fill_(0.5)  # (random weights often make nothing but zeros)
    model.save_pretrained(path)
    processor = {
        "image_processor_type": "DPTImageProcessor", "do_resize": True, "size": {"height": 28, "width": 28},
        "keep_aspect_ratio": True, "ensure_multiple_of": 14, "do_rescale": True, "rescale_factor": 1 / 255,
        "do_normalize": True, "image_mean": [0.485, 0.456, 0.406], "image_std": [0.229, 0.224, 0.225],
    }  # fmt: skip
    (path / "preprocessor_config.json").write_text(json.dumps(processor))
    return path


def test_a_model_gives_depth_of_the_size_of_the_picture(folder: Path) -> None:
    relative = folder.name == "relative"
    depth = open_depth(f"model:{folder}", SOURCE, scale=0.4 if relative else None, shift=0.05 if relative else 0.0)
    found, values = depth.at(0, LIGHT), depth.values(LIGHT)
    assert depth.plane_m is None and found.shape == values.shape == (36, 48) and found.dtype == np.float32
    assert np.isfinite(found).all() and values.std() > 0
    np.testing.assert_allclose(found, 1 / (0.4 * values + 0.05) if relative else values, rtol=1e-6)
    colour = np.repeat(LIGHT[..., None], 3, axis=-1)
    np.testing.assert_array_equal(depth.values(colour), values)


def test_each_frame_is_looked_at_once(folder: Path, monkeypatch) -> None:  # type: ignore[no-untyped-def]
    depth = open_depth(f"model:{folder}", SOURCE, scale=0.4, shift=0.05)
    asked, values = [], depth.values
    monkeypatch.setattr(depth, "values", lambda light: asked.append(light) or values(light))
    for index, light in ((0, LIGHT), (1, LIGHT[::-1])):
        assert depth.at(index, light) is depth.at(index, light)
    assert len(asked) == 2
    with pytest.raises(UsageError, match="without its picture"):
        depth.at(5)


def test_what_a_model_needs_is_said(folder: Path, tmp_path: Path, monkeypatch) -> None:  # type: ignore[no-untyped-def]
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    if folder.name == "relative":
        with pytest.raises(UsageError, match="give the scale in 1 / Z"):
            open_depth(f"model:{folder}", SOURCE)
    own, other = ("inverse", "depth") if folder.name == "relative" else ("depth", "inverse")
    assert open_depth(f"model:{folder}", SOURCE, scale=1, kind=own).scale.kind == own
    for said in ({"kind": other}, {"kind": "disparity", "baseline_m": 0.1}, {"baseline_m": 0.1}):
        with pytest.raises(UsageError, match=f"gives numbers of kind '{own}', not "):
            open_depth(f"model:{folder}", SOURCE, scale=1, **said)
    (tmp_path / "config.json").write_text("{}")
    for name in (tmp_path, tmp_path / "nothing"):
        with pytest.raises(DataError, match="cannot be loaded") as caught:
            open_depth(f"model:{name}", SOURCE, scale=1)
        assert "\n" not in str(caught.value)


def test_a_name_that_nobody_has_is_asked_for_once(monkeypatch) -> None:  # type: ignore[no-untyped-def]
    import huggingface_hub

    asked = []

    def model_info(_: object, name: str, timeout: float) -> None:
        asked.append((name, timeout <= 10))
        raise OSError("no network")

    monkeypatch.setattr(huggingface_hub.HfApi, "model_info", model_info)
    monkeypatch.setattr(transformers.AutoImageProcessor, "from_pretrained", _of_folders_alone)
    with pytest.raises(DataError, match=r"model:nobody/nothing cannot be loaded \(no network\)"):
        open_depth("model:nobody/nothing", SOURCE, scale=1)
    assert asked == [("nobody/nothing", True)]


def _of_folders_alone(name: str, local_files_only: bool, **_: object) -> None:
    assert local_files_only, "asked the hub before it was known that it has the model"
    raise OSError(f"{name} is not here")
