"""Two scans -> relative poses with covariance; all scans -> which of them hold together (paper, III.A)."""

from .hypotheses import INITIALISERS, match_pair
from .pairs import candidate_pairs, index_scans, match_pairs
from .refiners import REFINERS
from .selection import Selection, select_matches

__all__ = [
    "INITIALISERS",
    "REFINERS",
    "Selection",
    "candidate_pairs",
    "index_scans",
    "match_pair",
    "match_pairs",
    "select_matches",
]
