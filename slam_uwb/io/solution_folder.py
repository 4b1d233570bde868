"""A solution folder, format 1 <-> `Solution`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from ..model.errors import SlamUwbError, SurveyFormatError
from ..model.floor import FloorMap
from ..model.solution import Solution
from .files import FolderReader
from .findings import Findings
from .floor_map_files import ros_map
from .folder_swap import refuse_foreign, replace_folder
from .settings_file import format_settings
from .solution_decoding import SOLUTION_JSON, parse_solution_json
from .solution_encoding import solution_json
from .solution_tables import solution_tables
from .survey_toml import SURVEY_TOML


def write_solution(
    solution: Solution, out: Path, extras: Mapping[str, bytes] | None = None
) -> None:
    """Write a solution folder, complete or not at all; the same solution gives the same bytes.

    Args:
        solution: what to write. Poses and sigmas of stations.csv are along the world's axes:
            their covariances, kept in the station's own axes, are rotated.
        out: new, empty, or a solution folder, which is replaced with all that is in it once the
            new one is complete.
        extras: further files of the folder, relative name -> content (figures, a report).

    Raises:
        SlamUwbError: `out` is there, not empty and no solution folder; nothing is changed.
        OSError: the disk is full or the like; what was there before is there still.
        ValueError: an extra has the name of a file of the solution or leaves the folder.
    """
    refuse_foreign(out, SOLUTION_JSON, "solution folder")
    # Somebody who solved into the survey's own folder would lose the recordings next time.
    if (out / SURVEY_TOML).exists():
        raise SlamUwbError(f"{out} is a survey folder: nothing was changed")
    files = _solution_files(solution)
    taken = sorted(files.keys() & (extras or {}).keys())
    if taken:
        raise ValueError(f"{', '.join(taken)}: files of the solution itself")
    replace_folder(out, files | dict(extras or {}))


def read_solution(out: Path) -> Solution:
    """Read a solution folder: all of it stands in solution.json.

    The map's probabilities return within 0.002, everything else as it was written.

    Raises:
        SurveyFormatError: the folder or the file is missing or damaged; one line says how.
    """
    findings = Findings()
    if not out.is_dir():
        findings.fault(str(out), "no such folder")
        raise SurveyFormatError(findings.faults)
    content = FolderReader(out.resolve(), findings).read(SOLUTION_JSON)
    if content is None:
        raise SurveyFormatError(findings.faults)
    return parse_solution_json(content.data)


def _solution_files(solution: Solution) -> dict[str, bytes]:
    files = solution_tables(solution)
    files[SOLUTION_JSON] = solution_json(solution)
    files["map.png"], files["map.yaml"] = ros_map(solution.floor_map or _nothing_seen(solution))
    files["settings.toml"] = format_settings(solution.settings).encode()
    return files


def _nothing_seen(solution: Solution) -> FloorMap:
    """One unknown cell: without any scan the folder has its map all the same."""
    return FloorMap(np.full((1, 1), np.nan), solution.settings.mapping.resolution_m, (0.0, 0.0))
