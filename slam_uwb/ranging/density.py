"""How wrong a range is: the density of a link's error, given how many walls it may cross.

The error (measured minus true distance minus offsets) is a constant of the link. In line of sight it
is Gaussian with a few reflections; every wall adds a gamma-distributed delay, so n walls give a
Gaussian convolved with a gamma density; and a few links are simply wrong, too short or too long. A
link whose number of walls is known only by probabilities has the mixture.

The densities are computed by Fourier transform of their characteristic functions, once a parameter
set, and read from one cubic spline: value, slope and curvature belong to the same function, so
optimisers that take different ways end in the same place.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ..model.geometry import FloatArray

MAX_WALLS = 4
"""More walls than this are not told apart: hardly a range comes through."""

_STEP_M = 0.02
_SHORTEST_M, _NODES = -8.0, 4096  # one period of 82 m: no tail of a wall reaches round it
_LONGEST_M = 40.0

_REFLECTION_M = 0.3  # mean delay of a reflection in line of sight (study)
# Faults: half of them near (a poor place of the antenna), half anywhere (Cauchy: 30 m are no more
# absurd than 10 m), to either side.
_NEAR_FAULTS, _NEAR_SIGMAS, _FAULT_SCALE_M = 0.5, 3.0, 1.0


@dataclass(frozen=True, slots=True)
class ErrorParameters:
    """What the density of a link's error depends on."""

    sight_sigma: float = 0.09
    """m, of the constant error of a link in line of sight."""
    wall_delay: float = 0.40
    """m, mean delay a wall."""
    wall_shape: float = 1.3
    """Shape of the gamma density of one wall's delay."""
    reflected_share: float = 0.08
    """Share of the links in line of sight that a reflection makes longer."""
    fault_share: float = 0.02
    """Share of links that are wrong, to either side."""


