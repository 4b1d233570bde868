"""A tag to be located with anchors whose places are known: what was heard of it, and where it truly was."""

from __future__ import annotations

from dataclasses import dataclass, field

from .geometry import Points, Vector2, freeze_arrays
from .survey import AnchorId


@dataclass(frozen=True, slots=True)
class TimeDifference:
    """One message of the tag as two anchors heard it (TDOA)."""

    anchor_a: AnchorId
    anchor_b: AnchorId
    difference: float
    """m, the speed of light times (arrival at a minus arrival at b); NaN is nothing measured."""


@dataclass(frozen=True, slots=True)
class ReceivedPower:
    """How strong one anchor heard the tag (RSS)."""

    anchor: AnchorId
    power: float
    """dBm; NaN is nothing measured."""


@dataclass(frozen=True, slots=True)
class Epoch:
    """Everything measured at one time; either kind may be missing."""

    time: float
    """s."""
    differences: tuple[TimeDifference, ...] = ()
    powers: tuple[ReceivedPower, ...] = ()


@dataclass(frozen=True, slots=True)
class PowerLaw:
    """Log-distance model of received power: `at_one_metre` - 10 `exponent` log10(distance / 1 m)."""

    at_one_metre: float
    """dBm."""
    exponent: float
    """2 in free space, 3 to 4 through the walls of a building."""
    sigma: float
    """dB, of what walls, bodies and fading add."""

    def __post_init__(self) -> None:
        if not self.sigma > 0.0:
            raise ValueError(f"sigma is {self.sigma}, must be positive")


@dataclass(frozen=True, slots=True)
class Stay:
    """The tag lay still at one place for some time."""

    id: str
    start: float
    """s, included."""
    end: float
    """s, not included."""


@dataclass(frozen=True, slots=True)
class TagRecording:
    """One tag, static at some places in turn or moving all the time."""

    name: str
    tag_height: float
    """m above the floor."""
    epochs: tuple[Epoch, ...]
    """In the order of time."""
    stays: tuple[Stay, ...] = ()
    """Empty for a tag that moves."""
    power_law: PowerLaw | None = None
    """None where no powers were measured."""
    anchor_heights: dict[AnchorId, float] = field(default_factory=dict)
    """m above the floor, where the recording states them."""


@dataclass(frozen=True, slots=True, eq=False)
class TagTruth:
    """Where the tag truly was; for evaluation only."""

    places: dict[str, Vector2]
    """(2,) m of each stay that the truth knows; empty for a path."""
    path: Points | None = None
    """(N, 2) m, corners of the path in order; None for static places."""

    def __post_init__(self) -> None:
        if self.path is not None:
            freeze_arrays(self, path=(None, 2))
