"""What became of one of many tasks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Generic, TypeVar

from ..model.errors import SlamUwbError

Result = TypeVar("Result")


@dataclass(frozen=True, slots=True)
class Outcome(Generic[Result]):
    """One task: its result, or what it raised."""

    index: int
    """Its place among the tasks."""
    result: Result | None
    error: Exception | None = None


class ProcessLostError(SlamUwbError):
    """The process that worked on a task ended without an answer, and the one that tried again too."""

    exit_status = 1

    def __init__(self) -> None:
        super().__init__("the process that worked on it was ended from outside (out of memory?)")
