"""On which line of a TOML text a key stands: the standard library's parser does not tell."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

_HEADER = re.compile(r"\s*\[(\[?)\s*([A-Za-z0-9_-]+)\s*\]\]?\s*(?:#.*)?")

_Where = tuple[str | int, ...]


@dataclass(frozen=True, slots=True)
class TomlLines:
    """Where the tables of a text begin. Written for survey.toml: tables with plain names, one level deep."""

    text: tuple[str, ...]
    """Lines."""
    starts: dict[_Where, int]
    """Index of the header's line of each table: ("lidar",), ("stations", 3)."""

    @classmethod
    def of(cls, text: str, parsed: Mapping[str, Any]) -> TomlLines:
        """Look through a text; `parsed` is what the parser made of it."""
        lines = tuple(text.split("\n"))
        starts: dict[_Where, int] = {}
        counts: Counter[str] = Counter()
        for index, line in enumerate(lines):
            header = _HEADER.fullmatch(line.rstrip("\r"))
            if header is None:
                continue
            name = header.group(2)
            starts[(name, counts[name]) if header.group(1) else (name,)] = index
            counts[name] += 1
        # A header inside a multi-line string would shift all that follow: no line is better than a wrong one.
        told = {
            n
            for n, value in parsed.items()
            if counts[n] == (len(value) if isinstance(value, list) else 1)
        }
        return cls(lines, {where: start for where, start in starts.items() if where[0] in told})

    def find(self, where: Sequence[str | int]) -> int | None:
        """1-based line of a key, of its table where the key has no line, or None where neither can be told."""
        place = tuple(where)
        for length in (2, 1):
            if place[:length] in self.starts:
                start = self.starts[place[:length]]
                return self._key(start + 1, place[length:]) or start + 1
        return self._key(0, place)

    def _key(self, start: int, key: _Where) -> int | None:
        if not key:
            return None
        end = min((s for s in self.starts.values() if s >= start), default=len(self.text))
        pattern = re.compile(rf"\s*[\"']?{re.escape(str(key[0]))}[\"']?\s*[=.]")
        return next((i + 1 for i in range(start, end) if pattern.match(self.text[i])), None)
