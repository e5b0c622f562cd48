"""Instants: little changes from one to the next, and each is found without the others."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from vid2ev.errors import UsageError
from vid2ev.scenes.instants import MARGIN, Instants, rate_hz, speed_px_s
from vid2ev.scenes.source import SceneSource
from vid2ev.scenes.world import World

SMALL = ["camera.size=[96, 72]", "duration_s=0.25", "min_fps=1"]
HERE = 'kind = "fixed"'
PLACE = '{ kind = "fixed", position_m = [0, 0, 1.9] }'
STILL = (
    '[[objects]]\nname = "wall"\nkind = "plane"\nsize_m = 9\ntrajectory = { kind = "fixed", position_m = [0, 0, 2] }\n'
)


@pytest.mark.parametrize("name", ["flying-shapes", "spinning-shapes", "parallax", "room", "close-object"])
def test_nothing_moves_farther_than_was_asked_for(name: str) -> None:
    world = World.of(name, 1, [*SMALL, "max_shift_px=0.4"])
    instants = Instants(world)
    times = [instants[k] for k in range(len(instants))]
    assert times[0] == 0 and times[-1] == world.duration_ns
    assert min(later - earlier for earlier, later in pairwise(times)) > 0
    largest = 0.0
    for k in range(0, len(times) - 1, max(1, len(times) // 8)):
        shift, seen = world.flow(times[k], times[k + 1], world.render(times[k]))
        largest = max(largest, float(np.nanmax(np.where(seen, np.hypot(shift[..., 0], shift[..., 1]), 0))))
    assert 0.1 < largest <= 0.42


def test_light_is_sampled_as_densely_as_it_flickers() -> None:
    world = World.of("flicker", 3, SMALL)
    fastest = max(light.flicker.frequency_hz for light in world.scene.lights if light.flicker)
    instants = Instants(world)
    steps = np.diff([instants[k] for k in range(len(instants))])
    assert steps.max() * 1e-9 <= 1 / (32 * fastest)
    assert steps.max() * 1e-9 > 1 / (200 * fastest)


def test_lamps_change_light_in_small_steps() -> None:
    world = World.of("specular", 0, [*SMALL, "max_light_step=0.1"])
    instants = Instants(world)
    light = [world.render(instants[k]).light.max(axis=-1) for k in range(4)]
    steps = [np.abs(np.log((after + 0.01) / (before + 0.01))) for before, after in pairwise(light)]
    assert 0.001 < np.quantile(steps, 0.995) < 0.11 and np.max(steps) < 1  # (edges of shadows are faster)


@pytest.mark.parametrize(("lamp", "sweeps"), [("[0, 0, -2]", True), ("[0, 0, 2.9]", False)])
def test_a_shadow_that_moves_goes_in_small_steps_though_what_casts_it_is_not_seen(
    tmp_path: Path, lamp: str, sweeps: bool
) -> None:
    # (a blade turns behind the camera, between a lamp and the wall: its shadow turns about the picture's middle)
    file = tmp_path / "blade.toml"
    file.write_text(
        f"[scene]\nduration_s = 0.1\nmin_fps = 20\nambient = 0.2\n[camera]\nsize = [320, 240]\n{STILL}"
        '[[objects]]\nname = "blade"\nkind = "plane"\nsize_m = [0.1, 1, 0]\n'
        'trajectory = [{ kind = "fixed", position_m = [0, 0, -1.2] }, { kind = "spin", rate_deg_s = 360 }]\n'
        '[[lights]]\nname = "lamp"\nkind = "point"\nreach_m = 4\nshadows = true\n'
        f'trajectory = {{ kind = "fixed", position_m = {lamp} }}\n'
    )
    steps = len(Instants(World.of(file))) - 1
    if not sweeps:
        assert steps == 2
    else:
        assert 0.1 < np.radians(360 * 0.1 / steps) * 160 < 1  # px at the border


@pytest.mark.parametrize("glow", ["", "emission = 1\nflicker = { frequency_hz = 1 }\n"])
def test_a_shadow_that_is_not_seen_asks_for_nothing(tmp_path: Path, glow: str) -> None:
    # (a blade turns before a wall, which may glow and fade by itself, and the lamp is between the two)
    file, steps = tmp_path / "blade.toml", []
    for shadows in ("false", "true"):
        file.write_text(
            "[scene]\nduration_s = 2\nmin_fps = 1\nambient = 0.2\nsamples_per_period = 2\n"
            f"[camera]\nsize = [64, 48]\n{STILL}{glow}"
            '[[objects]]\nname = "blade"\nkind = "plane"\nsize_m = [0.1, 0.6, 0]\n'
            'trajectory = [{ kind = "fixed", position_m = [0, 0, 1] }, { kind = "spin", rate_deg_s = 5 }]\n'
            f'[[lights]]\nname = "lamp"\nkind = "point"\nshadows = {shadows}\n'
            'trajectory = { kind = "fixed", position_m = [0, 0, 1.9] }\n'
        )
        steps.append(len(Instants(World.of(file))) - 1)
    assert steps[0] == steps[1] > 4


@pytest.mark.parametrize("phase_deg", [0, 45, 90, 180])
@pytest.mark.parametrize("kind", ["spin", "orbit"])
def test_what_comes_into_view_once_a_round_is_met_each_time(tmp_path: Path, kind: str, phase_deg: int) -> None:
    # (in step with knots 16 ms apart, which would see it each time, or never)
    turn = f'kind = "{kind}", axis = [0, 0, 1], phase_deg = {phase_deg}'
    turn += ", rate_deg_s = 22500" if kind == "spin" else ", period_s = 0.016, radius_m = 1.2"
    file = tmp_path / "blade.toml"
    file.write_text(
        f"[scene]\nduration_s = 0.08\n[camera]\nsize = [320, 240]\n{STILL}"
        '[[objects]]\nname = "blade"\nkind = "sphere"\nsize_m = 0.3\n'
        f'trajectory = [{{ kind = "fixed", position_m = [0, 1.9, 1.9] }}, {{ {turn} }},'
        f'{{ kind = "fixed", position_m = [{1.2 if kind == "spin" else 0}, 0, 0] }}]\n'
    )
    instants = Instants(World.of(file))
    times_s = 1e-9 * np.array([instants[k] for k in range(len(instants))])
    highest_s = 0.016 * (np.arange(5) + (270 - phase_deg) % 360 / 360)
    after = np.searchsorted(times_s, highest_s).clip(1)
    assert (times_s[after] - times_s[after - 1]).max() < 5e-4  # (of passes of 3 ms)


JUMP = 'kind = "keyframes", path = "linear", times_s = [0.053, {}], positions_m = [[0, 0, 0], [0.3, 0, 0]]'
GLANCE = 'kind = "keyframes", times_s = [0, 0.0645, 0.0665], rotations_deg = [[0, 0, 0], [0, 0, 0], [0, 3, 0]]'


@pytest.mark.parametrize(
    ("camera", "thing"),
    [
        ('kind = "shake", rms_mm = 0, rms_deg = 1, low_hz = 80, high_hz = 80', HERE),
        ('kind = "shake", rms_mm = 5, rms_deg = 0.2, low_hz = 20, high_hz = 50, seed = 5', HERE),
        (HERE, JUMP.format(0.058)),
        (HERE, JUMP.format(0.055)),
        (GLANCE, HERE),
    ],
)
def test_what_is_over_soon_goes_in_small_steps_too(tmp_path: Path, camera: str, thing: str) -> None:
    file = tmp_path / "sudden.toml"
    file.write_text(
        f"[scene]\nduration_s = 0.2\nmin_fps = 10\n[camera]\nsize = [64, 48]\ntrajectory = {{ {camera} }}\n{STILL}"
        f'[[objects]]\nname = "thing"\nkind = "plane"\ntrajectory = [{PLACE}, {{ {thing} }}]\n'
    )
    world = World.of(file)
    instants, largest = Instants(world), 0.0
    for t_ns, next_ns in pairwise(instants[k] for k in range(len(instants))):
        shift, seen = world.flow(t_ns, next_ns, world.render(t_ns))
        largest = max(largest, float(np.where(seen, np.hypot(shift[..., 0], shift[..., 1]), 0).max()))
    assert 0.2 < largest <= 0.5


def test_nothing_happens_at_the_least_rate(tmp_path: Path) -> None:
    file = tmp_path / "still.toml"
    file.write_text(f"[scene]\nduration_s = 2\nmin_fps = 10\n{STILL}")
    instants = Instants(World.of(file))
    assert [instants[k] for k in range(len(instants))] == [k * 10**8 for k in range(21)]


def test_what_is_too_fast_is_limited(tmp_path: Path) -> None:
    file = tmp_path / "fast.toml"
    file.write_text(
        f"[scene]\nduration_s = 0.1\nmax_fps = 1000\n{STILL}"
        '[[objects]]\nname = "disc"\nkind = "box"\ntrajectory = [{ kind = "fixed", position_m = [0, 0, 2] },'
        '{ kind = "spin", rate_deg_s = 9000 }]\n'
    )
    instants = Instants(World.of(file))
    assert len(instants) == 101 and instants.fastest_hz == 1000


@pytest.mark.parametrize("fps", [None, 30, 240])
def test_the_first_instant_after_another_is_found(fps: float | None) -> None:
    instants = Instants(World.of("parallax", 0, SMALL), fps)
    times = [instants[k] for k in range(len(instants))]
    for t_ns in (-5, 0, 1, times[3], times[3] + 1, times[-1], times[-1] + 1):
        assert instants.first_from(t_ns) == int(np.searchsorted(times, t_ns))
    if fps:
        assert times == [round(k * 10**9 / fps) for k in range(len(times))] and times[-1] <= 250_000_000
    with pytest.raises(IndexError):
        instants[len(instants)]


def fly(path: Path, shape: str, motion: str) -> int:
    """How many steps there are in a tenth of a second of a thing smaller than the grid's pixels, 500 px wide at 1 m."""
    path.write_text(
        f"[scene]\nduration_s = 0.1\nmin_fps = 1\n[camera]\nsize = [640, 480]\nfocal_px = [500, 500]\n{STILL}"
        f'[[objects]]\nname = "fly"\n{shape}\ntrajectory = {motion}\n'
    )
    return len(Instants(World.of(path))) - 1


