"""What the anchors hear of a tag that calls out: times of arrival and powers, along any path.

The errors are those of `radio`: a constant of each anchor, multipath of the place, delays of the walls
and the furniture in the way. What a wall does to one anchor is drawn once, so that a tag which stays
or comes back meets the same error; multipath and shadowing change over a fraction of a metre.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..model.geometry import FloatArray
from .radio import Device, Radio
from .scene import Scene
from .segments import crossing_fractions


@dataclass(frozen=True, slots=True)
class TagRadio:
    """A tag that calls out over UWB and Bluetooth, as the paper's hybrid system [4] has it."""

    rate: float = 2.0
    """Hz, calls."""
    synchronisation: float = 0.06
    """m, standard deviation of one anchor's clock at one call (0.2 ns, wired or well tracked anchors)."""
    multipath_length: float = 0.5
    """m over which multipath and shadowing forget: the tag is several wavelengths further."""
    power_at_one_metre: float = -59.0
    """dBm, of a Bluetooth beacon."""
    power_budget: float = 36.0
    """dB of loss beyond the first metre at which half of the Bluetooth calls are lost (-95 dBm)."""
    power_fading: float = 4.0
    """dB, of one call: channels and bodies."""
    power_step: float = 1.0
    """dB; receivers report whole ones."""


@dataclass(frozen=True, slots=True, eq=False)
class Reception:
    """What A anchors make of N calls; NaN where one heard nothing."""

    arrivals: FloatArray
    """(N, A) m, the speed of light times the time of arrival after the call."""
    powers: FloatArray
    """(N, A) dBm."""
    walls: NDArray[np.int64]
    """(N, A) crossed by the straight path."""


def receive(
    scene: Scene,
    tags: FloatArray,
    steps: FloatArray,
    devices: list[Device],
    radio: Radio,
    tag_radio: TagRadio,
    rngs: list[np.random.Generator],
) -> Reception:
    """Hear a tag at (N, 3) m; `steps` (N,) m says how far each place is from the one before (inf: another place).

    Args:
        scene: walls, furniture and anchors.
        tags: places of the calls.
        steps: metres walked since the call before.
        devices: one an anchor.
        radio: propagation, the same as for ranging.
        tag_radio: the tag.
        rngs: one an anchor, so that a further anchor changes nothing for the others.
    """
    heard = [
        _one_anchor(scene, tags, steps, anchor, device, radio, tag_radio, rng)
        for anchor, device, rng in zip(scene.anchors, devices, rngs, strict=True)
    ]
    arrivals, powers, walls = (np.stack(part, axis=1) for part in zip(*heard, strict=True))
    return Reception(arrivals, powers, walls)


def _one_anchor(
    scene: Scene,
    tags: FloatArray,
    steps: FloatArray,
    anchor: FloatArray,
    device: Device,
    radio: Radio,
    tag_radio: TagRadio,
    rng: np.random.Generator,
) -> tuple[FloatArray, FloatArray, NDArray[np.int64]]:
    """(N,) arrivals, powers and walls."""
    count = len(tags)
    distances = np.linalg.norm(tags - anchor, axis=1)
    delays, walls = _delays(scene, tags, anchor, radio, rng)
    multipath = radio.link_sigma * _correlated(steps, tag_radio.multipath_length, rng)
    shadowing = radio.shadowing * _correlated(steps, tag_radio.multipath_length, rng)
    loss = 20.0 * np.log10(np.maximum(distances, 1.0)) + walls * radio.wall_loss + shadowing
    margin = np.maximum(radio.budget - loss, 0.0)
    comes_through = (1.0 - radio.base_loss) * -np.expm1(-margin / radio.fading)
    # Half a range's jitter would do for one reception; the clocks' disagreement is the larger part.
    noise = np.hypot(radio.jitter, tag_radio.synchronisation) * rng.normal(size=count)
    arrivals = distances + device.delay + multipath + delays + noise
    arrivals[rng.uniform(size=count) > comes_through] = np.nan
    faded = loss + tag_radio.power_fading * rng.normal(size=count)
    powers = np.round((tag_radio.power_at_one_metre - faded) / tag_radio.power_step)
    powers *= tag_radio.power_step
    powers[faded > tag_radio.power_budget] = np.nan
    return arrivals, powers, walls


def _delays(
    scene: Scene, tags: FloatArray, anchor: FloatArray, radio: Radio, rng: np.random.Generator
) -> tuple[FloatArray, NDArray[np.int64]]:
    """(N,) m by which walls and furniture make the path longer, and how many walls it crosses."""
    ends = np.broadcast_to(anchor, tags.shape)
    scale = 1.0 / radio.wall_shape
    crossed = np.isfinite(crossing_fractions(tags[:, :2], ends[:, :2], scene.partitions))
    wall_delays = radio.wall_delay * scale * rng.gamma(radio.wall_shape, size=(crossed.shape[1],))
    shares = crossing_fractions(tags[:, :2], ends[:, :2], scene.furniture)
    heights = tags[:, 2:] + shares * (ends[:, 2:] - tags[:, 2:])
    blocked = heights < scene.furniture_heights  # NaN, where nothing is crossed, is not
    side_delays: FloatArray = (
        radio.furniture_delay * scale * rng.gamma(radio.wall_shape, size=(blocked.shape[1],))
    )
    # The piece nearest to the tag counts, once, as in a ranging link.
    if blocked.shape[1]:
        nearest = np.argmin(np.where(blocked, shares, np.inf), axis=1)
        furniture = np.where(blocked.any(axis=1), side_delays[nearest], 0.0)
    else:
        furniture = np.zeros(len(tags))
    return crossed @ wall_delays + furniture, crossed.sum(axis=1)


def _correlated(steps: FloatArray, length: float, rng: np.random.Generator) -> FloatArray:
    """(N,) of unit variance, whose correlation falls to 1/e over `length` m of path."""
    drawn: FloatArray = rng.normal(size=len(steps))
    kept = np.exp(-steps / length)
    for k in range(1, len(drawn)):
        drawn[k] = kept[k] * drawn[k - 1] + np.sqrt(1.0 - kept[k] ** 2) * drawn[k]
    return drawn
