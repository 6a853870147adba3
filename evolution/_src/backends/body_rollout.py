"""Jobs of several bodies, some of which may not fit into the arena: those fail, and the others are tried."""

from __future__ import annotations

import logging
from collections import defaultdict
from collections.abc import Sequence
from functools import lru_cache

from evolution._src.backends import rollout
from evolution._src.backends.trials import Job, Outcome, make_failure
from evolution._src.errors import NoEnvironmentError
from symbrion_gym._src.robot.organism import Organism

logger = logging.getLogger(__name__)


def simulate_bodies(jobs: Sequence[Job], threads: int = 1) -> list[Outcome]:
    """Try jobs; those of a body whose environment cannot be made fail, as where no way is wide enough for it."""
    try:
        return rollout.simulate(jobs, threads)
    except NoEnvironmentError as error:
        places: dict[Organism, list[int]] = defaultdict(list)
        for place, job in enumerate(jobs):
            places[job.trials.find_organism()].append(place)
        if len(places) == 1:
            _tell(jobs[0].trials.find_organism().num_modules, str(error))
            return [make_failure(job.trials, str(error)) for job in jobs]
    outcomes: dict[int, Outcome] = {}
    for own in places.values():
        outcomes |= zip(own, simulate_bodies([jobs[place] for place in own], threads), strict=True)
    return [outcomes[place] for place in range(len(jobs))]


@lru_cache(maxsize=1000)
def _tell(modules: int, error: str) -> None:
    """Log once what is wrong with a body."""
    logger.warning("a body of %d modules counts as failed: %s", modules, error)
