"""What emulated instruments measure: the stations of a survey, one after the other."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

import numpy as np

from ...model.survey import Scan, StationId, Survey
from ..samples import NO_SAMPLES, LidarSamples, RangeEpoch, RangeReading

_MAX_READINGS = 4
"""A DWM1001 never reports more anchors at once."""
_SIGNAL, _NO_SIGNAL = 150.0, 30.0
"""Strengths as a Sweep gives them with and without a return."""
_PLAYED = 0.9
"""Share of a recording after which the operator carries the tripod on."""


@dataclass(frozen=True, slots=True, eq=False)
class PlayedStation:
    """What the instruments see at one station."""

    id: StationId
    scan: LidarSamples
    epochs: tuple[RangeEpoch, ...]
    """Evenly spread over `duration`."""
    duration: float
    """S; the recording is repeated from its start after that."""


@dataclass(slots=True)
class Tripod:
    """Where the instruments stand; moves on when a station was recorded nearly to its end."""

    stations: tuple[PlayedStation, ...]
    index: int = 0
    played: float = field(default=0.0)
    """S that the present station was recorded in one go."""

    @property
    def station(self) -> PlayedStation:
        """The present one."""
        return self.stations[self.index]

    def begin(self) -> PlayedStation:
        """A recording begins: at the next station if the one before is done."""
        if self.played >= _PLAYED * self.station.duration and self.index + 1 < len(self.stations):
            self.index += 1
        self.played = 0.0
        return self.station


def play_survey(
    survey: Survey, sample_hz: float, duration: float | None = None, *, upper: bool = False
) -> Tripod:
    """The stations of a survey as instruments on a tripod measure them.

    Args:
        survey: simulated or recorded; stations without a scan are left out.
        sample_hz: of the emulated scanner.
        duration: s of a station; as long as its scan takes where None.
        upper: whether the operator raises the scanner after each station that has an upper scan.
    """
    radios = radio_names(survey)
    played = []
    for station in survey.stations:
        if station.scan is None:
            continue
        links = {
            radios[str(link.anchor)]: link.distances.tolist()
            for link in survey.ranges
            if link.station == station.id
        }
        raised = station.upper_scan if upper else None
        for recorded, heard in ((station.scan, links), (raised, {})):
            if recorded is not None:
                scan = _samples(recorded)
                seconds = duration or max(len(scan), 1) / sample_hz
                played.append(PlayedStation(station.id, scan, _epochs(heard), seconds))
    return Tripod(tuple(played))


def radio_names(survey: Survey) -> dict[str, str]:
    """Anchor -> four hexadecimal digits: its own identifier where it is such, else D001, D002, ..."""
    return {
        str(anchor.id): str(anchor.id)
        if re.fullmatch(r"[0-9A-F]{4}", anchor.id)
        else f"{0xD001 + number:04X}"
        for number, anchor in enumerate(survey.anchors)
    }


def _samples(scan: Scan) -> LidarSamples:
    if not len(scan.bearings):
        return NO_SAMPLES
    bearings = np.mod(scan.bearings, 2.0 * np.pi)
    # A whole turn back is a new revolution; a sixteenth of a degree back is rounding.
    starts = np.flatnonzero(np.diff(bearings, prepend=bearings[0]) < -np.pi)
    signals = np.where(np.isfinite(scan.ranges), _SIGNAL, _NO_SIGNAL)
    return LidarSamples(bearings, scan.ranges, signals, starts)


def _epochs(links: dict[str, list[float]]) -> tuple[RangeEpoch, ...]:
    """The k-th readings of all anchors together, as many a report as fit."""
    epochs: list[RangeEpoch] = []
    for k in range(max(map(len, links.values()), default=0)):
        heard = [
            RangeReading(anchor, distances[k])
            for anchor, distances in links.items()
            if k < len(distances)
        ]
        epochs += [
            RangeEpoch(tuple(heard[i : i + _MAX_READINGS]))
            for i in range(0, len(heard), _MAX_READINGS)
        ]
    return tuple(epochs)
