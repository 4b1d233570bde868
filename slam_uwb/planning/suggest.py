"""Where to put the tripod next: where it lowers the expected covariance of the anchors most.

Greedy, as is usual for such designs (the gain of a place shrinks with what is measured already): the
best place for the anchors' covariances, then the next one given the first.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from ..model.geometry import FloatArray, Matrix2, Points, Vector2, frozen_array
from ..model.settings import PlanningSettings
from ..model.solution import AnchorEstimate, Solution
from .views import free_places, known_view, walls_between

_ONE_PLACE_M = 0.2
"""Standard deviation of one of several places, where none is given."""
_ON_RING = 180
_RING_SIGMA_M = 0.5


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


def suggest_stations(
    solution: Solution, count: int, settings: PlanningSettings
) -> tuple[Suggestion, ...]:
    """The next `count` places, the most useful first; fewer where the map has no more.

    Args:
        solution: with a floor map and anchors.
        count: how many are wanted.
        settings: what a range is expected to be worth, and what a scan needs to be matched.
    """
    beliefs = _beliefs(solution)
    if solution.floor_map is None or not beliefs:
        return ()
    places = free_places(solution.floor_map, settings.spacing_m, settings.clearance_m)
    if not len(places):
        return ()
    view = known_view(solution.floor_map, places, settings.reach_m)
    places, view = places[view >= settings.min_known_view], view[view >= settings.min_known_view]
    means = np.array([belief.mean for belief in beliefs])
    variances = _range_variances(solution, places, means, settings)
    slopes = _slopes(places, means, np.array([belief.rise for belief in beliefs]))
    rivals = [rival for belief in beliefs for rival in belief.rivals]
    telling = _telling(rivals, places, solution, settings)
    spreads = np.array([rival.spread for rival in rivals])
    covariances = np.array([belief.covariance for belief in beliefs])
    # Nothing is told apart yet: one factor a pair of rival places, lowered by each range.
    confused = np.ones(len(rivals))
    stations = np.array([s.pose.translation for s in solution.stations if s.pose]).reshape(-1, 2)
    found: list[Suggestion] = []
    while len(found) < count and len(places):
        # Next to a station the same walls and reflections spoil the range once more.
        near = np.linalg.norm(places[:, None] - stations[None], axis=2) < settings.shared_radius_m
        updated = _updated(covariances, slopes, variances * (1.0 + near.sum(axis=1))[:, None])
        before = float(_expected_error(covariances, confused, spreads))
        after = _expected_error(updated, telling * confused, spreads)
        best = int(np.argmin(after))
        found.append(Suggestion(places[best], before, float(after[best]), float(view[best])))
        covariances, confused = updated[best], confused * telling[best]
        stations = np.vstack([stations, places[best]])
    return tuple(found)


def _expected_error(
    covariances: FloatArray, confused: FloatArray, spreads: FloatArray
) -> FloatArray:
    """(...) m, root mean square over the anchors, of covariances (..., A, 2, 2) and doubts (..., R)."""
    variances = np.trace(covariances, axis1=-2, axis2=-1)
    doubt = confused @ spreads / variances.shape[-1]
    return np.asarray(np.sqrt(variances.mean(axis=-1) + doubt))


@dataclass(frozen=True, slots=True, eq=False)
class _Rival:
    """Two places of one anchor that the ranges do not tell apart yet."""

    one: Vector2
    other: Vector2
    rise: float
    """m, of the anchor above the tag."""
    spread: float
    """m^2, what this doubt adds to the anchor's variance."""


@dataclass(frozen=True, slots=True, eq=False)
class _Belief:
    """What is known of the place of one anchor."""

    mean: Vector2
    covariance: Matrix2
    rise: float
    """m, above the tag."""
    rivals: tuple[_Rival, ...]


def _beliefs(solution: Solution) -> list[_Belief]:
    """Of the anchors whose height is known and that anybody heard."""
    tags = list(solution.tag_heights.values())
    level = float(np.mean(tags)) if tags else 0.0
    found = []
    for anchor in solution.anchors:
        belief = _belief(anchor) or _ring_belief(anchor, solution)
        if belief is not None and anchor.height is not None:
            rise = anchor.height - level
            found.append(_Belief(*belief, rise, tuple(_rivals(anchor, rise))))
    return found


