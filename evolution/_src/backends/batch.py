"""All jobs in this process."""

from collections.abc import Sequence

from evolution._src.backends.simulation import Simulate, run_isolated
from evolution._src.backends.trials import Job, Outcome


class BatchBackend:
    """All jobs in this process, on the threads of `mujoco.batch`.

    Args:
        simulate: tries the jobs.
        workers: number of threads.
    """

    def __init__(self, simulate: Simulate, workers: int) -> None:
        self._simulate, self._workers = simulate, workers

    def run(self, jobs: Sequence[Job]) -> list[Outcome]:
        """Return one outcome for each job, in order."""
        return run_isolated(self._simulate, jobs, self._workers) if jobs else []

    def close(self) -> None:
        """Do nothing: there are no workers to stop."""
