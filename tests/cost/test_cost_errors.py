"""Errors against the reference, and the quality of pictures: against their definitions and other libraries."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from moving_texture import texture
from skimage.metrics import peak_signal_noise_ratio, structural_similarity

from vid2ev.compare.comparison import compare
from vid2ev.compare.pictures import HIGHEST_DB
from vid2ev.cost.errors import Reference
from vid2ev.cost.passes import Sent, repeated
from vid2ev.cost.quality import interpolated, quality, triples_of
from vid2ev.light.eight_bits import srgb_codes
from vid2ev.sources import open_source
from vid2ev.sources.edit import Edit
from vid2ev.stream import Events

SIZE = (16, 12)


def drawn(seed: int, count: int = 4000, size: tuple[int, int] = SIZE) -> Events:
    draw = np.random.default_rng(seed)
    t = np.sort(draw.integers(0, 100_000, count))
    x, y = (draw.integers(0, side, count).astype(np.uint16) for side in size)
    return Events(t, x, y, draw.integers(0, 2, count).astype(np.uint8))


def sent(events: Events | None = None, codes: list[np.ndarray] | None = None, blocks: int = 1, **rest: Any) -> Sent:
    mount = SimpleNamespace(kind="cis" if events is None else "dvs", size=SIZE)
    cut = np.linspace(0, 0 if events is None else len(events), blocks + 1).astype(int)
    parts = [] if events is None else [events.stretch(int(a), int(b)) for a, b in pairwise(cut)]
    return Sent(mount, parts, codes or [], **rest)  # type: ignore[arg-type]


def test_one_camera_is_compared_as_compare_does() -> None:
    mine, theirs = drawn(1), drawn(2, 3000)
    found = Reference([sent(theirs, blocks=3)], (0, 100_000)).errors([sent(mine, blocks=7)])
    said = compare(mine, theirs, SIZE)
    assert found.distance == pytest.approx(said.distance, rel=1e-12)
    assert found.count_error == said.count_error and found.timing_us == said.absolute_timing_error_us
    assert found.matched == said.matched / len(theirs)
    assert found.rms_lsb is None and found.views is None


def test_two_cameras_are_one_with_twice_the_pixels() -> None:
    """Events of two cameras, beside each other in one: the same errors."""
    left, right = (drawn(1), drawn(2)), (drawn(3, 500), drawn(4, 900))
    found = Reference([sent(left[1]), sent(right[1])], (0, 100_000)).errors([sent(left[0]), sent(right[0])])
    beside = []
    for a, b in zip(left, right, strict=True):
        both = Events.concatenate([a, replace(b, x=b.x + np.uint16(SIZE[0]))])
        order = np.argsort(both.t, kind="stable")
        beside.append(Events(both.t[order], both.x[order], both.y[order], both.p[order]))
    said = compare(*beside, (2 * SIZE[0], SIZE[1]))
    assert found.distance == pytest.approx(said.distance, rel=1e-12)
    assert found.count_error == said.count_error and found.timing_us == said.absolute_timing_error_us


def test_the_reference_has_no_error() -> None:
    for one in (sent(drawn(1)), sent(codes=[np.ones((12, 16), np.uint16)])):
        reference = Reference([replace(one, events=list(one.events))], (0, 100_000))
        assert reference.errors([one]) == reference.errors_of_itself()
    both = [sent(drawn(1)), sent(codes=[np.ones((12, 16), np.uint16)])]
    reference = Reference([replace(one, events=list(one.events)) for one in both], (0, 100_000))
    itself = reference.errors_of_itself()
    assert reference.errors(both) == itself and (itself.distance, itself.rms_lsb) == (0.0, 0.0)


def test_of_events_and_frames_the_events_make_the_headline() -> None:
    true, made = np.full((12, 16), 7, np.uint16), np.full((12, 16), 9, np.uint16)
    reference = Reference([sent(drawn(1)), sent(codes=[true])], (0, 100_000))
    found = reference.errors([sent(drawn(2)), sent(codes=[made])])
    assert found.rms_lsb == 2.0 and found.headline == found.distance != 2.0


def test_a_coarse_pixel_stands_for_those_that_it_covers() -> None:
    small = drawn(5, 300, (8, 6))
    wide = repeated(small, 2)
    assert len(wide) == 4 * len(small) and np.all(np.diff(wide.t) >= 0)
    counts = np.zeros((6, 8), int)
    np.add.at(counts, (small.y, small.x), 1)
    seen = np.zeros((12, 16), int)
    np.add.at(seen, (wide.y, wide.x), 1)
    assert np.array_equal(seen, np.kron(counts, np.ones((2, 2), int)))
    assert Reference([sent(wide)], (0, 100_000)).errors([sent(small)], coarse=2).distance == 0


def test_nothing_at_all_is_no_error_and_something_is() -> None:
    empty = Events.empty()
    none = Reference([sent(empty)], (0, 1)).errors([sent(empty)])
    assert (none.distance, none.count_error, none.timing_us, none.matched) == (0, 0, None, 1)
    much = Reference([sent(empty)], (0, 100_000)).errors([sent(drawn(1))])
    assert much.count_error is None and (much.distance or 0) > 0.5 and much.timing_us is None


def test_frames_are_compared_in_codes() -> None:
    draw = np.random.default_rng(0)
    true = [draw.integers(0, 1024, (12, 16, 3)).astype(np.uint16) for _ in range(3)]
    made = [np.clip(code.astype(int) + draw.integers(-9, 9, code.shape), 0, 1023).astype(np.uint16) for code in true]
    found = Reference([sent(codes=true)], (0, 1)).errors([sent(codes=made[:2])])
    differences = np.stack(made[:2]).astype(float) - np.stack(true[:2])
    assert found.rms_lsb == pytest.approx(np.sqrt(np.mean(differences**2)))
    assert found.distance is None and found.headline == found.rms_lsb


def test_quality_is_that_of_scikit_image() -> None:
    draw = np.random.default_rng(0)
    true = [draw.integers(0, 256, (40, 50)).astype(np.uint8) for _ in range(2)]
    made = [np.clip(picture + draw.normal(0, 9, picture.shape), 0, 255).astype(np.uint8) for picture in true]
    found = quality(list(zip(made, true, strict=True)))
    assert found is not None
    psnr = np.mean([peak_signal_noise_ratio(a, b, data_range=255) for a, b in zip(true, made, strict=True)])
    options: dict[str, Any] = {"gaussian_weights": True, "sigma": 1.5, "use_sample_covariance": False}
    ssim = np.mean([structural_similarity(a, b, data_range=255, **options) for a, b in zip(true, made, strict=True)])
    assert found == pytest.approx((psnr, ssim), rel=1e-12)
    assert quality([(true[0], true[0])]) == (HIGHEST_DB, 1.0)
    assert quality([]) is None and quality([(true[0][:5], true[0][:5])]) is None


def test_flow_makes_frames_that_were_left_out_better_than_a_straight_line(tmp_path: Any) -> None:
    source = open_source(texture(tmp_path, 2.0), fps=100)
    triples = triples_of(source, 0.15)
    assert triples and all(c.t_ns - b.t_ns == b.t_ns - a.t_ns == 10_000_000 for a, b, c in triples)
    flow, straight = (interpolated(triples, method, 0.15) for method in ("flow", "none"))
    assert flow and straight and flow.psnr_db > straight.psnr_db + 3 and flow.ssim > straight.ssim
    a, b, c = triples[0]
    mean = quality([(srgb_codes((a.light + c.light) / 2), srgb_codes(b.light))])
    assert interpolated(triples[:1], "none", 0.15) == pytest.approx(mean, rel=1e-3)


def test_frames_left_out_are_in_the_middle_of_those_beside_them(tmp_path: Any) -> None:
    class Uneven(Edit):
        def frames(self, start: int = 0) -> Any:
            for k, frame in enumerate(self.source.frames(start)):
                yield replace(frame, t_ns=frame.t_ns + 5_000_000 * (k % 2))

    source = open_source(texture(tmp_path, 0.5), fps=100)
    assert triples_of(source, 0.15) and not triples_of(Uneven(source), 0.15)
