"""The bundled surveys give the numbers they gave before, to 0.1 mm, and the same bytes each time."""

import json
from pathlib import Path

import pytest

from slam_uwb import Settings, read_survey, solve_survey, write_solution
from slam_uwb.report import draw_solution, figure_png

DATASETS = Path(__file__).parents[2] / "datasets"
STORED = Path(__file__).parent


def solve(dataset, mode):
    settings = Settings(graph=Settings().graph.model_copy(update={"mode": mode}))
    return solve_survey(read_survey(DATASETS / dataset), settings)


def numbers(solution):
    """Places and status by name; metres and radians."""
    stations = {
        s.id: [s.status, *([] if s.pose is None else s.pose.vector.tolist())]
        for s in solution.stations
    }
    anchors = {
        a.id: [a.status, *([] if a.position is None else a.position.tolist())]
        for a in solution.anchors
    }
    return {"stations": stations, "anchors": anchors}


@pytest.mark.parametrize("mode", ["joint", "sequential"])
@pytest.mark.parametrize("dataset", ["flat", "paper-office"])
def test_the_stored_numbers(dataset, mode, request):
    found = numbers(solve(dataset, mode))
    path = STORED / f"{dataset}-{mode}.json"
    if request.config.getoption("--update-golden"):
        path.write_text(json.dumps(found, indent=1) + "\n")
    stored = json.loads(path.read_text())
    assert found["stations"].keys() == stored["stations"].keys()
    assert found["anchors"].keys() == stored["anchors"].keys()
    for kind, items in found.items():
        for name, (status, *place) in items.items():
            stored_status, *stored_place = stored[kind][name]
            assert status == stored_status, name
            # 0.1 mm; headings to the angle that moves a wall 10 m away by 1 mm.
            assert place == pytest.approx(stored_place, abs=1e-4), name


def test_two_runs_give_the_same_bytes(tmp_path):
    for out in (tmp_path / "one", tmp_path / "two"):
        solution = solve("flat", "joint")
        write_solution(solution, out, extras={"figure.png": figure_png(draw_solution(solution))})
    one = {p.name: p.read_bytes() for p in (tmp_path / "one").iterdir()}
    two = {p.name: p.read_bytes() for p in (tmp_path / "two").iterdir()}
    assert one.keys() == two.keys()
    assert [name for name in one if one[name] != two[name]] == []
