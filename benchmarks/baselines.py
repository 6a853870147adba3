"""Success of zero actions and of random genotypes on the course, by which the default pit was selected.

    python -m benchmarks.baselines [--quick] [--only NAME ...]
    python -m benchmarks.baselines --only learning [--ids ID ...] [--algorithms NAME ...] [--seeds N ...] [--minutes M]

All trials are randomized and start on the floor of the true course.
`python docs/pictures.py results` draws the success by width, modules and friction.
"""

import argparse
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from itertools import product
from typing import Any

import gymnasium as gym
import numpy as np

from benchmarks.evolution_runs import Results
from benchmarks.material.learning import ALGORITHMS, learn
from benchmarks.material.learning_run import Budget
from evolution._src.backends.trials import Randomization
from evolution._src.controllers.controller import REACTIVE_HINT, U_SHAPE_HINT, make_controller
from evolution._src.search.evaluation import evaluate
from symbrion_gym._src.arenas.course import Course
from symbrion_gym._src.registration import ENVIRONMENTS

SEED = 5
PITS = tuple(round(0.36 + 0.01 * step, 2) for step in range(11))
"""Widths of the pit [m]."""
MODULES = (6, 7, 8)
ABYSSES = (0.36, 0.37)
"""Widths of the bottomless pit [m], just below and above the largest that a body crosses without control."""
FRICTIONS = (0.55, 0.65, 0.75, 0.85)
"""Sliding friction, where it is not drawn from the usual range."""
AS_IT_IS = Randomization(stretch=(1.0,))
DEFAULT_TRIALS = 200
"""Trials on the default course."""
STARTS = 50
"""Starts of each id with zero and with random actions."""
DEFAULT_IDS = (
    *("Reach-v0", "CrossGap-v0", "Climb-v0", "Traverse-v0", "Recover-v0", "Explore-v0"),
    "SnakePit-v1",
)
"""The default variant of each task."""
RANDOM_GENOTYPES = 50
RANDOM_STEP = 0.5
"""Standard deviation of random genotypes [rad]: the first step of a search from zero."""


def count_crossings(
    genotype: np.ndarray,
    pit: float,
    modules: int,
    trials: int,
    controller: str = "reactive",
    randomization: Randomization = AS_IT_IS,
    **environment: Any,
) -> int:
    """Return the number of successes in randomized trials from the floor."""
    conditions: dict[str, Any] = {"start": "floor", "seed": SEED, "workers": 2, "pit": pit, **environment}
    _, (outcome,) = evaluate(
        genotype,
        "truth",
        modules,
        trials=trials,
        controller=controller,
        randomization=randomization,
        **conditions,
    )
    return outcome.successes


def count_random_crossings(trials: int, modules: int = 8) -> int:
    """Return how many of `trials` episodes of the default environment succeed with random actions in the true arena.

    Each action is drawn from the whole action space at every step, independently of the others.
    """
    options = {"arena": "truth", "modules": modules, "autoreset_mode": "Disabled"}
    envs: Any = gym.make_vec(
        "symbrion_gym/SnakePit-v1", num_envs=trials, vectorization_mode="vector_entry_point", **options
    )
    envs.reset(seed=SEED)
    envs.action_space.seed(SEED)
    is_over, successes = np.zeros(trials, dtype=bool), 0
    while not is_over.all():
        _, _, terminated, truncated, infos = envs.step(envs.action_space.sample())
        ends = (terminated | truncated) & ~is_over
        successes += int(infos["success"][ends].sum()) if ends.any() else 0
        is_over |= ends
    envs.close()
    return successes


