"""Frames made tile by tile are those made at once, but where a network sees beyond its tile."""

from __future__ import annotations

import weakref
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import torch
from click.testing import CliRunner
from small_takes import images, moving
from torch.nn import functional as F
from torch.utils._python_dispatch import TorchDispatchMode

from interp.candidates import sight
from interp.candidates.calibrated import calibrated
from interp.interpolate.after import After
from interp.interpolate.whole import frames
from interp.light import luminance, to_light
from interp.methods import METHODS, Gap, closed_forms, of_networks, open_method, tiling
from interp.methods.closed_forms import ClosedForm
from interp.methods.of_networks import OfFrames
from interp.methods.tiling import LEAST, Tiling, parse_tiling, part, tiling_of
from interp.networks import make
from interp.representation.carried import at_places, carried, footprint_over, over, places_over
from interp.representation.event_counts import EventCounts
from interp.weights import save
from vid2ev.commands import main
from vid2ev.errors import UsageError

SIZE = (272, 208)  # width, height
TIMES = torch.tensor([0.25, 0.5, 0.75])


def gap(event_size: tuple[int, int] = SIZE) -> Gap:
    coarse = torch.rand(2, 3, 26, 34)
    frames = F.interpolate(coarse, SIZE[::-1], mode="bilinear", align_corners=False)
    counts = torch.poisson(torch.full((1, 2, 8, *event_size[::-1]), 0.05))
    return Gap(frames[0], frames[1], EventCounts(counts, torch.tensor([[0.15, 0.2]])))


@pytest.mark.parametrize("multiple", [2, 16, 32, 128])
@pytest.mark.parametrize("size", [(272, 208), (1920, 1080), (641, 97), (65, 300), (128, 129)])
@pytest.mark.parametrize("tile", ["64x64", "128x96", "auto", "none"])
def test_tiles_cover_all_and_their_weights_add_up(size: tuple[int, int], tile: str, multiple: int) -> None:
    tiling = parse_tiling(tile, size, multiple)
    total = torch.zeros(size[::-1])
    for each in tiling:
        assert each.left % multiple == 0 and each.top % multiple == 0
        weights = tiling.weights(each)
        assert weights.shape == (each.bottom - each.top, each.right - each.left)
        assert float(weights.min()) >= 0 and float(weights.max()) <= 1
        total[each.within] += weights
    torch.testing.assert_close(total, torch.ones_like(total))


