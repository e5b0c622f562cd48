"""Photographs in motion: layers move as a camera that pans, or stands beside, sees them move, whatever way they lie."""

from __future__ import annotations

import math
from collections.abc import Iterator

import cv2
import numpy as np
import pytest

from interp.data import layers
from interp.data.layers import FOCAL, Layers
from interp.data.settings import ClipSettings
from interp.data.shot import SAME, Beside
from vid2ev.stream.frames import luminance_of

SIDE = 96
SETTINGS = ClipSettings(size=(SIDE, SIDE))
NUMBERS = range(3)
RIGHT = (1.0, 0.0, 0.0, 0.0)


def alone(number: int, beside: Beside = SAME) -> Iterator[tuple[float, Layers]]:
    """Shots of each layer of a clip alone, with its distance [m]; none sways or fades."""
    for layer in Layers(SETTINGS, 0, number, beside, 8.0)._layers:
        shot = Layers(SETTINGS, 0, number, beside, 8.0)
        shot._layers, shot._fade = [layer._replace(waves=(0.0, 1.0, 0.0, 0.0))], 0.0
        yield layer.distance_m, shot


def moved_px(there: np.ndarray, here: np.ndarray) -> np.ndarray:
    """By how much a picture is moved beside another, to the right and down."""
    window = cv2.createHanningWindow((SIDE, SIDE), cv2.CV_32F)
    return np.array(cv2.phaseCorrelate(here, there, window)[0])


def is_seen(luminance: np.ndarray) -> bool:
    """Whether there is enough of a layer in a picture."""
    return bool(np.count_nonzero(luminance) > luminance.size / 8)


@pytest.mark.parametrize("angle", [0.0, 0.7, math.pi / 2, 4.0])
def test_a_camera_that_stands_beside_sees_all_layers_shifted_against_its_way(angle: float) -> None:
    across, seen = np.array([math.cos(angle), math.sin(angle)]), 0
    for number in NUMBERS:
        for k, (distance_m, _) in enumerate(alone(number)):
            place_m = 6 * distance_m / (FOCAL * SIDE) * across  # (f B / Z is 6 px)
            shot = [*alone(number, Beside(*place_m))][k][1]
            light, there = next(shot.pictures(8, 4, 4))
            if is_seen(here := luminance_of(light)):
                np.testing.assert_allclose(moved_px(there, here), -6 * across, atol=0.5)
                seen += 1
    assert seen >= 6


def test_layers_follow_the_camera_one_way_the_near_ones_more(monkeypatch: pytest.MonkeyPatch) -> None:
    def one_that_moves(self: Layers, *arguments: object) -> None:
        ways = iter([np.array(RIGHT)])  # (the camera's is the first that is drawn)
        monkeypatch.setattr(layers, "_way", lambda _: next(ways, np.zeros(4)))
        drawn(self, *arguments)  # type: ignore[arg-type]

    drawn, seen = Layers.__init__, 0
    monkeypatch.setattr(Layers, "__init__", one_that_moves)
    for number in NUMBERS:
        shots = [*alone(number)]
        nearest_m = min(distance_m for distance_m, _ in shots)
        for distance_m, shot in shots:
            first, *_, last = (there for _, there in shot.pictures(8, 0, 8))
            if is_seen(first):
                np.testing.assert_allclose(moved_px(last, first), [-8 * nearest_m / distance_m, 0], atol=0.5)
                seen += 1
    assert seen >= 6
