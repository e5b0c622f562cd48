"""`vid2ev sensors` shows what the presets say, to people and to programs."""

from __future__ import annotations

import json

import pytest
from click.testing import CliRunner

from vid2ev.commands.sensors import sensors
from vid2ev.errors import UsageError
from vid2ev.sensors.presets import load_sensor, preset_names, read_sensor
from vid2ev.sensors.spec import DvsSpec


def run(*arguments: str) -> str:
    done = CliRunner().invoke(sensors, arguments, catch_exceptions=False)
    assert done.exit_code == 0
    return done.output


def test_the_list_has_a_line_for_each_preset() -> None:
    lines = run().splitlines()
    for name in preset_names():
        assert [line for line in lines if line.split()[:1] == [name] and read_sensor(name).about["title"] in line]


def test_the_list_for_programs() -> None:
    assert sorted(json.loads(run("--json"))) == preset_names()


@pytest.mark.parametrize("name", preset_names())
def test_a_page_explains_every_key_and_cites_every_source(name: str) -> None:
    page = " ".join(run(name).split())
    for key, field in DvsSpec.model_fields.items():
        assert f"{key} = {json.dumps(load_sensor(name).model_dump(mode='json')[key])}" in page
        assert (field.description or "").partition(" [")[0] in page
    for source in [*read_sensor(name).sources.values(), *read_sensor(name).about["sources"]]:
        assert " ".join(source.split()) in page


@pytest.mark.parametrize("name", preset_names())
def test_the_page_for_programs_makes_the_same_sensor(name: str) -> None:
    page = json.loads(run(name, "--json"))
    assert DvsSpec(**{key: entry["value"] for key, entry in page["dvs"].items()}) == load_sensor(name)
    assert page["dvs"]["threshold_on"]["unit"] == "nat" and page["dvs"]["refractory_us"]["unit"] == "us"


def test_an_unknown_name_is_refused_as_everywhere() -> None:
    with pytest.raises(UsageError, match="did you mean"):
        run("davis364")