@pytest.mark.parametrize("x_m", [0, -0.62, 0.53])  # (in the middle, and beside the left and the right border)
def test_small_things_between_the_pixels_of_the_grid_count(tmp_path: Path, x_m: float) -> None:
    motion = f'{{ kind = "straight", position_m = [{x_m}, 0.003, 1], velocity_m_s = [1, 0, 0] }}'
    steps = fly(tmp_path / "fly.toml", 'kind = "sphere"\nsize_m = 0.006', motion)
    assert steps / 0.1 == pytest.approx(1.15 * 500 / 0.5, rel=0.03)


def test_small_meshes_count_where_their_vertices_are(tmp_path: Path) -> None:
    # (0.2 m from the axis about which it turns a radian a second, as its file has it)
    (tmp_path / "wing.obj").write_text("v 0.2 0 0\nv 0.203 0 0\nv 0.2 0.003 0\nf 1 2 3\nf 1 3 2\n")
    turn = f'{{ kind = "spin", axis = [0, 0, 1], rate_deg_s = {math.degrees(1)} }}'
    motion = f'[{{ kind = "fixed", position_m = [0, 0.003, 1] }}, {turn}]'
    steps = fly(tmp_path / "fly.toml", 'kind = "mesh"\nfile = "wing.obj"', motion)
    assert steps / 0.1 == pytest.approx(1.15 * 0.2 * 500 / 0.5, rel=0.05)  # (whole steps)