@dataclass(frozen=True, slots=True, eq=False)
class ErrorTable:
    """Densities of the error in line of sight and behind 1 to `MAX_WALLS` walls."""

    parameters: ErrorParameters
    coefficients: FloatArray
    """(C, W, 4) of the cubic in each cell, highest power first; W = MAX_WALLS + 1."""

    def densities(self, errors: FloatArray) -> FloatArray:
        """(..., W) densities of errors (...,), 1/m."""
        cell, t = self._cell(errors)
        c3, c2, c1, c0 = np.moveaxis(self.coefficients[cell], -1, 0)
        t = t[..., None]
        return np.asarray((((c3 * t + c2) * t + c1) * t + c0) * (cell >= 0)[..., None])

    def mixture(self, errors: FloatArray, walls: FloatArray) -> FloatArray:
        """(...,) density of errors (...,) where all links have the same probabilities of walls (W,)."""
        cell, t = self._cell(errors)
        c3, c2, c1, c0 = np.einsum("cwk,w->kc", self.coefficients, walls)
        value = ((c3[cell] * t + c2[cell]) * t + c1[cell]) * t + c0[cell]
        return np.asarray(value * (cell >= 0))

    def mixtures(
        self, errors: FloatArray, walls: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Density, slope and curvature, each (...,), of errors (...,) with probabilities of walls (..., W)."""
        cell, t = self._cell(errors)
        mixed = np.einsum("...wk,...w->...k", self.coefficients[cell], walls)
        mixed *= (cell >= 0)[..., None]
        c3, c2, c1, c0 = np.moveaxis(mixed, -1, 0)
        return (
            ((c3 * t + c2) * t + c1) * t + c0,
            (3.0 * c3 * t + 2.0 * c2) * t + c1,
            6.0 * c3 * t + 2.0 * c2,
        )

    def _cell(self, errors: FloatArray) -> tuple[NDArray[np.intp], FloatArray]:
        """The cell of each error, -1 outside of the table, and m from the cell's start."""
        place = (errors - _SHORTEST_M) / _STEP_M
        inside = (place >= 0.0) & (place < len(self.coefficients))
        cell = np.where(inside, place, -1.0).astype(np.intp)
        return cell, np.where(inside, place - cell, 0.0) * _STEP_M


@lru_cache(maxsize=16)
def error_table(parameters: ErrorParameters) -> ErrorTable:
    """The table of one parameter set (1 ms; the last few are kept)."""
    frequency = 2.0 * np.pi * np.fft.rfftfreq(_NODES, _STEP_M)
    gauss = np.exp(-0.5 * (parameters.sight_sigma * frequency) ** 2)
    reflection = 1.0 / (1.0 + 1j * frequency * _REFLECTION_M)
    scale = parameters.wall_delay / parameters.wall_shape
    delay = (1.0 + 1j * frequency * scale) ** (-parameters.wall_shape)
    reflected = parameters.reflected_share
    sight = gauss * (1.0 - reflected + reflected * reflection)
    delayed = gauss * np.cumprod(np.broadcast_to(delay, (MAX_WALLS, len(delay))), axis=0)
    spectra = np.vstack([sight, delayed]) * np.exp(1j * frequency * _SHORTEST_M)
    # The samples of a cubic B-spline are its weights smoothed by (1, 4, 1) / 6: undone in the spectrum.
    smoothing = (2.0 + np.cos(frequency * _STEP_M)) / 3.0
    count = round((_LONGEST_M - _SHORTEST_M) / _STEP_M)
    periods = np.fft.irfft(spectra / smoothing, _NODES, axis=1).T / _STEP_M
    weights = np.vstack([periods[-1:], periods[: count + 2]])
    return ErrorTable(parameters, np.ascontiguousarray(_cubics(weights)))


def _cubics(weights: FloatArray) -> FloatArray:
    """(C, W, 4) cubics in m, highest power first, of the cells between the weights (C + 3, W) of B-splines."""
    b0, b1, b2, b3 = (weights[k : len(weights) - 3 + k] for k in range(4))
    return np.stack(
        [
            (b3 - b0 + 3.0 * (b1 - b2)) / (6.0 * _STEP_M**3),
            (b0 - 2.0 * b1 + b2) / (2.0 * _STEP_M**2),
            (b2 - b0) / (2.0 * _STEP_M),
            (b0 + 4.0 * b1 + b2) / 6.0,
        ],
        axis=-1,
    )


def fault_density(
    errors: FloatArray, parameters: ErrorParameters
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Density of a faulty link's error (...,), its slope and curvature; symmetric, with far tails."""
    sigma = _NEAR_SIGMAS * parameters.sight_sigma
    square = (errors / sigma) ** 2
    near = _NEAR_FAULTS / (math.sqrt(2.0 * math.pi) * sigma) * np.exp(-0.5 * square)
    inverse = 1.0 / (_FAULT_SCALE_M**2 + errors**2)
    far = (1.0 - _NEAR_FAULTS) * _FAULT_SCALE_M / math.pi * inverse
    slope = -near * errors / sigma**2 - 2.0 * far * errors * inverse
    curvature = near * (square - 1.0) / sigma**2 + far * inverse * (8.0 * errors**2 * inverse - 2.0)
    return near + far, slope, curvature


@dataclass(frozen=True, slots=True, eq=False)
class LinkDensity:
    """The density of the error of each of L links."""

    table: ErrorTable
    walls: FloatArray
    """(..., L, W) probability of 0, 1, ... walls on each link."""
    weights: FloatArray
    """(..., L) how much each link counts, 0-1: links that share one error count as one together."""

    def costs(self, errors: FloatArray) -> FloatArray:
        """(..., L) negative log likelihood of errors (..., L), m."""
        rows = self.walls.reshape(-1, self.walls.shape[-1])
        share, parameters = self.table.parameters.fault_share, self.table.parameters
        mixed = share * fault_density(errors, parameters)[0]
        if len(rows) and (rows == rows[0]).all():
            # A search looks at all links alike, and at very many places.
            mixed += (1.0 - share) * self.table.mixture(errors, rows[0])
        else:
            walls = np.einsum("...w,...w->...", self.walls, self.table.densities(errors))
            mixed += (1.0 - share) * walls
        return np.asarray(-self.weights * np.log(mixed))

    def expand(self, errors: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Negative log likelihood of errors (..., L), m, its slope (1/m) and curvature (1/m^2), each (..., L)."""
        share = self.table.parameters.fault_share
        mixed = [
            (1.0 - share) * density + share * fault
            for density, fault in zip(
                self.table.mixtures(errors, self.walls),
                fault_density(errors, self.table.parameters),
                strict=True,
            )
        ]
        slope = -mixed[1] / mixed[0]
        curvature = slope**2 - mixed[2] / mixed[0]
        return -self.weights * np.log(mixed[0]), self.weights * slope, self.weights * curvature

    def posterior(self, errors: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(..., L, W) probability of each number of walls after seeing the error, and (..., L) of a fault."""
        share = self.table.parameters.fault_share
        walls = (1.0 - share) * self.walls * self.table.densities(errors)
        fault = share * fault_density(errors, self.table.parameters)[0]
        total = walls.sum(axis=-1) + fault
        return walls / total[..., None], fault / total
