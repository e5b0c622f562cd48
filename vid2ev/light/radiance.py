"""What a Radiance picture says that its light has been multiplied by.

    light of the scene = pixels / (EXPOSURE EXPOSURE ...)      all the lines that there are, 1 without any

Programs that make pictures of one scene, or frames of one clip, presentable multiply each by what suits it.

Source: Radiance, `filefmts`, "Picture File Format".
"""

from __future__ import annotations

import math
from pathlib import Path

from vid2ev.light.recognise import RADIANCE, head_of
from vid2ev.requests import number_of

NAME = b"EXPOSURE="


def exposure_in(path: Path) -> float:
    """The product of all exposures of a picture; 1 where it says none that can be meant, and of other files."""
    head = head_of(path)
    if not head.startswith(RADIANCE):
        return 1.0
    said = head.partition(b"\n\n")[0].splitlines()
    numbers = [line.removeprefix(NAME).decode("latin-1").strip() for line in said if line.startswith(NAME)]
    product = math.prod(map(number_of, numbers))
    return product if 0 < product < math.inf else 1.0
