"""`vid2ev calibration`: rig files and calibration files, one into another."""

from __future__ import annotations

from pathlib import Path

import click

NAMES = ("rig", "opencv", "kalibr", "dsec", "dv")
SUFFIXES = {".toml": "rig", ".json": "dv"}  # that say which format a file is to have


@click.command(short_help="Turn a rig or calibration file into another.")
@click.argument("source", metavar="IN")
@click.argument("target", metavar="OUT", type=Path)
@click.option("--as", "name", type=click.Choice(NAMES), help="Format of OUT.  [default: .toml is rig, .json is dv]")
@click.option("--unit", type=click.Choice(["m", "cm", "mm"]), help="Unit of IN, if it does not say.  [default: m]")
@click.option("--overwrite", is_flag=True, help="Replace what is there.")
def calibration(source: str, target: Path, name: str | None, unit: str | None, overwrite: bool) -> None:
    """Turn the rig or calibration file IN into OUT: the same lenses in the same places.

    IN is a rig file, YAML of OpenCV, Kalibr (camchain) or DSEC (cam_to_cam), or JSON of dv-processing: its content says
    which.  What OUT cannot hold is named.
    """
    from vid2ev.errors import UsageError
    from vid2ev.rig.calibration import left_out, read_calibration, write_calibration
    from vid2ev.rig.rig_file import out_of_reach

    name = name or SUFFIXES.get(target.suffix)
    if name is None:
        raise UsageError(f"{target} does not say its format; give --as {'|'.join(NAMES)}")
    read = read_calibration(source, unit)
    write_calibration(target, read.rig, name, overwrite)
    names = ", ".join(camera.name for camera in read.rig.cameras)
    lost = left_out(read.rig, name)
    notes = [*read.notes, *([f"{name} does not hold {'; '.join(lost)}"] if lost else [])]
    notes += out_of_reach(target, read.rig) if name == "rig" else []
    click.echo("\n".join([f"{target}: {names}, {read.format} to {name}", *(f"note: {note}" for note in notes)]))
