"""`vid2ev sensors`: list the sensor presets, or explain one key by key and cite its sources."""

from __future__ import annotations

import json
import re
import textwrap
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from vid2ev.sensors.presets import SensorFile


@click.command(short_help="List, explain and cite the sensor presets.")
@click.argument("name", required=False)
@click.option("--json", "as_json", is_flag=True, help="Print JSON for programs.")
def sensors(name: str | None, as_json: bool) -> None:
    """List the sensor presets, or explain one.

    NAME is a preset or a TOML file; its page shows each key with value, unit, meaning and source.
    """
    from vid2ev.sensors.presets import load_sensor, preset_names, read_sensor

    if name is None:
        titles = {preset: read_sensor(preset).about.get("title", "") for preset in preset_names()}
        click.echo(json.dumps(titles, indent=2) if as_json else _listing(titles))
        return
    sensor = read_sensor(name)
    keys = _explain(sensor, load_sensor(name).model_dump(mode="json"))
    if as_json:
        click.echo(json.dumps({"name": sensor.name, "about": dict(sensor.about), "dvs": keys}, indent=2, default=str))
    else:
        click.echo(_page(sensor, keys))


def _explain(sensor: SensorFile, values: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """Value, unit, meaning and source of each key: those that the sensor states, then the defaults."""
    from vid2ev.sensors.spec import DvsSpec

    explained = {}
    for key in dict.fromkeys([*sensor.values, *DvsSpec.model_fields]):
        meaning = DvsSpec.model_fields[key].description or ""
        unit = re.search(r" \[(\w+)\]", meaning)
        explained[key] = {
            "value": values[key],
            "unit": unit[1] if unit else None,
            "meaning": meaning.replace(unit[0], "") if unit else meaning,
            "source": sensor.sources.get(key) if key in sensor.values else "default",
        }
    return explained


def _listing(titles: dict[str, str]) -> str:
    width = max(map(len, titles))
    lines = [f"{name:<{width}}  {title}" for name, title in titles.items()]
    return "\n".join([*lines, "", "Explain one: vid2ev sensors NAME.  Use one: vid2ev convert VIDEO --sensor NAME"])


def _page(sensor: SensorFile, keys: dict[str, dict[str, Any]]) -> str:
    about = sensor.about
    lines = [f"{sensor.name}: {about['title']}" if "title" in about else sensor.name, ""]
    for key, entry in keys.items():
        unit = f" {entry['unit']}" if entry["unit"] else ""
        lines += [f"{key} = {json.dumps(entry['value'])}{unit}", *_wrapped(entry["meaning"])]
        if entry["source"]:
            lines += _wrapped(f"[{entry['source']}]")
    if about.get("differences"):
        lines += ["", "Differences", *_wrapped(about["differences"])]
    if about.get("sources"):
        lines += ["", "Sources", *(line for source in about["sources"] for line in _wrapped(f"- {source}"))]
    return "\n".join(lines)


def _wrapped(text: str) -> list[str]:
    return textwrap.wrap(text, width=100, initial_indent="    ", subsequent_indent="    ", break_long_words=False)
