"""`vid2ev info`: what a recording, an event file or a video holds."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from vid2ev.commands.source_options import source_options
from vid2ev.errors import DataError, UsageError

if TYPE_CHECKING:
    from vid2ev.sources import Source

OF_FRAMES = {".npz", ".txt"}  # endings of event files that sources of frames have, too


@click.command(short_help="Say what a recording, an event file or a video holds.")
@click.argument("file")
@source_options
@click.option("--json", "as_json", is_flag=True, help="Print JSON for programs.")
def info(file: str, as_json: bool, **options: Any) -> None:
    """Say what FILE holds: a folder that `vid2ev convert` wrote, an event file of any format, or a source of
    frames, read as the other options say.

    Exit code 1 says that it cannot be read, 2 that there is no such file.
    """
    from vid2ev.commands import summary
    from vid2ev.formats import describe_events, holds_events, recognise
    from vid2ev.sources.many import holds_pictures, is_list
    from vid2ev.terminal import lines

    path = Path(file)
    if os.path.isfile(path / "manifest.json"):  # (Path's raise OSError for long names, such as those of scenes may be)
        from vid2ev.recording.manifest import as_stated, read_manifest

        found = read_manifest(path)
        with as_stated(path / "manifest.json"):
            facts = [
                *summary.result_facts(found),
                *summary.recipe_facts(found),
                *summary.file_facts(path),
                *summary.speed_facts(found),
            ]
    elif (
        recognise(path)
        if os.path.isfile(path)
        else os.path.isdir(path) and holds_events(path) and not holds_pictures(path)
    ):
        found = describe_events(path)
        facts = summary.event_facts(found)
    elif is_list(path):
        raise UsageError(f"{path} is a text, which vid2ev convert takes for a list of videos; give one of them")
    else:
        from vid2ev.seen.recipe import holds_adc_codes

        source = _opened(path, file, options)
        found = {"path": file} | source.describe() | {"duration_expected_s": source.duration_expected_s}
        codes = [("codes", "of a sensor's ADC, not pictures")] if holds_adc_codes(path) else []
        facts = [("source", summary.source_text(found)), *codes, *(("warning", text) for text in source.warnings)]
    click.echo(json.dumps(found, indent=2) if as_json else lines(facts))


def _opened(path: Path, file: str, options: dict[str, Any]) -> Source:
    """The source of frames, whatever its name; what is none is an event file that is damaged if it is named as one."""
    from vid2ev.formats import FORMATS, format_named
    from vid2ev.sources import open_source

    try:
        return open_source(file, **options)
    except DataError as error:
        of_events = {format_named(name).suffix for name in FORMATS} - OF_FRAMES | {".hdf5"}
        if os.path.isfile(path) and path.suffix.lower() in of_events:
            raise DataError(
                f"{path} is named as event files are, but begins as none; it is damaged or something else"
            ) from error
        raise
