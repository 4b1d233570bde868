"""Serial ports: instruments by name, their handshakes, and the loop that reads them."""

from .devices import LIDARS, TAGS
from .session import Instrument, connected

__all__ = ["LIDARS", "TAGS", "Instrument", "connected"]
