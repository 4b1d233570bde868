"""The anchors that a tag is located with."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeAlias

from ..model.geometry import FloatArray
from ..model.survey import AnchorId

AnchorPlaces: TypeAlias = Mapping[AnchorId, FloatArray]
"""(3,) m, x, y and height above the floor; an anchor that is not here is not used."""
