"""Jobs over workers that may die: no job is lost and none is counted twice."""

from abc import ABC, abstractmethod
from collections import Counter, deque
from collections.abc import Sequence
from typing import Generic, NamedTuple, TypeVar

from evolution._src.backends.outcome import Outcome
from evolution._src.backends.trials import Job, make_failure

Worker = TypeVar("Worker")


BATCHES_PER_WORKER = 2
"""About how many batches of jobs each worker gets in a generation. 2 keeps the wait for the slowest batch
short; more would leave the batch of a worker too small."""
MAX_DEATHS = 2
"""A job that was alone on this many workers when they died is reported as failed. 2, because one death may
have any reason."""
EXIT_TIMEOUT = 5.0  # How long a worker process may take to end before it is killed [s]
CONNECT_TIMEOUT = 10.0
"""How long the head of a Ray cluster may take to answer [s]; Ray itself would try for minutes."""
FIRST_START_TIMEOUT = 120.0
"""How long the first worker of a Ray cluster may take to start [s]; it imports everything on a new node."""
START_TIMEOUT = 15.0
"""How much longer the other workers may take [s]; the next generation tries again to start those that were
late."""


class Reply(NamedTuple, Generic[Worker]):
    """The reply of a worker."""

    worker: Worker  # worker that replies
    outcomes: list[Outcome] | None  # one for each of its jobs; None if it died


class WorkerPool(ABC, Generic[Worker]):
    """Distribute jobs over workers, replace those that die and submit their jobs again.

    Args:
        workers: number of workers.

    Attributes:
        num_deaths: number of workers that have died so far.
    """

    def __init__(self, workers: int) -> None:
        self._num_wanted = self._capacity = workers
        self._workers: list[Worker] = []
        self.num_deaths = 0

    @abstractmethod
    def _start(self) -> Worker:
        """Start a worker and return it, ready."""

    def _start_many(self, count: int) -> list[Worker]:
        """Start `count` workers; fewer where resources are missing, but at least one if there is none yet."""
        return [self._start() for _ in range(count)]

    @abstractmethod
    def _submit(self, worker: Worker, jobs: list[Job]) -> None:
        """Send jobs to a worker; if it is dead already, `_wait` reports it."""

    @abstractmethod
    def _wait(self, busy: Sequence[Worker]) -> list[Reply[Worker]]:
        """Block until at least one busy worker has replied or died."""

    @abstractmethod
    def _stop(self, worker: Worker) -> None:
        """Stop a worker, dead or alive."""

    def run(self, jobs: Sequence[Job]) -> list[Outcome]:
        """Return one outcome for each job, in order."""
        pending = deque(self._make_batches(len(jobs)))
        outcomes: dict[int, Outcome] = {}
        busy: dict[int, tuple[Worker, list[int]]] = {}
        deaths: Counter[int] = Counter()
        self._capacity = self._num_wanted
        try:
            while len(outcomes) < len(jobs):
                self._assign(jobs, pending, busy)
                for worker, result in self._wait([worker for worker, _ in busy.values()]):
                    _, indices = busy.pop(id(worker))
                    if result is not None:
                        outcomes.update(zip(indices, result, strict=True))
                        continue
                    self._remove(worker)
                    for index in indices:
                        deaths[index] += len(indices) == 1
                        if deaths[index] < MAX_DEATHS:
                            pending.append([index])
                        else:
                            outcomes[index] = self._give_up(jobs[index])
        except BaseException:
            for worker, _ in busy.values():  # their replies would be taken for those of the next jobs
                self._remove(worker)
            raise
        return [outcomes[index] for index in range(len(jobs))]

    def close(self) -> None:
        """Stop all workers."""
        for worker in self._workers:
            self._stop(worker)
        self._workers.clear()

    def _make_batches(self, count: int) -> list[list[int]]:
        size = max(1, -(-count // (BATCHES_PER_WORKER * self._num_wanted)))
        return [list(range(first, min(first + size, count))) for first in range(0, count, size)]

    def _assign(
        self, jobs: Sequence[Job], pending: deque[list[int]], busy: dict[int, tuple[Worker, list[int]]]
    ) -> None:
        missing = min(self._capacity, len(busy) + len(pending)) - len(self._workers)
        if missing > 0:
            started = self._start_many(missing)
            self._workers += started
            if len(started) < missing:
                self._capacity = len(self._workers)
        for worker in self._workers:
            if pending and id(worker) not in busy:
                indices = pending.popleft()
                busy[id(worker)] = (worker, indices)
                self._submit(worker, [jobs[index] for index in indices])

    def _remove(self, worker: Worker) -> None:
        self.num_deaths += 1
        self._workers.remove(worker)
        self._stop(worker)

    def _give_up(self, job: Job) -> Outcome:
        return make_failure(job.trials, f"its worker died {MAX_DEATHS} times")
