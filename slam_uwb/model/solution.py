"""What is delivered: places with uncertainty and status, the map, and everything that led there."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum

from .floor import FloorMap, FloorPlan
from .geometry import FloatArray, Matrix2, Matrix3, Pose2, Vector2, freeze_arrays
from .products import LinkMeasurement, ScanMatch
from .settings import Settings
from .survey import AnchorId, Decision, Scan, StationId


class Status(StrEnum):
    """`ok`, or the reason why a value is not to be trusted."""

    OK = "ok"
    AMBIGUOUS = "ambiguous"
    """Other places explain the data nearly as well; place empty, candidates in alternatives.csv."""
    MIRROR_AMBIGUOUS = "mirror-ambiguous"
    """The mirror image across the line of stations is not excluded."""
    WEAK_GEOMETRY = "weak-geometry"
    """A place, but with a large covariance or an unmeasured height."""
    UNREACHABLE = "unreachable"
    """Heard from fewer than three stations."""
    DISCONNECTED = "disconnected"
    """Nothing holds it to the group that was solved."""


@dataclass(frozen=True, slots=True)
class Alternative:
    """Another place that the data do not exclude."""

    x: float
    y: float
    theta: float | None
    """rad; None for an anchor."""
    weight: float
    """Share of belief, 0-1."""


@dataclass(frozen=True, slots=True, eq=False)
class StationEstimate:
    """Where a tripod stood."""

    id: StationId
    pose: Pose2 | None
    """world_T_station; None where it could not be found."""
    covariance: Matrix3 | None
    """(3, 3) in the station's axes, order (x, y, theta)."""
    status: Status
    heading_known: bool = True
    """False where no scan and no survey fixes the heading: `yaw_deg` is then empty."""
    alternatives: tuple[Alternative, ...] = ()

    def __post_init__(self) -> None:
        if self.covariance is not None:
            freeze_arrays(self, covariance=(3, 3))


@dataclass(frozen=True, slots=True, eq=False)
class AnchorEstimate:
    """Where an anchor is."""

    id: AnchorId
    position: Vector2 | None
    """(2,) m in the world frame; None where it could not be found."""
    covariance: Matrix2 | None
    """(2, 2) m^2 in the world's axes."""
    height: float | None
    """m, as measured by hand (or estimated where nobody did)."""
    stations: int
    """How many stations' links were used."""
    status: Status
    alternatives: tuple[Alternative, ...] = ()

    def __post_init__(self) -> None:
        if self.position is not None:
            freeze_arrays(self, position=(2,))
        if self.covariance is not None:
            freeze_arrays(self, covariance=(2, 2))


@dataclass(frozen=True, slots=True)
class Bias:
    """An estimated constant of the ranges with its prior."""

    name: str
    mean: float
    """m."""
    sigma: float
    """m."""
    prior_mean: float
    prior_sigma: float


@dataclass(frozen=True, slots=True)
class SolverChecks:
    """How far the solver's answer can be confirmed by another way to it."""

    isam2_batch_gap: float
    """m, largest distance of a station or anchor from where iSAM2 and batch Levenberg-Marquardt have it."""
    other_starts_gap: float
    """m, the same to the best optimum that other starts of the anchors lead to; 0 where none is better."""
    iterations: int
    """Outer passes until nothing moved."""
    cost: float
    """Half the sum of squared whitened residuals at the solution."""


@dataclass(frozen=True, slots=True, eq=False)
class GraphEstimate:
    """What a solver of `graph` returns; every station and anchor of the problem has its entry."""

    stations: tuple[StationEstimate, ...]
    anchors: tuple[AnchorEstimate, ...]
    links: tuple[LinkMeasurement, ...]
    """Those of the problem with residual and rejection filled in."""
    frame: str
    """`site`, or the identifier of the station whose frame the world is."""
    biases: tuple[Bias, ...] = ()
    joint_names: tuple[str, ...] = ()
    """Order of the joint covariance: station identifiers (3 rows each), then anchors (2 rows each)."""
    joint_covariance: FloatArray | None = None
    """(M, M), stations in their own axes."""
    checks: SolverChecks | None = None

    @property
    def poses(self) -> dict[StationId, Pose2]:
        """world_T_station of the stations that have a place."""
        return {s.id: s.pose for s in self.stations if s.pose is not None}

    def with_links(self, links: tuple[LinkMeasurement, ...]) -> GraphEstimate:
        """The estimate with links whose use has changed, and the anchors' counts of them."""
        used = Counter(link.anchor for link in links if link.rejection is None)
        anchors = tuple(replace(anchor, stations=used[anchor.id]) for anchor in self.anchors)
        return replace(self, links=links, anchors=anchors)


@dataclass(frozen=True, slots=True)
class DecisionOutcome:
    """What became of something that a person decided."""

    decision: Decision
    effect: str
    """What was done."""
    contradiction: str | None = None
    """What in the data speaks against it; None where nothing does."""

    @property
    def warning(self) -> str | None:
        """One line that tells the contradiction; None where there is none."""
        if self.contradiction is None:
            return None
        d = self.decision
        decided = f"decisions.csv: {d.kind} {d.a}, {d.b}: {d.verdict}, {self.effect}"
        return f"{decided}, although {self.contradiction}"


@dataclass(frozen=True, slots=True)
class Move:
    """How the estimate of a station or anchor changed since an earlier solution."""

    kind: str
    """`station` or `anchor`."""
    id: str
    distance: float
    """m; NaN where the earlier or the present solution has no place for it."""
    before: float
    """m, one sigma along the longest axis in the earlier solution; NaN without a place."""
    after: float
    """m, the same now."""
    status_before: Status
    status_after: Status


@dataclass(frozen=True, slots=True)
class Continuation:
    """The earlier solution that this one continues, and what changed since."""

    checksum: str
    """Of the earlier survey."""
    added: tuple[StationId, ...]
    """Stations that are new."""
    seen_from: str | None
    """Station from which moves are seen where the two frames differ; None: the frame is the same."""
    moves: tuple[Move, ...]
    """Of all stations and anchors that the earlier solution lists."""


@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """Everything that `solve_survey` found."""

    survey_name: str
    checksum: str
    mode: str
    settings: Settings
    software_version: str
    frame: str
    """`site`, or the identifier of the station whose frame the world is."""
    stations: tuple[StationEstimate, ...]
    anchors: tuple[AnchorEstimate, ...]
    matches: tuple[ScanMatch, ...]
    """All hypotheses, the rejected too."""
    links: tuple[LinkMeasurement, ...]
    """All links, the rejected too."""
    biases: tuple[Bias, ...]
    joint_names: tuple[str, ...]
    joint_covariance: FloatArray | None
    checks: SolverChecks | None
    floor_map: FloorMap | None
    scans: Mapping[StationId, Scan]
    """Reduced to one sample an angle bin: enough to draw and to continue from."""
    tag_offset: tuple[float, float] = (0.0, 0.0)
    warnings: tuple[str, ...] = ()
    tag_heights: Mapping[StationId, float] = field(default_factory=dict)
    """m above the floor, of the stations whose tag's height is known."""
    plan: FloorPlan | None = None
    alignment: Pose2 | None = None
    """aligned_T_world where the frame was moved (`--align`) from that of station `frame`."""
    decisions: tuple[DecisionOutcome, ...] = ()
    """What became of the survey's decisions.csv."""
    picture: FloorMap | None = None
    """The picture that the frame was aligned to, in that frame; darkness in place of occupancy."""
    continued: Continuation | None = None
    """None where everything was solved from scratch."""
