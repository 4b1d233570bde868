"""Recordings of other programs -> stations and ranges of a survey."""

from .formats import RANGE_FORMATS, SCAN_FORMATS, ImportOptions, import_survey

__all__ = ["RANGE_FORMATS", "SCAN_FORMATS", "ImportOptions", "import_survey"]
