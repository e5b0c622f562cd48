"""The curves of high dynamic range, PQ and HLG, and the logarithmic ones, scaled to 1.0 at diffuse white.

    pq       L = 10000/203 (max(P - c1, 0) / (c2 - c3 P))**(1/m1),  P = V**(1/m2)     0 <= V <= 1
    hlg      L = E / E(0.75),   E = V**2 / 3                                          V <= 1/2
                                E = (exp((V - c) / a) + b) / 12                       above
    log100   L = 10**(2 (V - 1))                                                      V >= 0
    log316   L = 10**(2.5 (V - 1))                                                    V >= 0

PQ codes the light of a display, up to 10000 cd/m2, and diffuse white is 203 cd/m2 there: light goes to 49.26, and a
signal above 1 has no meaning, so that it counts as 1.  HLG codes the light of the scene, of which 75 % signal is
diffuse white: light goes to 3.77, and on where the signal does.  The logarithmic curves have a floor, 1/100 and 1/316
of white, which is what they give for black: to call it 0 would make a step that no scene has.

Sources: PQ, SMPTE ST 2084; HLG, ARIB STD-B67 and Rec. ITU-R BT.2100-2 tables 4 and 5; diffuse white, Rep. ITU-R
BT.2408-7 section 2; the logarithmic ones, Rec. ITU-T H.273 table 3, values 9 and 10.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

PQ_PEAK = 10000 / 203
PQ_M1, PQ_M2 = 2610 / 16384, 2523 / 4096 * 128
PQ_C1, PQ_C2, PQ_C3 = 3424 / 4096, 2413 / 4096 * 32, 2392 / 4096 * 32

HLG_A, HLG_B, HLG_C = 0.17883277, 0.28466892, 0.55991073
HLG_WHITE = (math.exp((0.75 - HLG_C) / HLG_A) + HLG_B) / 12

Curve = Callable[[np.ndarray], np.ndarray]


def pq_to_light(signal: np.ndarray) -> np.ndarray:
    """Light of a PQ signal."""
    p = np.clip(np.asarray(signal, np.float64), 0.0, 1.0) ** (1 / PQ_M2)
    return PQ_PEAK * (np.maximum(p - PQ_C1, 0.0) / (PQ_C2 - PQ_C3 * p)) ** (1 / PQ_M1)


def pq_to_signal(light: np.ndarray) -> np.ndarray:
    """PQ signal of light."""
    y = np.clip(np.asarray(light, np.float64) / PQ_PEAK, 0.0, 1.0) ** PQ_M1
    return ((PQ_C1 + PQ_C2 * y) / (1 + PQ_C3 * y)) ** PQ_M2


def hlg_to_light(signal: np.ndarray) -> np.ndarray:
    """Light of an HLG signal."""
    v = np.maximum(np.asarray(signal, np.float64), 0.0)
    return np.where(v <= 0.5, v * v / 3, (np.exp((v - HLG_C) / HLG_A) + HLG_B) / 12) / HLG_WHITE


def hlg_to_signal(light: np.ndarray) -> np.ndarray:
    """HLG signal of light."""
    e = np.maximum(np.asarray(light, np.float64), 0.0) * HLG_WHITE
    above = HLG_A * np.log(np.maximum(12 * e - HLG_B, 1e-300)) + HLG_C  # (used from 12 e = 3 on)
    return np.where(e <= 1 / 12, np.sqrt(3 * e), above)


def logarithmic(decades: float) -> tuple[Curve, Curve]:
    """The curve of a logarithm over so many decades: to light, and to signal."""

    def to_light(signal: np.ndarray) -> np.ndarray:
        return 10.0 ** (decades * (np.maximum(np.asarray(signal, np.float64), 0.0) - 1))

    def to_signal(light: np.ndarray) -> np.ndarray:
        return 1 + np.log10(np.maximum(np.asarray(light, np.float64), 10.0**-decades)) / decades

    return to_light, to_signal
