"""``slam-uwb settings``: every knob with its default and reason."""

from __future__ import annotations

from typing import Annotated

import typer

from .options import VerboseOption


def settings(
    preset: Annotated[
        str, typer.Argument(metavar="[PRESET]", help="`default` or `paper`.")
    ] = "default",
    _verbose: VerboseOption = False,
) -> None:
    """Print all settings as TOML, with unit, limits and reason.

    Save what you change to a file and hand it to `slam-uwb solve --settings FILE`.
    """
    from ..io import format_settings
    from ..model.errors import SettingsError
    from ..model.settings import PRESETS

    if preset not in PRESETS:
        raise SettingsError(preset, f"no such preset; there are {', '.join(PRESETS)}")
    typer.echo(format_settings(PRESETS[preset]))
