"""Write a whole folder or nothing."""

from __future__ import annotations

import os
import secrets
import shutil
from collections.abc import Iterable, Mapping
from glob import escape
from pathlib import Path, PurePosixPath

from ..model.errors import SlamUwbError


def refuse_foreign(out: Path, mark: str, kind: str) -> None:
    """SlamUwbError where `out` is there, not empty and without the file `mark` that makes it ours."""
    if out.is_dir() and (not any(out.iterdir()) or (out / mark).is_file()):
        return
    if out.is_symlink() or out.exists():
        raise SlamUwbError(f"{out} exists and is no {kind}: nothing was changed")


def replace_folder(out: Path, files: Mapping[str, bytes]) -> None:
    """Make `out` hold exactly `files` (relative names -> contents), or leave it as it was.

    Everything is written to a folder beside it and made durable before two renames put it in place.
    Whatever interrupts (Ctrl-C, a full disk) leaves the old `out`, or none where there was none, and
    no other trace.

    Raises:
        OSError: what the file system said.
        ValueError: a name leaves the folder.
    """
    target = out.resolve()
    target.parent.mkdir(parents=True, exist_ok=True)
    token = secrets.token_hex(6)
    # Beside the target, since a rename works within one file system only.
    fresh = target.with_name(f".{target.name}.{token}.partial")
    former = target.with_name(f".{target.name}.{token}.former")
    try:
        _write_files(fresh, files)
        _swap(fresh, target, former)
        _make_durable([target.parent])
    finally:
        _remove(fresh)
        # Only once something complete is in place: until then it is the only copy.
        if target.exists():
            _remove(former)


def remove_leftovers(out: Path) -> None:
    """Remove what processes left beside the complete folder `out` that were killed while they wrote it."""
    target = out.resolve()
    if target.exists():
        for kind in ("partial", "former"):
            for folder in target.parent.glob(f".{escape(target.name)}.*.{kind}"):
                _remove(folder)


def _write_files(folder: Path, files: Mapping[str, bytes]) -> None:
    folder.mkdir()
    for name, data in files.items():
        parts = PurePosixPath(name)
        if parts.is_absolute() or ".." in parts.parts or not parts.parts:
            raise ValueError(f"{name!r} leaves the folder")
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        # Exclusive: on a file system that ignores case, S1 must not overwrite s1.
        with path.open("xb") as stream:
            stream.write(data)
            stream.flush()
            os.fsync(stream.fileno())
    _make_durable(path for path in (folder, *folder.rglob("*")) if path.is_dir())


def _swap(fresh: Path, target: Path, former: Path) -> None:
    try:
        if target.exists():
            target.rename(former)
        fresh.rename(target)
    except BaseException:
        if former.exists() and not target.exists():
            former.rename(target)
        raise


def _make_durable(folders: Iterable[Path]) -> None:
    for folder in folders:
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def _remove(folder: Path) -> None:
    try:
        shutil.rmtree(folder, ignore_errors=True)
    except BaseException:
        # Interrupted while cleaning up: finish first.
        shutil.rmtree(folder, ignore_errors=True)
        raise
