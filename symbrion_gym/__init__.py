"""Robots and worlds in MuJoCo: arenas from scans, Scout modules, and Gymnasium environments.

Importing this package registers the environments `symbrion_gym/SnakePit-v1` and its siblings.
"""

import symbrion_gym._src.headless

import symbrion_gym.tasks  # noqa: F401  isort: skip  (so that `symbrion_gym.tasks` is there)

from typing import TYPE_CHECKING

from reconstruction._src.base.lazy import export_lazily
from symbrion_gym._src.registration import register

if TYPE_CHECKING:
    from symbrion_gym._src.arenas.arena import Arena, color_arena, place_objects
    from symbrion_gym._src.arenas.course import Course, StairsCourse
    from symbrion_gym._src.arenas.friction_map import FrictionMap, FrictionPatch
    from symbrion_gym._src.arenas.making import load_arena, load_tiles, make_arena
    from symbrion_gym._src.environment.making import make_sb3_env
    from symbrion_gym._src.environment.organism_env import OrganismEnv
    from symbrion_gym._src.environment.organism_vector_env import OrganismVectorEnv
    from symbrion_gym._src.errors import ArenaError, OrganismError, SymbrionGymError, TaskError
    from symbrion_gym._src.robot.belts import add_tracks
    from symbrion_gym._src.robot.body_plans import load_organism, make_random_organism, organism_to_text
    from symbrion_gym._src.robot.organism import Organism, cross, snake
    from symbrion_gym._src.robot.scout import ScoutConfig, make_scout
    from symbrion_gym._src.sensing.rangefinder import RangeFinder
    from symbrion_gym._src.sensing.survey import survey
    from symbrion_gym._src.sensing.survey_robot import LaserScanner, SurveyRobot
    from symbrion_gym._src.sensing.timing import timing
    from symbrion_gym._src.tasks.audit import audit
    from symbrion_gym._src.tasks.catalog import make_task
    from symbrion_gym._src.tasks.task import Task, read_task
    from symbrion_gym._src.tasks.terms import Reward, Sensor, Termination
    from symbrion_gym._src.traversability.footprint import Footprint

register()

__all__ = [
    "Arena",
    "ArenaError",
    "Course",
    "Footprint",
    "FrictionMap",
    "FrictionPatch",
    "LaserScanner",
    "Organism",
    "OrganismEnv",
    "OrganismError",
    "OrganismVectorEnv",
    "RangeFinder",
    "Reward",
    "ScoutConfig",
    "Sensor",
    "StairsCourse",
    "SurveyRobot",
    "SymbrionGymError",
    "Task",
    "TaskError",
    "Termination",
    "add_tracks",
    "audit",
    "color_arena",
    "cross",
    "load_arena",
    "load_organism",
    "load_tiles",
    "make_arena",
    "make_random_organism",
    "make_sb3_env",
    "make_scout",
    "make_task",
    "organism_to_text",
    "place_objects",
    "read_task",
    "snake",
    "survey",
    "timing",
]

__getattr__, __dir__ = export_lazily(__name__)
