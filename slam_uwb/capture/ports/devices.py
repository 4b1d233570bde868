"""The instruments by name."""

from __future__ import annotations

from collections.abc import Sequence

from ..samples import LidarSamples, RangeEpoch
from .device import Device
from .dwm1001 import DWM1001
from .rplidar import RPLIDARS
from .streaming_devices import DWM1001_TLV, DWM3001, LD06, MAUWB, TREK1000
from .sweep import SWEEP

LIDARS: dict[str, Device[LidarSamples]] = {
    device.name: device for device in (SWEEP, *RPLIDARS, LD06)
}
TAGS: dict[str, Device[Sequence[RangeEpoch]]] = {
    device.name: device for device in (DWM1001, DWM1001_TLV, DWM3001, TREK1000, MAUWB)
}