def count_successes(name: str, starts: int, policy: str) -> int:
    """Return how many of `starts` episodes of an id succeed, each with its own seed.

    Args:
        name: id of an environment.
        starts: number of episodes.
        policy: "zero", or "random": each action is drawn from the whole action space at every step.
    """
    envs: Any = gym.make_vec(
        name, num_envs=starts, vectorization_mode="vector_entry_point", autoreset_mode="Disabled"
    )
    envs.reset(seed=SEED)
    envs.action_space.seed(SEED)
    is_over, successes = np.zeros(starts, dtype=bool), 0
    while not is_over.all():
        still = np.zeros(envs.action_space.shape)
        _, _, terminated, truncated, infos = envs.step(
            envs.action_space.sample() if policy == "random" else still
        )
        ends = (terminated | truncated) & ~is_over
        successes += int(infos["success"][ends].sum()) if ends.any() else 0
        is_over |= ends
    envs.close()
    return successes


@dataclass(frozen=True)
class Lessons:
    """Runs of learning: of each algorithm, with each seed, of each id, in this order.

    Attributes:
        ids: names of environments without the namespace; the default variants first.
        algorithms: of `benchmarks.material.learning.ALGORITHMS`.
        seeds: one run each.
        minutes: no run begins after this time [min].
        budget: of each run.
    """

    ids: tuple[str, ...] = DEFAULT_IDS
    algorithms: tuple[str, ...] = ALGORITHMS
    seeds: tuple[int, ...] = (0, 1, 2)
    minutes: float = 600.0
    budget: Budget = field(default_factory=Budget)