def _places_of(anchor: AnchorEstimate) -> tuple[Points, FloatArray]:
    """(K, 2) m, all places that are not excluded, and their shares of belief (K,)."""
    places = [np.array([other.x, other.y]) for other in anchor.alternatives]
    weights = [other.weight for other in anchor.alternatives]
    if anchor.position is not None:
        places.append(anchor.position)
        weights.append(max(1.0 - sum(weights), 1e-3))
    share = np.array(weights)
    return np.array(places).reshape(-1, 2), share / share.sum() if len(share) else share


def _belief(anchor: AnchorEstimate) -> tuple[Vector2, Matrix2] | None:
    """Mean of an anchor's places, and the covariance of one of them."""
    places, share = _places_of(anchor)
    if anchor.height is None or not len(places):
        return None
    covariance = _ONE_PLACE_M**2 * np.eye(2) if anchor.covariance is None else anchor.covariance
    if not np.isfinite(covariance).all():
        return None
    return share @ places, np.asarray(covariance) + 1e-8 * np.eye(2)


def _rivals(anchor: AnchorEstimate, rise: float) -> Iterator[_Rival]:
    places, share = _places_of(anchor)
    for i, j in combinations(range(len(places)), 2):
        apart = float(np.sum((places[i] - places[j]) ** 2))
        yield _Rival(places[i], places[j], rise, float(share[i] * share[j]) * apart)


def _telling(
    rivals: list[_Rival], places: Points, solution: Solution, settings: PlanningSettings
) -> FloatArray:
    """(N, R) how much confusion a range from each place leaves, 0-1.

    The Bhattacharyya coefficient of the two normal densities that the range would have.
    """
    left = np.ones((len(places), len(rivals)))
    for column, rival in enumerate(rivals):
        both = np.array([rival.one, rival.other])
        slant = np.hypot(np.linalg.norm(places[:, None] - both, axis=2), rival.rise)
        variance = _range_variances(solution, places, both, settings).max(axis=1)
        left[:, column] = np.exp(-((slant[:, 0] - slant[:, 1]) ** 2) / (8.0 * variance))
    return left


def _ring_belief(anchor: AnchorEstimate, solution: Solution) -> tuple[Vector2, Matrix2] | None:
    """Mean and covariance of an anchor that too few stations heard: on the rings round those that did.

    None for an anchor that nobody heard: nothing says where to look for it.
    """
    poses = {s.id: s.pose for s in solution.stations if s.pose is not None}
    heard = [
        (poses[link.station].translation, link.distance)
        for link in solution.links
        if link.anchor == anchor.id and link.station in poses and link.distance > 0.0
    ]
    if anchor.height is None or not heard:
        return None
    angles = np.linspace(0.0, 2.0 * np.pi, _ON_RING, endpoint=False)
    centre, radius = heard[0]
    ring = centre + radius * np.column_stack([np.cos(angles), np.sin(angles)])
    # Loose: walls make some ranges too long by decimetres.
    misfits = [(np.linalg.norm(ring - c, axis=1) - r) / _RING_SIGMA_M for c, r in heard[1:]]
    share = np.exp(-0.5 * np.sum(np.square(misfits), axis=0)) + 1e-9 * np.ones(_ON_RING)
    share /= share.sum()
    mean = share @ ring
    away = ring - mean
    return mean, (away * share[:, None]).T @ away + _RING_SIGMA_M**2 * np.eye(2)


def _slopes(places: Points, means: Points, rise: FloatArray) -> FloatArray:
    """(N, A, 2) change of the slant range from each place with the place of an anchor (A,) m above the tag."""
    away = means[None] - places[:, None]
    slant = np.sqrt((away**2).sum(axis=2) + rise**2)
    return np.asarray(away / np.maximum(slant, 1e-6)[:, :, None])


def _range_variances(
    solution: Solution, places: Points, means: Points, settings: PlanningSettings
) -> FloatArray:
    """(N, A) m^2, by how many walls of the plan the range would cross."""
    plan = solution.plan
    ends = np.array([wall.ends for wall in plan.walls] if plan else []).reshape(-1, 2, 2)
    walls = walls_between(ends, places, means)
    return np.asarray(settings.sight_sigma_m**2 + walls * settings.wall_sigma_m**2)


def _updated(covariances: FloatArray, slopes: FloatArray, variances: FloatArray) -> FloatArray:
    """(N, A, 2, 2) covariances (A, 2, 2) after one more range each (Kalman's update)."""
    gain = np.einsum("aij,naj->nai", covariances, slopes)
    total = np.einsum("nai,nai->na", slopes, gain) + variances
    lowered = gain[..., :, None] * gain[..., None, :] / total[..., None, None]
    return np.asarray(covariances[None] - lowered)
