"""The sites by name."""

from __future__ import annotations

import re

import numpy as np

from ..model.errors import SlamUwbError
from .oblique import oblique
from .placing import NoPlaceError
from .random_floor import MAX_ROOMS, random_floor
from .rotunda import rotunda
from .scene import Scene, SceneBuilder
from .scenes import corridor, flat, paper_office, twin_rooms

_ATTEMPTS = 100


def build_scene(name: str, rng: np.random.Generator) -> Scene:
    """Draw one site; SlamUwbError where the name means none."""
    return _builder(name)(rng)


def _builder(name: str) -> SceneBuilder:
    floor = re.fullmatch(r"random-floor-(\d{1,4})", name)
    if floor and 1 <= int(floor[1]) <= MAX_ROOMS:
        return _patient(lambda rng: random_floor(rng, int(floor[1])))
    if name not in SCENES:
        known = ", ".join([*SCENES, f"random-floor-N (N rooms, 1 to {MAX_ROOMS})"])
        raise SlamUwbError(f"unknown scene {name!r}; there are: {known}")
    return SCENES[name]


def _patient(build: SceneBuilder) -> SceneBuilder:
    """Draw again where a drawing left no room for a station or anchor."""

    def build_until_it_fits(rng: np.random.Generator) -> Scene:
        for _ in range(_ATTEMPTS):
            try:
                return build(rng)
            except NoPlaceError:
                continue
        raise SlamUwbError(f"no drawing of {_ATTEMPTS} left room for every station and anchor")

    return build_until_it_fits


SCENES: dict[str, SceneBuilder] = {
    "paper-office": _patient(paper_office),
    "flat": _patient(flat),
    "corridor": _patient(corridor),
    "twin-rooms": _patient(twin_rooms),
    "oblique": _patient(oblique),
    "rotunda": _patient(rotunda),
}
"""Builders of the named sites; `random-floor-N` is a family and comes by `build_scene` alone."""
