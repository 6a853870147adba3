"""The exam: every entry is tried again, under conditions and on scans that are drawn when the exam is held.

Nothing is believed that a submission says of itself. Its code, where it has some of its own, runs in a process that
gets observations and returns actions; environment, success and fitness are computed outside of it.
"""

import json
import multiprocessing
import os
import signal
import sys
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import cache
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from threading import Timer
from time import monotonic
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from evolution._src.backends.cluster import Backend, make_backend
from evolution._src.backends.pool import Simulate
from evolution._src.backends.scoring import Scoring
from evolution._src.backends.settings import read_organism
from evolution._src.backends.trials import Job
from evolution._src.controllers.finding import check_genotype, find_controller, find_of_module
from evolution._src.controllers.protocol import Structure, reset_rows
from evolution._src.errors import EvolutionError, RunError
from evolution._src.references import check_allowed
from evolution._src.suite.submission import Entry, Submission
from evolution._src.suite.tasks import SuiteTask, find_suite_task, make_true_arena
from reconstruction._src.base.printable import make_printable
from reconstruction._src.base.progress import Progress, silent
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.environment.config import count_tracks

TRIALS = 10  # Trials of an entry, on the scan and in the truth each
SCORING = Scoring(module=0.0)
"""The fitness of a score: progress [m], 1 for a success rate of 1, less the effort."""
LONGEST_LINE = 500  # Characters of what is shown of a provenance, or of why something was not tried
_TOLD = ("name", "version", "sensors", "parameters", "lower", "upper", "initial")
_PATIENCE = 600.0  # A controller that needs longer for its trials in an arena hangs [s]
_PRIVILEGED = {"odometry", "goal"}  # Sensors that tell the exact pose
_LONGEST = 1 << 24  # Bytes of an answer of a controller


class Score(NamedTuple):
    """How an entry fared."""

    fitness: float  # mean over trials, see `evolution._src.backends.scoring`
    successes: int  # successful trials of `TRIALS`


class Result(NamedTuple):
    """An entry that was tried."""

    submission: str  # name of its submission
    entry: Entry
    scan: Score  # on a scan that was made for the exam
    truth: Score  # in the exact arena


class Exam(NamedTuple):
    """What an exam has found."""

    seed: int  # of its conditions and scans
    results: tuple[Result, ...]
    untried: tuple[tuple[str, str], ...]  # name of a submission, and why it has no result


def hold_exam(
    submissions: Sequence[Submission],
    seed: int,
    allow: Collection[str] = (),
    workers: int = 1,
    progress: Progress = silent,
    simulate: Simulate | None = None,
) -> Exam:
    """Try every entry of submissions; one whose code fails, or is not allowed, leaves its submission without results.

    Args:
        submissions: what is examined; of equal names the first.
        seed: of conditions and scans; draw it, and publish it with the results.
        allow: modules of controllers that may be imported, each in a process of its own.
        workers: number of threads; they change nothing but the time.
        progress: called with each entry.
        simulate: in place of the physics, for tests.
    """
    names = [submission.name.casefold() for submission in submissions]
    backend = make_backend("batch", workers, simulate=simulate)
    results: list[Result] = []
    untried = []
    total, done = sum(len(each.entries) for each in submissions), 0
    try:
        for number, submission in enumerate(submissions):
            own = []
            try:
                if names.index(names[number]) < number or not submission.entries:
                    raise RunError("it has no entries, or the name of another submission")
                for entry in submission.entries:
                    progress(f"{submission.name}: {entry.task}, seed {entry.seed}", done / total)
                    own.append(_examine(submission.name, entry, seed, allow, backend))
                    done += 1
            except EvolutionError as error:
                untried.append((submission.name, make_printable(error, LONGEST_LINE)))
            else:
                results += own
    finally:
        backend.close()
    return Exam(seed, tuple(results), tuple(untried))


@cache
def make_exam_scan(place: str, seed: int) -> Arena:
    """Return the arena of a new scan of the place of a task, made as those that ship."""
    from reconstruction._src.reconstruct import reconstruct
    from reconstruction._src.scans.preprocess import preprocess
    from reconstruction._src.scans.selection import thin
    from symbrion_gym._src.arenas.making import make_arena
    from symbrion_gym._src.sensing.survey import SPACING, survey

    points = thin(preprocess(survey(make_true_arena(place), seed=seed)), SPACING)
    return make_arena(reconstruct(points, "gsrm", units=2200, seed=seed).mesh, name=place, seed=seed)


def _examine(name: str, entry: Entry, seed: int, allow: Collection[str], backend: Backend) -> Result:
    """Return the result of an entry."""
    task = find_suite_task(entry.task)
    arenas = make_exam_scan(task.place, seed), make_true_arena(task.place)
    scores = []
    for number, arena in enumerate(arenas):  # in a new process: nothing is learned from one for the other
        with _open_controller(task, entry, allow) as controller:
            if isinstance(controller, _Outside):
                check_genotype(entry.task, entry.genotype, controller)
            trials = task.make_trials(arena, entry.body, controller, TRIALS, (seed, number))
            outcome = backend.run([Job(np.asarray(entry.genotype, dtype=float), trials)])[0]
        if outcome.error:
            raise RunError(f"{task.name}, seed {entry.seed}: it cannot be tried: {outcome.error}")
        scores.append(Score(SCORING.score(outcome, 0), outcome.successes))
    return Result(name, entry, *scores)


