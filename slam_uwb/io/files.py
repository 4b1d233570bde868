"""Reading files of a folder that somebody else made: safe paths, bounded sizes, gzip."""

from __future__ import annotations

import gzip
import hashlib
import io
import stat
import zlib
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath, PureWindowsPath

from .findings import Findings, shown

MAX_FILE_BYTES = 200_000_000
"""Uncompressed; an hour of a 500 Hz scanner is 30 MB."""
MAX_TOML_BYTES = 4_000_000
"""Thousands of stations; the TOML parser is not made for more."""
_MAX_DEFLATE_RATIO = 1032
"""What deflate can gain at most, by its format."""


@dataclass(frozen=True, slots=True)
class FileContent:
    """One file as it was found."""

    name: str
    """Relative to the folder, with ``.gz`` where the file has it."""
    data: bytes
    """Uncompressed."""


@dataclass(frozen=True, slots=True)
class FolderReader:
    """Reads files inside `root` (resolved) and remembers what was read, for the checksum."""

    root: Path
    findings: Findings
    digests: dict[str, bytes] = field(default_factory=dict)

    def read(self, name: str, max_bytes: int = MAX_FILE_BYTES) -> FileContent | None:
        """The file `name`, or `name`.gz where only that is there; None after noting a fault."""
        problem = _unsafe(name)
        if problem is not None:
            self.findings.fault(name if name.isprintable() else shown(name), problem)
            return None
        found = name
        try:
            there = self._there(name)
            if not there:
                self.findings.fault(name, "no such file")
                return None
            found = there[0]
            return self._read_found(found, max_bytes)
        except ValueError as error:
            self.findings.fault(found, str(error))
        except (OSError, RuntimeError) as error:
            problem = getattr(error, "strerror", None) or str(error)
            self.findings.fault(found, f"cannot be read: {problem}")
        return None

    def read_optional(self, name: str) -> FileContent | None:
        """As `read`, but a missing file is no fault; both `name` and `name`.gz are one, for which counts?"""
        there = self._there(name)
        if len(there) == 2:
            self.findings.fault(name, f"{name} and {name}.gz are both there: remove one")
        return self.read(there[0]) if there else None

    def checksum(self) -> str:
        """SHA-256 over the names and contents of all files read, wherever the folder lies."""
        total = hashlib.sha256()
        for name, digest in sorted(self.digests.items()):
            total.update(name.encode() + b"\0" + digest)
        return total.hexdigest()

    def _there(self, name: str) -> list[str]:
        # A broken link is there too, and a fault of its own rather than a missing file.
        paths = {n: self.root / n for n in (name, f"{name}.gz")}
        return [n for n, path in paths.items() if path.is_symlink() or path.exists()]

    def _read_found(self, name: str, max_bytes: int) -> FileContent:
        path = (self.root / name).resolve(strict=True)
        if not path.is_relative_to(self.root):
            raise ValueError("is a link that leaves the folder: copy the file here")
        raw = _read_regular(path, max_bytes)
        self.digests[name] = hashlib.sha256(raw).digest()
        return FileContent(name, _gunzip(raw, max_bytes) if name.endswith(".gz") else raw)


def _unsafe(name: str) -> str | None:
    if not name or not name.isprintable() or len(name) > 500:
        return f"{shown(name)} is no file name"
    if (
        PurePosixPath(name).is_absolute()
        or PureWindowsPath(name).drive
        or ".." in PurePosixPath(name).parts
    ):
        return "leaves the folder: expected a path relative to it, without '..'"
    if "\\" in name:
        return "expected '/' between folders"
    return None


def _read_regular(path: Path, max_bytes: int) -> bytes:
    # Looked at before it is opened: a pipe would never end, a device may do anything.
    status = path.stat()
    if not stat.S_ISREG(status.st_mode):
        raise ValueError("is no regular file")
    if status.st_size > max_bytes:
        raise ValueError(f"holds {status.st_size:,} bytes, the limit is {max_bytes:,}")
    return path.read_bytes()


def _gunzip(raw: bytes, max_bytes: int) -> bytes:
    """Uncompress at most `max_bytes`; ValueError beyond, before anything of that size is in memory."""
    try:
        with gzip.GzipFile(fileobj=io.BytesIO(raw)) as stream:
            # Counting first costs a second pass, but only for files that could be a bomb at all.
            if len(raw) * _MAX_DEFLATE_RATIO > max_bytes:
                size = 0
                while chunk := stream.read(1 << 20):
                    size += len(chunk)
                    if size > max_bytes:
                        raise ValueError(
                            f"uncompresses to more than the limit of {max_bytes:,} bytes"
                        )
                stream.seek(0)
            return stream.read()
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        raise ValueError(f"is no whole gzip file: {error}") from None


def read_file(path: Path, max_bytes: int = MAX_FILE_BYTES) -> FileContent:
    """A file that the user names, anywhere; ``.gz`` is uncompressed.

    Raises:
        OSError: it cannot be read.
        ValueError: it is no regular file, larger than `max_bytes` (uncompressed too), or no whole gzip file.
    """
    raw = _read_regular(path, max_bytes)
    return FileContent(str(path), _gunzip(raw, max_bytes) if path.suffix == ".gz" else raw)
