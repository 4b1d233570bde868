"""A solution continued with new stations: does the earlier one fit, what of it stands, what moved.

iSAM2 cannot be stored: the graph is built again, from the earlier matches and those of the new
stations.
"""

from .fit import require_fit
from .matches import Earlier, earlier_matches
from .moves import what_moved

__all__ = ["Earlier", "earlier_matches", "require_fit", "what_moved"]
