"""A fitness of one's own: get far with the head held low. Run it from this folder: `python own_fitness.py`."""

import evolution as ev


def far_and_low(outcome: ev.Outcome, body) -> float:
    """Return the progress without twice the greatest height of a module, mean over the trials [m]."""
    heights = [trial["highest"][2] for trial in outcome.descriptors]
    return outcome.progress - 2.0 * sum(heights) / max(len(heights), 1)


def main(generations: int = 10, folder: str | None = "runs/far_and_low") -> ev.Run:
    """Evolve with it. The folder keeps the function by its name; `ev.resume` refuses another version of it."""
    import own_fitness  # a function of this module, which resuming imports again, and not of the program that runs

    scoring = own_fitness.far_and_low
    return ev.evolve(
        ev.EvolutionConfig(
            arena="truth", scoring=scoring, descriptors=("extremes",), generations=generations, folder=folder
        )
    )
