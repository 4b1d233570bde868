"""The program `slam-uwb`: its commands and how it ends.

Every command imports the modules it works with when it runs, so that help and usage errors come
at once.
"""

from __future__ import annotations

import logging
import sys
from typing import Annotated

import typer

from .batch import batch
from .check import check
from .compare import compare
from .emulate import emulate
from .evaluate import evaluate
from .export import export
from .import_survey import import_recordings
from .interruption import Interrupted, interruptible
from .options import VerboseOption, show_version
from .plan import plan
from .ports import ports
from .position import position
from .record import record
from .report import report
from .settings import settings
from .simulate import simulate
from .solve import solve

INTERRUPTED = 130
WRONG_INPUT = 2
BUG = 1

_log = logging.getLogger("slam_uwb.cli")

# Plain help and usage errors: readable in a log, and rich is not loaded for them.
application = typer.Typer(
    name="slam-uwb",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
)
for command in (
    solve,
    evaluate,
    compare,
    batch,
    position,
    check,
    simulate,
    settings,
    record,
    ports,
    emulate,
    report,
    export,
    plan,
):
    application.command()(command)


# `import` is no name in Python.
application.command("import")(import_recordings)


@application.callback()
def program(
    _version: Annotated[
        bool,
        typer.Option(
            "--version", callback=show_version, is_eager=True, help="Print the version and exit."
        ),
    ] = False,
    _verbose: VerboseOption = False,
) -> None:
    """From tripod LiDAR scans and UWB ranges to a floor map, station poses and anchor coordinates.

    Start with `slam-uwb simulate --list` for a survey to try, `slam-uwb check SURVEY` for one of
    your own, and `slam-uwb solve SURVEY --out OUT`.

    Exit status: 0 done; 2 the input or the arguments are wrong; 3 the survey cannot be solved;
    4 an instrument fails; 130 interrupted.
    """


def main() -> None:
    """Run the command line; ends the process with the exit status."""
    sys.exit(_run())


def _run() -> int:
    """The exit status of one run; usage errors and `--help` leave by SystemExit."""
    came: list[int] = []
    try:
        with interruptible() as came:
            application()
    except Interrupted:
        return _end_interrupted()
    except Exception as error:
        if came:
            _log.debug("traceback", exc_info=error)
            return _end_interrupted()
        return _end_with_os_error(error) if isinstance(error, OSError) else _end_with(error)
    return 0


def _end_interrupted() -> int:
    _say("interrupted; nothing was left half-written")
    return INTERRUPTED


def _end_with_os_error(error: OSError) -> int:
    """A file that cannot be read or written is the user's to mend; the rest is named as it is."""
    _log.debug("traceback", exc_info=error)
    _say(str(error) if error.filename is None else f"{error.filename}: {error.strerror}")
    return BUG if error.filename is None else WRONG_INPUT


def _end_with(error: Exception) -> int:
    """One line a fault for what the package raises on purpose; anything else is a bug."""
    from ..model.errors import SlamUwbError

    _log.debug("traceback", exc_info=error)
    if isinstance(error, SlamUwbError):
        for line in str(error).splitlines():
            _say(line)
        return error.exit_status
    hint = "" if _log.isEnabledFor(logging.DEBUG) else " (slam-uwb -v ... shows where)"
    _say(f"internal error, please report it: {type(error).__name__}: {error}{hint}")
    return BUG


def _say(line: str) -> None:
    typer.echo(f"slam-uwb: {line}", err=True)
