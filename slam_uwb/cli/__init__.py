"""The command line: the only place that wires files and steps, prints and sets the exit status."""

from .application import main

__all__ = ["main"]