@pytest.mark.parametrize("name", ["parallax", "room", "flying-shapes"])
def test_instants_are_as_dense_as_is_asked_for_at_both_ends_of_a_step(name: str) -> None:
    world = World.of(name, 1, [*SMALL, "duration_s=0.5"])
    instants = Instants(world)
    for k in range(0, len(instants) - 1, max(1, len(instants) // 12)):
        ends = instants[k], instants[k + 1]
        assert 1e-9 * (ends[1] - ends[0]) * max(rate_hz(world, t_ns) for t_ns in ends) < 1.05


def test_small_things_count_where_a_lens_has_them(tmp_path: Path) -> None:
    # (at 47 degrees from the axis: 94 px from the middle through this lens, and beyond the picture without it)
    path = tmp_path / "scene.toml"
    path.write_text(
        '[scene]\nambient = 1\n[camera]\nsize = [200, 150]\nfov_deg = 100\nmodel = "equidistant"\n'
        'distortion = [0, 0, 0, 0]\n[[objects]]\nname = "dot"\nkind = "sphere"\nsize_m = 0.02\n'
        'trajectory = { kind = "straight", position_m = [1.08, 0, 1], velocity_m_s = [0, 2, 0] }\n'
    )
    world = World.of(path)
    # down through an equidistant lens, across the radius: pixels = focal * angle * (velocity / distance from the axis)
    focal = 100 / np.radians(50)
    expected = focal * np.arctan(1.08) * 2 / 1.08
    assert speed_px_s(world, 0) == pytest.approx(MARGIN * expected, rel=0.05)


def test_rates_that_cannot_be_meant_are_refused() -> None:
    world = World.of("parallax", 0, SMALL)
    for fps in (0, -1, float("nan")):
        with pytest.raises(UsageError, match="frames per second"):
            Instants(world, fps)


@pytest.mark.parametrize(
    ("settings", "more", "said"),
    [
        ("min_fps = 500\nmax_fps = 500", "", False),
        ("max_fps = 3200", '[[lights]]\nname = "lamp"\nkind = "ambient"\nflicker = { frequency_hz = 100 }\n', False),
        ("max_fps = 3199", '[[lights]]\nname = "lamp"\nkind = "ambient"\nflicker = { frequency_hz = 100 }\n', True),
    ],
    ids=["least", "just enough", "too few"],
)
def test_it_is_said_where_there_are_fewer_instants_than_were_asked_for_and_only_there(
    tmp_path: Path, settings: str, more: str, said: bool
) -> None:
    """Of a flicker 32 a period are asked for, and nothing else calls for any."""
    file = tmp_path / "scene.toml"
    steady = "max_light_step = 10\nsamples_per_period = 32"
    file.write_text(f"[scene]\nduration_s = 0.05\n{steady}\n{settings}\n[camera]\nsize = [16, 12]\n{STILL}{more}")
    assert bool(SceneSource(World.of(file)).warnings) == said
