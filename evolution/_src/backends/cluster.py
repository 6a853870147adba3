"""Jobs over a Ray cluster: an existing one by its address, or a local one."""

import contextlib
import os
import socket
import sys
from collections.abc import Iterator, Sequence
from typing import Any

from evolution._src.backends.pool import (
    BatchBackend,
    Reply,
    Simulate,
    WorkerPool,
    find_simulate,
    name_simulate,
    run_isolated,
)
from evolution._src.backends.scoring import Outcome
from evolution._src.backends.trials import Job
from evolution._src.errors import RunError
from reconstruction._src.base.extras import require_extras
from reconstruction._src.base.range_checks import check_choice
from reconstruction._src.tiles.workers import Job as TileJob
from reconstruction._src.tiles.workers import RunJobs, Work

_CONNECT_TIMEOUT = 10.0
"""How long the head of a cluster may take to answer [s]; Ray itself would try for minutes."""
_FIRST_START_TIMEOUT = 120.0
"""How long the first worker may take to start [s]; it imports everything on a new node."""
_START_TIMEOUT = 15.0
"""How much longer the other workers may take [s]; the next generation tries again to start those that were late."""
Handle = Any
"""Of an actor, or of a result that it will return: Ray, an optional dependency, makes its types at run time."""


class _Actor:
    """A worker on a node of the cluster; it keeps its compiled arenas between calls."""

    def __init__(self, simulate_name: str) -> None:
        self._simulate = find_simulate(simulate_name)

    def greet(self) -> None:
        """Return, which shows that the worker is ready."""

    def run(self, jobs: list[Job]) -> list[Outcome]:
        """Return one outcome for each job."""
        return run_isolated(self._simulate, jobs, 1)


def _import_ray(what: str, instead: str) -> Any:
    try:
        import ray
    except ImportError as error:
        raise RunError(
            f"{what} needs Ray: pip install 'symbrion-gym[cluster]'; {instead} needs nothing"
        ) from error
    return ray


def _connect(ray: Any, workers: int, address: str | None) -> None:
    """Connect to a running cluster, or start one on this machine; its workers find the same modules."""
    host, _, port = (address or "").removeprefix("ray://").rpartition(":")
    path = os.pathsep.join(path or os.getcwd() for path in sys.path)
    options: dict[str, Any] = {"address": address} if address else {"num_cpus": workers}
    try:
        if host and port.isdigit():
            socket.create_connection((host, int(port)), timeout=_CONNECT_TIMEOUT).close()
        ray.init(
            runtime_env={"env_vars": {"PYTHONPATH": path}},
            include_dashboard=None if address else False,
            log_to_driver=False,
            **options,
        )
    except (OSError, RuntimeError, ValueError) as error:
        raise RunError(f"no Ray cluster at {address or 'this machine'}: {error}") from error


class RayBackend(WorkerPool[Handle]):
    """Workers are actors of one CPU each; if the node of one dies, another is started elsewhere."""

    def __init__(self, simulate: Simulate, workers: int, address: str | None = None) -> None:
        super().__init__(workers)
        self._ray = ray = _import_ray("backend 'ray'", "'processes'")
        self._simulate = name_simulate(simulate)
        self._owns_cluster = not ray.is_initialized()
        if self._owns_cluster:
            _connect(ray, workers, address)
        self._actor = ray.remote(num_cpus=1, max_restarts=0)(_Actor)
        self._running: dict[Handle, Handle] = {}

    def _start(self) -> Handle:
        return self._actor.remote(self._simulate)

    def _start_many(self, count: int) -> list[Handle]:
        """Start actors at the same time, without those for which the cluster has no CPU now."""
        greetings: dict[Handle, Handle] = {}
        for _ in range(count):
            actor = self._start()
            greetings[actor.greet.remote()] = actor
        references = list(greetings)
        if not self._workers:
            self._ray.wait(references, num_returns=1, timeout=_FIRST_START_TIMEOUT)
        ready, late = self._ray.wait(references, num_returns=count, timeout=_START_TIMEOUT)
        started, reason = [], "no CPU is free"
        for reference in ready:
            try:
                self._ray.get(reference)
                started.append(greetings[reference])
            except self._ray.exceptions.RayError as error:
                reason = str(error)
        for reference in late:
            self._stop(greetings[reference])
        if not started and not self._workers:
            raise RunError(
                f"no worker starts in the Ray cluster ({reason}); look at its nodes, or use processes"
            )
        return started

    def _submit(self, worker: Handle, jobs: list[Job]) -> None:
        self._running[worker.run.remote(jobs)] = worker

    def _wait(self, busy: Sequence[Handle]) -> list[Reply[Handle]]:
        done, _ = self._ray.wait(list(self._running), num_returns=1)
        return [self._receive(reference) for reference in done]

    def _receive(self, reference: Handle) -> Reply[Handle]:
        worker = self._running.pop(reference)
        try:
            return worker, self._ray.get(reference)
        except self._ray.exceptions.RayTaskError as error:
            raise RunError(f"a worker could not try its genotypes: {error.cause}") from error
        except self._ray.exceptions.RayError:
            return worker, None  # the actor or its node died

    def _stop(self, worker: Handle) -> None:
        self._running = {
            reference: other for reference, other in self._running.items() if other is not worker
        }
        with contextlib.suppress(self._ray.exceptions.RayError):
            self._ray.kill(worker)

    def close(self) -> None:
        """Stop the actors, and the cluster if it was started here."""
        super().close()
        if self._owns_cluster:
            self._ray.shutdown()


def run_in_cluster(workers: int, address: str | None = None) -> RunJobs:
    """Return a function that runs jobs over a Ray cluster, one CPU each; for `rc.reconstruct_tiles(run_jobs=...)`.

    Jobs name files: the folder of the tiles must be one that all nodes see at the same place.
    """
    ray = _import_ray("a cluster for tiles", "processes")

    def run(work: Work, jobs: Sequence[TileJob]) -> Iterator[TileJob]:
        owns_cluster = not ray.is_initialized()
        if owns_cluster:
            _connect(ray, workers, address)
        try:
            remote = ray.remote(num_cpus=1)(work)
            for reference in [remote.remote(job) for job in jobs]:
                yield ray.get(reference)
        except ray.exceptions.RayError as error:
            raise RunError(f"a tile failed on the cluster: {error}") from error
        finally:
            if owns_cluster:
                ray.shutdown()

    return run


EXACT_BACKENDS = ("batch", "processes", "ray")  # Their results are bit-identical
BACKENDS = (*EXACT_BACKENDS, "warp")
"""The last one is a GPU in single precision, whose results are equal in distribution only."""
LOCAL_BACKENDS = ("batch", "warp")  # They run in this process
Backend = BatchBackend | WorkerPool[Any]  # Runs jobs on its workers, which `close` stops


def make_backend(
    name: str = "batch", workers: int = 1, address: str | None = None, simulate: Simulate | None = None
) -> Backend:
    """Make a backend; `simulate` tries the jobs, None means physics."""
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

        return ProcessBackend(simulate, workers)

    return RayBackend(simulate, workers, address)
