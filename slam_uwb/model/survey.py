"""What was measured: stations with their scans, anchors, ranges. SI units, angles in radians.

A `Survey` is what `io` reads from a survey folder (or `simulate` makes) and what
`pipeline.solve_survey` takes.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NewType

from .geometry import FloatArray, Pose2, freeze_arrays

StationId = NewType("StationId", str)
AnchorId = NewType("AnchorId", str)


@dataclass(frozen=True, slots=True, eq=False)
class Scan:
    """LiDAR samples of one set-up in the scanner's own frame, in recording order, many revolutions or one."""

    bearings: FloatArray
    """(N,) rad, counter-clockwise seen from above, whatever the scanner's own direction."""
    ranges: FloatArray
    """(N,) m; NaN is no return (longer than `max_range` included)."""
    max_range: float
    """m; beyond it the scanner sees nothing."""

    def __post_init__(self) -> None:
        freeze_arrays(self, bearings=(None,))
        freeze_arrays(self, ranges=self.bearings.shape)


@dataclass(frozen=True, slots=True)
class KnownPlace:
    """A surveyed station or anchor (control point) in the site's frame."""

    x: float
    y: float
    sigma: float = 0.02
    """m, each axis."""
    theta: float | None = None
    """rad; None where the heading is not known (always None for an anchor)."""
    sigma_theta: float = 0.017453292519943295
    """rad."""


@dataclass(frozen=True, slots=True, eq=False)
class Station:
    """One tripod set-up."""

    id: StationId
    scan: Scan | None
    tag_height: float
    """m above the floor, the survey's or the station's own; NaN where the survey has no tag."""
    known: KnownPlace | None = None
    upper_scan: Scan | None = None
    """Same place, raised above the furniture; its heading is its own."""
    upper_scan_height: float | None = None
    complete: bool = True


@dataclass(frozen=True, slots=True)
class Anchor:
    """A fixed UWB device, sought unless `known`."""

    id: AnchorId
    height: float | None
    """m above the floor; None where nobody measured it."""
    known: KnownPlace | None = None


@dataclass(frozen=True, slots=True, eq=False)
class RangeSamples:
    """All slant distances of one link as the device gave them, absurd ones included (`ranging` sorts them out)."""

    station: StationId
    anchor: AnchorId
    distances: FloatArray
    """(K,) m."""

    def __post_init__(self) -> None:
        freeze_arrays(self, distances=(None,))


@dataclass(frozen=True, slots=True, eq=False)
class TwoWayPeriods:
    """Double-sided two-way-ranging exchanges of one link (paper, Fig. 3)."""

    station: StationId
    anchor: AnchorId
    periods: FloatArray
    """(K, 4) s: tag round trip, anchor reply, tag reply, anchor round trip."""

    def __post_init__(self) -> None:
        freeze_arrays(self, periods=(None, 4))


@dataclass(frozen=True, slots=True, eq=False)
class AnchorRangeSamples:
    """Slant distances between two anchors."""

    anchor_a: AnchorId
    anchor_b: AnchorId
    distances: FloatArray
    """(K,) m."""

    def __post_init__(self) -> None:
        freeze_arrays(self, distances=(None,))


@dataclass(frozen=True, slots=True)
class RangeOffset:
    """Constant that every range is too long by (antenna delays), as the survey states it."""

    mean: float
    """m."""
    sigma: float
    """m."""


@dataclass(frozen=True, slots=True)
class Decision:
    """What a person decided about a pair of stations or a link."""

    kind: str
    """`pair` or `link`."""
    a: str
    """Station m of a pair, or the station of a link."""
    b: str
    """Station n of a pair, or the anchor of a link."""
    verdict: str
    """`keep`, `drop`, or for a pair `guess`."""
    guess: Pose2 | None = None
    """m_T_n, for `guess`; for `keep` where it says which of the pair's hypotheses is meant."""


@dataclass(frozen=True, slots=True, eq=False)
class Survey:
    """One site, recorded with one tripod."""

    name: str
    stations: tuple[Station, ...]
    anchors: tuple[Anchor, ...]
    ranges: tuple[RangeSamples, ...] = ()
    """At most one entry a link; a link that has `periods` is not here."""
    periods: tuple[TwoWayPeriods, ...] = ()
    anchor_ranges: tuple[AnchorRangeSamples, ...] = ()
    sequence: tuple[tuple[StationId, StationId], ...] | None = None
    """Pairs (m, n): fit scan n to scan m (paper, Algorithm 1)."""
    tag_offset: tuple[float, float] = (0.0, 0.0)
    """m, the antenna in the scanner's frame: the translation of station_T_tag."""
    range_offset: RangeOffset | None = None
    decisions: tuple[Decision, ...] = ()
    checksum: str = ""
    """SHA-256 over the survey's files, hexadecimal; empty for a survey that never was a folder."""

    def without_ranges(self) -> Survey:
        """The same survey, had nothing but its scans been recorded."""
        return replace(self, ranges=(), periods=(), anchor_ranges=())

    def station(self, station: StationId) -> Station:
        """The station of that name (KeyError where there is none)."""
        return {item.id: item for item in self.stations}[station]

    def anchor(self, anchor: AnchorId) -> Anchor:
        """The anchor of that name (KeyError where there is none)."""
        return {item.id: item for item in self.anchors}[anchor]


@dataclass(frozen=True, slots=True)
class ReferencePlace:
    """True place of a station or anchor; NaN where the reference does not say."""

    x: float
    y: float
    theta: float = float("nan")
    """rad."""


@dataclass(frozen=True, slots=True)
class Reference:
    """Ground truth of a survey; used by `evaluate` only."""

    stations: dict[StationId, ReferencePlace]
    anchors: dict[AnchorId, ReferencePlace]
