"""Libraries that not everybody installs: what to do where one is missing."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from ...model.errors import MissingLibraryError

_PACKAGE_OF = {
    "libusb-1.0.so": "libusb-1.0-0",
    "libGL.so": "libgl1",
    "libEGL.so": "libegl1",
    "libX11.so": "libx11-6",
}
"""Shared libraries that the wheels leave to the system, and the Debian packages that bring them."""


@contextmanager
def named_if_missing(refiner: str, extra: str) -> Iterator[None]:
    """Turn a failing import into one line that says what to install.

    Raises:
        MissingLibraryError: the module, or a library of the system that it loads, is missing.
    """
    try:
        yield
    except (ImportError, OSError) as error:
        wanting = [package for file, package in _PACKAGE_OF.items() if file in str(error)]
        install = f"apt install {wanting[0]}" if wanting else f"pip install 'slam-uwb[{extra}]'"
        raise MissingLibraryError(
            f"settings: matching.refiner: '{refiner}' needs what is not installed ({error}); "
            f"to install it: {install}"
        ) from error
