"""Initial matches by three corresponding landmarks (paper, Algorithm 3)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..model.geometry import FloatArray, Points
from ..model.settings import MatchingSettings
from .index import ScanIndex
from .pairing import pair_points

_CHUNK = 4096  # transformations scored at once; bounds memory
_MOST_TRIPLES = 200_000  # of one scan: those of 107 landmarks, 30 MB; furnished flats show up to 55


def landmark_matches(
    target: ScanIndex, source: ScanIndex, settings: MatchingSettings
) -> FloatArray:
    """The poses target_T_source (K, 3) with the most points near the other scan, as Algorithm 3 prints it.

    All 3-landmark combinations of both scans are compared by their side lengths in the three cyclic
    shifts, every corresponding pair of triples gives a transformation by least squares, and those
    with the highest number of source points whose closest target point is nearer than
    `closest_point_m` are returned, best first.

    Combinations grow with the cube of the landmarks: of a scan with more than 200,000 (round halls
    have them) an even choice is taken, and of the corresponding pairs one of `max_triples`.
    """
    triples_m, triples_n = _triples(target.scan.landmarks), _triples(source.scan.landmarks)
    pairs_m, pairs_n = _corresponding(triples_m, triples_n, settings)
    if not len(pairs_m):
        return np.zeros((0, 3))
    poses = fit_triples(pairs_m, pairs_n)
    counts = np.concatenate([
        closest_point_count(target, source, chunk, settings.closest_point_m)
        for chunk in np.array_split(poses, max(1, len(poses) // _CHUNK))
    ])  # fmt: skip
    best = np.argsort(-counts, kind="stable")[: settings.initial_matches]
    chosen: FloatArray = poses[best]
    return chosen


def closest_point_count(
    target: ScanIndex, source: ScanIndex, poses: FloatArray, closest_point_m: float
) -> FloatArray:
    """(K,) source points with a target point nearer than `closest_point_m`: the paper's score."""
    near = pair_points(target, source, poses).squared < closest_point_m**2
    return np.asarray(near.sum(axis=1), dtype=np.float64)


def _triples(landmarks: Points) -> FloatArray:
    """(T, 3, 2) combinations of three landmarks, each counter-clockwise so that cyclic shifts suffice."""
    triples = landmarks[_combinations(len(landmarks), _MOST_TRIPLES)]
    first, second = triples[:, 1] - triples[:, 0], triples[:, 2] - triples[:, 0]
    clockwise = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0] < 0.0
    triples[clockwise] = triples[clockwise][:, ::-1]
    return np.asarray(triples)


def _combinations(count: int, most: int) -> NDArray[np.int64]:
    """(T, 3) ascending numbers below `count`, all combinations in order; beyond `most` thinned evenly.

    Combinations are numbered, and only those of the numbers wanted are written down.
    """
    numbers = np.arange(count + 1)
    pairs, triples = numbers * (numbers - 1) // 2, numbers * (numbers - 1) * (numbers - 2) // 6
    total = int(triples[-1])
    rank = np.arange(total) if total <= most else np.linspace(0, total - 1, most).astype(np.int64)
    # The combinatorial number system counts by the largest member: from the other end, by the
    # smallest.
    rest = total - 1 - rank
    third = np.searchsorted(triples, rest, side="right") - 1
    rest = rest - triples[third]
    second = np.searchsorted(pairs, rest, side="right") - 1
    first = rest - pairs[second]
    return np.asarray(count - 1 - np.column_stack([third, second, first]), dtype=np.int64)


def _sides(triples: FloatArray) -> FloatArray:
    """(T, 3) lengths of the sides 0-1, 1-2, 2-0."""
    return np.asarray(np.linalg.norm(np.roll(triples, -1, axis=1) - triples, axis=2))


def _corresponding(
    triples_m: FloatArray, triples_n: FloatArray, settings: MatchingSettings
) -> tuple[FloatArray, FloatArray]:
    """Triples (C, 3, 2) of both scans whose sides agree, corner by corner; thinned evenly beyond `max_triples`."""
    from scipy.spatial import cKDTree

    if not len(triples_m) or not len(triples_n):
        return np.zeros((0, 3, 2)), np.zeros((0, 3, 2))
    shifted = np.concatenate([np.roll(triples_n, -shift, axis=1) for shift in range(3)])
    tree_m, tree_n = cKDTree(_sides(triples_m)), cKDTree(_sides(shifted))
    # Counting first costs little and keeps memory bounded where landmarks are many.
    total = int(tree_m.count_neighbors(tree_n, settings.landmark_side_m, p=np.inf))
    if total > settings.max_triples:
        keep = np.unique(
            np.linspace(
                0, len(shifted) - 1, max(1, len(shifted) * settings.max_triples // total)
            ).astype(int)
        )
        shifted = shifted[keep]
        tree_n = cKDTree(_sides(shifted))
    pairs = tree_n.sparse_distance_matrix(
        tree_m, settings.landmark_side_m, p=np.inf, output_type="coo_matrix"
    )
    order = np.lexsort((pairs.col, pairs.row))
    return triples_m[pairs.col[order]], shifted[pairs.row[order]]


def fit_triples(target: FloatArray, source: FloatArray) -> FloatArray:
    """(C, 3) least-squares poses target_T_source of corresponding corners (C, 3, 2) (eq. 4-5; Umeyama 1991)."""
    centre_t, centre_s = target.mean(axis=1), source.mean(axis=1)
    t, s = target - centre_t[:, None], source - centre_s[:, None]
    cosine = np.einsum("kij,kij->k", s, t)
    sine = np.einsum("ki,ki->k", s[:, :, 0], t[:, :, 1]) - np.einsum(
        "ki,ki->k", s[:, :, 1], t[:, :, 0]
    )
    theta = np.arctan2(sine, cosine)
    c, si = np.cos(theta), np.sin(theta)
    x = centre_t[:, 0] - (c * centre_s[:, 0] - si * centre_s[:, 1])
    y = centre_t[:, 1] - (si * centre_s[:, 0] + c * centre_s[:, 1])
    return np.column_stack([x, y, theta])
