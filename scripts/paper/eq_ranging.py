"""Eq. 1-3: ranging bias against clock error and reply asymmetry, by three ways of two-way ranging."""

from __future__ import annotations

import numpy as np

from slam_uwb.ranging.two_way import (
    SPEED_OF_LIGHT,
    asymmetric_distances,
    symmetric_bias,
    symmetric_distances,
)
from slam_uwb.report import Curve, draw_curves, figure_png

from .run import Claim, Run, Section, markdown_table

DISTANCE_M, REPLY_S = 10.0, 300e-6
PPM = np.array([0.1, 0.3, 1.0, 3.0, 10.0, 20.0])
ASYMMETRY_S = np.array([0.0, 1e-6, 10e-6, 100e-6])


def true_periods(asymmetry: float) -> np.ndarray:
    """(1, 4) s, T1 to T4 of one exchange over 10 m whose anchor replies `asymmetry` later than the tag."""
    flight = DISTANCE_M / SPEED_OF_LIGHT
    anchor, tag = REPLY_S + asymmetry, REPLY_S
    return np.array([[2 * flight + anchor, anchor, tag, 2 * flight + tag]])


def biases(ppm: float, asymmetry: float) -> tuple[float, float, float]:
    """m, of single-sided, symmetric and asymmetric double-sided ranging; the clocks err in opposite ways."""
    tag, node = 1e-6 * ppm, -1e-6 * ppm
    measured = true_periods(asymmetry) * (1.0 + np.array([tag, node, tag, node]))
    single = SPEED_OF_LIGHT * (measured[:, 0] - measured[:, 1]) / 2.0
    found = (single, symmetric_distances(measured), asymmetric_distances(measured))
    return tuple(float(d[0]) - DISTANCE_M for d in found)  # type: ignore[return-value]


def make(run: Run) -> Section:
    """Figure over the clock's error, table over the asymmetry, and eq. 3 against eq. 2."""
    names = ("single-sided", "symmetric (eq. 2)", "asymmetric")
    over_ppm = np.abs([biases(ppm, 10e-6) for ppm in PPM])
    curves = {n: Curve(PPM.tolist(), over_ppm[:, k].tolist()) for k, n in enumerate(names)}
    figure = draw_curves(
        "Ranging bias, 10 m, replies 300 us and 310 us, clocks off in opposite ways",
        ("clock error of each device / ppm", "bias / m"),
        curves,
        scales=("log", "log"),
    )
    run.write("eq1-3.png", figure_png(figure))
    rows = [
        [f"{1e6 * a:g}", *(f"{1e3 * b:.2f}" for b in biases(10.0, float(a)))] for a in ASYMMETRY_S
    ]
    gap = max(
        abs(biases(ppm, a)[1] - float(symmetric_bias(true_periods(a), 1e-6 * ppm, -1e-6 * ppm)[0]))
        for ppm in PPM.tolist()
        for a in ASYMMETRY_S.tolist()
    )
    single = abs(biases(10.0, 0.0)[0])
    text = (
        "![bias](eq1-3.png)\n\nBias in mm at 10 ppm, by how much later the anchor replies:\n\n"
        + markdown_table(["asymmetry / us", *names], rows)
        + '\nThe paper prints "10^-6 (10 ppm)" (sic): 10 ppm is 10^-5.\n'
    )
    claims = (
        Claim(
            "eq. 3 is what eq. 1 makes of eq. 2",
            "eq. 1-3",
            f"differ by {1e9 * gap:.2g} nm at most",
            "1 um",
            gap < 1e-6,
        ),
        Claim(
            "without the second reply the bias is metres",
            "several meters",
            f"{single:.2f} m at 10 ppm each",
            "0.5 to 10 m",
            0.5 < single < 10.0,
        ),
        Claim(
            "equal replies cancel it",
            "significantly reduced",
            f"{1e3 * abs(biases(10.0, 0.0)[1]):.3f} mm",
            "1 mm",
            abs(biases(10.0, 0.0)[1]) < 1e-3,
        ),
    )
    return Section("Eq. 1-3: bias of two-way ranging", text, claims)
