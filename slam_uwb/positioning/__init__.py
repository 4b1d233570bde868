"""The paper's second experiment: a tag located with known anchors by a hybrid RSS-TDOA Kalman filter."""

from .anchors import AnchorPlaces
from .places import PlaceEstimate, locate_stays
from .tracking import Track, track_tag

__all__ = ["AnchorPlaces", "PlaceEstimate", "Track", "locate_stays", "track_tag"]
