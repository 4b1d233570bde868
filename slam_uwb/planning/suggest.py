"""Where to put the tripod next: where it lowers the expected errors of the anchors most.

The best place for what is believed of the anchors, then the next one given the first, as is usual for
such designs (the gain of a place shrinks with what is measured already); then each is exchanged for
the best one given the others until none is better (Fedorov 1972).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

import numpy as np

from ..model.geometry import FloatArray, Points, Vector2, frozen_array
from ..model.settings import PlanningSettings
from ..model.solution import Solution
from .belief import Beliefs, build_beliefs
from .radio import hearing_probability, link_budget, range_variances, wall_counts
from .views import free_places, known_view

_EXCHANGES = 3
"""Rounds; the second one hardly ever changes anything."""
_BETTER_M2 = 1e-9
_NUMBERS_AT_ONCE = 4_000_000


@dataclass(frozen=True, slots=True, eq=False)
class Suggestion:
    """A place for the tripod."""

    place: Vector2
    """(2,) m, world frame."""
    before: float
    """m, root mean square of the anchors' expected errors without it (with those suggested before it)."""
    after: float
    """m, with it."""
    known_view: float
    """Share of its view that the map knows, 0-1: what its scan can be matched by."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "place", frozen_array(self.place, (2,), "place"))


@dataclass(frozen=True, slots=True, eq=False)
class _Views:
    """What N places say of the C places of the anchors."""

    places: Points
    """(N, 2) m."""
    matched: FloatArray
    """(N,) 0-1, how probably a scan from there matches."""
    slopes: FloatArray
    """(N, C, 2) change of the range with the anchor's place."""
    variances: FloatArray
    """(N, C) m^2, of the range."""
    heard: FloatArray
    """(N, C) 0-1, how probably there is a range at all."""
    slants: FloatArray
    """(N, C) m."""


@dataclass(frozen=True, slots=True, eq=False)
class _State:
    """What is believed once some places have been measured."""

    stations: Points
    """(S, 2) m, where was measured."""
    covariances: FloatArray
    """(C, 2, 2) m^2."""
    confused: FloatArray
    """(R,) 0-1, how much two places of an anchor are still confused."""


def suggest_stations(
    solution: Solution, count: int, settings: PlanningSettings
) -> tuple[Suggestion, ...]:
    """The next `count` places, the most useful first; fewer where the map has no more.

    Args:
        solution: with a floor map and anchors.
        count: how many are wanted.
        settings: what a range is expected to be worth, and what a scan needs to be matched.
    """
    beliefs = build_beliefs(solution)
    if solution.floor_map is None or beliefs is None:
        return ()
    places = free_places(solution.floor_map, settings.spacing_m, settings.clearance_m)
    if not len(places):
        return ()
    known = known_view(solution.floor_map, places, settings.reach_m)
    enough = known >= settings.min_known_view
    views = _look(solution, places[enough], known[enough], beliefs, settings)
    stations = np.array([s.pose.translation for s in solution.stations if s.pose]).reshape(-1, 2)
    state = _State(stations, beliefs.covariances, np.ones(len(beliefs.rivals)))
    chosen = _choose(state, views, beliefs, min(count, len(views.places)), settings)
    found = []
    for place in chosen:
        before = _variances(state.covariances, state.confused, beliefs)
        after, state = _measure(state, views, beliefs, place, settings)
        found.append(
            Suggestion(views.places[place], _rms(before), _rms(after), float(known[enough][place]))
        )
    return tuple(found)


def _choose(
    state: _State, views: _Views, beliefs: Beliefs, count: int, settings: PlanningSettings
) -> list[int]:
    """Numbers of the places, greedily and then by exchange."""
    chosen: list[int] = []
    least = math.inf
    for _ in range(count):
        place, least = _best(state, views, beliefs, chosen, settings)
        chosen.append(place)
    for _ in range(_EXCHANGES if count > 1 else 0):
        before = list(chosen)
        for k in range(count):
            others = chosen[:k] + chosen[k + 1 :]
            place, harm = _best(state, views, beliefs, others, settings)
            if harm < least - _BETTER_M2:
                chosen[k], least = place, harm
        if chosen == before:
            break
    return chosen