@contextmanager
def _open_controller(task: SuiteTask, entry: Entry, allow: Collection[str]) -> Iterator[Any]:
    """Yield the law that an entry names, or what stands for a controller that runs in a process of its own."""
    if ":" not in entry.controller:
        yield entry.controller
        return
    check_allowed(entry.controller, "controller", allow)
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    organism = read_organism(entry.body)
    num_tracks = count_tracks(str(task.make_options()["track_control"]), organism.num_modules)
    process = context.Process(
        target=_serve, args=(theirs, entry.controller, entry.body, num_tracks), daemon=True
    )
    before = os.environ.get("PYTHONSAFEPATH", "")
    os.environ["PYTHONSAFEPATH"] = "1"  # the new process takes no module of Python's from the working folder
    try:
        process.start()
    finally:
        os.environ["PYTHONSAFEPATH"] = before
    theirs.close()
    timer = Timer(_PATIENCE, _kill, (process,))  # which ends a wait for the rest of an answer
    timer.start()
    try:
        yield _Outside(ours)
    finally:
        timer.cancel()
        ours.close()
        _kill(process)
        process.join()


def _kill(process: BaseProcess) -> None:
    """Kill a process, and those that it has started."""
    if process.pid is not None and hasattr(os, "killpg"):
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(process.pid, signal.SIGKILL)
    process.kill()


class _Outside:
    """A controller in another process: it follows `Controller`. Of what comes back nothing but numbers is read."""

    def __init__(self, connection: Connection) -> None:
        self._connection, self._until = connection, monotonic() + _PATIENCE
        told = self._receive()
        try:
            name, version, *others = (json.loads(told)[each] for each in _TOLD)
            self.name, self.version = str(name), str(version)
            self.sensors, self.parameters = (tuple(map(str, each)) for each in others[:2])
            self.lower, self.upper, self.initial = (tuple(map(float, each)) for each in others[2:])
        except (KeyError, TypeError, ValueError, OverflowError, RecursionError) as error:
            raise RunError(f"the process of the controller tells no controller: {error}") from error
        if told := _PRIVILEGED.intersection(self.sensors):
            raise RunError(
                f"the controller reads {', '.join(sorted(told))}, which no robot knows; leave it out"
            )

    def begin(self, count: int) -> Bool[np.ndarray, " P"]:
        """Return which rows begin: the memory itself stays in the process."""
        return np.ones(count, dtype=bool)

    def act(
        self,
        observation: Float[np.ndarray, "P O"],
        genotype: Float[np.ndarray, "P G"],
        structure: Structure,
        state: Bool[np.ndarray, " P"],
    ) -> tuple[Float[np.ndarray, "P A"], Bool[np.ndarray, " P"]]:
        """Let the process act."""
        with suppress(OSError):  # dead: what is received says so
            self._connection.send((observation, np.array(genotype), dict(structure), state))
        numbers = np.frombuffer(self._receive(), dtype=np.float64)
        return numbers.reshape(len(observation), -1), np.zeros_like(state)

    def _receive(self) -> bytes:
        """Return what the process answers."""
        try:
            if self._connection.poll(max(self._until - monotonic(), 0.0)):
                return self._connection.recv_bytes(_LONGEST)
        except (EOFError, OSError) as error:
            raise RunError(
                "the process of the controller has ended; its error is on standard error"
            ) from error
        raise RunError(f"the controller took longer than {_PATIENCE:g} s for an arena")


def _serve(connection: Connection, source: str, body: str, num_tracks: int) -> None:
    """Act for a controller until the connection is closed."""
    if hasattr(os, "setsid"):
        os.setsid()  # so that what it starts ends with it
    os.dup2(2, 1)  # what it prints is no output of ours
    sys.argv = sys.argv[:1]  # which may hold the seed of the exam
    try:
        _act_for(connection, source, body, num_tracks)
    except Exception as error:
        sys.exit(f"{source}: {make_printable(error, LONGEST_LINE)}")  # on standard error


def _act_for(connection: Connection, source: str, body: str, num_tracks: int) -> None:
    controller = find_controller(find_of_module(source), read_organism(body), num_tracks)
    connection.send_bytes(json.dumps({each: getattr(controller, each) for each in _TOLD}).encode())
    state: Any = None
    while True:
        try:
            observation, genotype, structure, is_new = connection.recv()
        except EOFError:
            return
        state = controller.begin(len(is_new)) if is_new.all() else reset_rows(controller, state, is_new)
        actions, state = controller.act(observation, genotype, structure, state)
        connection.send_bytes(np.ascontiguousarray(actions, dtype=np.float64).tobytes())
