"""survey.toml: its tables as pydantic models, read with every fault and its line.

A table with a wrong key is read again without that key, so that the rest of the folder is still looked at;
since the fault is noted, no survey comes of it.
"""

from __future__ import annotations

import re
import tomllib
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal, TypeVar

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    StringConstraints,
    ValidationError,
)

from .files import FileContent
from .findings import Findings, shown
from .toml_lines import TomlLines

SURVEY_TOML = "survey.toml"
IDENTIFIER = r"^[A-Za-z0-9_.-]{1,64}$"

Where = tuple[str | int, ...]
"""A key by its path, e.g. ("stations", 3, "x_m")."""
Identifier = Annotated[str, StringConstraints(pattern=IDENTIFIER)]
Height = Annotated[float, Field(ge=-10.0, le=50.0)]
"""m above the floor; 245 is centimetres."""
Coordinate = Annotated[float, Field(ge=-1e7, le=1e7)]
"""m; national grids fit, a float still resolves nanometres."""
Offset = Annotated[float, Field(ge=-10.0, le=10.0)]
Sigma = Annotated[float, Field(gt=0.0, le=1000.0)]
Degrees = Annotated[float, Field(ge=-3600.0, le=3600.0)]
Files = Annotated[
    list[str], Field(min_length=1), BeforeValidator(lambda v: [v] if isinstance(v, str) else v)
]


class _Table(BaseModel):
    # Unknown keys only warn, so they are kept to be named; strict: "1.5" is no number, true no 1.
    model_config = ConfigDict(frozen=True, extra="allow", strict=True, allow_inf_nan=False)


class LidarTable(_Table):
    """[lidar]."""

    model: str = ""
    angle_direction: Literal["ccw", "cw"]
    max_range_m: float = Field(default=40.0, gt=0.0, le=1000.0)
    height_m: Height | None = None


class TagTable(_Table):
    """[tag]."""

    height_m: Height | None = None
    offset_x_m: Offset = 0.0
    offset_y_m: Offset = 0.0
    range_offset_m: Offset | None = None
    range_offset_sigma_m: Sigma = 0.05


class StationTable(_Table):
    """One of [[stations]]."""

    id: Identifier
    scan: Files | None = None
    upper_scan: Files | None = None
    upper_scan_height_m: Height | None = None
    tag_height_m: Height | None = None
    x_m: Coordinate | None = None
    y_m: Coordinate | None = None
    sigma_m: Sigma = 0.02
    yaw_deg: Degrees | None = None
    sigma_yaw_deg: Annotated[float, Field(gt=0.0, le=180.0)] = 1.0
    complete: bool = True


class AnchorTable(_Table):
    """One of [[anchors]]."""

    id: Identifier
    height_m: Height | None = None
    radio: Identifier | None = None
    x_m: Coordinate | None = None
    y_m: Coordinate | None = None
    sigma_m: Sigma = 0.02


class TopTable(_Table):
    """The keys above the tables; what stands in the tables is read by itself."""

    format: Literal[1]
    name: Annotated[str, StringConstraints(min_length=1, max_length=200)] | None = None
    sequence: list[Annotated[list[Identifier], Field(min_length=2, max_length=2)]] | None = None
    lidar: Any = None
    tag: Any = None
    stations: Any = None
    anchors: Any = None


@dataclass(frozen=True, slots=True)
class SurveyToml:
    """survey.toml as far as it could be read."""

    top: TopTable
    lidar: LidarTable | None
    tag: TagTable | None
    stations: tuple[tuple[int, StationTable], ...]
    """With their index in the file."""
    anchors: tuple[tuple[int, AnchorTable], ...]
    wrong: frozenset[Where]
    """Keys that were left out since they hold a fault."""
    lines: TomlLines = field(repr=False)
    findings: Findings = field(repr=False)

    def given(self, where: Where, table: _Table | None) -> set[str]:
        """Keys that the file gives in a table, the wrong ones too."""
        sound = set() if table is None else table.model_fields_set
        return sound | {str(key[-1]) for key in self.wrong if key[:-1] == where}

    def fault(self, where: Where, problem: str) -> None:
        """Note a fault of a key, e.g. ("stations", 3, "x_m")."""
        self.findings.fault(SURVEY_TOML, f"{key_name(where)}{problem}", self.lines.find(where))

    def warn(self, where: Where, problem: str) -> None:
        """Note a warning about a key."""
        self.findings.warn(SURVEY_TOML, f"{key_name(where)}{problem}", self.lines.find(where))


_Model = TypeVar("_Model", bound=_Table)


