"""Backends by their names."""

from collections.abc import Sequence
from typing import Protocol

from evolution._src.backends.batch import BatchBackend
from evolution._src.backends.pool import PoolConfig
from evolution._src.backends.simulation import Simulate, find_simulate
from evolution._src.backends.trials import Job, Outcome
from evolution._src.errors import RunError
from reconstruction._src.base.extras import require_extras
from reconstruction._src.base.range_checks import check_choice

EXACT_BACKENDS = ("batch", "processes", "ray")
"""Their results are equal to the bit."""
BACKENDS = (*EXACT_BACKENDS, "warp")
"""The last one is a GPU in single precision, whose results are equal in distribution only."""
LOCAL_BACKENDS = ("batch", "warp")
"""They run in this process."""


class Backend(Protocol):
    """Runs jobs on its workers."""

    def run(self, jobs: Sequence[Job]) -> list[Outcome]:
        """Return one outcome for each job, in order."""
        ...

    def close(self) -> None:
        """Stop the workers."""
        ...


def make_backend(
    name: str = "batch",
    workers: int = 1,
    address: str | None = None,
    simulate: Simulate | None = None,
    pool: PoolConfig | None = None,
) -> Backend:
    """Make a backend."""
    if workers < 1:
        raise RunError(f"workers is {workers}; at least 1 is needed")
    check_choice("backend", name, BACKENDS, RunError)
    if name == "warp":
        require_extras("backend 'warp'", "gpu")
    function = "simulate_on_device" if name == "warp" else "simulate"
    simulate = simulate or find_simulate(f"evolution._src.backends.rollout:{function}")
    if name in LOCAL_BACKENDS:
        return BatchBackend(simulate, workers)
    if name == "processes":
        from evolution._src.backends.processes import ProcessBackend

        return ProcessBackend(simulate, workers, pool)
    from evolution._src.backends.cluster import RayBackend

    return RayBackend(simulate, workers, address, pool)
