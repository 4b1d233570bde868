"""UWB ranging between the tripod's tag and the anchors: where both stand -> what the device reports.

The propagation is the simulator's own and shares nothing with any estimator.

Where the numbers come from: the links behind the surveys ``kolakowski-flat`` (36 EVK1000 links, Kolakowski &
Modelski, MIKON 2018) and ``lias-hall`` (H. Jiang, 2023), and the study of joint solvers that was fitted to them.
A link hardly varies (2-3 cm) but has a constant error: median +0.22 m in line of sight, by anchor 0.09-0.31 m;
+0.35 m behind furniture; +0.90 m and up to 3.1 m where no direct path exists.

**The parameters of the link error are these figures, written down once. They are never to be tuned to an
estimator's result.**
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..model.geometry import FloatArray, Points
from .scene import Scene
from .segments import crossing_fractions

SPEED_OF_LIGHT = 299_792_458.0
"""m/s."""


@dataclass(frozen=True, slots=True)
class Radio:
    """An uncalibrated pair of UWB transceivers and the walls' effect on it."""

    rate: float = 10.0
    """Hz, exchanges in all, shared by the anchors that answer (paper: 10 Hz, 7 anchors, about 100 each)."""
    duration: float = 60.0
    """s a station (paper: one minute)."""
    tag_height: float = 1.4
    """m above the floor: the tag rides on top of the scanner."""
    tag_offset: tuple[float, float] = (0.0, 0.0)
    """m, the antenna in the scanner's frame."""
    jitter: float = 0.025
    """m, standard deviation within a link (both surveys: 2-3 cm)."""
    range_step: float = 0.001
    """m; the device reports millimetres. 0: exact."""
    offset: float = 0.18
    """m, common to all links: antenna delays nobody calibrated (lias-hall 0.185; the joint study's b)."""
    anchor_sigma: float = 0.05
    """m, an anchor's own delay: lias-hall spreads over 0.09-0.31 m, about +-2 standard deviations of 8 anchors."""
    link_sigma: float = 0.07
    """m, the rest in line of sight, multipath at both ends (the joint study's LOS sigma)."""
    wall_delay: float = 0.40
    """m, mean of one wall's delay; two to three walls give the 0.9 m of links without direct path."""
    wall_shape: float = 1.3
    """Gamma shape of it: near exponential, so that a few links have the 3 m seen in the real ones."""
    furniture_delay: float = 0.13
    """m, mean where furniture is in the way and no wall need be: 0.35 m against 0.22 m; the same shape."""
    budget: float = 34.0
    """dB of loss beyond that of the first metre which the receiver bears: 50 m in line of sight."""
    wall_loss: float = 7.0
    """dB a wall, between plasterboard (3-4 dB) and brick (10 dB): three walls within a flat are about the end."""
    shadowing: float = 3.0
    """dB, standard deviation of a link's loss: furniture, frames, angles."""
    fading: float = 3.0
    """dB of margin over which lost exchanges fall to 1/e: weak links lose most, strong ones none."""
    base_loss: float = 0.02
    """Share of exchanges lost on the best link: collisions."""
    clock_error: float = 20e-6
    """Relative, each device's clock is up to this much fast or slow (IEEE 802.15.4 allows 20 ppm)."""
    reply_time: float = 300e-6
    """s between reception and answer: one frame and its processing (some hundred microseconds)."""
    reply_asymmetry: float = 1e-6
    """s by which tag and anchor differ in it at most: 3 mm at 40 ppm between the clocks (paper, eq. 3)."""

    def __post_init__(self) -> None:
        for name in ("rate", "duration", "wall_shape", "reply_time"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"{name} is {getattr(self, name)}, must be positive")

    @classmethod
    def noise_free(cls, duration: float = 60.0) -> Radio:
        """Every exchange of every link heard, true slant distances, perfect clocks."""
        return cls(
            duration=duration, jitter=0.0, range_step=0.0, offset=0.0, anchor_sigma=0.0, link_sigma=0.0,
            wall_delay=0.0, furniture_delay=0.0, budget=np.inf, base_loss=0.0, clock_error=0.0,
        )  # fmt: skip


@dataclass(frozen=True, slots=True)
class Device:
    """What one transceiver adds to everything it takes part in."""

    delay: float
    """m, over the common offset."""
    clock_error: float
    """Relative; positive is fast."""


