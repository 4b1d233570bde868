"""What one step hands to the next.

**Covariance convention, stated once:** order (x, y, theta), tangent space at the estimate,
expressed in the *source* station's axes: what ``BetweenFactorPose2(target, source, target_T_source,
noise)`` expects, so nothing is rotated on the way.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from .geometry import FloatArray, Matrix3, Points, Pose2, freeze_arrays
from .link_law import LinkModel
from .survey import Anchor, AnchorId, RangeOffset, Station, StationId

Progress = Callable[[str, int, int], None]
"""Called with (what is being done, how many done, how many in all)."""


def silent(_what: str, _done: int, _total: int) -> None:
    """Report nothing."""


_Item = TypeVar("_Item")
_Result = TypeVar("_Result")


class Kept(Generic[_Item]):
    """A large value that is at hand wherever work is done, and travels there once."""

    def __init__(self, value: _Item) -> None:
        self.value = value


class Share(Protocol):
    """Applies a function to items, here or in several processes: the results do not depend on where."""

    def __call__(
        self, function: Callable[[_Item], _Result], items: Sequence[_Item], /
    ) -> Iterator[_Result]:
        """The results in the order of the items. Function and items must be picklable."""

    def keep(self, value: _Item, /) -> Kept[_Item]:
        """The value for use in functions; the same object is sent only once."""


class _Alone:
    def __call__(
        self, function: Callable[[_Item], _Result], items: Sequence[_Item], /
    ) -> Iterator[_Result]:
        return map(function, items)

    def keep(self, value: _Item, /) -> Kept[_Item]:
        return Kept(value)


alone: Share = _Alone()
"""Shares nothing out."""


@dataclass(frozen=True, slots=True, eq=False)
class PreparedScan:
    """One scan reduced to one point an angle bin, with what matching and mapping need; scanner's frame."""

    station: StationId
    points: Points
    """(N, 2) m, ordered by bearing."""
    normals: Points
    """(N, 2) unit, towards the scanner; zero where there are too few neighbours for one."""
    normal_variance: FloatArray
    """(N,) variance of the wall's slope at the point; infinite where there is no normal."""
    lengths: FloatArray
    """(N,) m of wall that the point stands for (half the gaps to its neighbours, capped)."""
    on_wall: NDArray[np.bool_]
    """(N,) whether the point lies on a wall segment; clutter and furniture's edges do not."""
    segments: FloatArray
    """(S, 2, 2) m, wall segments as end points."""
    landmarks: Points
    """(L, 2) m, intersections of wall lines, virtual ones included (paper, Algorithm 2)."""
    free_ranges: FloatArray
    """(B,) m looked through in B equal sectors, sector k about bearing 2 pi (k + 0.5) / B - pi; 0 = unknown."""
    noise: float
    """m, standard deviation of a point's range after the reduction, seen in the scan itself."""

    def __post_init__(self) -> None:
        count = len(self.points)
        freeze_arrays(
            self, points=(None, 2), normals=(count, 2), normal_variance=(count,), lengths=(count,),
            segments=(None, 2, 2), landmarks=(None, 2), free_ranges=(None,),
        )  # fmt: skip
        freeze_arrays(self, np.bool_, on_wall=(count,))


@dataclass(frozen=True, slots=True, eq=False)
class ScanMatch:
    """One hypothesis of how two scans lie to each other."""

    target: StationId
    """Station m of matches.csv."""
    source: StationId
    """Station n of matches.csv."""
    target_T_source: Pose2
    covariance: Matrix3
    """(3, 3) in the source's axes; see the module docstring."""
    overlap: float
    """Share of the walls of both scans that the other one confirms, 0-1."""
    violation: float
    """Share of the walls of both scans that the other one looked through, 0-1."""
    score: float
    """Evidence: metres of wall confirmed minus weighted metres looked through; higher is better."""
    rank: int
    """0 is the pair's best."""
    degenerate: bool = False
    """True where the walls leave a direction free (a corridor's long axis)."""
    rejection: str | None = None
    """Why it is not used; None where it is."""

    def __post_init__(self) -> None:
        freeze_arrays(self, covariance=(3, 3))

    @property
    def ends(self) -> frozenset[StationId]:
        """Both stations, whichever was fitted to which."""
        return frozenset((self.target, self.source))


@dataclass(frozen=True, slots=True)
class LinkMeasurement:
    """All ranges of one station and one anchor as one measurement."""

    station: StationId
    anchor: AnchorId
    distance: float
    """m, slant; robust location of the samples; NaN where no sample is usable."""
    mean: float
    """m, plain average of the usable samples (the paper's averaged value)."""
    sigma: float
    """m; what the link's constant error deserves, not divided by the number of samples."""
    samples: int
    """How many were usable."""
    discarded: int = 0
    """How many were negative, non-finite, absurdly long or of another path."""
    residual: float = float("nan")
    """m, measured minus predicted: a range made long by a wall is positive. NaN before the solution."""
    walls: float = float("nan")
    """Expected number of walls crossed; NaN where unknown."""
    nlos_probability: float = float("nan")
    """0-1; NaN where unknown."""
    rejection: str | None = None
    """Why it is not used; None where it is."""

    @property
    def name(self) -> tuple[StationId, AnchorId]:
        """Which link it is."""
        return self.station, self.anchor


@dataclass(frozen=True, slots=True)
class AnchorLink:
    """All ranges between two anchors as one measurement."""

    anchor_a: AnchorId
    anchor_b: AnchorId
    distance: float
    """m, slant."""
    sigma: float
    """m."""


@dataclass(frozen=True, slots=True, eq=False)
class WallPieces:
    """Straight pieces of wall of the merged map, as far as radio is concerned; world frame.

    Doors are gaps. The two faces of one wall are pieces of two lines. Pieces of one line do not
    overlap; those that touch are one wall of which one part is more certain than the other.
    """

    ends: FloatArray
    """(P, 2, 2) m; whoever walks from the first end to the second has the room it was seen from on the left."""
    line: NDArray[np.int32]
    """(P,) number of the wall line that the piece belongs to."""
    probability: FloatArray
    """(P,) 0-1 that the piece blocks radio as a wall does; low for furniture."""

    def __post_init__(self) -> None:
        count = len(self.ends)
        freeze_arrays(self, ends=(None, 2, 2), probability=(count,))
        freeze_arrays(self, np.int32, line=(count,))


@dataclass(frozen=True, slots=True, eq=False)
class GraphProblem:
    """What the solvers of `graph` are given."""

    stations: tuple[Station, ...]
    """All of the survey, in its order; solvers do not look at their scans."""
    anchors: tuple[Anchor, ...]
    matches: tuple[ScanMatch, ...]
    """Those that hold together: rejection is None, at most one a pair."""
    placement: Mapping[StationId, Pose2]
    """world_T_station of the group that holds together, in the frame of its first station: the start."""
    links: tuple[LinkMeasurement, ...]
    anchor_links: tuple[AnchorLink, ...] = ()
    tag_offset: tuple[float, float] = (0.0, 0.0)
    range_offset: RangeOffset | None = None
    sequence: tuple[tuple[StationId, StationId], ...] | None = None
    link_model: LinkModel | None = None
    """How wrong ranges may be; only the sequential solver does without."""
