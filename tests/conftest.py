import os
import sys
import warnings
from collections.abc import Callable
from importlib import import_module
from pathlib import Path

import pytest

# Refiner -> the module of the optional library behind it, and whether a wheel of it exists for this Python.
OPTIONAL = {
    "open3d": ("open3d", True),
    "kiss_icp": ("kiss_icp.pybind.kiss_icp_pybind", sys.version_info < (3, 14)),
}


@pytest.fixture(scope="session")
def need_refiner() -> Callable[[str], str]:
    """Skip where the library of an optional refiner is absent; only CI has no excuse if there is a wheel."""

    def need(name: str) -> str:
        module, has_wheel = OPTIONAL.get(name, ("slam_uwb", True))
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # what a library does while it loads
                import_module(module)
        except (ImportError, OSError) as error:
            reason = f"refiner {name}: {error}"
            if os.environ.get("CI") == "true" and has_wheel:
                pytest.fail(reason)
            pytest.skip(reason)
        return name

    return need


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
