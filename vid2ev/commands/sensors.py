"""`vid2ev sensors`: list the sensor presets, or explain one key by key and cite its sources."""

from __future__ import annotations

import json
import textwrap
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from vid2ev.sensors.presets import Kind, SensorFile


@click.command(short_help="List, explain and cite the sensor presets.")
@click.argument("name", required=False)
@click.option("--json", "as_json", is_flag=True, help="Print JSON for programs.")
def sensors(name: str | None, as_json: bool) -> None:
    """List the sensor presets, or explain one.

    NAME is a preset or a TOML file; its page shows each key with value, unit, meaning, limits or choices, and source.
    Event sensors (dvs) and frame sensors (cis) have presets of their own; a name that both have gives two pages.
    """
    from vid2ev.sensors.presets import KINDS, kinds_of, read_sensor

    if name is None:
        titles = {
            kind.table: {preset: read_sensor(preset, kind).about.get("title", "") for preset in kind.names()}
            for kind in KINDS
        }
        click.echo(json.dumps(titles, indent=2) if as_json else _listing(titles))
        return
    pages = [(kind, *_explained(name, kind)) for kind in kinds_of(name)]
    if as_json:
        about = {kind.table: dict(sensor.about) for kind, sensor, _ in pages}
        values = {kind.table: keys for kind, _, keys in pages}
        click.echo(json.dumps({"name": name, "about": about, **values}, indent=2, default=str))
    else:
        click.echo("\n\n\n".join(_page(sensor, keys, kind) for kind, sensor, keys in pages))


def _explained(name: str, kind: Kind) -> tuple[SensorFile, dict[str, dict[str, Any]]]:
    """A sensor, and of each key value, unit, meaning, limits or choices, and source: those that the sensor states, then
    the defaults."""
    from vid2ev.gui.controls import controls_of
    from vid2ev.sensors.presets import load, read_sensor
    from vid2ev.sensors.spec import DvsSpec

    sensor, spec, explained = read_sensor(name, kind), load(kind, name), {}
    values = spec.model_dump(mode="json")
    reached = spec.reached_spreads() if isinstance(spec, DvsSpec) else {}
    controls = {control.key: control for control in controls_of(kind.spec)}
    for key in dict.fromkeys([*sensor.values, *kind.spec.model_fields]):
        control = controls[key]
        explained[key] = {
            "value": values[key],
            "unit": control.unit or None,
            "meaning": control.meaning,
            "source": sensor.sources.get(key) if key in sensor.values else "default",
        }
        if control.limits:
            explained[key]["limits"] = control.limits
        if control.choices:
            explained[key]["choices"] = list(control.choices)
        if key in reached:
            explained[key]["reached"] = list(reached[key])
    return sensor, explained


KIND_TITLES = {"dvs": "Event sensors (--sensor)", "cis": "Frame sensors (--cis)"}


def _listing(titles: dict[str, dict[str, str]]) -> str:
    width = max(len(name) for of_kind in titles.values() for name in of_kind)
    lines = []
    for table, of_kind in titles.items():
        lines += [KIND_TITLES[table], *(f"  {name:<{width}}  {title}" for name, title in of_kind.items()), ""]
    return "\n".join([*lines, "Explain one: vid2ev sensors NAME.  Use one: vid2ev convert VIDEO --sensor NAME"])


def _page(sensor: SensorFile, keys: dict[str, dict[str, Any]], kind: Kind) -> str:
    about, name = sensor.about, f"{sensor.name} [{kind.table}]"
    lines = [f"{name}: {about['title']}" if "title" in about else name, ""]
    for key, entry in keys.items():
        unit = f" {entry['unit']}" if entry["unit"] else ""
        lines += [f"{key} = {json.dumps(entry['value'])}{unit}", *_wrapped(entry["meaning"])]
        if "limits" in entry:
            lines += _wrapped(entry["limits"])
        if "choices" in entry:
            lines += _wrapped(f"one of {', '.join(map(json.dumps, entry['choices']))}")
        if "reached" in entry:
            on, off = entry["reached"]
            lines += _wrapped(f"reached: {on:.3g} nat ON, {off:.3g} nat OFF; no threshold is below a tenth of its mean")
        if entry["source"]:
            lines += _wrapped(f"[{entry['source']}]")
    if about.get("differences"):
        lines += ["", "Differences", *_wrapped(about["differences"])]
    if about.get("sources"):
        lines += ["", "Sources", *(line for source in about["sources"] for line in _wrapped(f"- {source}"))]
    return "\n".join(lines)


def _wrapped(text: str) -> list[str]:
    return textwrap.wrap(text, width=100, initial_indent="    ", subsequent_indent="    ", break_long_words=False)
