"""Instruments without instruments: a survey played over pseudo-terminals, handshakes and faults included."""

from .dwm1001 import Dwm1001Emulator
from .faults import Faults
from .rplidar import RplidarEmulator
from .sweep import SweepEmulator
from .terminal import plugged_in
from .tripod import Tripod, play_survey, radio_names

__all__ = [
    "Dwm1001Emulator",
    "Faults",
    "RplidarEmulator",
    "SweepEmulator",
    "Tripod",
    "play_survey",
    "plugged_in",
    "radio_names",
]
