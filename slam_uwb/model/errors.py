"""Everything this package raises on purpose.

One bad pair, range, station or anchor is not an error: it stays in the solution with a reason or a
status.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass


class SlamUwbError(Exception):
    """Base of all errors of this package; `exit_status` is what the command line ends with."""

    exit_status = 2


@dataclass(frozen=True, slots=True)
class Fault:
    """One fault or warning of a survey folder, with the place where a person finds it."""

    path: str
    """Relative to the survey folder."""
    problem: str
    """What is wrong, the value, and what was expected."""
    line: int | None = None
    """1-based; None where the whole file is meant."""
    column: str | None = None

    def __str__(self) -> str:
        where = self.path if self.line is None else f"{self.path}:{self.line}"
        column = "" if self.column is None else f" {self.column}:"
        return f"{where}:{column} {self.problem}"


class SurveyFormatError(SlamUwbError):
    """A survey (or solution, or reference) folder breaks its format; holds every fault found."""

    def __init__(self, faults: Sequence[Fault]) -> None:
        self.faults = tuple(faults)
        super().__init__("\n".join(str(fault) for fault in self.faults))


class SettingsError(SlamUwbError):
    """A setting is unknown or outside its limits."""

    def __init__(self, key: str, problem: str) -> None:
        self.key = key
        super().__init__(f"settings: {key}: {problem}")


class MissingLibraryError(SlamUwbError):
    """The settings ask for an optional library that is not installed; says how to install it."""


class DisconnectedSurveyError(SlamUwbError):
    """No two stations hold together and no site frame exists."""

    exit_status = 3

    def __init__(self, reason: str) -> None:
        super().__init__(f"the survey cannot be solved: {reason}")


class SolverError(SlamUwbError):
    """The joint problem could not be solved."""

    exit_status = 3


class CaptureError(SlamUwbError):
    """An instrument cannot be reached, does not answer as it should, or breaks off."""

    exit_status = 4

    def __init__(self, port: str, problem: str) -> None:
        self.port = port
        self.problem = problem
        super().__init__(f"{port}: {problem}")
