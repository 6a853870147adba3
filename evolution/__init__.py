"""Evolve controllers of modular robots, judge them in the true arena, and show what came of it."""

from evolution.cmaes import evolve, load_run, resume
from evolution.config import EvolutionConfig
from evolution.errors import RunError
from evolution.evaluation import Evaluation, Outcome, Randomisation, Scoring, evaluate
from evolution.playback import Recording, judge, play
from evolution.run import Run
from evolution.stages import Stage
from evolution.validation import Champion, Validation

__all__ = [
    "Champion",
    "Evaluation",
    "EvolutionConfig",
    "Outcome",
    "Randomisation",
    "Recording",
    "Run",
    "RunError",
    "Scoring",
    "Stage",
    "Validation",
    "evaluate",
    "evolve",
    "judge",
    "load_run",
    "play",
    "resume",
]
