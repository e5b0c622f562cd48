"""What a report says besides scores."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TypedDict


class About(TypedDict, total=False):
    """Facts of an evaluation, each if it is known.

    title               of the report
    settings            what was asked for, name and value
    sequences           what is known of each sequence: name and value, the same names for all
    sets                data sets and the names of their sequences
    not_scored          what could not be scored: reason and number
    remarks             what else has to be known, a sentence each
    versions            of programs, name and version
    events_from_truth   sequences whose events were simulated from light that passes through the frames that are scored
    """

    title: str
    settings: Mapping[str, object]
    sequences: Mapping[str, Mapping[str, object]]
    sets: Mapping[str, Sequence[str]]
    not_scored: Mapping[str, int]
    remarks: Sequence[str]
    versions: Mapping[str, str]
    events_from_truth: Sequence[str]
