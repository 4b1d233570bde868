import os
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def surveys_folder() -> Path:
    """The real surveys beside the project; where they are absent only CI has no excuse."""
    default = Path(__file__).parents[2] / "shared" / "surveys"
    folder = Path(os.environ.get("SLAM_UWB_SURVEYS", default))
    if not folder.is_dir():
        reason = f"the real surveys are not at {folder} (set SLAM_UWB_SURVEYS)"
        if os.environ.get("CI") == "true":
            pytest.fail(reason)
        pytest.skip(reason)
    return folder


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--update-golden", action="store_true", help="rewrite the stored numbers of tests/golden"
    )
