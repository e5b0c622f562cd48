"""Which settings are tried, and what they ask of a conversion."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vid2ev import DvsSpec
from vid2ev.commands.convert import convert
from vid2ev.cost.ladder import Given, Ladder, ladder_of, steps_of
from vid2ev.cost.rung import Rung
from vid2ev.errors import UsageError
from vid2ev.seen.recipe import Recipe
from vid2ev.sensors.cis_spec import CisSpec

CLIP = "synthetic:moving-edge,size=48x32,duration_s=0.1"


def ladder(given: tuple[str, ...] = (), steps: int = 12, **options: Any) -> Ladder:
    options = {"video": CLIP} | options
    return ladder_of(Recipe.of(**options), Given(options, given), steps)


def names(found: Ladder) -> set[str]:
    return {rung.name for rung in found.all}


def test_the_paper_s_sensor_has_everything_in_play() -> None:
    found = ladder()
    assert names(found) == {
        "reference", "finest", "default", "at most 2 steps", "at most 4 steps", "at most 8 steps", "straight light",
        "linear", "times on a line", "times of frames", "filter after log", "effects auto", "effects none",
        "half the size", "light", "lighter", "least",
    }  # fmt: skip
    assert found.reference.float64 and not found.reference.offered
    assert found.reference.options == {"subframes": 48}
    assert next(rung for rung in found.rungs if rung.name == "finest").options == {"subframes": 24}
    least = next(rung for rung in found.rungs if rung.name == "least")
    assert least.options == {"effects": "none", "upsample": "none"} and least.settings == {"timing": "frame"}


def test_each_name_is_there_once() -> None:
    found = ladder(steps=64, frame_camera=True).all
    assert len({rung.name for rung in found}) == len(found)


@pytest.mark.parametrize(
    ("given", "options", "gone"),
    [
        (("upsample",), {"upsample": "flow"}, {"straight light", "linear"}),
        (("upsample",), {"upsample": "none"}, {"straight light", "linear", "at most 4 steps"}),
        (("max_subframes",), {"max_subframes": 8}, {"at most 2 steps", "at most 4 steps"}),
        (("effects",), {}, {"effects auto", "effects none", "least effects"}),
        ((), {"overrides": ["timing=linear"]}, {"times on a line", "times of frames"}),
        ((), {"overrides": ["dvs.filter=after"]}, {"filter after log"}),
        (("size",), {"size": "24x16"}, {"half the size"}),
        ((), {"sensor": "ideal"}, {"filter after log", "times on a line", "effects none"}),
    ],
)
def test_what_is_given_or_not_there_is_left_as_it_is(given: tuple[str, ...], options: dict, gone: set[str]) -> None:
    found = ladder(given, **options)
    assert not names(found) & gone
    held = {*given} | {text.partition("=")[0].removeprefix("dvs.") for text in options.get("overrides", ())}
    for rung in found.all:
        assert not held & {*rung.options, *rung.settings}, rung


def test_the_reference_is_exact_whatever_the_sensor_says() -> None:
    found = ladder(sensor=DvsSpec(timing="frame"))
    assert found.reference.settings == {"timing": "response"}
    assert "timing" not in ladder(sensor="v2e-clean").reference.settings  # (no filter: a line is the response)
    no_poles = {"photoreceptor_tau_us": 0.0, "follower_tau_us": 0.0, "timing": "linear"}
    for spec in (DvsSpec(filter="after", timing="linear"), DvsSpec(filter="before", **no_poles)):
        assert ladder(sensor=spec).reference.settings == {"timing": "response"}


def test_lags_of_light_are_carried_in_float64_where_there_are_any() -> None:
    """Else, and where the sub-frames are as asked for, the reference is the finest that a conversion can be asked for:
    there is no other."""
    fixed = {"given": ("subframes",), "subframes": 3}
    for sensor, lags in (("ideal", False), (DvsSpec(filter="after"), False), (DvsSpec(filter="before"), True)):
        found = ladder(sensor=sensor, **fixed)
        assert found.reference.float64 == ladder(sensor=sensor).reference.float64 == lags
        assert ("finest" in names(found)) == lags and found.reference.offered != lags


@pytest.mark.parametrize(("options", "steps"), [({"subframes": 5}, 5), ({"upsample": "none"}, 1)])
def test_the_interval_with_the_most_steps_counts(options: dict[str, Any], steps: int) -> None:
    recipe, seen = Recipe.of(CLIP, **options), list[int]()
    assert steps_of(recipe, lambda: seen.append(1)) == steps and len(seen) == recipe.source.frames_expected


@pytest.mark.parametrize("sensor", ["ideal", "v2e-clean"])
def test_where_logarithms_are_straight_the_reference_has_steps_though_nothing_moves(sensor: str) -> None:
    """Or else it would be one between its logarithm and light that is straight, and a finer one another."""
    for steps, finest in ((1, 16), (12, 24), (64, 64), (100, 100)):
        found = ladder(sensor=sensor, steps=steps)
        assert found.rungs[0].name == "finest" and found.rungs[0].options == {"subframes": finest}
        assert found.reference.options == {"subframes": 2 * finest} and not found.reference.offered
    assert ladder(steps=1).reference.options == {"subframes": 4}
    assert ladder(sensor=DvsSpec(filter="after"), steps=1).reference.options == {"subframes": 32}


@pytest.mark.parametrize(("size", "half"), [("48x32", "24x16!"), ("33x49", "16x24!"), ("31x64", None)])
def test_half_the_size_is_half_of_each_side_and_no_postage_stamp(size: str, half: str | None) -> None:
    found = [rung for rung in ladder(video=f"synthetic:sine,size={size}").rungs if rung.group == "size"]
    assert [(rung.options, rung.coarse, rung.offered) for rung in found] == [({"size": half}, 2, False)] * (
        half is not None
    )


def test_a_cap_that_no_interval_reaches_is_not_tried() -> None:
    caps = {steps: sum("at most" in name for name in names(ladder(steps=steps))) for steps in (1, 2, 3, 8, 9, 33)}
    assert caps == {1: 0, 2: 0, 3: 1, 8: 2, 9: 3, 33: 5} and "linear" in names(ladder(steps=2))


def test_ways_that_are_one_are_not_tried_apart(tmp_path: Path) -> None:
    """Times are on a line anyway where all logarithms are straight; of a rig any camera counts."""
    ways = {"times on a line", "times of frames", "effects none"}
    straight, bent = DvsSpec(filter="after", timing="response", mismatch=0.1), DvsSpec(filter="after")
    straight = straight.model_copy(update={"photoreceptor_tau_us": 0.0, "follower_tau_us": 0.0})
    assert names(ladder(sensor=straight)) & ways == ways - {"times on a line"}
    assert names(ladder(sensor=bent)) & ways == ways
    assert names(ladder(sensor=straight.model_copy(update={"filter": "before"}))) & ways == ways
    cameras = (("ideal", ""), ("paper", ""), ("paper", 'set = { timing = "frame" }\n'))
    text = [
        f'[[camera]]\nname = "{k}"\nkind = "dvs"\nsensor = "{name}"\n{more}' for k, (name, more) in enumerate(cameras)
    ]
    (tmp_path / "rig.toml").write_text("".join(text))
    assert names(ladder(("rig",), rig=tmp_path / "rig.toml")) & ways == ways


def test_where_nothing_moves_light_between_the_frames_is_no_question() -> None:
    found = names(ladder(steps=1))
    assert not found & {"straight light", "linear", "at most 2 steps"} and "finest" in found


def test_scenes_need_nothing_between_their_instants() -> None:
    found = ladder(video="scene:parallax,size=64x48,duration_s=0.1", steps=1)
    assert not names(found) & {"straight light", "half the size"} and found.reference.options == {}


def test_frame_cameras_have_their_own() -> None:
    found = ladder(frame_camera=True, cis="phone")
    rungs = {rung.name: rung for rung in found.rungs}
    assert rungs["lines together"].settings == {"cis.line_us": 0.0}
    assert rungs["frames of an instant"].settings == {"cis.blur": False}
    assert rungs["frames without noise"].settings
    assert "half the size" not in rungs
    fixed = ladder(frame_camera=True, cis="phone", overrides=["cis.line_us=10"])
    assert "lines together" not in names(fixed)
    for overrides in (["cis.blur=false"], ["cis.blur=true"], ["cis.exposure_us=0"]):
        assert "frames of an instant" not in names(ladder(frame_camera=True, overrides=overrides))


def test_effects_of_frame_cameras_alone_are_in_play_too(tmp_path: Path) -> None:
    (tmp_path / "rig.toml").write_text('[[camera]]\nname = "a"\nkind = "cis"\n')
    ways = {"effects auto", "effects none"}
    for cis, there in (("phone", ways), ("ideal", set())):
        assert names(ladder(("rig",), rig=tmp_path / "rig.toml", cis=cis)) & ways == there


def test_frames_of_an_instant_are_those_of_the_same_times() -> None:
    """As many, open as long: what is left of an exposure is the light in its middle."""
    options = {"video": CLIP, "frame_camera": True, "cis": "phone"}
    rung = next(rung for rung in ladder(**options).rungs if rung.name == "frames of an instant")
    (one,), (other,) = (
        [mount.sensor.spec for mount in Recipe.of(**each).mounts if isinstance(mount.sensor.spec, CisSpec)]
        for each in (options, rung.applied(options))
    )
    assert other != one and other.window_us(1080) == one.window_us(1080)
    assert {*one.effects()} - {*other.effects()} == {"exposure"}


def test_a_plane_stands_for_depth(tmp_path: Path) -> None:
    depth = np.full((32, 48), 0.4, np.float32)
    depth[8:20, 10:30], depth[:8], depth[30:] = 0.2, np.inf, 0.0
    np.save(tmp_path / "depth.npy", depth)
    (tmp_path / "rig.toml").write_text('[[camera]]\nname = "a"\nkind = "dvs"\ntranslation_mm = [30, 0, 0]\n')
    found = ladder(("rig", "depth"), rig=tmp_path / "rig.toml", depth=str(tmp_path / "depth.npy"))
    plane = next(rung for rung in found.rungs if rung.group == "views")
    assert plane.options == {"depth": "plane:0.4"} and not plane.offered
    flat = ladder(("rig", "depth"), rig=tmp_path / "rig.toml", depth="plane:3")
    assert all(rung.group != "views" for rung in flat.rungs)


def test_convert_understands_what_is_recommended() -> None:
    for rung in ladder(steps=64, frame_camera=True).rungs:
        context = convert.make_context("convert", [CLIP, *shlex.split(rung.arguments())])
        for name, value in rung.options.items():
            assert context.params[name] == value, rung
        texts = dict(text.split("=", 1) for text in context.params["overrides"])
        assert {*texts} == {*rung.settings}
        applied = rung.applied({"video": CLIP, "frame_camera": True})
        Recipe.of(**{key: value for key, value in applied.items() if key != "effects"})


def test_a_specification_is_changed_as_a_preset_is() -> None:
    rung = Rung("a", settings={"timing": "linear", "cis.line_us": 3.0})
    options = {"video": CLIP, "sensor": DvsSpec(mismatch=0.1), "frame_camera": True}
    recipe = Recipe.of(**rung.applied(options))
    dvs, cis = (mount.sensor.spec for mount in recipe.mounts)
    assert (dvs.timing, dvs.mismatch, cis.line_us) == ("linear", 0.1, 3.0)  # type: ignore[union-attr]
    with pytest.raises(UsageError, match="timing=never"):
        Rung("b", settings={"timing": "never"}).applied(options)
