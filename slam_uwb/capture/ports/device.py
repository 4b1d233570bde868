"""What the recording loop needs to know of an instrument; each module beside this one describes one."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Generic, Protocol

from ..samples import Carry, Decoded, Samples_co
from .port import Port

Identity = Mapping[str, str]
"""What the instrument says of itself and of its settings, as read back."""


class Decode(Protocol[Samples_co]):
    """`(data, carry) -> Decoded`, as the modules of `frames` have it."""

    def __call__(  # noqa: D102
        self, data: bytes, carry: Carry, *, last: bool = False
    ) -> Decoded[Samples_co]: ...


def nothing(_port: Port) -> None:
    """For instruments that need no command at this point."""


@dataclass(frozen=True, slots=True)
class Device(Generic[Samples_co]):
    """One kind of instrument: its handshakes around the stream and what the stream should look like."""

    name: str
    """As it is given on the command line."""
    title: str
    baud: int
    decode: Decode[Samples_co]
    prepare: Callable[[Port], Identity]
    """From any state to ready for `begin`: identity, motor, settings. CaptureError where that fails."""
    begin: Callable[[Port], None] = nothing
    """Start the stream. Bytes that it read beyond its answer are lost: no more than a frame."""
    end: Callable[[Port], None] = nothing
    """Stop the stream, the motor goes on."""
    rest: Callable[[Port], None] = nothing
    """Leave the instrument as it should lie in its case: stream and motor off."""
    poll: tuple[bytes, float] | None = None
    """What to send, and every how many s, where the instrument speaks only when asked."""
    dtr: bool | None = None
    usb: tuple[tuple[int, int], ...] = ()
    """(vendor, product) of the USB adapters that it comes with."""
    first_s: float = 10.0
    """The first frame comes within this."""
    silence_s: float = 0.5
    """A longer gap between frames is a fault."""
    sample_hz: float | None = None
    """Nominal samples a second of a scanner."""
    rotation_hz: float | None = None
    """Nominal revolutions a second of a scanner."""
    max_range_m: float | None = None
    """What a scanner reaches at most."""
    tested: str = "constructed bytes"
    """What kind of bytes handshake and decoder were tested on."""
