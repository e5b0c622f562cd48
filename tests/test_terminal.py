"""Where nobody watches a terminal, long work says in its log how far it is, and short work says nothing."""

from __future__ import annotations

import io
import re
import sys
from itertools import pairwise

import pytest

from vid2ev import terminal
from vid2ev.terminal import MORE, SELDOM_S, bar_of, lines

STEPS = "{percentage:3.0f}% {bar:12} step {n_fmt}/{total_fmt}, {remaining} left{postfix}"


class Clock:
    """Seconds that pass when they are told to; of tqdm, too."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch):
        self.now_s = 1000.0
        monkeypatch.setattr(terminal.time, "monotonic", lambda: self.now_s)


def logged(monkeypatch: pytest.MonkeyPatch, steps: int, step_s: float) -> list[tuple[float, str]]:
    """The lines of so many steps, and after what time each came."""
    clock, log, found = Clock(monkeypatch), io.StringIO(), []
    monkeypatch.setattr(sys, "stderr", log)
    with bar_of(False, STEPS, total=steps, disable=False) as bar:
        for _ in range(steps):
            clock.now_s += step_s
            bar.set_postfix_str("loss 0.5", refresh=False)
            bar.update()
            bar.refresh()
            found += [(clock.now_s - 1000.0, line) for line in log.getvalue().splitlines()[len(found) :]]
    assert len(log.getvalue().splitlines()) == len(found)
    return found


def test_a_log_has_lines_of_long_work(monkeypatch):
    lines = logged(monkeypatch, 2000, 1.0)
    times = [when for when, _ in lines]
    assert times[:10] == [10.0 * k for k in range(1, 11)]
    assert all(late - soon >= max(SELDOM_S, MORE * late) for soon, late in pairwise(times))
    assert 30 < len(lines) < 50 and times[-1] > 1700
    assert lines[4][1].startswith("2% step 50/2000, ") and lines[4][1].endswith("left, loss 0.5")


def test_a_log_has_none_of_short_work(monkeypatch):
    assert logged(monkeypatch, 99, 0.1) == []


@pytest.mark.parametrize("is_terminal", [True, False])
def test_nothing_is_said_of_an_end_that_is_not_known(monkeypatch, is_terminal):
    clock, shown = Clock(monkeypatch), io.StringIO()
    monkeypatch.setattr(shown, "isatty", lambda: is_terminal)
    monkeypatch.setattr(sys, "stderr", shown)
    with bar_of(False, STEPS, disable=False) as bar:
        clock.now_s += 100.0
        bar.update(3)
        bar.refresh()
        assert shown.getvalue().split("\r")[-1].strip() == "step 3"
        clock.now_s += 100.0
        bar.total = 6
        bar.refresh()
        assert re.match(r"50%.* step 3/6, .* left$", re.split("[\r\n]", shown.getvalue().strip())[-1].strip())


def test_nothing_is_said_of_quiet_work(monkeypatch):
    clock, log = Clock(monkeypatch), io.StringIO()
    monkeypatch.setattr(sys, "stderr", log)
    with bar_of(True, STEPS, total=2) as bar:
        clock.now_s += 100.0
        bar.update()
    assert log.getvalue() == ""


@pytest.mark.parametrize("is_terminal", [True, False])
@pytest.mark.parametrize("unlike_the_environment", [{}, {"disable": False}])
def test_the_environment_switches_off_bars_and_lines(monkeypatch, is_terminal, unlike_the_environment):
    clock, shown = Clock(monkeypatch), io.StringIO()
    monkeypatch.setattr(shown, "isatty", lambda: is_terminal)
    monkeypatch.setattr(sys, "stderr", shown)
    with bar_of(False, STEPS, total=2, **unlike_the_environment) as bar:
        clock.now_s += 100.0
        bar.refresh()
    assert (shown.getvalue() != "") == bool(unlike_the_environment)


@pytest.mark.parametrize("stderr", ["closed", "none"])
def test_work_goes_on_where_nobody_reads_its_log(monkeypatch, stderr):
    class Closed(io.StringIO):
        def write(self, text: str) -> int:
            raise BrokenPipeError

    clock = Clock(monkeypatch)
    monkeypatch.setattr(sys, "stderr", Closed() if stderr == "closed" else None)
    shown = {"disable": False} if stderr == "closed" else {}
    with bar_of(False, STEPS, total=2, **shown) as bar:
        for _ in range(2):
            clock.now_s += 100.0
            bar.update()
            bar.refresh()
    assert bar.disable == (stderr == "none") or bar.n == 2


def test_what_is_quoted_of_files_moves_no_cursor() -> None:
    text = lines([("camera", "DVS\x1b[2J\x9b31m\r\nmade"), ("na\x07me", "\udcff é\t1")])
    assert text == "camera    DVS [2J 31m made\nna me     \udcff é 1"
