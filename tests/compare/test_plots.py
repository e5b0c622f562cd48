"""Pictures of comparisons."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from event_streams import events_of
from matplotlib.figure import Figure

from vid2ev.compare.comparison import compare
from vid2ev.compare.plots import BARS, draw_map, draw_timing


@pytest.mark.parametrize("size", [(1, 1), (1, 24), (3, 2), (24, 1), (346, 260), (1280, 720)])
def test_ticks_of_a_map_are_whole_pixels_with_room_for_their_numbers(size: tuple[int, int]) -> None:
    figure = Figure(figsize=(6, 4))
    axes = figure.add_subplot()
    draw_map(figure, axes, compare(events_of([5, 9]), events_of([5]), size))
    figure.draw_without_rendering()
    for axis in (axes.xaxis, axes.yaxis):
        seen = [each for each in axis.get_major_ticks() if axis.get_view_interval().min() <= each.get_loc()]
        seen = [each for each in seen if each.get_loc() <= axis.get_view_interval().max()]
        assert seen and all(float(each.get_loc()).is_integer() for each in seen)
        boxes = [each.label1.get_window_extent() for each in seen]
        assert not any(one.overlaps(other) for one, other in pairwise(boxes))


@pytest.mark.parametrize("most_us", [0, 7, 50, 51, 75, 152, 1234, 4999])
def test_bars_of_errors_that_are_alike_are_alike(most_us: int) -> None:
    error_us = np.arange(-most_us, most_us + 1)
    t_us = 100_000 * np.arange(1, len(error_us) + 1)
    found = compare(events_of(t_us + error_us), events_of(t_us), (1, 1))
    axes = Figure().add_subplot()
    draw_timing(axes, found)
    bars = [(bar.get_x(), bar.get_width(), bar.get_height()) for bar in axes.patches]
    heights = np.array([height for *_, height in bars])
    assert heights.sum() == len(error_us) and len(bars) <= BARS
    within = [height for x, width, height in bars if -most_us - 0.5 <= x and x + width <= most_us + 0.5]
    assert len({*within}) == 1 and len(within) >= len(heights[heights > 0]) - 2
    middle = [(x + width / 2, height) for x, width, height in bars if x < 0 < x + width]
    assert middle == [(0, within[0])]
