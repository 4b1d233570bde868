"""A solution against ground truth: rigid alignment, errors, consistency of the uncertainties, statistics."""

from .align import evaluate_solution, rigid_alignment
from .comparison import Method, MethodResult, compare_methods, methods, settings_as_printed
from .comparison_table import comparison_to_csv, comparison_to_latex, comparison_to_markdown
from .evaluation import AlignOn, ErrorSummary, Evaluation, GroupEvaluation, ItemEvaluation
from .positioning import distances_to_path, static_errors, trajectory_errors
from .statistics import (
    Interval,
    PairedComparison,
    bootstrap_interval,
    ecdf,
    nees_bounds,
    pooled_nees,
    sign_flip_test,
)
from .table import evaluation_to_json, format_evaluation
from .trajectory_files import estimate_to_tum, reference_to_tum

__all__ = [
    "AlignOn",
    "ErrorSummary",
    "Evaluation",
    "GroupEvaluation",
    "Interval",
    "ItemEvaluation",
    "Method",
    "MethodResult",
    "PairedComparison",
    "bootstrap_interval",
    "compare_methods",
    "comparison_to_csv",
    "comparison_to_latex",
    "comparison_to_markdown",
    "distances_to_path",
    "ecdf",
    "estimate_to_tum",
    "evaluate_solution",
    "evaluation_to_json",
    "format_evaluation",
    "methods",
    "nees_bounds",
    "pooled_nees",
    "reference_to_tum",
    "rigid_alignment",
    "settings_as_printed",
    "sign_flip_test",
    "static_errors",
    "trajectory_errors",
]
