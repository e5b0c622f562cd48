"""`vid2ev sensors` shows what the presets say, to people and to programs."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from vid2ev.commands.sensors import sensors
from vid2ev.errors import UsageError
from vid2ev.sensors.presets import KINDS, Kind, load, read_sensor


def run(*arguments: str) -> str:
    done = CliRunner().invoke(sensors, arguments, catch_exceptions=False)
    assert done.exit_code == 0
    return done.output


ALL = [(kind, name) for kind in KINDS for name in kind.names()]


@pytest.mark.parametrize(("kind", "name"), ALL)
def test_the_list_has_a_line_for_each_preset(kind: Kind, name: str) -> None:
    titled = [line for line in run().splitlines() if read_sensor(name, kind).about["title"] in line]
    assert [line.split()[0] for line in titled] == [name]


def test_the_list_for_programs() -> None:
    listed = json.loads(run("--json"))
    assert {kind: sorted(titles) for kind, titles in listed.items()} == {kind.table: kind.names() for kind in KINDS}


@pytest.mark.parametrize(("kind", "name"), ALL)
def test_a_page_explains_every_key_and_cites_every_source(kind: Kind, name: str) -> None:
    page = " ".join(run(name).split())
    for key, field in kind.spec.model_fields.items():
        assert f"{key} = {json.dumps(load(kind, name).model_dump(mode='json')[key])}" in page
        assert (field.description or "").partition(" [")[0] in page
    for source in [*read_sensor(name, kind).sources.values(), *read_sensor(name, kind).about["sources"]]:
        assert " ".join(source.split()) in page


@pytest.mark.parametrize(("kind", "name"), ALL)
def test_the_page_for_programs_makes_the_same_sensor(kind: Kind, name: str) -> None:
    page = json.loads(run(name, "--json"))
    assert kind.spec(**{key: entry["value"] for key, entry in page[kind.table].items()}) == load(kind, name)
    assert page["about"][kind.table]["title"] == read_sensor(name, kind).about["title"]


def test_units_are_given_apart() -> None:
    keys = json.loads(run("paper", "--json"))
    assert keys["dvs"]["threshold_on"]["unit"] == "nat" and keys["dvs"]["refractory_us"]["unit"] == "us"
    assert keys["cis"]["exposure_us"]["unit"] == "us" and keys["cis"]["noise_lsb"]["unit"] == "LSB"


@pytest.mark.parametrize("kind", KINDS)
def test_every_key_whose_name_ends_in_a_unit_has_one(kind: Kind) -> None:
    keys = json.loads(run("paper", "--json"))[kind.table]
    assert not [key for key in keys if key.endswith(("_us", "_hz", "_e", "_lsb")) and not keys[key]["unit"]]


@pytest.mark.parametrize(("kind", "name"), ALL)
def test_a_page_says_what_each_key_may_be(kind: Kind, name: str) -> None:
    page, keys = " ".join(run(name).split()), json.loads(run(name, "--json"))[kind.table]
    for key, said in kind.spec.model_json_schema()["properties"].items():
        if "enum" in said:
            assert keys[key]["choices"] == said["enum"]
            assert f"one of {', '.join(map(json.dumps, said['enum']))}" in page
        if "maximum" in said:
            least = f"above {said['exclusiveMinimum']:g}" if "exclusiveMinimum" in said else f"from {said['minimum']:g}"
            assert keys[key]["limits"] == f"{least}, at most {said['maximum']:g}"
            assert keys[key]["limits"] in page


def test_a_file_of_a_frame_sensor_is_explained_as_one(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text("[cis]\n# measured\nexposure_us = 123\n")
    page = run(str(path))
    assert "exposure_us = 123.0 us" in page and "[measured]" in page and "threshold_on" not in page


def test_an_unknown_name_is_refused_as_everywhere() -> None:
    with pytest.raises(UsageError, match="did you mean"):
        run("davis364")
    with pytest.raises(UsageError, match="did you mean phone"):
        run("phones")


def test_what_the_clip_leaves_of_the_mismatch_is_said(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text("[dvs]\nthreshold_on = 0.2\nthreshold_off = 0.4\nmismatch = 0.2\n")
    assert "reached: 0.134 nat ON, 0.187 nat OFF" in run(str(path)) and "reached" not in run("paper")
    assert json.loads(run(str(path), "--json"))["dvs"]["mismatch"]["reached"] == pytest.approx(
        [0.1343, 0.1873], abs=1e-4
    )
