"""Refuse, before any work is done, a folder to write that would destroy something."""

from __future__ import annotations

import errno
import os
import secrets
from pathlib import Path

from ..model.errors import SlamUwbError

SOLUTION_FILE = "solution.json"
SURVEY_SUBFOLDERS = ("scans", "reference")
"""What a survey folder may hold later, if it does not now."""


class TargetError(SlamUwbError):
    """A folder to write that is refused."""

    def __init__(self, folder: Path, problem: str) -> None:
        super().__init__(f"--out {folder}: {problem}; nothing was changed")


def refuse_solution_target(out: Path, survey: Path) -> None:
    """Raise `TargetError` unless `out` is new, empty or a solution, and the survey stays whole."""
    target, source = out.resolve(), survey.resolve()
    if source.is_relative_to(target):
        raise TargetError(out, "would replace the survey itself")
    if target.is_relative_to(source) and target.relative_to(source).parts[0] in SURVEY_SUBFOLDERS:
        raise TargetError(out, f"is part of the survey {survey}")
    inside = _contents(out)
    if inside and not (out / SOLUTION_FILE).is_file():
        raise TargetError(out, f"exists and is no solution folder (no {SOLUTION_FILE} in it)")
    # The whole folder is replaced: whatever somebody gathered in it would be lost.
    folders = [item.name for item in inside if item.is_dir()]
    if folders:
        raise TargetError(out, f"holds more than a solution: the folder {folders[0]}")


def refuse_survey_target(out: Path) -> None:
    """Raise `TargetError` unless `out` is new or empty: recordings cannot be made again."""
    if _contents(out):
        raise TargetError(out, "exists and is not empty")


def replace_file(target: Path, data: bytes) -> None:
    """Write a file whole or not at all; OSError as the file system has it."""
    if not target.parent.is_dir():
        # The error would name the file that is made first, which nobody asked for.
        raise FileNotFoundError(errno.ENOENT, "no such folder", str(target.parent))
    fresh = target.with_name(f".{target.name}.{secrets.token_hex(4)}.partial")
    try:
        fresh.write_bytes(data)
        fresh.replace(target)
    finally:
        fresh.unlink(missing_ok=True)


def _contents(out: Path) -> list[Path]:
    """What is in `out`, empty where it is new; it must be possible to put a folder there."""
    # A dangling link is there too.
    if (out.exists() or out.is_symlink()) and not out.is_dir():
        raise TargetError(out, "is no folder")
    # The new folder is made beside the old one and renamed.
    above = next(folder for folder in out.resolve().parents if folder.exists())
    if not above.is_dir():
        raise TargetError(out, f"{above} is no folder")
    if not os.access(above, os.W_OK | os.X_OK):
        raise TargetError(out, f"{above} is not writable")
    return sorted(out.iterdir()) if out.is_dir() else []
