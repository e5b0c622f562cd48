"""Files that are cut short give the events before the cut or an error; what is none is no event file.

`tests/test_hostile_files.py` reads files that are damaged in all other ways.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from vid2ev.errors import DataError
from vid2ev.formats import FORMATS, format_named, open_events, read_events

EXAMPLES = Path(__file__).parents[2] / "examples"
READABLE = [name for name in FORMATS if format_named(name).open]


@pytest.mark.parametrize("name", READABLE)
@pytest.mark.parametrize("kept", [0.1, 0.5, 0.9, 0.999])
def test_a_file_cut_short_gives_the_events_before_the_cut_or_an_error(
    tmp_path: Path, name: str, kept: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(EXAMPLES)
    from hostile.event_seeds import seeds

    path = seeds(name, tmp_path)[0]
    whole = path.read_bytes()
    (events,) = read_events(path)
    path.write_bytes(whole[: int(kept * len(whole))])
    try:
        file = format_named(name).open(path)  # type: ignore[misc]
        found = [event for block in file.events() for event in zip(block.t, block.x, block.y, block.p, strict=True)]
    except DataError:
        return
    assert found == list(zip(events.t, events.x, events.y, events.p, strict=True))[: len(found)]


def test_garbage_is_no_event_file(tmp_path: Path) -> None:
    random = np.random.default_rng(0)
    texts = [b"", b"hello", b"%\n", b"% end\n", b"1,2\n", b"a b\n", b"PK\x03\x04"]
    for k, content in enumerate([*texts, random.bytes(5000)]):
        (tmp_path / str(k)).write_bytes(content)
        with pytest.raises(DataError, match="no event file"):
            open_events(tmp_path / str(k))
