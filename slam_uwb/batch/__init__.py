"""Many surveys, and many of any other task: in processes of this machine or on a Dask cluster."""

from .outcome import Outcome as Outcome
from .processes import map_tasks as map_tasks
from .processes import run_tasks as run_tasks
