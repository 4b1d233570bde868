"""Files: survey folders, references, solution folders and settings <-> values of `model`.

Reading finds every fault of a folder before it gives up; writing leaves a whole folder or none.
"""

from .reference import read_reference
from .settings_file import format_settings, read_settings
from .solution_folder import read_solution, write_solution
from .survey_folder import SurveyCheck, check_survey, read_survey
from .survey_writer import write_survey

__all__ = [
    "SurveyCheck",
    "check_survey",
    "format_settings",
    "read_reference",
    "read_settings",
    "read_solution",
    "read_survey",
    "write_solution",
    "write_survey",
]
