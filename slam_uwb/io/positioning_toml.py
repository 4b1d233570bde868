"""positioning.toml: the head of a positioning recording, with the line of every fault."""

from __future__ import annotations

import re
import tomllib
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import tomlkit
from pydantic import BaseModel, ConfigDict, Field, StringConstraints, ValidationError

from ..model.survey import AnchorId
from ..model.tag import PowerLaw, Stay, TagRecording
from .files import FileContent
from .findings import Findings, shown
from .survey_toml import Height, Identifier, key_name
from .toml_lines import TomlLines

POSITIONING_TOML = "positioning.toml"


class _Table(BaseModel):
    model_config = ConfigDict(frozen=True, extra="allow", strict=True, allow_inf_nan=False)


class _Tag(_Table):
    height_m: Height


class _Power(_Table):
    at_one_metre_dbm: Annotated[float, Field(ge=-150.0, le=50.0)]
    exponent: Annotated[float, Field(gt=0.0, le=10.0)]
    sigma_db: Annotated[float, Field(gt=0.0, le=100.0)]


class _Place(_Table):
    id: Identifier
    start_s: float
    end_s: float


class _Anchor(_Table):
    id: Identifier
    height_m: Height


class _Document(_Table):
    format: Literal[1]
    name: Annotated[str, StringConstraints(min_length=1, max_length=200)] | None = None
    tag: _Tag
    power: _Power | None = None
    places: list[_Place] = []
    anchors: list[_Anchor] = []


@dataclass(frozen=True, slots=True)
class RecordingHead:
    """What positioning.toml says."""

    name: str | None
    tag_height: float
    stays: tuple[Stay, ...]
    power_law: PowerLaw | None
    anchor_heights: dict[AnchorId, float]


def parse_positioning_toml(content: FileContent, findings: Findings) -> RecordingHead | None:
    """Read it; None after noting every fault."""
    try:
        text = content.data.decode("utf-8-sig")
        raw = tomllib.loads(text)
    except UnicodeDecodeError:
        findings.fault(content.name, "expected UTF-8 text")
        return None
    except (ValueError, RecursionError) as error:
        found = re.search(r"\(at line (\d+), column (\d+)\)", str(error))
        line = int(found.group(1)) if found else None
        findings.fault(content.name, f"no TOML: {error}", line)
        return None
    lines = TomlLines.of(text, raw)
    try:
        document = _Document.model_validate(raw)
    except ValidationError as error:
        for problem in error.errors(include_url=False):
            where = tuple(problem["loc"])
            given = "" if problem["type"] == "missing" else f" = {shown(problem['input'])}"
            told = f"{key_name(where)}{given}: {problem['msg'].lower()}"
            findings.fault(content.name, told, lines.find(where))
        return None
    _warn_of_unknown(document, (), content.name, lines, findings)
    return _head(document, content.name, lines, findings)


def positioning_toml(recording: TagRecording) -> bytes:
    """The head of a recording as TOML."""
    document: dict[str, Any] = {
        "format": 1,
        "name": recording.name,
        "tag": {"height_m": recording.tag_height},
    }
    law = recording.power_law
    if law is not None:
        document["power"] = {
            "at_one_metre_dbm": law.at_one_metre,
            "exponent": law.exponent,
            "sigma_db": law.sigma,
        }
    if recording.stays:
        document["places"] = [
            {"id": stay.id, "start_s": stay.start, "end_s": stay.end} for stay in recording.stays
        ]
    if recording.anchor_heights:
        document["anchors"] = [
            {"id": str(name), "height_m": height}
            for name, height in recording.anchor_heights.items()
        ]
    return tomlkit.dumps(document).encode()


def _head(
    document: _Document, name: str, lines: TomlLines, findings: Findings
) -> RecordingHead | None:
    sound = True
    seen: set[str] = set()
    for k, place in enumerate(document.places):
        where = ("places", k)
        problem = None
        if place.id in seen:
            problem = f"places[{k}].id = {shown(place.id)}: this place is there twice"
        elif place.end_s <= place.start_s:
            problem = f"places[{k}].end_s = {place.end_s:g}: expected more than start_s"
        seen.add(place.id)
        if problem is not None:
            findings.fault(name, problem, lines.find(where))
            sound = False
    if not sound:
        return None
    power = document.power
    return RecordingHead(
        document.name,
        document.tag.height_m,
        tuple(Stay(place.id, place.start_s, place.end_s) for place in document.places),
        None if power is None else PowerLaw(power.at_one_metre_dbm, power.exponent, power.sigma_db),
        {AnchorId(anchor.id): anchor.height_m for anchor in document.anchors},
    )


def _warn_of_unknown(
    item: _Table, where: tuple[str | int, ...], name: str, lines: TomlLines, findings: Findings
) -> None:
    for key in item.model_extra or {}:
        if not key.startswith("x_"):
            place = (*where, key)
            findings.warn(name, f"{key_name(place)}: unknown key is ignored", lines.find(place))
    for key in type(item).model_fields:
        value = getattr(item, key)
        parts = enumerate(value) if isinstance(value, list) else [(None, value)]
        for k, part in parts:
            if isinstance(part, _Table):
                inside = (*where, key) if k is None else (*where, key, k)
                _warn_of_unknown(part, inside, name, lines, findings)
