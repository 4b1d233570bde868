"""Every knob of the method, a module a step: default, unit (in the name), limits and the reason.

Settings are frozen, refuse unknown keys at every level and are tuned by file only (``--settings
FILE``). `PRESETS` holds named sets; ``paper`` is what Kolakowski et al. 2020 print.
"""

from __future__ import annotations

import json
from typing import Any

from pydantic import ValidationError

from ..errors import SettingsError
from .graph import GraphSettings
from .mapping import MappingSettings
from .matching import MatchingSettings
from .planning import PlanningSettings
from .positioning import PositioningSettings
from .ranging import RangingSettings
from .scan import ScanSettings
from .section import Section

__all__ = [
    "PRESETS",
    "GraphSettings",
    "MappingSettings",
    "MatchingSettings",
    "PlanningSettings",
    "PositioningSettings",
    "RangingSettings",
    "ScanSettings",
    "Settings",
    "settings_from_mapping",
]


class Settings(Section):
    """All sections."""

    scan: ScanSettings = ScanSettings()
    matching: MatchingSettings = MatchingSettings()
    ranging: RangingSettings = RangingSettings()
    graph: GraphSettings = GraphSettings()
    mapping: MappingSettings = MappingSettings()
    planning: PlanningSettings = PlanningSettings()
    positioning: PositioningSettings = PositioningSettings()


PRESETS: dict[str, Settings] = {
    "default": Settings(),
    "paper": Settings(
        matching=MatchingSettings(
            initialiser="landmark",
            refiner="paper_lm",
            ranking="closest_points",
            placement="sequence",
            initial_matches=5,
            hypotheses=5,
        ),
        ranging=RangingSettings(two_way="symmetric"),
    ),
}


_UNKNOWN = {"extra_forbidden": "no such setting; `slam-uwb settings` prints all of them"}
"""pydantic says this in its own terms."""


def settings_from_mapping(mapping: dict[str, Any]) -> Settings:
    """Settings from a nested mapping of what differs from the defaults.

    Raises:
        SettingsError: names every bad key, its value and the limit.
    """
    try:
        # Strict, or "0.1" and true would pass for numbers; by way of JSON, whose lists may be tuples.
        return Settings.model_validate_json(json.dumps(mapping, default=str), strict=True)
    except ValidationError as error:
        problems = [
            (
                ".".join(map(str, e["loc"])),
                f"{_UNKNOWN.get(e['type'], e['msg'])} (given: {e['input']!r})",
            )
            for e in error.errors()
        ]
        first_key, first = problems[0]
        rest = "".join(f"\nsettings: {key}: {problem}" for key, problem in problems[1:])
        raise SettingsError(first_key, first + rest) from None
