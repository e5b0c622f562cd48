"""What networks cost: the published numbers of parameters, exactly, and what the options say of themselves."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError

from interp.blocks.unet import Unet, rrin_layout
from interp.networks import make, names, spec_of
from interp.work import SIZES, table, work_of
from vid2ev import UsageError

README = Path(__file__).parents[2] / "interp" / "README.md"

# Parameters and kMAC/px of size paper; RRIN's 19.19 M, Super SloMo's 39.61 M, Time Lens's 79.2 M, E2VID's 10.71 M and
# FireNet's 38 k are published, the digits and the kMAC/px are computed from the architectures.
PUBLISHED = {
    "superslomo": (39_610_473, 663),
    "rrin": (19_194_445, 868),
    "rrin_events": (17_134_797, 814),
    "timelens": (79_206_668, 1630),
    "e2vid": (10_710_401, 454),
    "firenet": (37_777, 37.6),
}


@pytest.mark.parametrize("name", PUBLISHED)
def test_networks_are_as_large_as_published(name: str) -> None:
    work = work_of(make(name, "paper"))
    parameters, kmac = PUBLISHED[name]
    assert work.parameters == parameters
    assert work.once + work.each == pytest.approx(kmac, abs=0.6 if kmac > 100 else 0.06)  # given in whole kMAC


def test_the_hdr_network_is_as_large_as_published() -> None:
    work = work_of(make("hdr", "paper", second="frames"))
    assert work.parameters == 2_979_555 and work.each == pytest.approx(268, abs=0.6)


def test_events_in_super_slomo_cost_what_their_channels_do() -> None:
    assert work_of(make("slomo_events", "paper")).parameters == 39_610_473 + 10 * 1568


@pytest.mark.parametrize(("size", "millions"), [("tiny", 1.08), ("small", 4.29), ("paper", 17.13)])
def test_the_papers_network_has_three_sizes(size: str, millions: float) -> None:
    assert work_of(make("rrin_events", size)).parameters / 1e6 == pytest.approx(millions, abs=0.005)


@pytest.mark.parametrize(
    ("channels", "depth", "parameters"),
    [
        ((6, 4), 5, 10_992_292),
        ((10, 4), 4, 2_733_860),
        ((16, 2), 4, 2_735_010),
        ((9, 3), 4, 2_733_283),
        ((9, 3), 3, 667_875),
    ],
)
def test_each_unet_of_rrin_is_as_large_as_published(channels: tuple[int, int], depth: int, parameters: int) -> None:
    assert sum(part.numel() for part in Unet(*channels, rrin_layout(depth, 32)).parameters()) == parameters


def test_the_combined_system_is_three_of_these_unets() -> None:
    # 14.40 M with 32 channels into the combined UNet, which has 30 with 5 bins a half
    assert work_of(make("rrin_slomo_events", "paper")).parameters == 14_400_941 - 2 * 288
    assert work_of(make("rrin_slomo_events", "paper", bins=6)).parameters == 14_400_941


# What options cost at size paper, in parameters and kMAC/px: as their descriptions say.
OPTIONS: list[tuple[str, dict[str, Any], dict[str, Any], str, float, float, str]] = [
    ("slomo_events", {}, {"bins": 6}, "events", 3136, 3.136, "1,568 parameters and 1.568"),
    ("slomo_events", {}, {"recurrent": True}, "recurrent", 2041, 20.16, "2,041 parameters and 2.016"),
    ("rrin_events", {}, {"bins": 6}, "bins", 1152, 1.152, "576 parameters and 0.576"),
    ("rrin_events", {}, {"candidate": "input"}, "candidate", 2 * 864, 2 * 0.864, "864 parameters and 0.864"),
    ("rrin_events", {}, {"gate": True}, "gate", 0, 0, "costs one mean"),
    ("rrin_slomo_events", {}, {"bins": 6}, "events", 2 * 288, 2 * 0.288, "288 parameters and 0.288"),
    ("rrin_slomo_events", {}, {"flow_input": "frames+events"}, "flow_input", 1440, 1.44, "288 parameters"),
    ("rrin_slomo_events", {"refine": "none"}, {}, "refine", 667_875, 141.696, "667,875 parameters and 142"),
    ("rrin_slomo_events", {}, {"reconstruct": "firenet"}, "reconstruct", 38_641, 188.9, "38 k parameters"),
    ("flow", {}, {"bins": 1}, "bins", 288, 0.288, "288 parameters and 0.288"),
    ("timelens", {}, {"bins": 6}, "bins", 4704, 6.272, "4,704 parameters and 6.272"),
    ("e2vid", {}, {"bins": 6}, "bins", 800, 0.8, "800 parameters and 0.8"),
    ("firenet", {}, {"bins": 6}, "bins", 144, 0.144, "144 parameters and 0.144"),
    ("hdr", {}, {"bins": 6}, "bins", 1568, 1.568, "1,568 parameters and 1.568"),
    ("rrin_events_guided", {"depths": (4, 4, 3)}, {}, "depths", 2_065_408, 59.904, "U4 151 and 91"),
    ("rrin_events_guided", {"depths": (3, 4, 4)}, {}, "depths", 2_065_408, 14.976, "U2 and U3 51 and 36"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "before", "after", "field", "parameters", "kmac", "said"), OPTIONS)
def test_options_cost_what_they_say(
    name: str, before: dict, after: dict, field: str, parameters: int, kmac: float, said: str
) -> None:
    with_it, without = work_of(make(name, "paper", **after)), work_of(make(name, "paper", **before))
    assert with_it.parameters - without.parameters == parameters
    assert with_it.once + with_it.each - without.once - without.each == pytest.approx(kmac, abs=0.06)
    assert said in (type(spec_of(name)).model_fields[field].description or "")


@pytest.mark.parametrize(("size", "unets", "channels"), [("small", 4, 2), ("tiny", 16, 4)])
def test_channels_into_a_network_cost_half_where_all_of_it_costs_a_quarter(
    size: str, unets: int, channels: int
) -> None:
    paper, less = (work_of(make("flow", each)).parameters for each in ("paper", size))
    assert paper / less == pytest.approx(unets, rel=0.02)
    paper, less = (
        work_of(make("flow", each, bins=1)).parameters - work_of(make("flow", each)).parameters
        for each in ("paper", size)
    )
    assert paper == channels * less


@pytest.mark.parametrize(
    ("name", "options", "saved"),
    [("superslomo", {}, 0.028), ("rrin", {}, 0.008), ("hdr", {}, 0.047), ("hdr", {"second": "frames"}, 0.07)],
)
def test_one_colour_saves_what_is_said(name: str, options: dict, saved: float) -> None:
    three, one = (work_of(make(name, "paper", colours=colours, **options)) for colours in (3, 1))
    assert 1 - (one.once + one.each) / (three.once + three.each) == pytest.approx(saved, abs=5e-4)
    said = type(spec_of(name)).model_fields["colours"].description or ""
    assert ("5 % of the cost for grey frames, with frames in path B 7 %" if name == "hdr" else "1 to 3 %") in said


@pytest.mark.parametrize("name", names())
def test_every_option_says_what_it_is(name: str) -> None:
    spec = spec_of(name)
    for key, field in type(spec).model_fields.items():
        assert field.description, f"{name}: {key} has no description"
    with pytest.raises(ValidationError):
        spec.size = "paper"  # type: ignore[misc]


@pytest.mark.parametrize(
    ("name", "options", "sentence"),
    [
        ("rrin_event", {}, "did you mean rrin_events?"),
        (None, {}, "network 'None': expected one of"),
        ("rrin_events", {"size": "huge"}, "size = 'huge' is impossible"),
        ("rrin_events", {"gates": True}, "no option 'gates' (did you mean gate?)"),
        ("rrin_events", {"depths": (9, 4, 4, 3)}, "depths"),
        ("firenet", {"bins": 0}, "bins = 0 is impossible"),
        ("firenet", {"bins": True}, "bins = True is impossible: it must not be true or false"),
    ],
)
def test_what_cannot_be_is_refused_in_a_sentence(name: str, options: dict, sentence: str) -> None:
    with pytest.raises(UsageError, match=re.escape(sentence)) as refused:
        make(name, **options)
    assert "\n" not in str(refused.value)


@pytest.mark.slow  # (all sizes of all networks)
def test_the_table_in_the_readme_is_this() -> None:
    assert "\n".join(table()) in README.read_text(encoding="utf-8")


def test_the_table_in_the_readme_has_every_network() -> None:
    page = README.read_text(encoding="utf-8")
    rows = {line.split("|")[1].strip(" `"): line for line in page.splitlines() if line.startswith("| `")}
    assert list(rows) == names()
    for name, row in rows.items():
        cells = [cell.strip() for cell in row.split("|")[2:-1]]
        work = work_of(make(name, SIZES[0]))
        assert cells[0] == f"{work.parameters:,}" and cells[3] == f"{work.once:.1f} + {work.each:.1f}"
