"""No command pays for libraries that it does not use."""

import json
import subprocess
import sys

import pytest

OPTIONAL = {"open3d", "kiss_icp", "filterpy", "serial", "laspy", "pye57", "rosbags", "distributed"}
WATCHED = OPTIONAL | {"matplotlib", "ezdxf", "rich", "gtsam", "shapely", "jinja2", "scipy"}
SLOW_PARTS = {"scipy.stats"}
PROGRAM = """
import json, sys
from slam_uwb.cli import main
sys.argv = ["slam-uwb", *sys.argv[1:]]
try:
    main()
except SystemExit as end:
    status = end.code
sys.stderr.write("\\n" + json.dumps([status, sorted(sys.modules)]))
"""


def loaded(*arguments):
    """Exit status of a run, and which of the watched libraries it loaded."""
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    )
    status, modules = json.loads(done.stderr.splitlines()[-1])
    libraries = {name.partition(".")[0] for name in modules}
    return status, WATCHED.intersection(libraries) | SLOW_PARTS.intersection(modules)


@pytest.fixture
def broken(survey):
    (survey / "survey.toml").write_text("format = 1\n")
    return survey


def test_solve_loads_what_it_draws_with_and_nothing_optional(pristine_survey, tmp_path):
    status, modules = loaded("solve", pristine_survey, "--out", tmp_path / "out", "--no-ranges")
    assert status == 0
    assert modules == {"gtsam", "scipy", "shapely", "jinja2", "matplotlib"}


def test_solve_draws_nothing_where_there_is_nothing_to_draw(broken, tmp_path):
    assert loaded("solve", broken, "--out", tmp_path / "out") == (2, set())


def test_a_survey_is_checked_without_a_solver(pristine_survey):
    assert loaded("check", pristine_survey) == (0, set())


def test_a_report_is_drawn_without_matplotlib(solution):
    assert loaded("report", solution) == (0, {"jinja2", "scipy"})


def test_a_solution_is_scored_and_exported_without_a_solver(solution, survey, tmp_path):
    status, modules = loaded("evaluate", solution, "--reference", survey / "reference")
    assert (status, modules - {"scipy"}) == (0, set())
    status, modules = loaded("plan", solution)
    assert (status, modules - {"scipy"}) == (0, set())


def test_a_batch_leaves_the_work_to_its_processes(broken, tmp_path):
    status, modules = loaded("batch", broken, "--out", tmp_path / "out", "--workers", 1)
    assert status == 1
    assert "distributed" not in modules
    assert "matplotlib" not in modules
