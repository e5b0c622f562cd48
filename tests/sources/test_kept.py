"""What passes once, kept to be read again."""

from __future__ import annotations

import errno
import io
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vid2ev.errors import DataError, UsageError
from vid2ev.sources.kept import Kept


@given(
    st.binary(max_size=300), st.lists(st.tuples(st.integers(0, 3), st.integers(1, 90)), max_size=60), st.integers(0, 99)
)
def test_every_reader_has_all_of_it(data: bytes, turns: list[tuple[int, int]], in_memory: int) -> None:
    """In whatever turns and pieces they read, and whether it fits into memory or not."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("vid2ev.sources.kept.IN_MEMORY", in_memory)
        kept = Kept(io.BytesIO(data), "stream")
        readers, found = [kept.reader() for _ in range(4)], [b""] * 4
        for number, size in turns:
            found[number] += readers[number].read(size)
        assert kept.size == max(map(len, found))
        assert all(data.startswith(each) for each in found)
        assert all(
            each + reader.read(400) + reader.read(400) == data for each, reader in zip(found, readers, strict=True)
        )


def test_what_is_not_wanted_goes_when_it_is_read() -> None:
    kept = Kept(io.BytesIO(bytes(range(10))), "stream")
    assert kept.reader().read(4) == bytes(range(4))
    kept.wanted = False
    last = kept.reader()
    assert last.read(3) + last.read(3) == bytes(range(4)) and kept.reader().read(2) == bytes(range(2))
    behind = kept.reader()
    assert last.read(3) + last.read(9) + last.read(9) == bytes(range(4, 10))
    for late in (kept.reader, lambda: behind.read(1)):
        with pytest.raises(UsageError, match="stream: can be read once only"):
            late()


def test_what_cannot_be_kept_is_one_sentence() -> None:
    class Full(io.BytesIO):
        def write(self, data: Any) -> int:
            raise OSError(errno.ENOSPC, "No space left on device")

    kept = Kept(io.BytesIO(b"0123456789"), "standard input")
    kept._file = Full()  # type: ignore[assignment]
    with pytest.raises(DataError, match=r"standard input: 10 bytes do not fit .*No space left.*set TMPDIR") as refused:
        kept.reader().read(20)
    assert "\n" not in str(refused.value)