def _best(
    state: _State, views: _Views, beliefs: Beliefs, chosen: list[int], settings: PlanningSettings
) -> tuple[int, float]:
    """The best place given those chosen, and the harm that is left."""
    for place in chosen:
        _, state = _measure(state, views, beliefs, place, settings)
    # In parts: of a floor of many lost anchors, all places at once are gigabytes.
    size = max(1, _NUMBERS_AT_ONCE // (len(beliefs.rivals) + 4 * len(beliefs.means)))
    harm = np.concatenate(
        [
            _harm(_expected(state, _part(views, start, size), beliefs, settings)[0], settings)
            for start in range(0, len(views.places), size)
        ]
    )
    best = int(np.argmin(harm))
    return best, float(harm[best])


def _measure(
    state: _State, views: _Views, beliefs: Beliefs, place: int, settings: PlanningSettings
) -> tuple[FloatArray, _State]:
    """Expected variances (A,) of the anchors after measuring at a place, and the state then."""
    one = _part(views, place, 1)
    after, covariances, confused = _expected(state, one, beliefs, settings)
    stations = np.vstack([state.stations, one.places])
    return after[0], _State(stations, covariances[0], confused[0])


def _part(views: _Views, start: int, count: int) -> _Views:
    """Some of the places."""
    return _Views(*(getattr(views, item.name)[start : start + count] for item in fields(_Views)))


def _expected(
    state: _State, views: _Views, beliefs: Beliefs, settings: PlanningSettings
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """After measuring at each of the N places: variances (N, A), covariances (N, C, 2, 2), confusions (N, R).

    A scan that does not match brings nothing.
    """
    matched = views.matched[:, None]
    variances = views.variances * _repetition(views.places, state.stations, settings)[:, None]
    telling = 1.0 - matched * (1.0 - _confusion(views, variances, state.covariances, beliefs))
    lowered = state.covariances - _updated(state.covariances, views, variances)
    covariances = state.covariances - matched[..., None, None] * lowered
    confused = state.confused * telling
    return _variances(covariances, confused, beliefs), covariances, confused


def _look(
    solution: Solution,
    places: Points,
    known: FloatArray,
    beliefs: Beliefs,
    settings: PlanningSettings,
) -> _Views:
    away = beliefs.means[None] - places[:, None]
    slants = np.sqrt((away**2).sum(axis=2) + beliefs.rises**2)
    walls = wall_counts(solution, places, beliefs.means)
    return _Views(
        places=places,
        matched=np.minimum(known / settings.sure_known_view, 1.0),
        slopes=away / np.maximum(slants, 1e-6)[:, :, None],
        variances=range_variances(walls, settings),
        heard=hearing_probability(walls, slants, link_budget(solution)),
        slants=slants,
    )


def _repetition(places: Points, stations: Points, settings: PlanningSettings) -> FloatArray:
    """(N,) factor of a range's variance at each place, for what stations nearby have told already.

    Walls and reflections spoil ranges of neighbours alike. Of two errors of one variance v and
    correlation r, the second adds what an independent one of v (1 + r) / (1 - r) would.
    """
    apart = np.linalg.norm(places[:, None] - stations[None], axis=2)
    correlation = np.exp(-apart / settings.shared_radius_m)
    return np.asarray(1.0 + (2.0 * correlation / (1.0 - correlation + 1e-9)).sum(axis=1))


def _updated(covariances: FloatArray, views: _Views, variances: FloatArray) -> FloatArray:
    """(N, C, 2, 2) covariances (C, 2, 2) expected after one more range each, heard or not (Kalman's update)."""
    gain = np.einsum("cij,ncj->nci", covariances, views.slopes)
    total = np.einsum("nci,nci->nc", views.slopes, gain) + variances
    lowered = gain[..., :, None] * gain[..., None, :] * (views.heard / total)[..., None, None]
    return np.asarray(covariances[None] - lowered)


def _confusion(
    views: _Views, variances: FloatArray, covariances: FloatArray, beliefs: Beliefs
) -> FloatArray:
    """(N, R) how much confusion of two places of an anchor a range from each place leaves, 0-1.

    The Bhattacharyya coefficient of the two normal densities that the range would have.
    """
    i, j = beliefs.rivals.T
    spread = np.einsum("nci,cij,ncj->nc", views.slopes, covariances, views.slopes) + variances
    both = spread[:, i] + spread[:, j]
    apart = views.slants[:, i] - views.slants[:, j]
    alike = np.sqrt(2.0 * np.sqrt(spread[:, i] * spread[:, j]) / both)
    left = alike * np.exp(-(apart**2) / (4.0 * both))
    heard = (views.heard[:, i] + views.heard[:, j]) / 2.0
    return np.asarray(1.0 - heard * (1.0 - left))


def _variances(covariances: FloatArray, confused: FloatArray, beliefs: Beliefs) -> FloatArray:
    """(..., A) m^2 of each anchor, by covariances (..., C, 2, 2) of its places and doubts (..., R)."""
    anchors = np.arange(beliefs.owners[-1] + 1)
    own = beliefs.owners == anchors[:, None]
    between = beliefs.owners[beliefs.rivals[:, 0]] == anchors[:, None]
    within = (np.trace(covariances, axis1=-2, axis2=-1) * beliefs.shares) @ own.T
    return np.asarray(within + (confused * beliefs.spreads) @ between.T)


def _harm(variances: FloatArray, settings: PlanningSettings) -> FloatArray:
    """(...) m^2, mean over the anchors (..., A): quadratic while an anchor is of use, then level.

    How wrong an anchor is of which nobody can make any use does not matter.
    """
    useless = settings.useless_m**2
    return np.asarray((variances / (1.0 + variances / useless)).mean(axis=-1))


def _rms(variances: FloatArray) -> float:
    return float(np.sqrt(variances.mean()))
