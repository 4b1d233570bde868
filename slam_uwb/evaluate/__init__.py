"""A solution against ground truth: rigid alignment, errors, consistency of the uncertainties."""

from .align import evaluate_solution, rigid_alignment
from .evaluation import ErrorSummary, Evaluation, GroupEvaluation, ItemEvaluation
from .table import evaluation_to_json, format_evaluation

__all__ = [
    "ErrorSummary",
    "Evaluation",
    "GroupEvaluation",
    "ItemEvaluation",
    "evaluate_solution",
    "evaluation_to_json",
    "format_evaluation",
    "rigid_alignment",
]
