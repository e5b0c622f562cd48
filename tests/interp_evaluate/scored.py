"""Rows that look like those of a real evaluation, for tests and for a look at the report."""

from __future__ import annotations

import numpy as np

from interp.evaluate.row import Row

METHODS = {
    "nearest": 24.5,
    "linear": 25.5,
    "flow": 28.5,
    "integration": 28.0,
    "bridge": 31.5,
    "rrin_events_light": 33.0,
}
SEQUENCES = {"car_far": 60.0, "balloon_pop": 160.0, "spinning_umbrella": 35.0, "street_pan": 15.0, "still_life": 3.0}
EVENTS = ("integration", "bridge", "rrin_events_light")
NAN = float("nan")


def row(**known: object) -> Row:
    """A row of which only some is known."""
    nothing = dict.fromkeys(Row.__dataclass_fields__, NAN)
    names = {"sequence": "a", "method": "bridge", "group": 0, "position": 1, "multiple": 8, "t_us": 0}
    return Row(**(nothing | names | {"patch_x": 0, "patch_y": 0} | known))  # type: ignore[arg-type]


def scored(groups: int = 12, multiple: int = 8, seed: int = 0) -> list[Row]:
    """5 sequences by 6 methods; far from the key frames, and where much moves, all are worse."""
    rng = np.random.default_rng(seed)
    rows = []
    for number, (sequence, speed) in enumerate(SEQUENCES.items()):
        for group in range(groups):
            motion = float(speed * (0.3 + 1.4 * np.sin(np.pi * group / groups) ** 2) * rng.uniform(0.8, 1.25))
            for position in range(1, multiple):
                away = min(position, multiple - position) / multiple
                hard = float(rng.normal(0, 0.5))
                for method, level in METHODS.items():
                    keen = 1.1 if method in EVENTS else 2.2
                    lost = keen * away * np.log2(1 + motion) + (max(0, np.log2(motion / 100)) * 3)
                    psnr = float(level + 5 - lost - hard - 0.35 * number * (method in EVENTS) + rng.normal(0, 0.3))
                    ssim = float(1 - 0.5 * 10 ** (-(psnr - 18) / 15))
                    rows.append(
                        Row(
                            sequence, method, group, position, multiple, 33_333 * group + 33_333 * position // multiple,
                            psnr - 0.8, ssim - 0.01, psnr, ssim, psnr - 4, psnr + 5, min(motion / 300, 0.9), psnr - 9,
                            ssim * 0.6, 100, 60, motion, motion * 30, motion * 0.2, 0.4 + 0.1 * number + 0.002 * group,
                            motion * 0.1, 0.5 * number, 100.0 * number - 100,
                        )
                    )  # fmt: skip
    return rows
