"""`vid2ev cost`, and `convert --budget`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import h5py
import hdf5plugin  # noqa: F401
import numpy as np
import pytest
from click.testing import CliRunner, Result
from matplotlib.image import imread
from moving_texture import texture

from vid2ev.commands import Commands, splitting
from vid2ev.commands.convert import convert
from vid2ev.commands.cost import cost
from vid2ev.cost import choice, store

COMMON = ["--sensor", "ideal", "--fps", "50", "--threads", "1"]


@pytest.fixture
def clip(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.chdir(tmp_path)
    texture(tmp_path, frames=6)
    return "texture.npy"


def call(command: Any, *arguments: str) -> Result:
    """A command within the group that turns errors into sentences."""
    group = Commands("vid2ev")
    group.get_command = lambda ctx, name: command  # type: ignore[method-assign]
    group.list_commands = lambda ctx: [command.name]  # type: ignore[method-assign]
    return CliRunner().invoke(group, [command.name, *arguments], catch_exceptions=False)


def made(path: str) -> dict[str, np.ndarray]:
    with h5py.File(f"{path}/events.h5") as file:
        return {name: file[f"events/{name}"][:] for name in "txyp"}


def same(one: str, other: str) -> bool:
    return all(np.array_equal(a, made(other)[name]) for name, a in made(one).items())


def test_table_file_and_picture(clip: str) -> None:
    done = call(cost, clip, *COMMON, "--repeats", "1", "--budget", "vR=0.02")
    assert done.exit_code == 0, done.output
    told = json.loads(Path("texture_cost.json").read_text())
    assert told["budget"] == "vR=0.02" and told["reference"]["distance"] == 0
    shown = {row["name"] for row in told["settings"]}
    assert all(name in done.output for name in shown) and {"default", "straight light", "half the size"} <= shown
    assert imread("texture_cost.png").shape[:2] == (600, 950)
    refused = call(cost, clip, *COMMON)
    assert refused.exit_code == 2 and "texture_cost.json exists; --overwrite replaces it" in refused.output
    within = call(cost, clip, *COMMON, "-o", "texture_cost.json/new/cost")
    assert within.exit_code == 1 and "texture_cost.json is a file; choose another place" in within.output
    again = call(cost, clip, *COMMON, "--repeats", "1", "--overwrite", "--json", "--upsample", "none")
    assert again.exit_code == 0, again.output
    assert "upsample" not in json.dumps(json.loads(again.stdout)["settings"])


def test_what_was_measured_is_said_also_where_it_cannot_be_written(clip: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(store, "check_new", lambda place, overwrite: None)  # (the place is taken after this)
    Path("taken").write_text("a file")
    done = call(cost, clip, *COMMON, "--repeats", "1", "--upsample", "none", "-o", "taken/cost")
    assert done.exit_code == 1 and "straight light" not in done.output
    assert "default" in done.stdout and "taken/cost.json cannot be written" in done.output


def test_a_budget_that_nothing_meets_ends_with_2_and_what_was_measured_is_there(clip: str) -> None:
    for options in ([], ["--json", "--overwrite"]):
        done = call(cost, clip, *COMMON, "--repeats", "1", "--budget", "time=1e-9x", *options)
        assert done.exit_code == 2
        assert done.stderr.startswith("error: budget 'time=1e-9x': the best settings come to time=")
        assert "allow more" not in done.stdout and "straight light" in done.stdout
        assert json.loads(Path("texture_cost.json").read_text())["recommended"] is None
    assert json.loads(done.stdout)["recommended"] is None
    converted = call(convert, clip, *COMMON, "-o", "out", "--budget", "time=1e-9x")
    assert converted.exit_code == 2 and "the best settings come to time=" in converted.stderr
    assert not Path("out").exists()


def test_a_budget_is_kept_and_noted(clip: str) -> None:
    done = call(convert, clip, *COMMON, "--no-preview", "-o", "out", "--budget", "time=1000000x")
    assert done.exit_code == 0, done.output
    note = json.loads(Path("out/manifest.json").read_text())["budget"]
    assert note["asked"] == "time=1000000x" and note["setting"] == "finest" and 0 < note["errors"]["distance"] < 0.02
    assert note["setting"] in done.output
    plain = call(convert, clip, *COMMON, "--no-preview", "-o", "plain", *note["arguments"].split())
    assert plain.exit_code == 0 and same("out", "plain")


def test_what_is_given_explicitly_stays(clip: str) -> None:
    fixed = ["--upsample", "none", "--effects", "all", "--size", "48x32", "--set", "timing=frame"]
    done = call(convert, clip, *COMMON, *fixed, "--no-preview", "-o", "out", "--budget", "vR=1")
    assert done.exit_code == 0, done.output
    note = json.loads(Path("out/manifest.json").read_text())["budget"]
    assert (note["arguments"], note["setting"]) == ("", note["setting"]) and note["setting"] in ("default", "reference")
    assert call(convert, clip, *COMMON, *fixed, "--no-preview", "-o", "plain").exit_code == 0
    assert same("out", "plain")


def test_a_conversion_that_goes_on_keeps_its_setting(clip: str) -> None:
    asked = [clip, *COMMON, "--no-preview", "-o", "out", "--budget", "vR=0.3"]
    assert call(convert, *asked).exit_code == 0
    before = Path("out/manifest.json").read_bytes()
    done = call(convert, *asked, "--resume")
    assert done.exit_code == 0 and "as before" in done.output
    assert Path("out/manifest.json").read_bytes() == before


def test_what_is_given_later_does_not_give_way_to_what_was_chosen(clip: str) -> None:
    """Of one that goes on; it is told so, as of anything else that differs."""
    asked = [clip, *COMMON, "--no-preview", "-o", "out", "--budget", "time=1000000x"]
    assert call(convert, *asked).exit_code == 0
    before = Path("out/manifest.json").read_bytes()
    assert json.loads(before)["budget"]["options"].keys() == {"subframes"}
    done = call(convert, *asked, "--subframes", "2", "--resume")
    assert done.exit_code == 2 and "out" in done.stderr and "as before" not in done.output
    assert Path("out/manifest.json").read_bytes() == before
    assert call(convert, *asked, "--cuts", "restart", "--resume").exit_code == 0


@pytest.mark.parametrize(
    "wrong",
    [["--format", "nonsense"], ["--cis-out", "png"], ["--probe", "1000,1000"], ["--jobs", "2", "--split", "cuts",
     "--cuts", "keep"]],
)  # fmt: skip
def test_what_cannot_be_converted_is_refused_before_anything_is_tried(
    clip: str, wrong: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(choice, "measured", lambda *_, **__: pytest.fail("it was tried"))
    plain, done = (call(convert, clip, *COMMON, "-o", "out", *wrong, *more) for more in ([], ["--budget", "vR=0.1"]))
    assert plain.exit_code == done.exit_code == 2 and plain.stderr == done.stderr
    assert not Path("out").exists()


@pytest.mark.parametrize("device", ["auto", "cpu"])
def test_settings_are_timed_on_the_cpu_and_other_devices_say_so(clip: str, device: str) -> None:
    asked = [clip, *COMMON, "--no-preview", "--device", device, "--budget", "time=1e-9x"]
    refused = [call(convert, *asked, *more) for more in ([], ["-q"])]
    assert [each.exit_code for each in refused] == [2, 2]
    said = ["timed on the CPU, whatever --device converts on" in each.stderr for each in refused]
    assert said == [device != "cpu", False]


def test_truth_is_written_within_a_budget_as_without(clip: str) -> None:
    asked = [clip, *COMMON, "--no-preview", "--depth", "plane:2", "--truth", "depth", "--truth-rate", "100"]
    done = call(convert, *asked, "-o", "out", "--budget", "vR=1")
    assert done.exit_code == 0, done.output
    assert call(convert, *asked, "-o", "plain").exit_code == 0
    assert {path.name for path in Path("out").iterdir()} == {path.name for path in Path("plain").iterdir()}


def test_parts_are_made_with_effects_that_are_known_before(clip: str, monkeypatch: pytest.MonkeyPatch) -> None:
    ladders: list[set[str]] = []
    monkeypatch.setattr(splitting, "split_among", lambda *_: {})
    within = choice.measured

    def measured(*arguments: Any, **options: Any) -> Any:
        cost = within(*arguments, **options)
        ladders.append({row.rung.name for row in cost.rows})
        return cost

    monkeypatch.setattr(choice, "measured", measured)
    noisy = [clip, *COMMON, "--set", "leak_rate_hz=5", "--budget", "vR=1", "--jobs", "2", "-q"]
    for split in (["--split", "tiles"], []):
        call(convert, *noisy, *split, "-o", f"out{len(ladders)}")
    assert [("effects auto" in names, "effects none" in names) for names in ladders] == [(False, True), (True, True)]


@pytest.mark.parametrize(
    ("budget", "said"),
    [("vR=x", "such as vR=0.05"), ("lsb=1", "lsb cannot be measured here"), ("time=0", "no setting takes no time")],
)
def test_a_budget_that_cannot_be_is_refused_before_anything_is_written(clip: str, budget: str, said: str) -> None:
    done = call(convert, clip, *COMMON, "-o", "out", "--budget", budget)
    assert done.exit_code == 2 and said in done.output and done.output.count("\n") == 1
    assert not Path("out").exists() and not Path("out.partial").exists()


def test_a_dry_run_tries_nothing(clip: str) -> None:
    done = call(convert, clip, *COMMON, "-o", "out", "--budget", "vR=0.1", "--dry-run")
    assert done.exit_code == 0 and "budget" in done.output
    assert call(convert, clip, *COMMON, "-o", "out", "--budget", "wrong", "--dry-run").exit_code == 2
