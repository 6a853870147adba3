"""Jobs over workers that may die: nothing is lost, nothing is counted twice."""

from abc import ABC, abstractmethod
from collections import Counter, deque
from collections.abc import Sequence
from typing import Any, NamedTuple

from evolution.backends.trials import Job, Outcome, make_failure

DEATHS_ALLOWED = 2
"""A job that was alone on so many workers when they died is taken to be the reason."""


class Reply(NamedTuple):
    """What a worker says: its outcomes, or None if it died over its jobs."""

    worker: Any
    outcomes: list[Outcome] | None


class WorkerPool(ABC):
    """Deal jobs to workers, replace those that die and deal their jobs again."""

    def __init__(self, workers: int) -> None:
        self._wanted = self._room = workers
        self._workers: list[Any] = []
        self.deaths = 0

    @abstractmethod
    def _start(self) -> Any:
        """Start a worker and return it, ready."""

    def _start_several(self, count: int) -> list[Any]:
        """Start so many workers; fewer where there is no room, but one at least if there is none yet."""
        return [self._start() for _ in range(count)]

    @abstractmethod
    def _submit(self, worker: Any, jobs: list[Job]) -> None:
        """Give a worker its jobs; if it is dead already, `_wait` tells."""

    @abstractmethod
    def _wait(self, busy: Sequence[Any]) -> list[Reply]:
        """Block until at least one busy worker has replied or died."""

    @abstractmethod
    def _end(self, worker: Any) -> None:
        """Let a worker go, dead or alive."""

    def run(self, jobs: Sequence[Job]) -> list[Outcome]:
        """Return one outcome for each job, in order."""
        pending = deque(self._deal(len(jobs)))
        outcomes: dict[int, Outcome] = {}
        busy: dict[int, tuple[Any, list[int]]] = {}
        deaths: Counter[int] = Counter()
        self._room = self._wanted
        try:
            while len(outcomes) < len(jobs):
                self._hand_out(jobs, pending, busy)
                for worker, result in self._wait([worker for worker, _ in busy.values()]):
                    _, indices = busy.pop(id(worker))
                    if result is not None:
                        outcomes.update(zip(indices, result, strict=True))
                        continue
                    self._bury(worker)
                    for index in indices:
                        deaths[index] += len(indices) == 1
                        if deaths[index] < DEATHS_ALLOWED:
                            pending.append([index])
                        else:
                            outcomes[index] = make_failure(jobs[index].trials, "its worker died, twice")
        except BaseException:
            for worker, _ in busy.values():  # their replies would be taken for those of the next jobs
                self._bury(worker)
            raise
        return [outcomes[index] for index in range(len(jobs))]

    def close(self) -> None:
        """Let all workers go."""
        for worker in self._workers:
            self._end(worker)
        self._workers.clear()

    def _deal(self, count: int) -> list[list[int]]:
        size = max(1, -(-count // (2 * self._wanted)))
        return [list(range(first, min(first + size, count))) for first in range(0, count, size)]

    def _hand_out(
        self, jobs: Sequence[Job], pending: deque[list[int]], busy: dict[int, tuple[Any, list[int]]]
    ) -> None:
        missing = min(self._room, len(busy) + len(pending)) - len(self._workers)
        if missing > 0:
            started = self._start_several(missing)
            self._workers += started
            if len(started) < missing:
                self._room = len(self._workers)
        for worker in self._workers:
            if pending and id(worker) not in busy:
                indices = pending.popleft()
                busy[id(worker)] = (worker, indices)
                self._submit(worker, [jobs[index] for index in indices])

    def _bury(self, worker: Any) -> None:
        self.deaths += 1
        self._workers.remove(worker)
        self._end(worker)
