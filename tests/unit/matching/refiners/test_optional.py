import pickle
import sys
from types import ModuleType

import numpy as np
import pytest

from slam_uwb.matching.refiners.kiss_icp import refine_kiss_icp
from slam_uwb.matching.refiners.open3d import refine_open3d
from slam_uwb.matching.refiners.optional import named_if_missing
from slam_uwb.model.errors import MissingLibraryError, SlamUwbError
from slam_uwb.model.geometry import Pose2


@pytest.mark.parametrize(
    ("refine", "module", "extra"),
    [
        (refine_open3d, "open3d", r"slam-uwb\[open3d\]"),
        (refine_kiss_icp, "kiss_icp", r"slam-uwb\[kiss-icp\]"),
    ],
)
def test_a_missing_module_is_named_with_its_extra(
    monkeypatch, view, room, settings, refine, module, extra
):
    monkeypatch.setitem(sys.modules, module, None)  # import raises ModuleNotFoundError
    index = view("a", room, Pose2(2.0, 1.5, 0.5))
    with pytest.raises(SlamUwbError, match=rf"{module}.*pip install '{extra}'") as caught:
        refine(index, index, np.zeros((1, 3)), settings)
    assert caught.value.exit_status == 2
    # Worker processes hand errors over by pickling them.
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)  # noqa: S301


@pytest.mark.parametrize("kind", [ImportError, OSError])
@pytest.mark.parametrize(
    ("file", "package"),
    [
        ("libusb-1.0.so.0", "libusb-1.0-0"),
        ("libGL.so.1", "libgl1"),
        ("libEGL.so.1", "libegl1"),
        ("libX11.so.6", "libx11-6"),
    ],
)
def test_a_missing_system_library_is_named_with_its_package(kind, file, package):
    with (
        pytest.raises(MissingLibraryError, match=rf"{file}.*apt install {package}$"),
        named_if_missing("open3d", "open3d"),
    ):
        raise kind(f"{file}: cannot open shared object file: No such file or directory")


def test_other_errors_pass():
    with pytest.raises(ZeroDivisionError), named_if_missing("open3d", "open3d"):
        raise ZeroDivisionError


def test_another_version_of_kiss_icp_is_refused(monkeypatch, view, room, settings):
    """Its private names may mean something else there."""
    package, pybind = ModuleType("kiss_icp"), ModuleType("kiss_icp.pybind")
    package.__version__ = "1.4.0"
    package.pybind = pybind
    pybind.kiss_icp_pybind = ModuleType("kiss_icp.pybind.kiss_icp_pybind")
    monkeypatch.setitem(sys.modules, "kiss_icp", package)
    monkeypatch.setitem(sys.modules, "kiss_icp.pybind", pybind)
    index = view("a", room, Pose2(2.0, 1.5, 0.5))
    with pytest.raises(MissingLibraryError, match=r"needs version 1\.3\.x, not 1\.4\.0"):
        refine_kiss_icp(index, index, np.zeros((1, 3)), settings)
