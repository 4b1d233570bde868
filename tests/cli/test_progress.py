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
