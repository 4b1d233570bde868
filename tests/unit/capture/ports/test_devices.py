"""What holds for every device of the tables."""

import re

import pytest

from slam_uwb.capture.ports import LIDARS, TAGS
from slam_uwb.capture.ports.rplidar_requests import request


@pytest.mark.parametrize("name", [*LIDARS, *TAGS])
def test_names_and_limits(name):
    device = {**LIDARS, **TAGS}[name]
    assert device.name == name
    # What stands before the colon of --lidar and --uwb.
    assert re.fullmatch(r"[a-z0-9-]+", name)
    assert 0 < device.silence_s <= device.first_s
    assert (device.sample_hz is not None) == (name in LIDARS)
    assert (device.max_range_m is not None) == (name in LIDARS)


@pytest.mark.parametrize(
    ("command", "payload", "expected"),
    [
        # Protocol notes, 2.2: express legacy, PWM 660 and 0.
        (0x82, bytes(5), "a5 82 05 00 00 00 00 00 22"),
        (0xF0, (660).to_bytes(2, "little"), "a5 f0 02 94 02 c1"),
        (0xF0, bytes(2), "a5 f0 02 00 00 57"),
        # Express in mode 3, the typical mode, 600 turns a minute.
        (0x82, bytes([3, 0, 0, 0, 0]), "a5 82 05 03 00 00 00 00 21"),
        (0x84, (0x7C).to_bytes(4, "little"), "a5 84 04 7c 00 00 00 59"),
        (0xA8, (600).to_bytes(2, "little"), "a5 a8 02 58 02 55"),
    ],
)
def test_requests_of_an_rplidar(command, payload, expected):
    assert request(command, payload) == bytes.fromhex(expected)
