"""One iSAM2 problem to which stations are added as they are measured.

What is there already stays as it is eliminated: a station brings its matches and its ranges, an anchor
enters when the stations that see it determine its place, and only ranges whose residual has moved are
fed again. `settle` goes on until nothing moves: the same problem, with the same labels, solved at once
ends there too.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import gtsam
import numpy as np
from numpy.typing import NDArray

from ..model.errors import SolverError
from ..model.geometry import FloatArray, Pose2, Vector2
from ..model.link_law import LinkModel
from ..model.products import LinkMeasurement, ScanMatch
from ..model.settings import GraphSettings
from ..model.solution import Status
from ..model.survey import Anchor, AnchorId, RangeOffset, Station, StationId
from . import factors
from .feeding import feed_ranges
from .initial import Search, find_point
from .range_fit import OffsetPrior
from .ranges import RangeTable, WeighedRanges, weigh_ranges
from .sightings import Sightings
from .steps import solver_error
from .variables import Indices, Variables, from_values

_STALE_M = 3e-3
"""A range whose residual has moved so far is fed again when a station is added."""
_PASSES = 2
"""Looks at the residuals a station; what is left is small and comes with the next."""
_RELINEARISE = 1e-4
"""m and rad. A pose that moved less stays linearised: a tenth of it squared is nothing."""


@dataclass(slots=True, eq=False)
class _Rows:
    """Ranges in the problem, one a row."""

    station: list[int] = field(default_factory=list)
    anchor: list[int] = field(default_factory=list)
    measured: list[float] = field(default_factory=list)
    sigma: list[float] = field(default_factory=list)
    rise: list[float] = field(default_factory=list)
    labels: list[FloatArray] = field(default_factory=list)
    slot: list[int] = field(default_factory=list)
    """Of the factor that was fed last; -1 before."""
    fed: list[float] = field(default_factory=list)
    """m, the residual that it was fed at."""


class GrowingProblem:
    """Poses and anchors of the stations so far; the first station is the frame."""

    def __init__(
        self,
        anchors: Sequence[Anchor],
        model: LinkModel,
        prior: RangeOffset,
        settings: GraphSettings,
        tag_offset: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        """No station yet.

        Args:
            anchors: with their heights; those without one are left out.
            model: of the links' errors; labels are those of its walls at the place where an anchor enters.
            prior: of the offset common to all ranges, m.
            settings: see `GraphSettings`.
            tag_offset: m, the tag in each scanner's frame.
        """
        step = gtsam.ISAM2GaussNewtonParams()
        step.setWildfireThreshold(1e-6)
        parameters = gtsam.ISAM2Params()
        parameters.setOptimizationParams(step)
        parameters.relinearizeSkip = 1
        parameters.setRelinearizeThreshold(_RELINEARISE)
        self._isam = gtsam.ISAM2(parameters)
        self._model, self._prior, self._settings = model, prior, settings
        self._lever = np.array(tag_offset)
        self._heights = {a.id: a.height for a in anchors if a.height is not None}
        self._indices = Indices({}, {a.id: index for index, a in enumerate(anchors)})
        self._entered: list[AnchorId] = []
        self._pending: dict[AnchorId, list[tuple[StationId, LinkMeasurement, float]]] = {}
        self._rows = _Rows()
        self._variables = Variables({}, {}, prior.mean)

    @property
    def variables(self) -> Variables:
        """Poses, anchors and offsets as they are now."""
        return self._variables

    @property
    def ranges(self) -> WeighedRanges:
        """The ranges that have entered, with their labels."""
        return self._weighed(slice(None))

    def add_station(
        self,
        station: Station,
        matches: Iterable[ScanMatch],
        links: Iterable[LinkMeasurement],
    ) -> tuple[AnchorId, ...]:
        """Add a station by its matches with those that are there, and its ranges.

        Args:
            station: a new one; the first is the frame.
            matches: between it and stations that were added before; none for the first.
            links: its own; unusable ones are left out.

        Returns:
            The anchors that have entered with it.

        Raises:
            SolverError: no match holds the station, or something is not determined.
        """
        matches = tuple(matches)
        new, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
        pose = self._start_of(station.id, matches)
        key = len(self._indices.stations)
        self._indices.stations[station.id] = key
        values.insert(factors.X(key), factors.to_gtsam(pose))
        if key == 0:
            new.push_back(factors.gauge_factor(key, pose))
        for match in matches:
            ends = (self._indices.stations[match.target], self._indices.stations[match.source])
            new.push_back(factors.match_factor(match, *ends))
        poses = {**self._variables.poses, station.id: pose}
        self._variables = Variables(
            poses, self._variables.anchors, self._variables.offset, self._variables.delays
        )
        usable = [k for k in links if k.rejection is None and k.anchor in self._heights]
        for link in usable:
            self._take(station, link)
        waiting = [k.anchor for k in usable if k.anchor in self._pending]
        entered = self._enter_anchors(waiting, new, values)
        self._update(new, values, _PASSES, _STALE_M)
        return entered

    def settle(self) -> int:
        """Feed all ranges again until nothing moves; the number of passes that it took."""
        nothing = gtsam.NonlinearFactorGraph(), gtsam.Values()
        return self._update(*nothing, self._settings.max_passes, self._settings.tolerance_m)

    def _start_of(self, station: StationId, matches: Sequence[ScanMatch]) -> Pose2:
        """By the match that tells most; the origin for the first station."""
        if not self._indices.stations:
            return Pose2.identity()
        if not matches:
            raise SolverError(f"no match holds station {station}")
        best = min(matches, key=lambda match: float(np.trace(match.covariance)))
        poses = self._variables.poses
        if best.source == station:
            return poses[best.target] @ best.target_T_source
        return poses[best.source] @ best.target_T_source.inverse()

    def _take(self, station: Station, link: LinkMeasurement) -> None:
        """A range to an anchor that is there, or that waits for more."""
        if link.anchor in self._entered:
            self._append(station.id, station.tag_height, link)
        else:
            waiting = self._pending.setdefault(link.anchor, [])
            waiting.append((station.id, link, station.tag_height))

    def _append(self, station: StationId, tag_height: float, link: LinkMeasurement) -> None:
        rows, place = self._rows, self._variables.anchors[link.anchor]
        tag = self._variables.poses[station].transform(self._lever)
        rows.station.append(self._indices.stations[station])
        rows.anchor.append(self._entered.index(link.anchor))
        rows.measured.append(link.distance)
        rows.sigma.append(link.sigma)
        rows.rise.append(self._heights[link.anchor] - tag_height)
        rows.labels.append(self._model.labels(tag[None, :], place[None, :])[0])
        rows.slot.append(-1)
        rows.fed.append(np.inf)

    def _enter_anchors(
        self,
        waiting: Sequence[AnchorId],
        new: gtsam.NonlinearFactorGraph,
        values: gtsam.Values,
    ) -> tuple[AnchorId, ...]:
        """Those of the anchors that wait whose place the ranges now tell."""
        offset = RangeOffset(self._variables.offset, self._prior.sigma)
        search = Search(self._model, OffsetPrior(offset, self._model.anchor_sigma), self._settings)
        entered = []
        for anchor in waiting:
            found = find_point(self._seen(anchor), self._heights[anchor], search)
            if found.status is not Status.OK or found.place is None:
                continue
            if not self._entered:
                new.push_back(factors.offset_prior(self._prior))
                values.insert(factors.OFFSET_KEY, self._variables.offset)
            self._insert(anchor, found.place, new, values)
            entered.append(anchor)
        return tuple(entered)

    def _insert(
        self,
        anchor: AnchorId,
        place: Vector2,
        new: gtsam.NonlinearFactorGraph,
        values: gtsam.Values,
    ) -> None:
        key = self._indices.anchors[anchor]
        new.push_back(factors.anchor_prior(key, place, factors.WEAK_PLACE_SIGMA))
        new.push_back(factors.delay_prior(key, self._model.anchor_sigma))
        values.insert(factors.L(key), place)
        values.insert(factors.D(key), self._variables.offset)
        self._entered.append(anchor)
        self._variables.anchors[anchor] = place
        for station, link, tag_height in self._pending.pop(anchor):
            self._append(station, tag_height, link)

    def _seen(self, anchor: AnchorId) -> Sightings:
        """From where a waiting anchor is seen."""
        waiting = self._pending[anchor]
        tags = [self._variables.poses[name].transform(self._lever) for name, _, _ in waiting]
        heights, distances, sigmas = np.array(
            [(height, link.distance, link.sigma) for _, link, height in waiting]
        ).T
        return Sightings(np.array(tags), heights, distances, sigmas)

    def _update(
        self, new: gtsam.NonlinearFactorGraph, values: gtsam.Values, passes: int, stale: float
    ) -> int:
        """Passes until no residual has moved by more than `stale`, m; how many it took."""
        for number in range(1, passes + 1):
            fed = self._feed(new, values, stale)
            if number > 1 and not fed:
                return number - 1
            new, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
        return passes

    def _feed(self, new: gtsam.NonlinearFactorGraph, values: gtsam.Values, stale: float) -> int:
        """Exchange the factors of the ranges that have moved and take one step; how many there were."""
        rows, moved = self._rows, np.zeros(0, dtype=np.intp)
        if rows.slot:
            residuals = self._table(slice(None)).residuals(self._variables)
            moved = np.flatnonzero(np.abs(residuals - rows.fed) > stale)
            for row in moved:
                rows.fed[row] = float(residuals[row])
            at = self._estimate(values)
            part = self._weighed(moved)
            for factor in feed_ranges(part, self._variables, at, self._indices, safe=False):
                new.push_back(factor)
        if new.empty():
            return 0
        old = [rows.slot[row] for row in moved if rows.slot[row] >= 0]
        try:
            result = self._isam.update(new, values, old)
        except RuntimeError as error:
            raise solver_error(error, self._indices) from error
        slots = list(result.getNewFactorsIndices())
        for row, slot in zip(moved, slots[len(slots) - len(moved) :], strict=True):
            rows.slot[row] = slot
        self._variables = from_values(
            self._isam.calculateEstimate(), self._variables, self._indices
        )
        return len(moved)

    def _estimate(self, new: gtsam.Values) -> gtsam.Values:
        """Where factors are fed: the estimate of iSAM2, and the new values."""
        values = gtsam.Values(self._isam.calculateEstimate())
        values.insert(new)
        return values

    def _weighed(self, some: slice | NDArray[np.intp]) -> WeighedRanges:
        table = self._table(some)
        labels = np.array([*self._rows.labels, self._model.unlabelled()])[:-1][some]
        return weigh_ranges(table, labels, self._model)

    def _table(self, some: slice | NDArray[np.intp]) -> RangeTable:
        rows, count = self._rows, len(self._indices.stations)
        return RangeTable(
            stations=tuple(self._indices.stations),
            anchors=tuple(self._entered),
            lost=frozenset(),
            levers=np.tile(self._lever, (count, 1)),
            first=np.array(rows.station, dtype=np.intp)[some],
            second=np.array(rows.anchor, dtype=np.intp)[some] + count,
            measured=np.array(rows.measured)[some],
            sigmas=np.array(rows.sigma)[some],
            rises=np.array(rows.rise)[some],
        )
