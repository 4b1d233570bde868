"""Settings <-> TOML, each key with its reason, unit and limits."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

import tomlkit
from annotated_types import Ge, Gt, Le, Lt
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from ..model.errors import SettingsError
from ..model.settings import PRESETS, Settings, settings_from_mapping

MAX_SETTINGS_BYTES = 1_000_000

_UNITS = {"m": "m", "deg": "degrees", "s": "s", "hz": "Hz", "mm": "mm", "m2": "m^2", "db": "dB"}
_COMPARISONS = {Gt: (">", "gt"), Ge: (">=", "ge"), Lt: ("<", "lt"), Le: ("<=", "le")}
_COMMENT_WIDTH = 96


def read_settings(source: str | Path) -> Settings:
    """Settings of a preset (`PRESETS`) or of a TOML file that says what differs from the defaults.

    A file whose name is a preset's is meant with a path: ``./paper``.

    Raises:
        SettingsError: no such preset or file, no TOML, or a key is unknown, of a wrong type or
            outside its limits; it names key, value and limit.
    """
    if isinstance(source, str) and source in PRESETS:
        return PRESETS[source]
    return settings_from_mapping(_toml(Path(source)))


def format_settings(settings: Settings) -> str:
    """All settings as TOML that `read_settings` reads back as the same, with comments on each key."""
    document = tomlkit.document()
    for name in type(settings).model_fields:
        section = getattr(settings, name)
        if document.body:
            document.add(tomlkit.nl())
        for line in _wrapped(type(section).__doc__ or ""):
            document.add(tomlkit.comment(line))
        document.add(name, _table(section))
    return tomlkit.dumps(document)


def _toml(path: Path) -> dict[str, Any]:
    if not path.is_file():
        presets = ", ".join(PRESETS)
        raise SettingsError(str(path), f"no such file, and no preset (these are: {presets})")
    try:
        if path.stat().st_size > MAX_SETTINGS_BYTES:
            raise SettingsError(str(path), f"larger than {MAX_SETTINGS_BYTES:,} bytes")
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except UnicodeDecodeError:
        raise SettingsError(str(path), "expected UTF-8 text") from None
    except (ValueError, RecursionError) as error:
        raise SettingsError(str(path), f"no TOML: {error}") from None
    except OSError as error:
        raise SettingsError(str(path), f"cannot be read: {error.strerror}") from None


def _table(section: BaseModel) -> tomlkit.items.Table:
    table = tomlkit.table()
    for name, field in type(section).model_fields.items():
        value = getattr(section, name)
        for line in _wrapped(_remark(name, field)):
            table.add(tomlkit.comment(line))
        if value is None:
            # TOML has no null; what is not set is left out.
            table.add(tomlkit.comment(f"{name} is not set"))
        else:
            table.add(name, list(value) if isinstance(value, tuple) else value)
    return table


def _remark(name: str, field: FieldInfo) -> str:
    facts = [_unit(name), *_limits(field)]
    known = ", ".join(fact for fact in facts if fact)
    return f"{field.description or ''}{f' ({known})' if known else ''}".strip()


def _unit(name: str) -> str:
    return _UNITS.get(name.rpartition("_")[2], "") if "_" in name else ""


def _limits(field: FieldInfo) -> list[str]:
    limits = [
        f"{sign} {getattr(limit, attribute):g}"
        for kind, (sign, attribute) in _COMPARISONS.items()
        for limit in field.metadata
        if isinstance(limit, kind)
    ]
    if get_origin(field.annotation) is Literal:
        limits.append("one of " + ", ".join(map(str, get_args(field.annotation))))
    return limits


def _wrapped(text: str) -> list[str]:
    words = re.sub(r"\s+", " ", text.strip())
    return re.findall(rf"(\S.{{0,{_COMMENT_WIDTH - 1}}})(?:\s|$)", words)
