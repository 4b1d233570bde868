"""Floor plan and seed -> a survey with its truth; shares no code with any estimator."""

from .catalogue import SCENES as SCENES
from .lidar import Lidar as Lidar
from .radio import Radio as Radio
from .reception import TagRadio as TagRadio
from .scene import Scene as Scene
from .survey import Simulation as Simulation
from .survey import simulate_survey as simulate_survey
from .tags import TagSimulation as TagSimulation
from .tags import simulate_static_tags as simulate_static_tags
from .tags import simulate_walk as simulate_walk
