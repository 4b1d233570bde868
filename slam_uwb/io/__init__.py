"""Files: survey folders, references, solution folders and settings <-> values of `model`.

Reading finds every fault of a folder before it gives up; writing leaves a whole folder or none.
"""

from .growing_survey import (
    check_height,
    check_station_name,
    known_radios,
    put_anchor,
    read_time_zero,
    recorded_stations,
    start_survey,
)
from .picture import read_picture
from .reference import read_reference
from .settings_file import format_settings, read_settings
from .solution_folder import read_solution, write_solution
from .station_recording import StationRecording, recording_station
from .survey_checksum import survey_checksum
from .survey_folder import SurveyCheck, check_survey, read_survey
from .survey_writer import write_survey
from .upper_recording import recording_upper_scan

__all__ = [
    "StationRecording",
    "SurveyCheck",
    "check_height",
    "check_station_name",
    "check_survey",
    "format_settings",
    "known_radios",
    "put_anchor",
    "read_picture",
    "read_reference",
    "read_settings",
    "read_solution",
    "read_survey",
    "read_time_zero",
    "recorded_stations",
    "recording_station",
    "recording_upper_scan",
    "start_survey",
    "survey_checksum",
    "write_solution",
    "write_survey",
]
