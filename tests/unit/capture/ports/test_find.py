import pytest

from slam_uwb.capture.ports import LIDARS, TAGS
from slam_uwb.capture.ports.find import FoundPort, candidates, find_port
from slam_uwb.model.errors import CaptureError

SWEEP = FoundPort("/dev/ttyUSB0", (0x0403, 0x6015), "DM00KT5I", "FT230X")
TAG = FoundPort("/dev/ttyACM0", (0x1366, 0x0105), "760", "J-Link")
OTHER_SWEEP = FoundPort("/dev/ttyUSB1", (0x0403, 0x6015), "DM01", "FT230X")
MODEM = FoundPort("/dev/ttyS0", None, "", "ttyS0")


def test_the_only_port_that_fits_is_taken():
    ports = (MODEM, SWEEP, TAG)
    assert find_port(LIDARS["sweep"], "", ports) == "/dev/ttyUSB0"
    assert find_port(TAGS["dwm1001"], "", ports) == "/dev/ttyACM0"


def test_a_name_is_taken_as_it_is():
    assert find_port(LIDARS["sweep"], "/dev/ttyS9", ()) == "/dev/ttyS9"


def test_usb_identifiers():
    ports = (SWEEP, OTHER_SWEEP, TAG)
    assert find_port(LIDARS["sweep"], "1366:0105", ports) == "/dev/ttyACM0"
    assert find_port(LIDARS["sweep"], OTHER_SWEEP.usb_name, ports) == "/dev/ttyUSB1"


@pytest.mark.parametrize("wanted", ["", "0403:6015"])
def test_several_that_fit_are_named(wanted):
    with pytest.raises(CaptureError, match=r"ttyUSB0 \(0403:6015:DM00KT5I\), /dev/ttyUSB1"):
        find_port(LIDARS["sweep"], wanted, (SWEEP, OTHER_SWEEP))


def test_none_fits():
    with pytest.raises(CaptureError, match="slam-uwb ports"):
        find_port(LIDARS["sweep"], "", (MODEM, TAG))


def test_candidates():
    devices = [*LIDARS.values(), *TAGS.values()]
    assert candidates(SWEEP, devices) == ("sweep",)
    assert candidates(MODEM, devices) == ()
    assert "dwm1001" in candidates(TAG, devices)
