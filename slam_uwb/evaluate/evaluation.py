"""What an evaluation says: one record an item, and their summaries."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..model.geometry import Pose2
from ..model.solution import Status

Alignment = Literal["site", "stations", "anchors", "both", "unaligned", "none"]
"""What fixed the reference's frame: `site` needs nothing, `unaligned` took it as given, `none`: nothing could."""
AlignOn = Literal["auto", "stations", "anchors", "both", "unaligned"]
"""What to align on; `auto`: nothing in a site frame, else the stations, else the anchors."""

_NAN = float("nan")


@dataclass(frozen=True, slots=True)
class ItemEvaluation:
    """One station or anchor; errors are estimate minus reference, in the reference's frame."""

    id: str
    status: Status
    placed: bool
    """The solution gives a place (which its status may call untrustworthy)."""
    referenced: bool
    """The reference knows the place, x and y."""
    dx: float = _NAN
    """m; NaN where one of the two places is not known."""
    dy: float = _NAN
    """m."""
    error: float = _NAN
    """m, the length of (dx, dy)."""
    heading_error: float = _NAN
    """rad in (-pi, pi]; NaN for an anchor, and where one of the two headings is not known."""
    nees: float = _NAN
    """Normalised estimation error squared; NaN where no usable covariance exists."""
    nees_dof: int = 0
    """Its degrees of freedom: 2, or 3 with a heading; 0 without NEES."""


@dataclass(frozen=True, slots=True)
class ErrorSummary:
    """Summary of some errors; NaN where there is none."""

    count: int
    rmse: float
    median: float
    max: float

    @classmethod
    def of(cls, errors: Sequence[float]) -> ErrorSummary:
        """Of those errors that are not NaN; signs do not count."""
        known = np.abs(np.asarray(errors, dtype=np.float64))
        known = known[~np.isnan(known)]
        if not len(known):
            return cls(0, _NAN, _NAN, _NAN)
        rmse = float(np.sqrt(np.mean(known**2)))
        return cls(len(known), rmse, float(np.median(known)), float(np.max(known)))


@dataclass(frozen=True, slots=True)
class GroupEvaluation:
    """All stations, or all anchors."""

    items: tuple[ItemEvaluation, ...]
    """In the solution's order."""
    absent: tuple[str, ...] = ()
    """Names that the reference knows and the solution does not have: another survey's reference?"""

    @property
    def expected(self) -> int:
        """How many should have a place: those that the reference knows."""
        return sum(item.referenced for item in self.items) + len(self.absent)

    @property
    def unplaced(self) -> int:
        """How many of the expected have none."""
        return self.expected - sum(item.referenced and item.placed for item in self.items)

    @property
    def without_reference(self) -> int:
        """How many of the solution cannot be judged since the reference does not know them."""
        return sum(not item.referenced for item in self.items)

    @property
    def not_ok(self) -> tuple[tuple[str, Status], ...]:
        """Name and status of every item that is not `ok`."""
        return tuple((item.id, item.status) for item in self.items if item.status is not Status.OK)

    @property
    def ok_errors(self) -> ErrorSummary:
        """m, of those with status `ok`."""
        return ErrorSummary.of([item.error for item in self._ok])

    @property
    def placed_errors(self) -> ErrorSummary:
        """m, of all that have a place."""
        return ErrorSummary.of([item.error for item in self.items])

    @property
    def ok_heading_errors(self) -> ErrorSummary:
        """rad, of those with status `ok`."""
        return ErrorSummary.of([item.heading_error for item in self._ok])

    @property
    def ok_nees(self) -> tuple[float, int]:
        """Sums of the NEES of the `ok` ones and of its degrees of freedom, ideally equal."""
        scored = [item for item in self._ok if item.nees_dof]
        return sum(item.nees for item in scored), sum(item.nees_dof for item in scored)

    @property
    def _ok(self) -> list[ItemEvaluation]:
        return [item for item in self.items if item.status is Status.OK]


@dataclass(frozen=True, slots=True)
class Evaluation:
    """A solution scored against its reference."""

    survey_name: str
    mode: str
    alignment: Alignment
    reference_T_world: Pose2 | None
    """Maps the solution into the reference's frame; None where nothing fixes it: no errors then."""
    stations: GroupEvaluation
    anchors: GroupEvaluation
