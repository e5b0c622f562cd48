"""Rigs of all kinds, for tests."""

from __future__ import annotations

from typing import Any

import numpy as np
from hypothesis import strategies as st

from vid2ev.rig.camera import RESERVED, Camera, Rig, Source

names = st.from_regex(r"[A-Za-z0-9][A-Za-z0-9_-]{0,12}", fullmatch=True).filter(
    lambda name: name.casefold() not in RESERVED
)
sides = st.integers(1, 4000)
sizes = st.tuples(sides, sides)
focal = st.floats(1, 5000)
shift = st.floats(-2000, 2000)
turn = st.floats(-100, 100)
small = st.floats(-0.5, 0.5)
values = st.one_of(
    st.booleans(), st.integers(-(2**60), 2**60), st.floats(allow_nan=False, allow_infinity=False), st.text(max_size=8)
)


@st.composite
def lenses(draw: st.DrawFn, models: dict[str, tuple[int, ...]] | None = None) -> dict[str, Any]:
    """The keys of a lens of which all is known."""
    counts = models or {"none": (0,), "radtan": (4, 5, 8), "equidistant": (4,)}
    model = draw(st.sampled_from(sorted(counts)))
    count = draw(st.sampled_from(counts[model]))
    return {
        "size": draw(sizes),
        "focal_px": draw(st.tuples(focal, focal)),
        "centre_px": draw(st.tuples(shift, shift)),
        "distortion_model": model,
        "distortion": tuple(draw(st.lists(small, min_size=count, max_size=count))),
    }


@st.composite
def cameras(draw: st.DrawFn, name: str) -> Camera:
    """A camera that states anything that it can."""
    optics: dict[str, Any] = draw(
        st.one_of(st.just({}), lenses(), st.fixed_dictionaries({"fov_deg": st.floats(1, 170)}))
    )
    optional: dict[str, st.SearchStrategy[Any]] = {
        "rotation_deg": st.tuples(turn, turn, turn),
        "translation_mm": st.tuples(shift, shift, shift),
        "clock_offset_us": st.integers(-(10**15), 10**15),
        "sensor": st.sampled_from(["paper", "davis346", "/presets/mine.toml"]),
        "set": st.dictionaries(st.text(max_size=8), st.one_of(values, st.lists(values, max_size=3)), max_size=3),
        "seed": st.integers(0, 2**63 - 1),
    }
    stated = draw(st.fixed_dictionaries({}, optional=optional))
    return Camera(name=name, kind=draw(st.sampled_from(["dvs", "cis"])), **optics, **stated)


@st.composite
def rigs(draw: st.DrawFn) -> Rig:
    """A rig that a person may write."""
    called = draw(st.lists(names, min_size=1, max_size=4, unique_by=str.casefold))
    source = draw(st.one_of(st.just({}), lenses(), st.fixed_dictionaries({"fov_deg": st.floats(1, 170)})))
    return Rig(source=Source(**source), cameras=tuple(draw(cameras(name)) for name in called))


@st.composite
def calibrated_rigs(draw: st.DrawFn, models: dict[str, tuple[int, ...]] | None = None) -> Rig:
    """A rig as a calibration file can hold it: every lens known, the first camera at the origin."""
    called = draw(st.lists(names, min_size=1, max_size=4, unique_by=str.casefold))
    places = [((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))]
    places += [(draw(st.tuples(turn, turn, turn)), draw(st.tuples(shift, shift, shift))) for _ in called[1:]]
    return Rig(
        cameras=tuple(
            Camera(
                name=name,
                kind=draw(st.sampled_from(["dvs", "cis"])),
                rotation_deg=turned,
                translation_mm=moved,
                clock_offset_us=draw(st.integers(-(10**9), 10**9)),
                **draw(lenses(models)),
            )
            for name, (turned, moved) in zip(called, places, strict=True)
        )
    )


def pair() -> Rig:
    """Two event cameras and a frame camera between them, as on a car."""
    lens = {"size": (640, 480), "distortion_model": "radtan", "distortion": (-0.1, 0.05, 0.001, -0.002)}
    return Rig(
        cameras=(
            Camera(name="left", kind="dvs", focal_px=(556.7, 556.5), centre_px=(342.4, 215.1), **lens),
            Camera(name="rgb", kind="cis", size=(1440, 1080), fov_deg=62.0, translation_mm=(44, -0.5, 13)),
            Camera(
                name="right",
                kind="dvs",
                focal_px=(555.5, 555.6),
                centre_px=(321.0, 224.7),
                rotation_deg=(4.0, -3.0, 6.0),
                translation_mm=(150, 8, -5),
                clock_offset_us=-12,
                **lens,
            ),
        )
    )


def differences(one: Rig, other: Rig) -> tuple[float, float]:
    """The greatest difference between rotations, and between translations in m."""
    apart = [(a.pose, b.pose) for a, b in zip(one.cameras, other.cameras, strict=True)]
    return (
        max(float(np.abs(a.rotation - b.rotation).max()) for a, b in apart),
        max(float(np.abs(a.translation_m - b.translation_m).max()) for a, b in apart),
    )
