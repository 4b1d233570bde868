"""A rotating scanner on a tripod: a scene and a place -> the samples of one recording."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..model.geometry import FloatArray, Pose2
from ..model.survey import Scan
from .scene import Scene
from .segments import cast_rays

_WOBBLE_PERIOD = 5.0
"""s between independent values of the motor's rate."""


@dataclass(frozen=True, slots=True)
class Lidar:
    """A Scanse Sweep as the paper used it (section IV), and the recordings taken with it."""

    rate: float = 500.0
    """Hz, samples (paper)."""
    rotation: float = 2.0
    """Hz, revolutions (paper)."""
    rotation_wobble: float = 0.005
    """Relative, standard deviation of the motor's rate over some seconds: each revolution hits new angles."""
    duration: float = 60.0
    """s a recording (paper: one minute)."""
    height: float = 1.3
    """m above the floor: chest height, over tables and below cupboards' tops (paper, section I.A)."""
    upper_duration: float = 10.0
    """s, the raised recording; 0 takes none."""
    upper_height: float = 2.5
    """m above the floor (paper: without furniture)."""
    noise: float = 0.015
    """m, standard deviation of a range, the part that does not grow."""
    noise_share: float = 0.005
    """Of the range, added to `noise`: the device's resolution falls with distance."""
    range_step: float = 0.01
    """m; the device gives centimetres. 0: exact."""
    angle_step: float = float(np.deg2rad(1.0 / 16.0))
    """rad; the device gives sixteenths of a degree. 0: exact."""
    max_range: float = 25.0
    """m; beyond it no return (the real devices' samples and data sheets end near there)."""
    dropout: float = 0.01
    """Share of samples without return whatever is there: dark, shiny or glancing surfaces."""
    passers_per_minute: float = 0.5
    """Expected number of persons who walk through a minute of recording."""
    passer_radius: float = 0.25
    """m, a person at chest height, seen as a disc."""
    passer_height: float = 1.8
    """m; a scanner above it sees nobody."""

    def __post_init__(self) -> None:
        for name in ("rate", "rotation", "duration", "max_range"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"{name} is {getattr(self, name)}, must be positive")

    @classmethod
    def noise_free(cls, duration: float = 60.0, upper_duration: float = 10.0) -> Lidar:
        """Exact samples on the walls, at the same angles in every revolution, nobody about."""
        return cls(
            duration=duration, upper_duration=upper_duration, rotation_wobble=0.0, noise=0.0, noise_share=0.0,
            range_step=0.0, angle_step=0.0, dropout=0.0, passers_per_minute=0.0,
        )  # fmt: skip


def record_scan(
    scene: Scene,
    world_T_station: Pose2,
    height: float,
    duration: float,
    lidar: Lidar,
    rng: np.random.Generator,
) -> Scan:
    """One recording.

    Args:
        scene: what there is to see.
        world_T_station: the scanner's place in the plan and the direction of its zero.
        height: m above the floor.
        duration: s; `duration` times `lidar.rate` samples.
        lidar: the device.
        rng: noise, dropouts and passers-by.

    Returns:
        Samples in recording order; NaN where there is no return.
    """
    times = np.arange(round(duration * lidar.rate)) / lidar.rate
    bearings = _bearings(times, lidar, rng)
    world = bearings + world_T_station.theta
    ranges = cast_rays(world_T_station.translation, world, scene.faces_at(height))
    if height < lidar.passer_height:
        ranges = np.minimum(ranges, _passers(times, world, lidar, rng))
    return Scan(
        _stepped(bearings, lidar.angle_step), _measured(ranges, lidar, rng), lidar.max_range
    )


def _bearings(times: FloatArray, lidar: Lidar, rng: np.random.Generator) -> FloatArray:
    """(N,) rad in [0, 2 pi): steady rotation plus the integral of the slow wobble of its rate."""
    # Rounded, so that every revolution of a steady motor gives the same floats.
    steady = np.mod(np.round(np.arange(len(times)) * (lidar.rotation / lidar.rate), 9), 1.0)
    knots = (
        np.arange(0.0, times[-1] + 2.0 * _WOBBLE_PERIOD, _WOBBLE_PERIOD)
        if len(times)
        else np.zeros(1)
    )
    rate_error = np.interp(times, knots, rng.normal(0.0, 1.0, len(knots))) * lidar.rotation_wobble
    turns = (
        np.round(steady, 9) + rng.uniform() + np.cumsum(rate_error) * (lidar.rotation / lidar.rate)
    )
    bearings: FloatArray = 2.0 * np.pi * np.mod(turns, 1.0)
    return bearings


def _passers(
    times: FloatArray, world: FloatArray, lidar: Lidar, rng: np.random.Generator
) -> FloatArray:
    """(N,) m to the nearest person along each ray; infinite where nobody is in it.

    Each walks a straight chord past the tripod; the nearer of wall and person is what the scanner sees, so a
    person behind a wall is nowhere and one in the room throws a shadow on what lies behind.
    """
    nearest = np.full(len(times), np.inf)
    for _ in range(rng.poisson(lidar.passers_per_minute * len(times) / lidar.rate / 60.0)):
        middle, direction = rng.uniform(0.0, len(times) / lidar.rate), rng.uniform(-np.pi, np.pi)
        speed, passing = rng.uniform(0.7, 1.4), rng.uniform(0.6, 2.0)
        along = speed * (times - middle)
        present = np.abs(along) < 4.0
        ahead = np.array([np.cos(direction), np.sin(direction)])
        places = along[present, None] * ahead + passing * np.array([-ahead[1], ahead[0]])
        rays = np.stack([np.cos(world[present]), np.sin(world[present])], axis=-1)
        towards = (places * rays).sum(axis=-1)
        inside = towards**2 - (places**2).sum(axis=-1) + lidar.passer_radius**2
        seen = (towards > 0) & (inside >= 0)
        hits = np.where(seen, towards - np.sqrt(np.maximum(inside, 0.0)), np.inf)
        nearest[present] = np.minimum(nearest[present], hits)
    return nearest


def _measured(ranges: FloatArray, lidar: Lidar, rng: np.random.Generator) -> FloatArray:
    """What the device makes of true ranges."""
    met = np.where(np.isfinite(ranges), ranges, 0.0)
    noisy = met + rng.normal(0.0, 1.0, len(ranges)) * (lidar.noise + lidar.noise_share * met)
    stepped = _stepped(noisy, lidar.range_step)
    lost = rng.uniform(size=len(ranges)) < lidar.dropout
    # Noise must not bring back what was out of reach, nor push a return beyond it.
    lost |= (ranges > lidar.max_range) | (stepped > lidar.max_range) | (stepped <= 0.0)
    return np.where(lost, np.nan, stepped)


def _stepped(values: FloatArray, step: float) -> FloatArray:
    return values if step == 0.0 else np.round(values / step) * step
