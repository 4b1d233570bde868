"""What a person decided about links: obeyed, and told where the ranges say otherwise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ..model.products import LinkMeasurement
from ..model.solution import DecisionOutcome
from ..model.survey import Decision

DROPPED = "dropped by decisions.csv"
_FITS_SIGMAS = 2.0
"""A dropped link whose residual is within so many of its sigmas agrees with all the others."""


def decide_links(
    links: Sequence[LinkMeasurement], decisions: Sequence[Decision]
) -> tuple[LinkMeasurement, ...]:
    """The links, the dropped ones with that reason: no solver uses a link that has one."""
    dropped = {(d.a, d.b) for d in decisions if d.kind == "link" and d.verdict == "drop"}
    return tuple(
        replace(link, rejection=DROPPED) if (link.station, link.anchor) in dropped else link
        for link in links
    )


def keep_links(
    links: Sequence[LinkMeasurement], decisions: Sequence[Decision]
) -> tuple[LinkMeasurement, ...]:
    """The solved links; one that was kept is used even where the solution calls it a fault.

    It takes part in the solution in any case, with the weight that its own error leaves it.
    """
    kept = {(d.a, d.b) for d in decisions if d.kind == "link" and d.verdict == "keep"}
    return tuple(
        replace(link, rejection=None)
        if (link.station, link.anchor) in kept and _judged(link)
        else link
        for link in links
    )


def review_links(
    decisions: Sequence[Decision], solved: Sequence[LinkMeasurement]
) -> tuple[DecisionOutcome, ...]:
    """What became of each decision about a link; `solved` as the solver left it, before `keep_links`."""
    by_name = {(str(link.station), str(link.anchor)): link for link in solved}
    return tuple(
        _review(decision, by_name.get((decision.a, decision.b)))
        for decision in decisions
        if decision.kind == "link"
    )


def _judged(link: LinkMeasurement) -> bool:
    """Whether a link took part, both of its ends being placed."""
    return link.samples > 0 and link.residual == link.residual


def _review(decision: Decision, link: LinkMeasurement | None) -> DecisionOutcome:
    if link is None or link.samples == 0:
        return DecisionOutcome(decision, "not used", "there is no usable range")
    if decision.verdict == "drop":
        fits = abs(link.residual) <= _FITS_SIGMAS * link.sigma
        contradiction = f"it agrees with the others: residual {link.residual:+.2f} m"
        return DecisionOutcome(decision, "not used", contradiction if fits else None)
    if not _judged(link):
        return DecisionOutcome(decision, "not used", link.rejection)
    return DecisionOutcome(decision, "used", link.rejection)
