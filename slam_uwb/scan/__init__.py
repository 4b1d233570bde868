"""One scan: from a recording to points, normals, wall segments, landmarks and free space (paper, Algorithm 2)."""

from .prepare import prepare_scan, reduce_scan

__all__ = ["prepare_scan", "reduce_scan"]
