"""Recordings and recipes on one screen: a name and a line for each fact."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from vid2ev.terminal import counted

BEFORE_THE_SENSOR = ("view", "subframes")  # of a plan: what is made as it is needed, whatever is asked


def recipe_facts(recipe: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Source, light, sensor and seed, from a recipe's description or a manifest."""
    upsampling = recipe["upsampling"]
    light = {
        "none": "the frames, in a straight line from one to the next",
        "linear": f"in a straight line from frame to frame, {_parts(upsampling, 'in one part')}",
        "flow": f"along the motion between the frames, {_parts(upsampling, 'in parts as needed, at most {}')}",
    }
    others = f"by {upsampling['method']} between the frames, {_parts(upsampling, 'in parts as needed, at most {}')}"
    facts = [("source", source_text(recipe["source"])), ("light", light.get(upsampling["method"], others))]
    if "cameras" in recipe:
        cameras = recipe["cameras"].items()
        return [
            *facts,
            ("depth", recipe["depth"] or "not needed"),
            *((name, sensor_text(sensor)) for name, sensor in cameras),
            *((f"plan {name}", plan_text(plan)) for name, plan in recipe.get("plan", {}).items()),
        ]
    effects = ", ".join(recipe["sensor"]["effects"]) or "none"
    facts += [("plan", plan_text(plan)) for plan in recipe.get("plan", {}).values()]
    return [*facts, ("sensor", f"{sensor_text(recipe['sensor'])}, seed {recipe['seed']}"), ("effects", effects)]


def plan_text(plan: Mapping[str, Any]) -> str:
    """A plan's description as one line."""
    rows = [row for row in plan["rows"] if row["effect"] not in BEFORE_THE_SENSOR]
    gone = ", ".join(f"{row['effect']} {row['fate']}" for row in rows if row["fate"] != "kept") or "all effects kept"
    what, most, unit = (
        ("levels", plan["max_lsb"], " LSB") if "max_lsb" in plan else ("the distance", plan["distance"], "")
    )
    changes = "what that changes has no bound" if most is None else f"changes {what} by at most {most:.2g}{unit}"
    return f"{gone}; {changes}"


def sensor_text(sensor: Mapping[str, Any]) -> str:
    """A sensor's description as one line."""
    parameters = sensor["parameters"]
    if sensor.get("kind") == "cis":
        shutter = f", lines {parameters['line_us']:g} us apart" if parameters["line_us"] else ""
        exposure = f"{parameters['exposure_us']:g} us" if parameters.get("blur", True) else "an instant"
        how = f"{parameters['frame_rate_hz']:g} frames/s of {exposure}{shutter}"
    else:
        how = f"thresholds ON {parameters['threshold_on']:g} and OFF {parameters['threshold_off']:g}"
    return f"{sensor['name']}, {'x'.join(map(str, sensor['size']))}, {how}"


def result_facts(manifest: Mapping[str, Any]) -> list[tuple[str, str]]:
    """What came out, duration and warnings, from a manifest."""
    if "results" in manifest:
        results, cameras = manifest["results"], manifest["cameras"]
        counts = [(name, _count_text(result, cameras[name])) for name, result in results.items()]
        return [*counts, _duration(next(iter(results.values()))), *_warnings_of(results)]
    sensor = manifest["sensor"]
    what = "frames" if sensor.get("kind") == "cis" else "events"
    warnings = manifest["warnings"]
    return [
        (what, _count_text(manifest, sensor, named=True)),
        _duration(manifest),
        *(("warning", text) for text in warnings),
    ]


def _warnings_of(results: Mapping[str, Any]) -> list[tuple[str, str]]:
    """The warnings of cameras, each once; those that not all of them have say whose they are."""
    having: dict[str, list[str]] = {}
    for name, result in results.items():
        for text in result["warnings"]:
            having.setdefault(text, []).append(name)
    return [
        ("warning", text if len(names) == len(results) else f"{', '.join(names)}: {text}")
        for text, names in having.items()
    ]


def _count_text(result: Mapping[str, Any], sensor: Mapping[str, Any], named: bool = False) -> str:
    """Events or frames of a camera; `named`: which of them it is stands before."""
    counts, seconds, (width, height) = result["counts"], result["duration_us"] / 1e6, sensor["size"]
    if sensor.get("kind") == "cis":
        exposures = f"{counts['exposures']:,}" if named else counted(counts["exposures"], "frame")
        return f"{exposures}, {counts['unfinished']:,} cut off by the end"
    per_s = counts["events"] / seconds if seconds else 0.0
    rate = f", {short(per_s)}/s, {short(per_s / width / height)}/s per pixel"
    share = f", {100 * counts['on'] / counts['events']:.1f} % ON" if counts["events"] else ""
    events = f"{counts['events']:,}" if named else counted(counts["events"], "event")
    return f"{events}{rate if seconds else ''}{share}"