@pytest.mark.parametrize("side", [64, 128, 512, 1024])
def test_the_outer_quarters_of_an_overlap_do_not_count_and_between_them_weights_are_even(side: int) -> None:
    """A quarter of a tile overlaps the next one, or 128 pixels."""
    one, other, *_ = parse_tiling(f"{side}x{side}", (3 * side, side), 2)
    overlap = one.right - other.left
    assert overlap == min(side // 4, 128)
    rising = parse_tiling(f"{side}x{side}", (3 * side, side), 2).weights(other)[0, :overlap]
    quarter = overlap // 4
    assert not rising[:quarter].any() and rising[quarter:-quarter].all() and bool((rising[-quarter:] == 1).all())
    torch.testing.assert_close(rising + rising.flip(0), torch.ones(overlap))


def test_small_frames_are_not_divided_and_large_ones_into_tiles_that_fit() -> None:
    for size in ((1280, 800), (2048, 512), (512, 2048)):  # (of up to a million pixels, whatever their shape)
        assert len(parse_tiling("auto", size, 32)) == 1
    assert len(parse_tiling("auto", (2050, 512), 32)) > 1
    for size in ((1920, 1080), (3840, 2160), (1025, 4000)):
        tiling = parse_tiling("auto", size, 32)
        assert len(tiling) > 1
        assert max((each.right - each.left) * (each.bottom - each.top) for each in tiling) <= 1024 * 1024
    for tile in ("32x32", "512", "512x", "-512x512", "512x512x512", "512x" + "9" * 5000):
        with pytest.raises(UsageError, match=f"at least {LEAST}"):
            parse_tiling(tile, (100, 100), 2)


@pytest.mark.parametrize("event_size", [SIZE, (136, 104), (90, 70), (544, 416)])
def test_events_go_with_their_tile(event_size: tuple[int, int]) -> None:
    whole = gap(event_size)
    assert whole.events is not None
    laid = over(whole.events, SIZE[::-1]).off_on
    for tile in parse_tiling("96x96", SIZE, 32):
        cut = part(whole, tile)
        assert cut.events is not None
        torch.testing.assert_close(cut.events.off_on, laid[(..., *tile.within)])
        torch.testing.assert_close(cut.frame_1, whole.frame_1[(..., *tile.within)])


@pytest.mark.parametrize("method", ["nearest", "linear", "bridge"])
def test_what_looks_at_a_pixel_alone_is_the_same_in_tiles(method: str) -> None:
    opened, whole = open_method(method), gap((136, 104))
    tiled = opened.between(whole, TIMES, parse_tiling("96x96", SIZE, 2))
    torch.testing.assert_close(tiled, opened.between(whole, TIMES), atol=1e-5, rtol=0)


@pytest.mark.parametrize("event_size", [SIZE, (136, 104)])
@pytest.mark.parametrize("method", ["integration", "bridge", "ramps"])
def test_strips_are_the_whole_to_the_bit(
    monkeypatch: pytest.MonkeyPatch, method: str, event_size: tuple[int, int]
) -> None:
    whole = gap(event_size)
    at_once = open_method(method).between(whole, TIMES)
    monkeypatch.setattr(tiling, "STRIP_PX", 16 * SIZE[0])
    made = open_method(method).between(whole, TIMES)
    assert torch.equal(made, at_once) if event_size == SIZE else float((made - at_once).abs().max()) < 1e-6


class Largest(TorchDispatchMode):
    """How many values the largest tensor has that is made meanwhile."""

    values = 0

    def __torch_dispatch__(self, func: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        made = func(*args, **(kwargs or {}))
        if isinstance(made, torch.Tensor):
            self.values = max(self.values, made.numel())
        return made


@pytest.mark.parametrize("apart", [False, True])
@pytest.mark.parametrize("method", ["bridge", "ramps", "guided"])
def test_coarse_events_never_lie_over_whole_frames(monkeypatch: pytest.MonkeyPatch, method: str, apart: bool) -> None:
    """All that is made is as large as images and motion to them, however finely time is divided."""
    monkeypatch.setattr(tiling, "STRIP_PX", 8 * SIZE[0])
    whole = gap((68, 52))
    assert whole.events is not None
    fine = EventCounts(torch.poisson(torch.full((1, 2, 64, 52, 68), 0.01)), whole.events.contrast)
    with Largest() as largest:
        events = calibrated((whole.frame_0, whole.frame_1), fine, None, apart)
        open_method(method).between(replace(whole, events=events), TIMES[:1])
    assert largest.values <= 8 * SIZE[0] * SIZE[1] < 2 * 64 * SIZE[0] * SIZE[1]


@pytest.mark.parametrize("event_size", [SIZE, (136, 104)])
def test_events_that_belong_elsewhere_go_with_their_tile_too(event_size: tuple[int, int]) -> None:
    whole = gap(event_size)
    assert whole.events is not None
    where = places_over(EventCounts.none(1, event_size[::-1]), SIZE[::-1]) + 9 * torch.rand(*SIZE[::-1], 2) - 5
    moved = replace(whole, events=at_places(whole.events, where[None]))
    assert moved.events is not None
    laid = carried(whole.events, where)
    assert torch.equal(over(moved.events, SIZE[::-1]).off_on, laid.off_on)
    assert footprint_over(moved.events, SIZE[::-1]) == laid.footprint
    for tile in parse_tiling("96x96", SIZE, 32):
        cut = part(moved, tile)
        assert cut.events is not None and cut.events.places is None and cut.events.footprint == laid.footprint
        torch.testing.assert_close(cut.events.off_on, laid.off_on[(..., *tile.within)], atol=1e-4, rtol=0)


@pytest.mark.parametrize("name", [*METHODS, "rrin_events_light"])
def test_images_come_some_at_a_time(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    monkeypatch.setattr(closed_forms, "AT_ONCE_PX", SIZE[0] * SIZE[1])
    monkeypatch.setattr(of_networks, "HELD", 2 * 3 * SIZE[0] * SIZE[1])
    network = None if name in METHODS else make(name).eval()
    method = open_method(name) if network is None else OfFrames(name, network, needs_events=True)
    divided = parse_tiling("192x160", SIZE, 2 if network is None else network.multiple)
    some = [*method.images(gap(), TIMES, divided)]
    assert [len(images) for images in some] == ([1, 1, 1] if network is None else [2, 1])


def test_frames_that_are_taken_are_let_go(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """No more than two images are there at a time: one that is made, and the one before."""
    there: weakref.WeakSet[torch.Tensor] = weakref.WeakSet()
    most = 0

    def law(gap: Gap, times: torch.Tensor, _: Tiling) -> Iterator[torch.Tensor]:
        nonlocal most
        for _each in times:
            made = gap.frame_0[None].clone()
            there.add(made)
            most = max(most, len(there))
            yield made
            del made

    monkeypatch.setitem(METHODS, "linear", lambda: closed_forms.ClosedForm("linear", law, needs_events=False))
    assert len([*frames(images(tmp_path / "in", moving(3)), multiple=8, method="linear")]) == 17
    assert most == 1


def test_a_network_in_tiles_makes_the_same_but_at_their_borders() -> None:
    # Two levels see about 40 px around; the outer quarter of the overlap counts nothing.
    network = make("rrin_events_light", depths=(2, 2, 2, 2), zero_heads=False).eval()
    method, whole = OfFrames("light", network, needs_events=True), gap()
    tiling = parse_tiling("192x160", SIZE, network.multiple)
    assert len(tiling) == 4
    tiled, at_once = method.between(whole, TIMES, tiling), method.between(whole, TIMES)
    assert float((at_once - whole.frame_0).abs().max()) > 0.05
    away = torch.ones(SIZE[::-1], dtype=torch.bool)
    for tile in tiling:
        for edge in (tile.left, tile.right):
            if 0 < edge < SIZE[0]:
                away[:, max(0, edge - 40) : edge + 40] = False
        for edge in (tile.top, tile.bottom):
            if 0 < edge < SIZE[1]:
                away[max(0, edge - 40) : edge + 40] = False
    assert float(away.float().mean()) > 0.1
    torch.testing.assert_close(tiled[..., away], at_once[..., away], atol=1e-5, rtol=0)
    assert float((tiled - at_once).abs().max()) < 1 / 255


@pytest.mark.parametrize("size", [SIZE, (269, 203)])
def test_hdr_in_tiles_is_that_of_the_whole_also_when_it_remembers(tmp_path: Path, size: tuple[int, int]) -> None:
    network = make("hdr")
    torch.nn.init.normal_(network.out.weight, std=0.05)
    save(tmp_path / "hdr.safetensors", "hdr", network)
    tiled, whole = (After(tmp_path / "hdr.safetensors", True, "cpu", tile) for tile in ("96x80", "none"))
    tiled_state, state = None, None
    for _ in range(3):
        frame, events = 1.2 * torch.rand(1, 3, *size[::-1]), torch.randn(1, 5, *size[::-1])
        with torch.inference_mode():
            in_tiles, tiled_state = tiled.network(frame, events, tiled_state, residue=tiled.residue)
            picture, state = whole.network(frame, events, state)
        assert float((picture - frame).abs().max()) > 0.05
        torch.testing.assert_close(in_tiles, picture, atol=1e-5, rtol=1e-4)
        torch.testing.assert_close(tiled_state.cell, state.cell, atol=1e-5, rtol=1e-4)


@pytest.mark.parametrize("event_size", [SIZE, (136, 104)])
@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("flow", {}),
        ("guided", {}),
        ("rrin_events_guided", {}),
        ("rrin_events_guided", {"colours": 1}),
        ("rrin_slomo_events", {"flow": "guided"}),
        ("rrin_events_light", {}),
        ("rrin_events_light", {"colours": 1}),
    ],
)
def test_motion_is_that_of_the_whole(
    monkeypatch: pytest.MonkeyPatch, name: str, options: dict[str, Any], event_size: tuple[int, int]
) -> None:
    """Fresh networks are closed forms: what is left to differ is motion, colours, and how bright light may be."""
    monkeypatch.setattr(sight, "AGAIN", 0)  # (once more of coarse events: below)
    network = None if name in METHODS else make(name, **options).eval()
    method = open_method(name) if network is None else OfFrames(name, network, needs_events=name != "rrin_events_light")
    whole = gap(event_size)
    whole = replace(whole, frame_1=2 * whole.frame_0.roll((9, 37), (1, 2)))  # (above white here and there)
    tiles = tiling_of(method, SIZE, "192x192", 1 if event_size == SIZE else 2)
    assert len(tiles) > 1
    made, at_once = method.between(whole, TIMES, tiles), method.between(whole, TIMES)
    assert float((at_once - whole.frame_0).abs().mean()) > 0.01
    assert float((made - at_once).abs().max()) < 2e-4


def of_motion(coarser: int) -> Gap:
    """A texture that moves by (8, 5) px, and what coarse pixels see of it."""
    width, height = SIZE
    texture = F.interpolate(torch.rand(1, 3, 30, 38), (height + 32, width + 32), mode="bicubic").clamp(0.05, 0.95)
    frames, levels = list[torch.Tensor](), list[torch.Tensor]()
    for k in range(17):
        moved = torch.tensor([[[1, 0, k / (width + 32)], [0, 1, 5 / 8 * k / (height + 32)]]])
        frame = F.grid_sample(texture, F.affine_grid(moved, list(texture.shape), False), "bicubic", "border", False)
        frames.append(frame[0, :, 16:-16, 16:-16].clamp(0.03, 1))
        seen = F.avg_pool2d(torch.log(luminance(to_light(frames[-1], "srgb")) + 1e-3), coarser)
        levels.append((seen[0] / 0.15).round())
    changes = torch.stack(levels).diff(dim=0)
    counts = torch.stack([(-changes).clamp(min=0), changes.clamp(min=0)])[None]
    return Gap(frames[0], frames[-1], EventCounts(counts, torch.full((1, 2), 0.15)))


@pytest.mark.parametrize("coarser", [2, 4])
@pytest.mark.parametrize("name", ["guided", "rrin_events_guided", "rrin_slomo_events"])
def test_motion_that_is_sought_twice_is_that_of_the_whole_but_where_nobody_knows_it(name: str, coarser: int) -> None:
    """The second time to 8 bits of images that differ by 1e-6, of which flow that is not sure makes another one."""
    options = {"flow": "guided"} if name == "rrin_slomo_events" else {}
    network = None if name in METHODS else make(name, **options).eval()
    method = open_method(name) if network is None else OfFrames(name, network, needs_events=True)
    torch.manual_seed(0)
    whole, tiles = of_motion(coarser), tiling_of(method, SIZE, "192x192", coarser)
    assert len(tiles) > 1
    off = (method.between(whole, TIMES, tiles) - method.between(whole, TIMES)).abs()
    assert float((off > 1 / 255).float().mean()) < 2e-4


@pytest.mark.parametrize(("footprint", "overlap"), [(1, 128), (2, 128), (4, 160), (9, 360), (20, 512)])
def test_of_coarse_events_tiles_overlap_by_as_much_more_as_these_are_asked_over(footprint: int, overlap: int) -> None:
    """But of networks that do not ask."""
    guided, light = (OfFrames(name, make(name), True) for name in ("rrin_events_guided", "rrin_events_light"))
    one, other, *_ = tiling_of(guided, (8192, 1024), "1024x1024", footprint)
    assert 0 <= one.right - other.left - overlap < guided.network.multiple
    one, other, *_ = tiling_of(light, (8192, 1024), "1024x1024", footprint)
    assert one.right - other.left == 128


@pytest.mark.parametrize("name", ["rrin_events_guided", "rrin_events_light"])
def test_images_in_tiles_are_the_same_where_a_gpu_has_less_memory_for_each_tile(
    monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    network, whole = make(name).eval(), gap()
    method, tiling = OfFrames(name, network, needs_events=True), parse_tiling("128x128", SIZE, network.multiple)
    enough = method.between(whole, TIMES, tiling)
    fewer = iter(range(3, 0, -1))
    monkeypatch.setattr(of_networks, "_at_once", lambda _: next(fewer, 1))
    torch.testing.assert_close(method.between(whole, TIMES, tiling), enough, atol=1e-5, rtol=0)


@pytest.mark.parametrize(
    ("name", "options"), [("rrin_light", {"depths": (3, 3, 3, 3)}), ("rrin_slomo_events", {"flow": "dis"})]
)
@pytest.mark.parametrize("transfer", ["srgb", "linear"])
def test_motion_is_that_of_the_whole_however_frames_are_coded(
    name: str, options: dict[str, Any], transfer: str
) -> None:
    network = make(name, transfer=transfer, **options).eval()
    dark = replace(gap(), events=None)
    dark = replace(dark, frame_0=0.05 * dark.frame_0, frame_1=0.05 * dark.frame_0.roll((2, 5), (1, 2)))
    tiling, method = parse_tiling("128x128", SIZE, network.multiple), OfFrames(name, network, needs_events=False)
    made, at_once = method.between(dark, TIMES, tiling), method.between(dark, TIMES)
    torch.testing.assert_close(made, at_once, atol=1e-6, rtol=0)


@pytest.mark.parametrize("name", METHODS)
def test_a_method_has_tiles_where_it_is_made_in_them(name: str) -> None:
    method, asked = METHODS[name](), parse_tiling("96x96", SIZE, 2)
    seen: set[int] = set()
    cells = Tiling.cells

    def counted(tiling: Tiling, *rest: Any) -> Any:
        seen.add(len(tiling))
        return cells(tiling, *rest)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Tiling, "cells", counted)
        method.between(gap(), TIMES, asked)
    assert isinstance(method, ClosedForm) and method.in_tiles == (len(asked) in seen)


@pytest.mark.parametrize(("method", "told"), [("linear", False), ("flow", False), ("rrin_light-tiny", True)])
def test_tiles_are_told_of_what_is_made_in_them(tmp_path: Path, method: str, told: bool) -> None:
    source = images(tmp_path / "in", [frame.repeat(3, 0).repeat(3, 1) for frame in moving(2)])
    by = "--network" if told else "--method"
    said = CliRunner().invoke(
        main, ["interpolate", str(source), by, method, "--tile", "64x64", "-o", str(tmp_path / "a")]
    )
    assert said.exit_code == 0 and (f"{'tiles':<10}" in said.output) == told, said.output


def test_a_tiling_says_what_it_is() -> None:
    assert parse_tiling("none", SIZE, 32).describe() == "none"
    assert parse_tiling("128x128", SIZE, 32).describe() == "6 tiles of 128x128"
    assert isinstance(parse_tiling("128x128", SIZE, 32), Tiling)
