"""Evolve controllers of modular robots, judge them in the true arena, and play them back."""

from typing import TYPE_CHECKING

from reconstruction.deprecation import export_former_names
from reconstruction.lazy import export_lazily

if TYPE_CHECKING:
    from evolution.backends.outcome import Outcome
    from evolution.backends.scoring import Scoring
    from evolution.backends.trials import Randomization, RolloutConfig
    from evolution.bodies.genome import BodyGenome
    from evolution.body_search.config import BodiesConfig, BodyEvolutionConfig
    from evolution.body_search.confirmation import confirm
    from evolution.body_search.learning import LearningConfig
    from evolution.body_search.loop import evolve_bodies, load_bodies, resume_bodies
    from evolution.champions.playback import Recording, judge, play
    from evolution.champions.policy import ChampionPolicy
    from evolution.controllers.config import ControllerConfig
    from evolution.controllers.finding import find_controller
    from evolution.controllers.protocol import Controller, OutOfBoundsWarning
    from evolution.dispatch import evolve
    from evolution.errors import EvolutionError, RunError
    from evolution.search.archive import ArchiveConfig
    from evolution.search.cmaes import CmaesConfig
    from evolution.search.config import EvolutionConfig
    from evolution.search.elites_of_record import find_elites
    from evolution.search.evaluation import Evaluation, Evaluator, evaluate
    from evolution.search.grid import Grid, evaluate_grid
    from evolution.search.islands import IslandsConfig
    from evolution.search.loop import load_run, resume
    from evolution.search.run import Run, load_champion
    from evolution.search.side_by_side import evolve_side_by_side
    from evolution.search.stages import Stage
    from evolution.search.validation import Champion, Validation

__all__ = [
    "ArchiveConfig",
    "BodiesConfig",
    "BodyEvolutionConfig",
    "BodyGenome",
    "Champion",
    "ChampionPolicy",
    "CmaesConfig",
    "Controller",
    "ControllerConfig",
    "Evaluation",
    "Evaluator",
    "EvolutionConfig",
    "EvolutionError",
    "Grid",
    "IslandsConfig",
    "LearningConfig",
    "OutOfBoundsWarning",
    "Outcome",
    "Randomization",
    "Recording",
    "RolloutConfig",
    "Run",
    "RunError",
    "Scoring",
    "Stage",
    "Validation",
    "confirm",
    "evaluate",
    "evaluate_grid",
    "evolve",
    "evolve_bodies",
    "evolve_side_by_side",
    "find_controller",
    "find_elites",
    "judge",
    "load_bodies",
    "load_champion",
    "load_run",
    "play",
    "resume",
    "resume_bodies",
]

_load, __dir__ = export_lazily(__name__)
__getattr__ = export_former_names(_load, Randomisation="Randomization")
