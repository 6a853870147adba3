"""Evolve controllers of modular robots, judge them in the true arena, and show what came of it."""

from typing import TYPE_CHECKING

from reconstruction.lazy import export_lazily

if TYPE_CHECKING:
    from evolution.backends.trials import Outcome, Randomisation, Scoring
    from evolution.champions.playback import Recording, judge, play
    from evolution.champions.policy import ChampionPolicy
    from evolution.errors import RunError
    from evolution.search.config import EvolutionConfig
    from evolution.search.evaluation import Evaluation, evaluate
    from evolution.search.loop import evolve, load_run, resume
    from evolution.search.run import Run, load_champion
    from evolution.search.stages import Stage
    from evolution.search.validation import Champion, Validation

__all__ = [
    "Champion",
    "ChampionPolicy",
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
    "load_champion",
    "load_run",
    "play",
    "resume",
]

__getattr__, __dir__ = export_lazily(__name__)
