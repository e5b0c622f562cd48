"""A file that is written again has another stamp."""

from __future__ import annotations

import os
from pathlib import Path

from vid2ev.stamps import stamp


def test_a_stamp_is_another_after_each_change(tmp_path: Path) -> None:
    file, folder = tmp_path / "one.txt", tmp_path / "folder"
    seen = [stamp(file, folder)]
    assert seen == [()]

    def is_another() -> bool:
        seen.append(stamp(file, folder))
        assert stamp(file, folder) == seen[-1]
        return seen[-1] not in seen[:-1]

    file.write_text("one")
    assert is_another()
    file.write_text("three")
    assert is_another()
    folder.mkdir()
    assert is_another()
    (folder / "a").write_text("1")
    (folder / "gone").symlink_to(folder / "nothing")
    assert is_another()
    os.utime(folder / "a", ns=(1, 1))
    assert is_another()
    (folder / "a").rename(folder / "b")
    assert is_another()
    assert stamp("", "a\0b", "n" * 300, "brick") == ()
