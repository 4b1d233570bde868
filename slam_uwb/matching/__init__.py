"""Two scans -> relative poses with covariance; all scans -> which of them hold together (paper, III.A)."""

from .decisions import DecidedPairs, decide_pairs, review_pairs
from .doubt import name_ambiguous, repeating_building
from .hypotheses import INITIALISERS, match_pair
from .pairs import candidate_pairs, index_scans, match_pairs
from .refiners import REFINERS, Refinement
from .selection import Selection, select_matches

__all__ = [
    "INITIALISERS",
    "REFINERS",
    "DecidedPairs",
    "Refinement",
    "Selection",
    "candidate_pairs",
    "decide_pairs",
    "index_scans",
    "match_pair",
    "match_pairs",
    "name_ambiguous",
    "repeating_building",
    "review_pairs",
    "select_matches",
]
