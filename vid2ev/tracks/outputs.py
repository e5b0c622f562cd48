"""What a conversion writes: event files of any format, frames made of events, a preview."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from vid2ev.errors import SavedError, UsageError
from vid2ev.formats import FORMATS, check_holds, format_named
from vid2ev.formats.event_file import Format, Recording
from vid2ev.formats.frame_index import FRAME_INDEX, write_frame_index
from vid2ev.recording import exposures
from vid2ev.requests import names_in
from vid2ev.views.on_disk import KINDS, write_frames
from vid2ev.views.requests import parse_representation, parse_slicing

FRAMES_BY, FRAMES_AS = "duration:10ms", "counts"


@dataclass(frozen=True)
class Outputs:
    """The files of a recording beside its manifest; checked when they are named.

    formats     names of `vid2ev.formats.FORMATS`
    preview     preview.mp4
    frames      slices of the events as "npz", "png" or "mp4"; None for none
    frames_by   the slices, as `views.requests.parse_slicing` has them
    frames_as   what they are made into, as `views.requests.parse_representation` has it
    probe       pixels (x, y) whose state over time goes to probe.csv and probe.png
    noise_maps  noise_maps.npz: thresholds, hot and cold pixels
    pictures    of frame cameras, some of `recording.exposures.KINDS`
    """

    formats: tuple[str, ...] = ("hdf5",)
    preview: bool = True
    frames: str | None = None
    frames_by: str = FRAMES_BY
    frames_as: str = FRAMES_AS
    probe: tuple[tuple[int, int], ...] = ()
    noise_maps: bool = False
    pictures: tuple[str, ...] = ("raw", "mp4")

    @classmethod
    def of(
        cls,
        formats: str | Sequence[str] = ("hdf5",),
        probe: Sequence[str | tuple[int, int]] = (),
        pictures: str | Sequence[str] = ("raw", "mp4"),
        **rest: Any,
    ) -> Outputs:
        """The outputs of these options; several formats or pictures may be in one text, with commas, and a pixel be
        "x,y"; each counts once.  Raises UsageError."""
        names = names_in(formats)
        pixels = tuple(dict.fromkeys(map(pixel_of, probe)))
        outputs = cls(names, probe=pixels, pictures=names_in(pictures), **rest)
        for kind in outputs.pictures:
            if kind not in exposures.KINDS:
                raise UsageError(f"pictures as '{kind}': expected one of {', '.join(exposures.KINDS)}")
        for name in names:
            if name not in FORMATS or not format_named(name).write:
                writable = ", ".join(name for name in FORMATS if format_named(name).write)
                raise UsageError(f"format '{name}' cannot be written; expected one of {writable}")
        if outputs.frames is not None and outputs.frames not in KINDS:
            raise UsageError(f"frames as '{outputs.frames}': expected one of {', '.join(KINDS)}")
        if outputs.frames is None and (outputs.frames_by, outputs.frames_as) != (FRAMES_BY, FRAMES_AS):
            raise UsageError(
                f"frames by '{outputs.frames_by}', as '{outputs.frames_as}': expected frames to write; add --frames-out"
                " npz, png or mp4"
            )
        parse_slicing(outputs.frames_by)
        parse_representation(outputs.frames_as)
        return outputs

    @classmethod
    def options(cls) -> tuple[str, ...]:
        """Its fields."""
        return tuple(each.name for each in fields(cls))

    @classmethod
    def taken_from(cls, given: dict[str, Any]) -> dict[str, Any]:
        """Those options that are fields of this class, taken out of all that are given."""
        return {name: given.pop(name) for name in cls.options() if name in given}

    def check(self, size: tuple[int, int], duration_us: int | None, start_us: int | None = None) -> None:
        """Raise UsageError where a format cannot hold pixels of `size` (width, height), or the duration or the time at
        which it starts if known, and where a pixel to be probed is not there."""
        for x, y in self.probe:
            if not (0 <= x < size[0] and 0 <= y < size[1]):
                raise UsageError(f"probe {x},{y}: expected a pixel of a sensor of {size[0]}x{size[1]}")
        for kind in self.kinds():
            check_holds(kind, size, duration_us, start_us)

    def kinds(self) -> list[Format]:
        """The formats."""
        return [format_named(name) for name in self.formats]

    @property
    def by_the_clock(self) -> bool:
        """Whether one of the formats cannot hold all instants, whatever they are counted from."""
        return any(kind.clock_us for kind in self.kinds())

    @property
    def want_frames(self) -> bool:
        """Whether one of the formats holds frames beside its events."""
        return any("frames" in kind.keeps for kind in self.kinds())

    def describe(self) -> dict[str, Any]:
        """The outputs, ready for JSON."""
        lists = {"formats": list(self.formats), "pictures": list(self.pictures)}
        return asdict(self) | lists | {"probe": [list(pixel) for pixel in self.probe]}

    def files(self) -> dict[str, str]:
        """The file of each format; where two have one suffix, the second has its format's name, too."""
        taken: dict[str, str] = {}
        for kind in self.kinds():
            plain = f"events{kind.suffix}"
            taken[kind.name] = f"events-{kind.name}{kind.suffix}" if plain in taken.values() else plain
        return taken

    @property
    def _index_beside(self) -> bool:
        """Whether the file that is read of the folder, the first that there is, has no instants of frames inside."""
        return self.files().get("hdf5") != f"events{format_named('hdf5').suffix}"

    def names(self, kind: str = "dvs") -> list[str]:
        """All files of a camera of a kind, the manifest among them."""
        if kind == "cis":
            return [*(exposures.KINDS[name] for name in self.pictures), "manifest.json"]
        files = [*self.files().values(), *[FRAME_INDEX] * self._index_beside]
        files += [KINDS[self.frames]] if self.frames else []
        files += ["frames.csv"] * (self.frames == "mp4")  # (the slices that its pictures are of)
        files += ["probe.csv", "probe.png"] if self.probe else []
        return files + ["noise_maps.npz"] * self.noise_maps + ["preview.mp4"] * self.preview + ["manifest.json"]

    def write(self, folder: Path, recording: Recording) -> None:
        """Write the files of a recording, but for the preview.

        Raises OSError, UsageError for times that a format cannot hold and SavedError for events that cannot be: what
        was kept of them to go on from was damaged.
        """
        files = self.files()
        for kind in self.kinds():
            assert kind.write is not None
            try:
                kind.write(folder / files[kind.name], recording)
            except UsageError:
                raise
            except ValueError as error:
                raise SavedError(
                    f"{folder}: {error}; what was kept to go on from is damaged, --overwrite starts again"
                ) from error
        if recording.frame_us is not None and self._index_beside:
            write_frame_index(folder / FRAME_INDEX, recording)
        if self.frames is not None:
            path = folder / KINDS[self.frames]
            write_frames(path, recording, self.frames_as, self.frames_by, kind=self.frames)


def pixel_of(pixel: str | tuple[int, int]) -> tuple[int, int]:
    """The pixel (x, y), or of a text "x,y"; raises UsageError."""
    text = pixel if isinstance(pixel, str) else ",".join(map(str, pixel))
    found = re.fullmatch(r"\s*(\d{1,9})\s*,\s*(\d{1,9})\s*", text)
    if not found:
        raise UsageError(f"probe '{text}': expected column and row of a pixel, such as 160,120")
    return int(found[1]), int(found[2])
