"""vid2ev: ordinary video in, what an event camera would have recorded out.

The public names load what they need on first use, so that `import vid2ev` is quick.
"""

from __future__ import annotations

import os
from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from vid2ev.errors import DataError as DataError
    from vid2ev.errors import UsageError as UsageError
    from vid2ev.errors import Vid2evError as Vid2evError
    from vid2ev.formats import read_events as read_events
    from vid2ev.making.conversion import convert as convert
    from vid2ev.seen.instants import events_of as events_of
    from vid2ev.sensors.batch import DvsBatch as DvsBatch
    from vid2ev.sensors.batch_on_card import DvsBatchOnCard as DvsBatchOnCard
    from vid2ev.sensors.card_grids import NetCountsOnCard as NetCountsOnCard
    from vid2ev.sensors.card_grids import VoxelsOnCard as VoxelsOnCard
    from vid2ev.sensors.cis import Cis as Cis
    from vid2ev.sensors.cis_spec import CisSpec as CisSpec
    from vid2ev.sensors.devices import memory_of as memory_of
    from vid2ev.sensors.dvs import Dvs as Dvs
    from vid2ev.sensors.presets import cis_names as cis_names
    from vid2ev.sensors.presets import load_cis as load_cis
    from vid2ev.sensors.presets import load_sensor as load_sensor
    from vid2ev.sensors.presets import preset_names as preset_names
    from vid2ev.sensors.spec import DvsSpec as DvsSpec
    from vid2ev.sources import open_source as open_source
    from vid2ev.stream.events import Events as Events
    from vid2ev.stream.events import Label as Label
    from vid2ev.stream.exposures import Exposure as Exposure
    from vid2ev.stream.frames import Frame as Frame
    from vid2ev.views.grid import NetCounts as NetCounts
    from vid2ev.views.grid import Windows as Windows

    __version__: str

_HOME = {
    "Cis": "vid2ev.sensors.cis",
    "CisSpec": "vid2ev.sensors.cis_spec",
    "DataError": "vid2ev.errors",
    "Dvs": "vid2ev.sensors.dvs",
    "DvsBatch": "vid2ev.sensors.batch",
    "DvsBatchOnCard": "vid2ev.sensors.batch_on_card",
    "DvsSpec": "vid2ev.sensors.spec",
    "Events": "vid2ev.stream.events",
    "Exposure": "vid2ev.stream.exposures",
    "Frame": "vid2ev.stream.frames",
    "Label": "vid2ev.stream.events",
    "NetCounts": "vid2ev.views.grid",
    "NetCountsOnCard": "vid2ev.sensors.card_grids",
    "UsageError": "vid2ev.errors",
    "Vid2evError": "vid2ev.errors",
    "VoxelsOnCard": "vid2ev.sensors.card_grids",
    "Windows": "vid2ev.views.grid",
    "cis_names": "vid2ev.sensors.presets",
    "convert": "vid2ev.making.conversion",
    "events_of": "vid2ev.seen.instants",
    "load_cis": "vid2ev.sensors.presets",
    "load_sensor": "vid2ev.sensors.presets",
    "memory_of": "vid2ev.sensors.devices",
    "open_source": "vid2ev.sources",
    "preset_names": "vid2ev.sensors.presets",
    "read_events": "vid2ev.formats",
}

__all__ = ["__version__", *_HOME]

# OpenCV reads this once, when it is loaded: pictures of more pixels than `vid2ev.untrusted` allows are refused before
# there is memory for them (16 bytes for a pixel).  Of a number that it could not hold it would end the program; what is
# no limit is refused by `most_bytes`.
_MEGABYTES = os.environ.get("VID2EV_LARGEST_MB", "")
_ALLOWED = int(_MEGABYTES) if _MEGABYTES.isdecimal() and len(_MEGABYTES) <= 9 else 4096
os.environ.setdefault("OPENCV_IO_MAX_IMAGE_PIXELS", str(_ALLOWED << 16))


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        return version("vid2ev")
    if name not in _HOME:
        raise AttributeError(f"module 'vid2ev' has no attribute '{name}'")
    value = globals()[name] = getattr(import_module(_HOME[name]), name)
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
