"""What a search for bodies found, in words: for the console and the page."""

from __future__ import annotations

from evolution._src.backends.scoring import Scoring
from evolution._src.body_search.config import BodyEvolutionConfig
from evolution._src.body_search.run import BodyRun


def describe_success(run: BodyRun) -> str:
    """Return in words how often the champion of a run succeeded, in which trials, and its fitness."""
    champion = run.champion
    assert champion is not None
    rate, fitness = (
        f"{champion.successes} of {champion.trials}",
        f"{format_fitness(run, champion.fitness)} in its exam",
    )
    if run.confirmation is None:
        return f"succeeded in {rate} trials of its exam, not confirmed by fresh trials; {fitness}"
    if champion.successes:
        return f"succeeded in {rate} fresh trials; {fitness}"
    return f"no success: {rate} fresh trials, and no other candidate did better; {fitness}"


def format_fitness(run: BodyRun, fitness: float) -> str:
    """Return a fitness in words, in meters where the weights that ship make it of progress in meters."""
    unit = " m" if isinstance(run.config.scoring, Scoring) else ""
    return f"fitness {fitness:.2f}{unit}"


def find_effort_weight(config: BodyEvolutionConfig) -> float:
    """Return the effort of a joule of work of the hinges."""
    from symbrion_gym._src.tasks.usual_terms import UsualTerms  # loads MuJoCo

    return float(dict(config.episode.environment).get("effort_weight", UsualTerms.effort_weight)) or 1.0


def explain_fitness(run: BodyRun) -> str:
    """Return what a fitness means, in one sentence."""
    scoring = run.config.scoring
    if not isinstance(scoring, Scoring):
        return "Fitness is what the scoring of this run returns; higher is better."
    text = (
        "Fitness, in meters: how far the whole body came on its way, as a mean over trials, plus "
        f"{scoring.success:g} m times the share of trials that succeeded, less "
        f"{scoring.effort * find_effort_weight(run.config):.2g} m for each joule of work of the hinges"
    )
    return (
        f"{text}{f' and {scoring.module:g} m for each module' if scoring.module else ''}. Higher is better."
    )
