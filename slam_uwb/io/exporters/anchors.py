"""Anchors for positioning systems: those whose status is `ok`, and whose height is known where it is asked for.

A system cannot be told that a place is doubtful, so a doubtful one is not handed to it.
"""

from __future__ import annotations

import json
from collections.abc import Iterator

from ...model.solution import AnchorEstimate, Solution, Status
from ..csv_text import number, table

_MILLIMETRES = 1000.0


def trusted_anchors(
    solution: Solution,
) -> Iterator[tuple[AnchorEstimate, tuple[float, float, float]]]:
    """Anchors that are ok, with (x, y, z) m."""
    for anchor in solution.anchors:
        if anchor.status is Status.OK and anchor.position is not None and anchor.height is not None:
            x, y = anchor.position.tolist()
            yield anchor, (x, y, float(anchor.height))


def left_out(solution: Solution) -> list[str]:
    """Identifiers of the anchors that are not handed to a positioning system."""
    handed = {anchor.id for anchor, _ in trusted_anchors(solution)}
    return [str(anchor.id) for anchor in solution.anchors if anchor.id not in handed]


def anchors_csv(solution: Solution) -> dict[str, bytes]:
    """anchors_xyz.csv: `anchor,x_m,y_m,z_m`."""
    rows = [[a.id, *(number(v, 4) for v in place)] for a, place in trusted_anchors(solution)]
    return {"anchors_xyz.csv": table(("anchor", "x_m", "y_m", "z_m"), rows)}


def anchors_json(solution: Solution) -> dict[str, bytes]:
    """anchors_xyz.json: metres, with the sigmas along x and y."""
    anchors = []
    for anchor, (x, y, z) in trusted_anchors(solution):
        entry: dict[str, object] = {
            "id": anchor.id,
            "x_m": round(x, 4),
            "y_m": round(y, 4),
            "z_m": round(z, 4),
        }
        if anchor.covariance is not None:
            xx, yy = (max(float(anchor.covariance[k, k]), 0.0) ** 0.5 for k in (0, 1))
            entry |= {"sigma_x_m": round(xx, 4), "sigma_y_m": round(yy, 4)}
        anchors.append(entry)
    frame = {"survey": solution.survey_name, "frame": solution.frame, "anchors": anchors}
    return {"anchors_xyz.json": _json(frame)}


def anchors_dwm1001(solution: Solution) -> dict[str, bytes]:
    """anchors_dwm1001.txt: for each anchor its identifier and the shell's command, whole millimetres.

    `aps x y z` sets an anchor's place in the shell of the DWM1001 (PANS firmware).
    """
    lines = [
        f"{anchor.id} aps {' '.join(str(_whole(v)) for v in place)}"
        for anchor, place in trusted_anchors(solution)
    ]
    return {"anchors_dwm1001.txt": ("\n".join(lines) + "\n").encode() if lines else b""}


def anchors_bitcraze(solution: Solution) -> dict[str, bytes]:
    """anchors_bitcraze.yaml: number -> x, y, z m, as Bitcraze's Loco Positioning client reads it.

    The client numbers anchors; identifiers that are no numbers are numbered in turn, which the
    comment beside each says.
    """
    found = list(trusted_anchors(solution))
    own = [str(anchor.id) for anchor, _ in found]
    plain = all(name.isdecimal() and str(int(name)) == name for name in own)
    lines = []
    for index, (name, (_, place)) in enumerate(zip(own, found, strict=True)):
        lines.append(f"{name if plain else index}:  # {name}")
        lines += [f"  {axis}: {v + 0.0:.4f}" for axis, v in zip("xyz", place, strict=True)]
    return {"anchors_bitcraze.yaml": ("\n".join(lines) + "\n").encode() if lines else b"{}\n"}


def anchors_pozyx(solution: Solution) -> dict[str, bytes]:
    """anchors_pozyx.json: identifier and coordinates in whole millimetres."""
    anchors = [
        {"id": anchor.id, "coordinates": dict(zip("xyz", map(_whole, place), strict=True))}
        for anchor, place in trusted_anchors(solution)
    ]
    return {"anchors_pozyx.json": _json({"unit": "mm", "anchors": anchors})}


def _whole(metres: float) -> int:
    return round(_MILLIMETRES * metres)


def _json(content: object) -> bytes:
    return (json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False) + "\n").encode()
