"""Progress bars are for people who watch."""

import io
import sys

import pytest

from humanmm.progress import progress_bars
from humanmm.tasks.pipeline import STAGES
from humanmm.tasks.units.unit import Unit


class _Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize("shown", [True, False])
def test_bars_are_shown_on_a_terminal_unless_they_are_not_wanted(monkeypatch: pytest.MonkeyPatch, shown: bool) -> None:
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr(sys, "stderr", _Terminal())
    with progress_bars(shown=shown) as report:
        report(Unit(STAGES[0]), 1, 2)
        report(Unit(STAGES[0]), 2, 2)
    assert (STAGES[0].name in sys.stderr.getvalue()) is shown  # type: ignore[attr-defined]


def test_nothing_is_written_where_nobody_watches(capfd: pytest.CaptureFixture[str]) -> None:
    with progress_bars() as report:
        report(Unit(STAGES[0]), 1, 2)
    assert capfd.readouterr() == ("", "")
