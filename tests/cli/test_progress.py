"""The progress bar: only for a person, only for work that lasts."""

import io

import pytest

from slam_uwb.cli import progress


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.mark.parametrize(
    ("stream", "patience_s", "seen"),
    [(Terminal, 0.0, True), (Terminal, 60.0, False), (io.StringIO, 0.0, False)],
)
def test_bar(monkeypatch, stream, patience_s, seen):
    stderr = stream()
    monkeypatch.setattr("sys.stderr", stderr)
    monkeypatch.setattr(progress, "PATIENCE_S", patience_s)
    monkeypatch.setenv("TERM", "xterm")
    with progress.progress_bar() as report:
        report("matching scans", 1, 3)
        report("matching scans", 3, 3)
    assert ("matching scans" in stderr.getvalue()) == seen
    assert bool(stderr.getvalue()) == seen


@pytest.mark.parametrize(("stream", "seen"), [(Terminal, True), (io.StringIO, False)])
def test_one_bar_has_rate_and_time_left(monkeypatch, stream, seen):
    stderr = stream()
    monkeypatch.setattr("sys.stderr", stderr)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "120")
    # Two of four in half a minute: four a minute, half a minute to go.
    clock = iter([0.0, 15.0, 30.0])
    monkeypatch.setattr(progress.time, "monotonic", lambda: next(clock, 30.0))
    with progress.rate_bar("surveys", 4) as advance:
        advance("a")
        advance("b")
    text = stderr.getvalue()
    assert bool(text) == seen
    if seen:
        assert "surveys" in text
        assert "2/4" in text
        assert "4.0 a minute" in text