class Baselines:
    """The parts, each a method of its name.

    Args:
        results: where they write.
        quick: few trials.
        report: called with each figure as text.
        lessons: runs of learning that are wanted, and their budgets.
    """

    def __init__(
        self,
        results: Results,
        quick: bool,
        report: Callable[[str], None],
        lessons: Lessons | None = None,
    ) -> None:
        self._results, self._report, self._lessons = results, report, lessons or Lessons()
        self._trials = 4 if quick else 60
        self._map_trials = 4 if quick else 30
        self._friction_trials = 4 if quick else 12
        self._default_trials = 8 if quick else DEFAULT_TRIALS
        self._starts = 4 if quick else STARTS
        self._genotypes = 4 if quick else RANDOM_GENOTYPES

    def _put(self, part: str, figures: dict[str, Any]) -> None:
        self._results.put(part, figures)
        self._report(f"{part}: {figures}")

    def default_course(self) -> None:
        """Measure the default course with 8 modules: all genes zero, hand-set genotypes, random genotypes."""
        pit, count = Course().pit, self._default_trials
        figures: dict[str, Any] = {"pit": pit, "trials": count}
        figures["zero"] = count_crossings(np.zeros(len(REACTIVE_HINT)), pit, 8, count)
        for law, hint in (("reactive", REACTIVE_HINT), ("travelling", U_SHAPE_HINT)):
            figures[f"hint of {law}"] = count_crossings(np.array(hint), pit, 8, count, law)
        rng = np.random.default_rng(SEED)
        for law in ("reactive", "path"):
            genes = len(make_controller(law, 8).parameters)
            draws = RANDOM_STEP * rng.standard_normal((self._genotypes, genes))
            found = [count_crossings(draw, pit, 8, max(count // len(draws), 1), law) for draw in draws]
            figures[f"random of {law}"] = sum(found)
        self._put("default_course", figures)

    def random_actions(self) -> None:
        """Measure the default environment with 8 modules and an action drawn at random at every step."""
        count = self._default_trials
        self._put("random_actions", {"trials": count, "successes": count_random_crossings(count)})

    def ids(self) -> None:
        """Measure zero and random actions in every id, from as many starts as seeds."""
        for name in ENVIRONMENTS:
            figures = {policy: count_successes(name, self._starts, policy) for policy in ("zero", "random")}
            short = name.removeprefix("symbrion_gym/")
            self._put(f"ids/{short}", {"starts": self._starts, **figures})

    def learning(self) -> None:
        """Learn ids by CMA-ES, PPO and SAC; a run that is stored with as large a budget is not repeated."""
        lessons, began = self._lessons, time.monotonic()
        for algorithm, seed, name in product(lessons.algorithms, lessons.seeds, lessons.ids):
            part = f"learning/{name}/{algorithm}/{seed}"
            if self._is_learned(part) or time.monotonic() - began > 60 * lessons.minutes:
                continue
            self._put(part, learn(f"symbrion_gym/{name}", algorithm, seed, lessons.budget))

    def _is_learned(self, part: str) -> bool:
        stored = self._results.content.get(part)
        if stored is None:
            return False
        had, wanted = stored["budget"], asdict(self._lessons.budget)
        return stored["solved"] or all(had[name] >= wanted[name] for name in wanted)

    def other_tasks(self) -> None:
        """Measure zero actions with six modules, and over a bottomless pit."""
        zero, count = np.zeros(len(REACTIVE_HINT)), self._trials
        six = count_crossings(zero, Course().pit, 6, count)
        bridge = {f"{pit:.2f}": count_crossings(zero, pit, 8, count, bottomless=True) for pit in ABYSSES}
        self._put("other_tasks", {"trials": count, "six modules": six, "abyss": bridge})

    def widths(self) -> None:
        """Measure zero actions by the width of the pit and the number of modules."""
        zero = np.zeros(len(REACTIVE_HINT))
        for modules in MODULES:
            row = {f"{pit:.2f}": count_crossings(zero, pit, modules, self._map_trials) for pit in PITS}
            self._put(f"widths/{modules}", {"trials": self._map_trials, "successes": row})

    def frictions(self) -> None:
        """Measure zero actions with 8 modules by the width of the pit and the friction."""
        zero = np.zeros(len(REACTIVE_HINT))
        for friction in FRICTIONS:
            fixed = Randomization(friction=(friction, friction), stretch=(1.0,))
            count = self._friction_trials
            row = {f"{pit:.2f}": count_crossings(zero, pit, 8, count, "reactive", fixed) for pit in PITS}
            self._put(f"frictions/{friction:.2f}", {"trials": count, "successes": row})


PARTS = tuple(name for name in vars(Baselines) if not name.startswith("_"))
USUAL_PARTS = tuple(name for name in PARTS if name != "learning")
"""Learning takes days, and needs the extra `rl`: it is run only when it is named."""


def run(quick: bool = False, only: tuple[str, ...] = (), lessons: Lessons | None = None) -> dict[str, Any]:
    """Measure, print, store and return the figures.

    Args:
        quick: few trials.
        only: names of the parts to measure; all but "learning" by default.
        lessons: runs of the part "learning".
    """
    results = Results("baselines")
    baselines = Baselines(results, quick, lambda text: print(text, flush=True), lessons)
    for name in only or USUAL_PARTS:
        getattr(baselines, name)()
    return results.content


def main() -> None:
    """Read the command line and run."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.baselines",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--quick", action="store_true", help="few trials")
    parser.add_argument("--only", nargs="*", default=[], choices=PARTS, help="parts to measure")
    known = [name.removeprefix("symbrion_gym/") for name in ENVIRONMENTS]
    group = parser.add_argument_group("learning", "runs that are not stored yet")
    group.add_argument("--ids", nargs="*", default=Lessons.ids, choices=known, metavar="ID")
    group.add_argument("--algorithms", nargs="*", default=ALGORITHMS, choices=ALGORITHMS)
    group.add_argument("--seeds", nargs="*", type=int, default=Lessons.seeds)
    group.add_argument("--minutes", type=float, default=Lessons.minutes, help="no run begins after this time")
    usual = Budget()
    group.add_argument("--run-minutes", type=float, default=usual.minutes, help="processor time of a run")
    group.add_argument("--robot-seconds", type=float, default=usual.robot_seconds, help="of a run")
    options = parser.parse_args()
    budget = Budget(options.robot_seconds, options.run_minutes)
    wanted = (tuple(options.ids), tuple(options.algorithms), tuple(options.seeds))
    run(options.quick, tuple(options.only), Lessons(*wanted, options.minutes, budget))


if __name__ == "__main__":
    main()
