"""What people write as numbers, wherever they write them."""

from __future__ import annotations

import math
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

import click
import numpy as np
import pytest
from click.testing import CliRunner

from interp.commands.interpolate import interpolate
from interp.commands.making import contrast_of
from interp.commands.reconstruct import reconstruct
from interp.interpolate.take import Options
from vid2ev import UsageError
from vid2ev.commands.auto import Auto
from vid2ev.commands.convert import convert
from vid2ev.commands.info import info
from vid2ev.commands.options import FiniteRange, Rate
from vid2ev.cost.front import Budget
from vid2ev.light.transfer import parse_transfer
from vid2ev.requests import number_of, setting
from vid2ev.rig.depth import plane_of
from vid2ev.sources.motion import parse_motion
from vid2ev.sources.synthetic import parse_synthetic

NONE = ["", "1_0", "nan", "inf", "-inf", "infinity", " 1", "1 ", "1e", "0x10", "1,0", "٣", "1e999", "1.2.3", "."]


@pytest.mark.parametrize("text", NONE)
def test_what_people_do_not_write_is_no_number(text: str) -> None:
    assert math.isnan(number_of(text))


@pytest.mark.parametrize("text", ["0", "-1", "+2.50", ".5", "5.", "1e-3", "12E+2", "0007", "3.141592653589793"])
def test_what_people_write_is_the_number_that_it_says(text: str) -> None:
    assert number_of(text) == float(text)


ASKED: dict[str, Callable[[str], object]] = {
    "budget": lambda text: Budget.parse(f"vR={text}"),
    "gamma": lambda text: parse_transfer(f"gamma:{text}"),
    "plane": lambda text: plane_of(f"plane:{text}"),
    "motion": lambda text: parse_motion(f"pan:speed={text}"),
    "synthetic": lambda text: parse_synthetic(f"sine,frequency_hz={text}"),
    "size": lambda text: parse_synthetic(f"sine,size={text}x{text}"),
    "contrast": contrast_of,
    "option": lambda text: FiniteRange(0).convert(text, None, None),
    "whole": lambda text: Auto("auto", 1, "N").convert(text, None, None),
}


@pytest.mark.parametrize("text", ["1_0", "nan"])
@pytest.mark.parametrize("where", ASKED)
def test_no_number_of_python_goes_for_one(where: str, text: str) -> None:
    with pytest.raises((UsageError, click.BadParameter), match=text):
        ASKED[where](text)


def test_a_row_of_a_path_has_numbers(tmp_path: Path) -> None:
    path = tmp_path / "path.csv"
    path.write_text("0,0,0\n1_0,5,0\n")
    with pytest.raises(Exception, match="row 2 is 1_0,5,0; expected finite numbers"):
        parse_motion(str(path))


def test_settings_are_toml_or_numbers_or_texts() -> None:
    assert setting("a=.5", "a=1")[1] == 0.5 and setting("a=1_0.", "a=1")[1] == "1_0."


@pytest.mark.parametrize("text", ["nan", "inf", "1_0"])
@pytest.mark.parametrize(
    ("command", "options"),
    [
        (convert, ("--start", "--stop", "--slowdown", "--fps")),
        (interpolate, ("--start", "--stop", "--refractory")),
        (reconstruct, ("--start", "--stop", "--refractory", "--cutoff")),
    ],
)
def test_seconds_and_microseconds_of_commands_are_finite_numbers(
    command: click.Command, options: tuple[str, ...], text: str
) -> None:
    for option in options:
        said = CliRunner().invoke(command, ["anything", option, text])
        assert said.exit_code == 2 and f"'{text}': expected a finite number" in said.output


def test_a_rate_is_a_number_or_one_over_another_and_stays_exact(tmp_path: Path) -> None:
    assert [Rate().convert(text, None, None) for text in ("30000/1001", "1e3/.5", "29.97")] == [
        Fraction(30000, 1001),
        2000,
        29.97,
    ]
    wrong = "30000/", "/1001", "1/0", "0/1", "-1/2", "1/2/3", "nan/1", "1_0/1", "2000001/2", "0", "1e7"
    for text in (*wrong, "1e300/1e-300", "1e-300/1e300"):
        with pytest.raises(click.BadParameter, match=r"expected a (finite )?number|is not in the range"):
            Rate(1e6).convert(text, None, None)
    np.save(tmp_path / "stack.npy", np.arange(31 * 16, dtype=np.uint8).reshape(31, 4, 4))
    arguments = [str(tmp_path / "stack.npy"), "--transfer", "srgb", "--fps", "30000/1001", "--json"]
    said = CliRunner().invoke(info, arguments)
    assert said.exit_code == 0 and '"fps": "30000/1001"' in said.output, said.output


@pytest.mark.parametrize("seconds", [math.nan, math.inf])
def test_parts_of_what_is_interpolated_begin_and_end_at_finite_seconds(seconds: float) -> None:
    for part in ({"start_s": seconds}, {"stop_s": seconds}):
        with pytest.raises(UsageError, match="expected seconds"):
            Options(**part)
