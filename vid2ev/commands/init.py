"""`vid2ev init`: a rig file to edit."""

from __future__ import annotations

from pathlib import Path

import click


@click.command(short_help="Write a rig file to edit.")
@click.argument("rig", metavar="RIG", type=Path)
@click.option("--from", "calibration", metavar="FILE", help="Begin with the cameras of a calibration file.")
@click.option("--unit", type=click.Choice(["m", "cm", "mm"]), help="Unit of FILE, if it does not say.  [default: m]")
@click.option("--overwrite", is_flag=True, help="Replace what is there.")
def init(rig: Path, calibration: str | None, unit: str | None, overwrite: bool) -> None:
    """Write RIG, a file such as rig.toml that says which cameras see a video and from where.

    It holds an event camera and a frame camera 15 mm apart, and explains every key; with --from, the cameras of a
    calibration file of OpenCV, Kalibr, DSEC or dv-processing.
    """
    from vid2ev.rig.calibration import read_calibration
    from vid2ev.rig.rig_file import EXAMPLE, out_of_reach, rig_text, write_text

    if calibration is None:
        write_text(rig, EXAMPLE.read_text(encoding="utf-8"), overwrite)
        click.echo(f"{rig}: edit it, then vid2ev convert VIDEO --rig {rig}")
        return
    read = read_calibration(calibration, unit)
    says = f"# The cameras of a calibration file ({read.format}); `vid2ev init` without --from explains every key."
    write_text(rig, f"{says}\n\n{rig_text(read.rig, rig.parent)}", overwrite)
    names = ", ".join(camera.name for camera in read.rig.cameras)
    notes = (f"note: {note}" for note in [*read.notes, *out_of_reach(rig, read.rig)])
    click.echo("\n".join([f"{rig}: {names}, of {calibration} ({read.format})", *notes]))
