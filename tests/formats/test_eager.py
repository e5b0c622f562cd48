"""The disk begins early with what is written, and nothing else is different."""

from __future__ import annotations

import io
import sys
from pathlib import Path

import pytest

from vid2ev.formats import eager
from vid2ev.formats.eager import EagerFile, beginner


@pytest.mark.skipif(sys.platform != "linux", reason="other systems begin when they like")
def test_the_disk_begins_with_all_that_was_written_and_the_system_knows_the_call(tmp_path: Path, monkeypatch) -> None:
    begin, begun = beginner(), []
    assert begin is not None
    monkeypatch.setattr(eager, "ENOUGH", 100)
    monkeypatch.setattr(
        eager, "beginner", lambda: lambda *asked: begun.append((begin(*asked), (tmp_path / "file").stat().st_size))
    )
    with EagerFile(tmp_path / "file", "w") as file:
        for _ in range(25):
            assert file.write(b"ten bytes.") == 10
    assert begun == [(0, 100), (0, 200)]
    assert (tmp_path / "file").read_bytes() == b"ten bytes." * 25


def test_where_the_system_cannot_nothing_happens(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(sys, "platform", "elsewhere")
    assert beginner.__wrapped__() is None
    monkeypatch.setattr(eager, "ENOUGH", 1)
    monkeypatch.setattr(eager, "beginner", lambda: None)
    with io.BufferedWriter(EagerFile(tmp_path / "file", "w")) as file:
        file.write(b"here")
        assert (tmp_path / "file").stat().st_size == 0, "not even written out"
    assert (tmp_path / "file").read_bytes() == b"here"