def _duration(result: Mapping[str, Any]) -> tuple[str, str]:
    counts, seconds = result["counts"], result["duration_us"] / 1e6
    return (
        "duration",
        f"{seconds:.3f} s: {counted(counts['frames'], 'frame')}, {counts['subframes']:,} made between them",
    )


def speed_facts(manifest: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Time taken, and the share of the event sensors that slept through still light, from a manifest."""
    result = next(iter(manifest["results"].values())) if "results" in manifest else manifest
    seconds, video_s = manifest["run"]["seconds"], result["duration_us"] / 1e6
    ratio = f", {of_the_clip(seconds, video_s)}" if seconds and video_s else ""
    threads = manifest["run"]["threads"]
    took = f"{seconds:.1f} s{ratio}, {counted(threads, 'sensor thread')}"
    slept, of = map(sum, zip((0, 0), *manifest["run"].get("strips_slept", {}).values(), strict=True))
    device = device_facts(manifest["run"].get("device", {"asked": "cpu"}))
    return [
        ("took", took),
        *device,
        *([("slept", f"{100 * slept / of:.0f} % of the pixels' intervals")] if slept else []),
    ]


def of_the_clip(seconds: float, video_s: float) -> str:
    """How long something takes, in multiples of how long the clip is."""
    ratio = seconds / video_s
    return f"{f'{ratio:.2g}' if ratio < 10 else f'{ratio:,.0f}'} x the length of the clip"


def device_facts(device: Mapping[str, str]) -> list[tuple[str, str]]:
    """Where a recording is made, and why, of a device's description; nothing if it is on the CPU as ever."""
    return [("device", f"{device['used']}: {device['why']}")] if device["asked"] != "cpu" else []


def file_facts(directory: Path) -> list[tuple[str, str]]:
    """The files of a recording, those in folders by their number."""
    held = sorted(directory.iterdir())
    files = [f"{path.name} {_bytes(path)}" for path in held if path.is_file()]
    folders = [f"{path.name}/ {counted(_files_in(path), 'file')}" for path in held if path.is_dir()]
    return [("files", f"{directory}: " + ", ".join(files + folders))]


def _files_in(folder: Path) -> int:
    return sum(path.is_file() for path in folder.rglob("*"))


def source_text(source: Mapping[str, Any]) -> str:
    """A source's description as one line; unknown facts are left out."""
    facts = [
        "x".join(map(str, source["size"])) if source.get("size") else "",
        _frames_text(source),
        f"{source['duration_expected_s']:.6g} s" if source.get("duration_expected_s") else "",
        *(str(source[key]) for key in ("codec", "pixel_format", "transfer") if source.get(key)),
    ]
    return f"{source['path']} ({', '.join(fact for fact in [source.get('kind', ''), *facts] if fact)})"


def _frames_text(source: Mapping[str, Any]) -> str:
    """How many frames a source has, as far as it is known before they are read."""
    if not source.get("frames_expected"):
        return ""
    guessed = source.get("frames_estimated") or {"start_s", "stop_s"} & {*source.get("edits", {})}
    return f"{'about ' * bool(guessed)}{counted(source['frames_expected'], 'frame')}"


def event_facts(facts: Mapping[str, Any]) -> list[tuple[str, str]]:
    """An event file's description."""
    count = facts["events"]
    first, last = facts["first_us"], facts["last_us"]
    spread = (last - first) / 1e6 if count else 0.0
    share = f", {100 * facts['on'] / count:.1f} % ON" if count else ""
    found = [
        ("events", f"{count:,}{share}{', ' + short(count / spread) + '/s' if spread else ''}"),
        ("size", "x".join(map(str, facts["size"])) if facts["size"] else "not stated"),
    ]
    if count:
        found.append(("time", f"{first} ... {last} us ({spread:.6f} s), counted from {facts['start_us']} us"))
    if facts["times_going_back"]:
        found.append(("order", f"times go back at {counted(facts['times_going_back'], 'place')}"))
    said = {key.replace("_", " "): value for key, value in facts["stored"].items() if value is not None}
    stored = [facts["format"], *(f"{key} {value}" for key, value in said.items() if not isinstance(value, dict | list))]
    stored += [f"{facts['bytes'] / count:.2f} bytes per event"] if count else []
    stored += [f"with {name}" for name in ("labels", "frames") if facts[name]]
    return [*found, ("stored", ", ".join(stored)), *(("warning", text) for text in facts["warnings"])]


def _parts(upsampling: Mapping[str, Any], auto: str) -> str:
    parts = upsampling["subframes"]
    return auto.format(upsampling["max_subframes"]) if parts == "auto" else f"in {counted(parts, 'part')}"


def short(number: float) -> str:
    """A number to three digits, in thousands, millions and so on, with a space before the unit to come."""
    number = float(f"{number:.3g}")  # (of 999.9 that is a thousand)
    for unit, size in (("T", 1e12), ("G", 1e9), ("M", 1e6), ("k", 1e3)):
        if number >= size:
            return f"{number / size:.3g} {unit}"
    return f"{number:.3g} "


def _bytes(path: Path) -> str:
    return f"{short(path.stat().st_size)}B"
