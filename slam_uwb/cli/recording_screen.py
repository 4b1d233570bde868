"""What the operator sees while a station is recorded, and after it."""

from __future__ import annotations

import math
import shutil
import sys
import textwrap
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import typer

if TYPE_CHECKING:
    from rich.console import RenderableType

    from ..capture.quality import AnchorQuality, ScanQuality
    from ..capture.recorder import Live, StationReport

Watch = Callable[["Live"], None]


def say(text: str) -> None:
    """A line to stdout; in a terminal broken between words, not where its edge happens to be."""
    if sys.stdout.isatty():
        text = textwrap.fill(
            text,
            max(shutil.get_terminal_size().columns, 20),
            subsequent_indent="  ",
            break_on_hyphens=False,
        )
    typer.echo(text)


@contextmanager
def live_screen(station: str) -> Iterator[Watch]:
    """Yield what the recorder calls with the state of things; silent where stdout is no terminal."""
    if not sys.stdout.isatty():
        yield lambda _live: None
        return
    from rich.live import Live as Screen

    # Drawn by the recording loop alone: no second thread beside it.
    with Screen(auto_refresh=False, transient=True) as screen:
        shown = [-1.0]

        def watch(live: Live) -> None:
            moment = round(live.elapsed * 4)
            if moment != shown[0]:
                shown[0] = moment
                screen.update(_picture(station, live), refresh=True)

        yield watch


def _picture(station: str, live: Live) -> RenderableType:
    from rich.console import Group
    from rich.progress_bar import ProgressBar
    from rich.table import Table
    from rich.text import Text

    lines = [Text(f"station {station}: {live.elapsed:.0f} of {live.duration:.0f} s")]
    if live.scan is not None:
        lines += map(Text, describe_scan(live.scan))
    lines += [Text(describe_anchor(anchor)) for anchor in live.anchors]
    if live.silent > 1.0:
        lines.append(Text(f"the tag is silent for {live.silent:.1f} s", style="bold"))
    # A bar ends no line of its own: what follows would stand behind it.
    bar = Table.grid()
    bar.add_row(ProgressBar(total=live.duration, completed=live.elapsed, width=50))
    return Group(lines[0], bar, *lines[1:])


def describe_scan(scan: ScanQuality) -> tuple[str, str]:
    """Two lines on a scanner."""
    returns = 100.0 * scan.returns / scan.samples if scan.samples else 0.0
    turning = (
        f"{_figure(scan.points, '.0f')} points a revolution, {_figure(scan.rotation_hz, '.2f')} Hz"
    )
    return (
        f"lidar  {turning}, {scan.samples} samples, {returns:.0f} % with a return",
        f"       {scan.tally.frames} frames, {dropped(scan.tally.dropped)}",
    )


def describe_anchor(anchor: AnchorQuality) -> str:
    """One line on an anchor."""
    failed = f", {anchor.failed} failed" if anchor.failed else ""
    return (
        f"anchor {anchor.anchor:<8} {anchor.count:4d} ranges, median {_figure(anchor.median, '.2f')} m, "
        f"spread {_figure(anchor.spread, '.3f')} m{failed}"
    )


def dropped(reasons: object) -> str:
    """What was left out, by reason."""
    counts = dict(reasons) if isinstance(reasons, dict) else {}
    told = ", ".join(f"{number} {reason}" for reason, number in counts.items())
    return told or "nothing damaged"


def _figure(value: float, form: str) -> str:
    return "-" if math.isnan(value) else format(value, form)


def print_station(title: str, report: StationReport) -> None:
    """How a recording went, to stdout."""
    state = "recorded" if report.problem is None else f"broke off: {report.problem}"
    say(f"{title} {state}")
    if report.live.scan is not None:
        for line in describe_scan(report.live.scan):
            typer.echo(f"  {line}")
    for anchor in report.live.anchors:
        typer.echo(f"  {describe_anchor(anchor)}")
    for doubt in report.doubts:
        say(f"  look at this: {doubt}")