@dataclass(frozen=True, slots=True)
class LinkTruth:
    """What makes one link what it is, constant for as long as tripod and anchor stand still."""

    distance: float
    """m, slant, between the antennas."""
    walls: int
    """Crossed by the straight path."""
    error: float
    """m, constant."""
    success: float
    """Share of exchanges that come through; 0 is a link that is never heard."""


def draw_device(radio: Radio, rng: np.random.Generator) -> Device:
    """An anchor, or the tag (whose delay is part of the common offset)."""
    return Device(radio.anchor_sigma * rng.normal(), radio.clock_error * rng.uniform(-1.0, 1.0))


def walls_crossed(scene: Scene, tags: Points, anchors: Points) -> NDArray[np.int64]:
    """(N,) number of walls between each (N, 2) tag and (N, 2) anchor; openings count nothing up to the ceiling.

    A path over a door meets the lintel at most with its lower half and goes round it for centimetres.
    """
    walls: NDArray[np.int64] = np.isfinite(crossing_fractions(tags, anchors, scene.partitions)).sum(
        axis=1
    )
    return walls


def furniture_crossed(scene: Scene, tag: FloatArray, anchor: FloatArray) -> bool:
    """True where the path from tag (3,) to anchor (3,) m, inclined as it is, runs through furniture."""
    shares = crossing_fractions(tag[None, :2], anchor[None, :2], scene.furniture)[0]
    return bool(np.any(tag[2] + shares * (anchor[2] - tag[2]) < scene.furniture_heights))


def draw_link(
    scene: Scene,
    tag: FloatArray,
    anchor: FloatArray,
    device: Device,
    radio: Radio,
    rng: np.random.Generator,
) -> LinkTruth:
    """The constants of one link between the antennas at `tag` and `anchor`, (3,) m."""
    distance = float(np.linalg.norm(anchor - tag))
    walls = int(walls_crossed(scene, tag[None, :2], anchor[None, :2])[0])
    error = radio.offset + device.delay + radio.link_sigma * rng.normal()
    loss = (
        20.0 * np.log10(max(distance, 1.0))
        + walls * radio.wall_loss
        + radio.shadowing * rng.normal()
    )
    scale = 1.0 / radio.wall_shape
    error += radio.wall_delay * scale * float(rng.gamma(radio.wall_shape, size=walls).sum())
    if furniture_crossed(scene, tag, anchor):
        error += radio.furniture_delay * scale * float(rng.gamma(radio.wall_shape))
    margin = max(radio.budget - loss, 0.0)
    return LinkTruth(
        distance, walls, error, float((1.0 - radio.base_loss) * -np.expm1(-margin / radio.fading))
    )


def count_exchanges(links: list[LinkTruth], radio: Radio) -> int:
    """Exchanges tried with each anchor at one station: the tag asks in turn those that ever answer."""
    return round(radio.rate * radio.duration) // max(1, sum(link.success > 0 for link in links))


def sample_ranges(
    link: LinkTruth, tries: int, radio: Radio, rng: np.random.Generator
) -> FloatArray:
    """(K,) m, the distances that came through out of `tries`."""
    count = rng.binomial(tries, link.success)
    distances: FloatArray = link.distance + link.error + radio.jitter * rng.normal(size=count)
    return (
        distances
        if radio.range_step == 0.0
        else np.round(distances / radio.range_step) * radio.range_step
    )


def sample_periods(
    link: LinkTruth, tries: int, tag: Device, anchor: Device, radio: Radio, rng: np.random.Generator
) -> FloatArray:
    """(K, 4) s, T1..T4 of the exchanges that came through, each by its device's clock (paper, Fig. 3, eq. 1)."""
    count = rng.binomial(tries, link.success)
    flight = (link.distance + link.error) / SPEED_OF_LIGHT
    replies = radio.reply_time + radio.reply_asymmetry * rng.uniform(-0.5, 0.5, (2, count))
    # Only receptions are uncertain. The tag's one counts twice in eq. 2, so jitter = sqrt(4 + 1 + 1) / 4 stamps.
    stamp_sigma = radio.jitter / SPEED_OF_LIGHT * 4.0 / np.sqrt(6.0)
    poll, response, final = stamp_sigma * rng.normal(size=(3, count))
    anchor_reply, tag_reply = replies
    periods = [
        (2 * flight + anchor_reply + response) * (1 + tag.clock_error),
        (anchor_reply - poll) * (1 + anchor.clock_error),
        (tag_reply - response) * (1 + tag.clock_error),
        (2 * flight + tag_reply + final) * (1 + anchor.clock_error),
    ]
    return np.stack(periods, axis=-1)
