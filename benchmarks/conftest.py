"""Surveys of the sizes asked for, written once a run."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from measure import load
from stages import Site

from slam_uwb import simulate_survey, write_survey
from slam_uwb.simulate import Lidar
from slam_uwb.simulate.catalogue import build_scene

ROOMS = {90: 28, 300: 84, 1000: 290}
"""Rooms of a random floor that has about so many stations; 18 are the paper's office."""
WHOLE_MINUTE = 90
"""Recordings of up to so many stations last a minute, of more ten seconds: the disk is not measured."""
SEED = 1


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--sizes", default="18,90", help="stations: of 18, 90, 300, 1000")
    parser.addoption("--batch", type=int, default=6, help="surveys of the batch")
    parser.addoption(
        "--graph", type=int, default=10_000, help="stations of the largest drawn graph"
    )


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    if "size" in metafunc.fixturenames:
        sizes = [int(part) for part in metafunc.config.getoption("--sizes").split(",")]
        metafunc.parametrize("size", sizes, scope="session")


@pytest.fixture(scope="session")
def scratch(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where surveys and solutions lie."""
    return tmp_path_factory.mktemp("bench")


@pytest.fixture(scope="session")
def sites() -> dict[int, Site]:
    """Those made so far."""
    return {}


@pytest.fixture
def site(size: int, sites: dict[int, Site], scratch: Path) -> Site:
    """The survey of a size."""
    if size not in sites:
        lidar = Lidar(duration=60.0 if size <= WHOLE_MINUTE else 10.0, upper_duration=0.0)
        rng = np.random.default_rng(SEED)
        name = f"random-floor-{ROOMS[size]}" if size in ROOMS else "paper-office"
        scene = build_scene(name, rng)
        made = simulate_survey(scene, SEED, lidar=lidar)
        folder = scratch / f"survey-{size}"
        write_survey(made.survey, folder)
        sites[size] = Site(len(made.survey.stations), folder, scratch / f"out-{size}")
        # Only one size is in memory at a time.
        for other in sites.values():
            if other is not sites[size]:
                other.made.clear()
    return sites[size]


@pytest.fixture(autouse=True)
def _load(request: pytest.FixtureRequest) -> None:
    """The load average goes with each figure."""
    if "benchmark" in request.fixturenames:
        request.getfixturevalue("benchmark").extra_info["load"] = load()