def parse_survey_toml(content: FileContent, findings: Findings) -> SurveyToml | None:
    """Read survey.toml; None where it is no TOML or not of format 1."""
    raw = _toml(content, findings)
    if raw is None:
        return None
    parser = _Parser(TomlLines.of(content.data.decode("utf-8-sig"), raw), findings)
    if not _is_format_1(raw, parser):
        return None
    top = parser.table(TopTable, raw, ())
    if top is None:
        return None
    return SurveyToml(
        top=top,
        lidar=parser.table(LidarTable, raw["lidar"], ("lidar",)) if "lidar" in raw else None,
        tag=parser.table(TagTable, raw["tag"], ("tag",)) if "tag" in raw else None,
        stations=parser.tables(StationTable, raw, "stations"),
        anchors=parser.tables(AnchorTable, raw, "anchors"),
        wrong=frozenset(parser.wrong),
        lines=parser.lines,
        findings=findings,
    )


def key_name(where: Where) -> str:
    """("stations", 3, "x_m") as ``stations[3].x_m``."""
    return "".join(f"[{p}]" if isinstance(p, int) else f".{p}" for p in where).removeprefix(".")


def _toml(content: FileContent, findings: Findings) -> dict[str, Any] | None:
    try:
        text = content.data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.data.count(b"\n", 0, error.start) + 1
        findings.fault(
            SURVEY_TOML, f"byte 0x{content.data[error.start]:02X}: expected UTF-8 text", line
        )
        return None
    try:
        return tomllib.loads(text)
    except RecursionError:
        findings.fault(SURVEY_TOML, "no TOML: nested too deeply")
    except ValueError as error:
        found = re.search(r"\(at line (\d+), column (\d+)\)", str(error))
        line = int(found.group(1)) if found else text.count("\n") + 1
        findings.fault(SURVEY_TOML, f"no TOML: {error}", line)
    return None


def _is_format_1(raw: dict[str, Any], parser: _Parser) -> bool:
    # Another format may mean anything by the other keys: nothing else is worth saying.
    value = raw.get("format")
    if value == 1 and type(value) is int:
        return True
    given = "format is missing" if "format" not in raw else f"format = {shown(value)}"
    parser.findings.fault(
        SURVEY_TOML, f"{given}: expected format = 1", parser.lines.find(("format",))
    )
    return False


@dataclass(frozen=True, slots=True)
class _Parser:
    lines: TomlLines
    findings: Findings
    wrong: set[Where] = field(default_factory=set)

    def tables(
        self, model: type[_Model], raw: dict[str, Any], key: str
    ) -> tuple[tuple[int, _Model], ...]:
        rows = raw.get(key, [])
        if not isinstance(rows, list):
            self._fault((key,), f" = {shown(rows)}: expected [[{key}]] tables")
            return ()
        read = ((i, self.table(model, row, (key, i))) for i, row in enumerate(rows))
        return tuple((i, table) for i, table in read if table is not None)

    def table(self, model: type[_Model], raw: Any, where: Where) -> _Model | None:
        if not isinstance(raw, dict):
            self._fault(where, f" = {shown(raw)}: expected a table")
            return None
        self._warn_of_unknown(model, raw, where)
        try:
            return model.model_validate(raw)
        except ValidationError as error:
            faults = error.errors(include_url=False)
        for fault in faults:
            given = "" if fault["type"] == "missing" else f" = {shown(fault['input'])}"
            self._fault((*where, *fault["loc"]), f"{given}: {_expected(fault)}")
        wrong = {fault["loc"][0] for fault in faults}
        self.wrong.update((*where, key) for key in wrong)
        try:
            return model.model_validate({k: v for k, v in raw.items() if k not in wrong})
        except ValidationError:
            return None

    def _warn_of_unknown(self, model: type[_Model], raw: dict[str, Any], where: Where) -> None:
        for key in raw:
            # x_ marks the user's own keys, but x_m where no place belongs is a mistake.
            if key not in model.model_fields and (not key.startswith("x_") or key == "x_m"):
                place = (*where, key)
                self.findings.warn(
                    SURVEY_TOML,
                    f"{key_name(place)}: unknown key is ignored",
                    self.lines.find(place),
                )

    def _fault(self, where: Where, problem: str) -> None:
        self.findings.fault(SURVEY_TOML, f"{key_name(where)}{problem}", self.lines.find(where))


_EXPECTED = {
    "missing": "required, but missing",
    "float_type": "expected a number",
    "finite_number": "expected a finite number",
    "string_type": "expected text in quotes",
    "bool_type": "expected true or false",
    "list_type": "expected a list",
    "string_pattern_mismatch": "expected an identifier: 1 to 64 of A-Z a-z 0-9 _ . -",
    "greater_than": "expected more than {gt:g}",
    "greater_than_equal": "expected at least {ge:g}",
    "less_than_equal": "expected at most {le:g}",
    "literal_error": "expected {expected}",
}


def _expected(fault: Any) -> str:
    if fault["loc"][0] == "sequence" and fault["type"] in ("too_short", "too_long"):
        return "expected a pair of stations"
    text = _EXPECTED.get(fault["type"], str(fault["msg"]).lower())
    return text.format(**fault.get("ctx", {})).replace("'", '"')
