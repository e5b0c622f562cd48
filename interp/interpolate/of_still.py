"""One frame, and the events while it was exposed: a hybrid recording in a .mat file with its picture beside it, or any
picture with any event file.

Nothing says when the frame was taken but its events, so they are taken for those of its exposure, from the first to
the last; `interp.methods.one_frame` makes frames of that time.  The frame itself is none of them: it shows no instant.

NAME.mat holds a table of events, N x 4, of t [us], x, y and p (0 and 1, or -1 and 1), as `events` or as the only such
one, and NAME.png lies beside it.  Source of such files: https://github.com/pz-even/ni-joint (DAVIS346).
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import torch

from interp.interpolate.sensor import sensor_of
from interp.interpolate.take import Key, Options
from interp.light import to_codes
from interp.representation.dead_time import look_back_us, stated
from interp.representation.event_counts import USUAL_NATS
from vid2ev import Events
from vid2ev.errors import DataError, UsageError
from vid2ev.formats import open_events, survey
from vid2ev.formats.matlab import is_mat
from vid2ev.light.picture_files import read_picture, remarks_on_tags, white_in
from vid2ev.light.pictures import PictureReader
from vid2ev.pictures.brightest import MOST_OF_HALF_FLOATS
from vid2ev.recording.exposures import LATEST_US
from vid2ev.recording.manifest import identity
from vid2ev.terminal import counted

PICTURES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp")
COLUMNS = 4
SHORTEST_US = 100  # of exposures whose times have fractions: what is shorter is in seconds


class OfStill:
    """A picture and its events.

    Raises UsageError where there is no picture, or are no events, DataError for files that hold none.
    """

    curve = coded = "srgb"
    apart = bright = False

    def __init__(self, picture: Path, events: Path, options: Options):
        unfit = {
            "--crop": options.crop, "--size": options.size, "--start": options.start_s, "--stop": options.stop_s,
            "--source-fps": options.source_hz,
        }  # fmt: skip
        if asked := [name for name, value in unfit.items() if value is not None]:
            raise UsageError(f"{picture} is a single frame, which stays as it is; leave {asked[0]} out")
        self._picture, self._path, self.name = picture, events, picture.stem
        pixels, primaries, tagged = read_picture(picture)
        self.size = pixels.shape[1], pixels.shape[0]
        self.channels, self.bits = (1 if pixels.ndim == 2 else 3), (8 if pixels.dtype == np.uint8 else 16)
        usual = "linear" if pixels.dtype.kind == "f" else tagged or "srgb"
        transfer = usual if options.transfer == "auto" else options.transfer
        self._transfer, reader = transfer, PictureReader(transfer, "rgb", white_in(picture))
        said = reader.remarks_on(pixels)
        light = np.nan_to_num(reader.light(pixels, primaries), nan=0.0, posinf=MOST_OF_HALF_FLOATS)
        self._codes = to_codes(torch.from_numpy(light)[..., : self.channels], "srgb").numpy()
        self._events, stated, warnings = (table_of(events), None, []) if is_mat(events) else _events_in(events)
        if len(self._events) < 2:
            held = counted(len(self._events), "event")
            raise DataError(f"{events} holds {held}; expected those of the exposure of a frame")
        corner = int(self._events.x.max()) + 1, int(self._events.y.max()) + 1
        guess = self.size if all(np.less_equal(corner, self.size)) else corner
        self.event_size: tuple[int, int] = stated or guess
        sensor = sensor_of(events, options.contrast, options.refractory_us)
        self.contrast, self.dead_time = sensor.contrast or (USUAL_NATS, USUAL_NATS), sensor.dead_time
        self.gaps_expected = 1
        self.remarks = [
            f"a single frame, taken for the mean of the light while its events came: {self._span_us / 1e3:g} ms"
        ]
        self.remarks += [f"{events}: {text}" for text in warnings]
        self.remarks += [*said, *(remarks_on_tags(picture, pixels) if options.transfer == "auto" else ())]
        if options.transfer == "auto" and is_mat(events):
            self.remarks.append("its codes are taken for sRGB; of raw frames, --transfer linear says what they are")
        if not sensor.contrast:
            self.remarks.append(f"an event is taken for {USUAL_NATS:g} nat; --contrast says what it stands for")

    @property
    def rate(self) -> Fraction:
        """Frames in a second, if each took as long as this one."""
        return Fraction(10**6, self._span_us)

    def looks(self, t_us: int) -> tuple[()]:
        """Nobody says so."""
        return ()

    def describe(self, besides: Collection[Path] = ()) -> dict[str, Any]:
        """What both files are."""
        about = {"kind": "single frame", "path": str(self._picture), "size": list(self.size)}
        about["transfer"] = self._transfer
        known = {"contrast": list(self.contrast), "dead_time": stated(self.dead_time)}
        events = {"path": str(self._path), "identity": identity(self._path, besides=besides)} | known
        return about | {"identity": identity(self._picture), "events": events}

    def keys(self, start: int = 0) -> Iterator[Key]:
        """The frame, at both ends of its exposure."""
        ends = [int(self._events.t[0]), int(self._events.t[0]) + self._span_us]
        yield from [Key(t_us, self._codes, known=False) for t_us in ends][start:]

    def events(self, start_us: int, stop_us: int) -> Events | None:
        """See `Take`."""
        since_us = start_us - look_back_us(self.dead_time)
        return self._events.select((self._events.t > since_us) & (self._events.t <= stop_us))

    @property
    def _span_us(self) -> int:
        return max(1, int(self._events.t[-1] - self._events.t[0]))


def _events_in(path: Path) -> tuple[Events, tuple[int, int] | None, list[str]]:
    """The events of an event file, in order of time; the size of their sensor if it states that, and what is to be
    known of it."""
    file = open_events(path)
    events = Events.concatenate(survey(file).blocks())
    return events, file.size, file.warnings


def picture_beside(path: Path) -> Path:
    """The picture beside a file of events.  Raises UsageError."""
    found = next((path.with_suffix(suffix) for suffix in PICTURES if path.with_suffix(suffix).exists()), None)
    if found is None:
        raise UsageError(f"{path}: no picture beside it; expected {path.with_suffix('.png').name}")
    return found


def table_of(path: Path) -> Events:
    """The events of a .mat file, in order of time.  Raises DataError."""
    from scipy.io import loadmat

    try:
        found = {name: value for name, value in loadmat(path).items() if not name.startswith("__")}
    except Exception as error:  # (the reader raises whatever a damaged file leads it to)
        raise DataError(f"{path} cannot be read as a MATLAB file ({error}); save it as version 5 or 7") from error
    tables = {name: value for name, value in found.items() if getattr(value, "ndim", 0) == 2}
    tables = {name: value for name, value in tables.items() if value.shape[1] == COLUMNS and value.dtype.kind in "iuf"}
    table = tables.get("events", next(iter(tables.values()), None))
    if table is None or (len(tables) > 1 and "events" not in tables):
        raise DataError(
            f"{path} holds {', '.join(found) or 'nothing'}; expected a table 'events', N x 4, of t, x, y, p"
        )
    if not np.isfinite(table).all():
        raise DataError(f"{path}: events with values that are no numbers; expected t, x, y, p, all of them known")
    table = table[np.argsort(table[:, 0], kind="stable")]
    t, x, y, p = table.T
    if len(table) and (min(x.min(), y.min()) < 0 or max(x.max(), y.max()) > np.iinfo(np.uint16).max):
        raise DataError(f"{path}: events at columns or rows below 0 or above 65535; expected t, x, y, p in this order")
    if np.abs(t.astype(np.float64)).max(initial=0) >= LATEST_US:
        raise DataError(f"{path}: events from {t[0]:g} to {t[-1]:g} us; expected times within {LATEST_US:g} us")
    if len(t) > 1 and t[-1] - t[0] < SHORTEST_US and (t % 1).any():  # (whole microseconds may be as short)
        raise DataError(f"{path}: events from {t[0]:g} to {t[-1]:g}; expected times in us: multiply seconds by 1e6")
    return Events(t.astype(np.int64), x.astype(np.uint16), y.astype(np.uint16), (p > 0).astype(np.uint8))
