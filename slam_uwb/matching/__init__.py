"""Two scans -> relative poses with covariance; all scans -> which of them hold together (paper, III.A)."""

from .decisions import decide_pairs, review_pairs
from .hypotheses import INITIALISERS, match_pair
from .pairs import candidate_pairs, index_scans, match_pairs
from .refiners import REFINERS, Refinement
from .selection import Selection, select_matches

__all__ = [
    "INITIALISERS",
    "REFINERS",
    "Refinement",
    "Selection",
    "candidate_pairs",
    "decide_pairs",
    "index_scans",
    "match_pair",
    "match_pairs",
    "review_pairs",
    "select_matches",
]
