"""Evolve controllers of modular robots, judge them in the true arena, and play them back."""

from typing import TYPE_CHECKING

from reconstruction._src.base.lazy import export_lazily

if TYPE_CHECKING:
    from evolution._src.backends.scoring import Outcome, Scoring
    from evolution._src.backends.settings import Randomization, RolloutConfig
    from evolution._src.champions.playback import ChampionPolicy, Recording, judge, play
    from evolution._src.controllers.finding import find_controller
    from evolution._src.controllers.protocol import Controller
    from evolution._src.errors import EvolutionError, RunError
    from evolution._src.experiments.train import train
    from evolution._src.experiments.training import Training
    from evolution._src.search.bodies.config import BodiesConfig, BodyEvolutionConfig, LearningConfig
    from evolution._src.search.bodies.genome import BodyGenome
    from evolution._src.search.cmaes import Run
    from evolution._src.search.config import EvolutionConfig
    from evolution._src.search.evaluation import Evaluation, Evaluator, evaluate
    from evolution._src.search.loop import confirm, evolve, load_run, resume
    from evolution._src.search.run import load_champion
    from evolution._src.search.validation import Champion, Validation

__all__ = [
    "BodiesConfig",
    "BodyEvolutionConfig",
    "BodyGenome",
    "Champion",
    "ChampionPolicy",
    "Controller",
    "Evaluation",
    "Evaluator",
    "EvolutionConfig",
    "EvolutionError",
    "LearningConfig",
    "Outcome",
    "Randomization",
    "Recording",
    "RolloutConfig",
    "Run",
    "RunError",
    "Scoring",
    "Training",
    "Validation",
    "confirm",
    "evaluate",
    "evolve",
    "find_controller",
    "judge",
    "load_champion",
    "load_run",
    "play",
    "resume",
    "train",
]

__getattr__, __dir__ = export_lazily(__name__)
