"""What has to be known beside the scores of an evaluation, of its summary: what was left out, and what is peculiar."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from vid2ev.terminal import counted

NAMED = 3  # sequences that are named where many have the same to be said of them


def left_out(summary: Mapping[str, Any]) -> dict[str, int]:
    """What was not scored: reason, which begins with "gaps" or "frames", with its sequences where there are others, and
    number."""
    found: dict[str, dict[str, int]] = {}
    for name, of in summary["sequences"].items():
        counts = {f"gaps: {reason}": count for reason, count in of["not_scored"].items()}
        counts |= {f"frames that {method} lacks": count for method, count in of["missing"].items() if count}
        for method, reasons in of["unfit"].items():
            counts |= {
                f"frames of {method}: {reason} ({several(which)})": len(which) for reason, which in reasons.items()
            }
        for reason, count in counts.items():
            found.setdefault(reason, {})[name] = count
    alone = len(summary["sequences"]) == 1
    return {
        reason if alone else f"{reason}, in {several(counts)}": sum(counts.values()) for reason, counts in found.items()
    }


def remarks(summary: Mapping[str, Any]) -> list[str]:
    """Sentences: what cannot be used, what is peculiar about sequences, and frames of 100 dB."""
    said: dict[str, list[str]] = {}
    for name, of in summary["sequences"].items():
        of_methods = (f"{method}: {remark}" for method, some in of["of_methods"].items() for remark in some)
        for remark in (*of["remarks"], *of_methods):
            said.setdefault(remark, []).append(name)
    return [
        *(f"{name}: not used: {reason}" for name, reason in summary["unusable"].items()),
        *(f"{several(names)}: {remark}" for remark, names in said.items()),
        *_decoded_otherwise(summary),
        *_perfect(summary["methods"]),
    ]


def notes(summary: Mapping[str, Any]) -> list[str]:
    """All of it, a sentence each."""
    return [*remarks(summary), *(f"not scored: {said}" for said in not_scored(summary))]


def not_scored(summary: Mapping[str, Any]) -> list[str]:
    """What was not scored, and how much of it."""
    said = []
    for reason, count in left_out(summary).items():
        thing = "gap" if reason.startswith("gaps") else "frame"
        said.append(counted(count, thing) + reason.removeprefix(f"{thing}s"))
    return said


def several(names: Iterable[str]) -> str:
    """Names, the first of many."""
    listed = list(names)
    more = len(listed) - NAMED
    return ", ".join(listed) if more <= 1 else f"{', '.join(listed[:NAMED])} and {more} more"


def _decoded_otherwise(summary: Mapping[str, Any]) -> Iterator[str]:
    """Where others' pictures are of videos whose colours every decoder makes for itself."""
    others = [name for name, of in summary["identities"].items() if not {"closed_form", "weights_sha256"} & {*of}]
    videos = [name for name, of in summary["sequences"].items() if str(of.get("stored", "")).startswith("yuv")]
    if others and videos:
        yield (
            f"{several(others)} on {several(videos)}: decoders make other RGB of YUV, by 40 to 50 dB; to compare"
            " methods finely, make PNG of the video, give these to all of them, and score the folder"
        )


def _perfect(methods: Mapping[str, Any]) -> Iterator[str]:
    for name, of in methods.items():
        if of["perfect"]:
            yield f"{name}: {counted(of['perfect'], 'frame')} without an error, or hardly any, taken as 100 dB each"
