"""`vid2ev init` and `vid2ev calibration`: files to edit and files of others, and refusals of one line."""

from __future__ import annotations

from pathlib import Path

import click
import pytest
from click.testing import CliRunner, Result
from drawn_rigs import differences, pair

from vid2ev.commands import Commands
from vid2ev.commands.calibration import calibration
from vid2ev.commands.init import init
from vid2ev.errors import DataError, UsageError
from vid2ev.rig.calibration import FORMATS, read_calibration, write_calibration
from vid2ev.rig.rig_file import EXAMPLE, read_rig, write_rig


class TheseCommands(Commands):
    """The command line with two commands, as it reports errors."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return ["calibration", "init"]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        return {"calibration": calibration, "init": init}.get(cmd_name)


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def vid2ev(*arguments: str) -> Result:
    result = CliRunner().invoke(TheseCommands("vid2ev"), arguments)
    if result.exception and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result


def test_init_writes_the_example() -> None:
    assert vid2ev("init", "rig.toml").exit_code == 0
    assert Path("rig.toml").read_text() == EXAMPLE.read_text()
    refused = vid2ev("init", "rig.toml")
    assert refused.exit_code == 2 and refused.stderr.strip() == "error: rig.toml exists; --overwrite replaces it"
    assert vid2ev("init", "rig.toml", "--overwrite").exit_code == 0


@pytest.mark.parametrize("name", FORMATS)
def test_init_begins_with_a_calibration(name: str) -> None:
    write_calibration("calibration", pair(), name)
    shown = vid2ev("init", "rig.toml", "--from", "calibration")
    assert shown.exit_code == 0 and "left, rgb, right" in shown.output and f"({name})" in shown.output
    assert read_rig("rig.toml") == read_calibration("calibration").rig
    assert max(differences(read_rig("rig.toml"), pair())) < 1e-9


@pytest.mark.parametrize("name", FORMATS)
def test_a_calibration_in_place_of_a_rig_is_told_how_to_become_one(name: str) -> None:
    write_calibration("calibration", pair(), name)
    with pytest.raises(DataError, match=r"^calibration: .*; vid2ev init rig\.toml --from calibration makes a rig"):
        read_rig("calibration")


@pytest.mark.parametrize("name", FORMATS)
def test_a_rig_goes_into_any_format_and_back(name: str) -> None:
    write_rig("rig.toml", pair().model_copy(update={"source": read_rig(EXAMPLE).source}))
    assert vid2ev("calibration", "rig.toml", "there", "--as", name).exit_code == 0
    assert vid2ev("calibration", "there", "back.toml").exit_code == 0
    assert max(differences(read_rig("back.toml"), pair())) < 1e-9


def test_what_is_left_out_is_named() -> None:
    write_rig("rig.toml", pair())
    shown = vid2ev("calibration", "rig.toml", "calibration.json")
    assert "rig to dv" in shown.output
    assert "note: dv does not hold clock_offset_us; kind" in shown.output
    assert "note" not in vid2ev("calibration", "rig.toml", "camchain.yaml", "--as", "kalibr").output


def test_sensors_that_a_rig_may_not_take_from_where_they_are_are_named() -> None:
    for folder in ("in", "out"):
        Path(folder).mkdir()
    left, *others = pair().cameras
    Path("in/mine.toml").write_text("[dvs]\nthreshold_on = 0.3\n")
    cameras = tuple(camera.model_copy(update={"sensor": "in/mine.toml"}) for camera in (left, *others))
    write_rig("in/rig.toml", pair().model_copy(update={"cameras": cameras}))
    for command, rig in (("calibration", "out/rig.toml"), ("init", "out/other.toml")):
        shown = vid2ev(command, *(["in/rig.toml", rig] if command == "calibration" else [rig, "--from", "in/rig.toml"]))
        notes = [line.removeprefix("note: ") for line in shown.output.splitlines() if line.startswith("note: ")]
        with pytest.raises(UsageError) as refused:
            read_rig(rig)
        assert notes == [str(refused.value)] and "names ../in/mine.toml" in notes[0]
    assert "note" not in vid2ev("calibration", "in/rig.toml", "whole.toml").output
    assert read_rig("whole.toml").cameras[0].sensor == "in/mine.toml"


@pytest.mark.parametrize(
    ("exit_code", "sentence", "arguments"),
    [
        (2, "out.yaml does not say its format; give --as rig|opencv|kalibr|dsec|dv", ["rig.toml", "out.yaml"]),
        (2, "none.yaml: no such file; give a rig file, such as", ["none.yaml", "out.toml"]),
        (1, "is no calibration file of a known format", ["text.yaml", "out.toml"]),
        (2, "camchain.yaml counts in m; leave --unit mm out", ["camchain.yaml", "out.toml", "--unit", "mm"]),
        (2, "rig.toml exists; --overwrite replaces it", ["camchain.yaml", "rig.toml"]),
        (2, "camera cis has no", ["example.toml", "out.json"]),
        (1, "cannot be written", ["rig.toml", "nowhere/out.json"]),
    ],
)
def test_refusals_are_one_line_and_leave_nothing(exit_code: int, sentence: str, arguments: list[str]) -> None:
    write_rig("rig.toml", pair())
    write_calibration("camchain.yaml", pair(), "kalibr")
    Path("text.yaml").write_text("hello: world")
    vid2ev("init", "example.toml")
    before = sorted(Path().iterdir())
    refused = vid2ev("calibration", *arguments)
    assert refused.exit_code == exit_code, refused.output
    line = refused.stderr.strip()
    assert line.startswith("error: ") and sentence in line and "\n" not in line and refused.stdout == ""
    assert sorted(Path().iterdir()) == before
