"""What a person decided about pairs of scans: obeyed, and told where the scans say otherwise."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..model.geometry import Pose2
from ..model.products import ScanMatch
from ..model.settings import MatchingSettings
from ..model.solution import DecisionOutcome
from ..model.survey import Decision, StationId
from .agreement import placed, same_place
from .hypotheses import describe_match
from .index import ScanIndex
from .pairs import Pair
from .refiners import REFINERS

DROPPED = "dropped by decisions.csv"
_GUESS_SIGMA = np.array([0.1, 0.1, 0.05])
"""m, m, rad: of a fit by hand that the scans cannot improve."""
_BASIN_M, _BASIN_RAD = 1.0, 0.35
"""A refined guess that ends further away is another place than the one guessed."""
_LOOKED_THROUGH = 0.05
"""Share of walls looked through from which on a pose is wrong; right ones of real flats have 0.003."""


@dataclass(frozen=True, slots=True, eq=False)
class DecidedPairs:
    """Pairs and hypotheses as the decisions leave them."""

    pairs: tuple[Pair, ...]
    """Those that may be used."""
    hypotheses: tuple[ScanMatch, ...]
    """Of these pairs."""
    firm: tuple[ScanMatch, ...]
    """What must be used: kept or guessed."""
    dropped: tuple[ScanMatch, ...]
    """Hypotheses of dropped pairs, with that reason."""


def decide_pairs(
    decisions: Sequence[Decision],
    pairs: Sequence[Pair],
    hypotheses: Sequence[ScanMatch],
    scans: Mapping[StationId, ScanIndex],
    settings: MatchingSettings,
) -> DecidedPairs:
    """Take dropped pairs out, and make one firm match of each pair that is kept or guessed.

    A kept pair is the hypothesis nearest to the pose given with it, or its best one; a guess is
    refined, and taken as it is where that leads elsewhere or finds no wall in common.
    """
    chosen = [d for d in decisions if d.kind == "pair"]
    drops = {frozenset((d.a, d.b)) for d in chosen if d.verdict == "drop"}
    firm = [_firm_match(d, hypotheses, scans, settings) for d in chosen if d.verdict != "drop"]
    matches = tuple(match for match in firm if match is not None)
    known = {frozenset(pair) for pair in pairs}
    further = [(m.target, m.source) for m in matches if m.ends not in known]
    return DecidedPairs(
        pairs=(*(pair for pair in pairs if frozenset(pair) not in drops), *further),
        hypotheses=tuple(h for h in hypotheses if h.ends not in drops),
        firm=matches,
        dropped=tuple(replace(h, rejection=DROPPED) for h in hypotheses if h.ends in drops),
    )


def review_pairs(
    decisions: Sequence[Decision],
    decided: DecidedPairs,
    placement: Mapping[StationId, Pose2],
    settings: MatchingSettings,
) -> tuple[DecisionOutcome, ...]:
    """What became of each decision about a pair, and what in the scans speaks against it.

    Args:
        decisions: all of the survey.
        decided: what `decide_pairs` made of them.
        placement: world_T_station of the stations that hold together.
        settings: evidence that a match needs.
    """
    return tuple(
        _review_drop(decision, decided, placement)
        if decision.verdict == "drop"
        else _review_firm(decision, decided, placement, settings)
        for decision in decisions
        if decision.kind == "pair"
    )


def _firm_match(
    decision: Decision,
    hypotheses: Sequence[ScanMatch],
    scans: Mapping[StationId, ScanIndex],
    settings: MatchingSettings,
) -> ScanMatch | None:
    """The match that a decision asks for; None where a scan is missing, or nothing was found to keep."""
    target, source = StationId(decision.a), StationId(decision.b)
    pose = decision.guess
    if target not in scans or source not in scans:
        return None
    found = [h for h in hypotheses if h.ends == {target, source}]
    if found and found[0].target != target:
        # A pair is the same pair either way round.
        target, source = source, target
        pose = None if pose is None else pose.inverse()
    if decision.verdict == "keep":
        near = [h for h in found if pose is None or same_place(h.target_T_source, pose)]
        if near or pose is None:
            return min(near, key=lambda h: h.rank, default=None)
    assert pose is not None  # noqa: S101 - a guess has one, and a kept pair came here with one
    return _refined_guess(pose, scans[target], scans[source], settings)


def _refined_guess(
    guess: Pose2, target: ScanIndex, source: ScanIndex, settings: MatchingSettings
) -> ScanMatch:
    refine = REFINERS[settings.refiner]
    refined = refine(target, source, guess.vector[None, :], settings)
    for pose, settled in zip(refined.poses, refined.converged, strict=True):
        match = describe_match(target, source, pose, 0, settings)
        if (
            settled
            and match.score >= settings.min_evidence_m
            and same_place(match.target_T_source, guess, _BASIN_M, _BASIN_RAD)
        ):
            return match
    by_hand = describe_match(target, source, guess.vector, 0, settings)
    return replace(by_hand, covariance=np.diag(_GUESS_SIGMA**2), degenerate=False)


def _review_drop(
    decision: Decision, decided: DecidedPairs, placement: Mapping[StationId, Pose2]
) -> DecisionOutcome:
    ends = {decision.a, decision.b}
    dropped = [h for h in decided.dropped if h.ends == ends]
    agreeing = [
        h for h in dropped if same_place(h.target_T_source, placed(h.target, h.source, placement))
    ]
    if not dropped:
        return DecisionOutcome(decision, "nothing to drop: the pair had no match")
    contradiction = None
    if agreeing:
        share = f"{100.0 * agreeing[0].overlap:.0f} %"
        contradiction = (
            f"one of its matches agrees with the map of all the others (overlap {share})"
        )
    return DecisionOutcome(decision, "not used", contradiction)


def _review_firm(
    decision: Decision,
    decided: DecidedPairs,
    placement: Mapping[StationId, Pose2],
    settings: MatchingSettings,
) -> DecisionOutcome:
    ends = {decision.a, decision.b}
    match = next((m for m in decided.firm if m.ends == ends), None)
    if match is None:
        return DecisionOutcome(
            decision, "not used", "no match was found that could be kept, or a scan is missing"
        )
    if not ends <= placement.keys():
        return DecisionOutcome(decision, "used, but not in the largest group of stations")
    return DecisionOutcome(decision, "used", "; ".join(_doubts(match, placement, settings)) or None)


def _doubts(
    match: ScanMatch, placement: Mapping[StationId, Pose2], settings: MatchingSettings
) -> Iterator[str]:
    if match.violation > _LOOKED_THROUGH:
        yield f"the scans look through {100.0 * match.violation:.0f} % of each other's walls there"
    elif match.score < settings.min_evidence_m:
        yield "the scans have no wall in common there"
    elsewhere = placement[match.target].inverse() @ placement[match.source]
    if not same_place(match.target_T_source, elsewhere):
        away = match.target_T_source.distance_to(elsewhere)
        yield f"the other matches put it {away:.2f} m away"
