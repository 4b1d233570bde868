"""Range samples -> one measurement a link."""

from .agreement import RangeGain, range_gain
from .decisions import decide_links, keep_links, review_links
from .link_model import LinkModel, link_model
from .reduce import reduce_anchor_links, reduce_links
from .separation import least_separation
from .two_way import asymmetric_bias, asymmetric_distances, symmetric_bias, symmetric_distances

__all__ = [
    "LinkModel",
    "RangeGain",
    "asymmetric_bias",
    "asymmetric_distances",
    "decide_links",
    "keep_links",
    "least_separation",
    "link_model",
    "range_gain",
    "reduce_anchor_links",
    "reduce_links",
    "review_links",
    "symmetric_bias",
    "symmetric_distances",
]
