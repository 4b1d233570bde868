"""What no single file of a survey folder can tell: does it all fit together, and is it plausible?"""

from __future__ import annotations

import math

import numpy as np

from ..model.survey import Survey
from .survey_rows import ABSURD_RANGE_M
from .survey_toml import AnchorTable, StationTable, SurveyToml

FAR_STATION_M = 3.0
"""Scans three metres apart needed fitting by hand (paper, II, after [2])."""


def fault_of_layout(survey: Survey, toml: SurveyToml, *, has_ranges: bool) -> None:
    """Note keys of survey.toml that need one another, and tables that the recordings need."""
    if not toml.stations:
        toml.fault(("stations",), ": expected at least one [[stations]] table")
    for index, table in toml.stations:
        _fault_of_place(("stations", index), table, toml)
        _fault_of_station(("stations", index), table, toml)
    for index, anchor in toml.anchors:
        _fault_of_place(("anchors", index), anchor, toml)
    _fault_of_devices(survey, toml, has_ranges=has_ranges)


def _fault_of_place(
    where: tuple[str, int], table: StationTable | AnchorTable, toml: SurveyToml
) -> None:
    given = toml.given(where, table)
    if len(given & {"x_m", "y_m"}) == 1:
        there, absent = ("x_m", "y_m") if "x_m" in given else ("y_m", "x_m")
        toml.fault((*where, there), f" without {absent}: expected both or none")
    elif "x_m" not in given and "sigma_m" in given:
        toml.warn((*where, "sigma_m"), " without x_m and y_m is ignored")


def _fault_of_station(where: tuple[str, int], table: StationTable, toml: SurveyToml) -> None:
    given = toml.given(where, table)
    if "yaw_deg" in given and not given & {"x_m", "y_m"}:
        toml.fault((*where, "yaw_deg"), " without x_m and y_m: expected all three")
    if "sigma_yaw_deg" in given and "yaw_deg" not in given:
        toml.warn((*where, "sigma_yaw_deg"), " without yaw_deg is ignored")
    if "upper_scan" in given and "scan" not in given:
        problem = " without scan: a single recording is the station's scan"
        toml.fault((*where, "upper_scan"), problem)
    offset = (0.0, 0.0) if toml.tag is None else (toml.tag.offset_x_m, toml.tag.offset_y_m)
    if any(offset) and "x_m" in given and not given & {"scan", "yaw_deg"}:
        toml.fault(
            (*where, "yaw_deg"),
            f": required, but missing: with the tag {math.hypot(*offset):g} m off the scanner's "
            "axis and no scan, the heading says where the antenna is",
        )


def _fault_of_devices(survey: Survey, toml: SurveyToml, *, has_ranges: bool) -> None:
    there = toml.given((), toml.top)
    if any(table.scan or table.upper_scan for _, table in toml.stations) and "lidar" not in there:
        toml.fault(("lidar",), ": required, but missing: stations have scans")
    if has_ranges and "tag" not in there:
        toml.fault(("tag",), ": required, but missing: there are ranges")
    elif has_ranges and "height_m" not in toml.given(("tag",), toml.tag):
        measured = _measured(survey)
        if any(s.id in measured and math.isnan(s.tag_height) for s in survey.stations):
            problem = ": required, but missing: not every station has tag_height_m"
            toml.fault(("tag", "height_m"), problem)
    offset_keys = toml.given(("tag",), toml.tag) & {"range_offset_m", "range_offset_sigma_m"}
    if offset_keys == {"range_offset_sigma_m"}:
        toml.warn(("tag", "range_offset_sigma_m"), " without range_offset_m is ignored")


def _measured(survey: Survey) -> set[str]:
    by_ranges: set[str] = {link.station for link in survey.ranges}
    return by_ranges | {link.station for link in survey.periods}


def warn_of_doubts(survey: Survey, toml: SurveyToml) -> None:
    """Note what is read as it is, but rarely meant."""
    _warn_of_shared_recordings(toml)
    _warn_of_stations_without_anything(survey, toml)
    _warn_of_sequence(survey, toml)
    _warn_of_distant_stations(survey, toml)
    _warn_of_heights(survey, toml)


def _warn_of_shared_recordings(toml: SurveyToml) -> None:
    users: dict[str, str] = {}
    for index, table in toml.stations:
        for key, files in (("scan", table.scan), ("upper_scan", table.upper_scan)):
            for file in files or ():
                if file in users:
                    toml.warn(
                        ("stations", index, key),
                        f": {file} is also the scan of station {users[file]}",
                    )
                users.setdefault(file, table.id)


def _warn_of_stations_without_anything(survey: Survey, toml: SurveyToml) -> None:
    measured = _measured(survey)
    for (index, table), station in zip(toml.stations, survey.stations, strict=True):
        if not table.scan and station.known is None and station.id not in measured:
            toml.warn(
                ("stations", index),
                ": neither scan nor ranges nor a known place: nothing locates it",
            )


def _warn_of_sequence(survey: Survey, toml: SurveyToml) -> None:
    without = {table.id for _, table in toml.stations if not table.scan}
    for index, pair in enumerate(survey.sequence or ()):
        for station in without.intersection(pair):
            toml.warn(("sequence", index), f": station {station} has no scan to fit")


def _warn_of_distant_stations(survey: Survey, toml: SurveyToml) -> None:
    """The paper's placing conditions (II), as far as they can be told before anything is solved."""
    scanned = [
        (i, s)
        for (i, _), s in zip(toml.stations, survey.stations, strict=True)
        if s.scan is not None
    ]
    known = [s.known for _, s in scanned if s.known is not None]
    # A station whose place is still unknown may stand between the two.
    if len(known) < max(2, len(scanned)):
        return
    places = np.array([(place.x, place.y) for place in known])
    distances = np.linalg.norm(places[:, None] - places[None], axis=-1)
    np.fill_diagonal(distances, np.inf)
    for (index, station), nearest in zip(scanned, distances.min(axis=1), strict=True):
        if nearest > FAR_STATION_M:
            toml.warn(
                ("stations", index),
                f": station {station.id} is {nearest:.2f} m from the nearest other one: "
                f"scans more than {FAR_STATION_M:g} m apart rarely match",
            )


def _warn_of_heights(survey: Survey, toml: SurveyToml) -> None:
    tag_heights: dict[str, float] = {s.id: s.tag_height for s in survey.stations}
    reaches: dict[str, list[tuple[float, float]]] = {}
    for link in survey.ranges:
        usable = link.distances[(link.distances > 0.0) & (link.distances <= ABSURD_RANGE_M)]
        if len(usable):
            longest = float(usable.max())
            reaches.setdefault(link.anchor, []).append((longest, tag_heights[link.station]))
    for index, table in toml.anchors:
        found = reaches.get(table.id, [])
        if table.height_m is None or not found:
            continue
        if all(longest < abs(table.height_m - tag_height) for longest, tag_height in found):
            toml.warn(
                ("anchors", index, "height_m"),
                f" = {table.height_m:g}: every range to it is shorter than its height above the "
                f"tag (longest {max(found)[0]:.3f} m)",
            )
