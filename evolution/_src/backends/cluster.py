"""Jobs over a Ray cluster: an existing one by its address, or a local one."""

import contextlib
import os
import socket
import sys
from collections.abc import Sequence
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

_CONNECT_TIMEOUT = 10.0
"""How long the head of a cluster may take to answer [s]; Ray itself would try for minutes."""
Handle = Any
"""Of a result that will come: Ray, an optional dependency, makes its types at run time."""


def _try_jobs(simulate_name: str, jobs: list[Job]) -> list[Outcome]:
    """Return one outcome for each job; the process of a node keeps its compiled arenas between calls."""
    return run_isolated(find_simulate(simulate_name), jobs, 1)


def _import_ray() -> Any:
    try:
        import ray
    except ImportError as error:
        raise RunError(
            "backend 'ray' needs Ray: pip install 'symbrion-gym[cluster]'; 'processes' needs nothing"
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


class RayBackend(WorkerPool[object]):
    """Workers are places in Ray's queue, of one CPU each; a task whose node dies is submitted again."""

    def __init__(self, simulate: Simulate, workers: int, address: str | None = None) -> None:
        super().__init__(workers)
        self._ray = ray = _import_ray()
        self._simulate = name_simulate(simulate)
        self._owns_cluster = not ray.is_initialized()
        if self._owns_cluster:
            _connect(ray, workers, address)
        self._task = ray.remote(num_cpus=1, max_retries=0)(_try_jobs)
        self._running: dict[Handle, object] = {}

    def _start(self) -> object:
        return object()

    def _submit(self, worker: object, jobs: list[Job]) -> None:
        self._running[self._task.remote(self._simulate, jobs)] = worker

    def _wait(self, busy: Sequence[object]) -> list[Reply[object]]:
        done, _ = self._ray.wait(list(self._running), num_returns=1)
        return [self._receive(reference) for reference in done]

    def _receive(self, reference: Handle) -> Reply[object]:
        worker = self._running.pop(reference)
        try:
            return worker, self._ray.get(reference)
        except self._ray.exceptions.RayTaskError as error:
            raise RunError(f"a worker could not try its genotypes: {error.cause}") from error
        except self._ray.exceptions.RayError:
            return worker, None  # the process or its node died

    def _stop(self, worker: object) -> None:
        for reference in [each for each, other in self._running.items() if other is worker]:
            del self._running[reference]
            with contextlib.suppress(self._ray.exceptions.RayError):
                self._ray.cancel(reference, force=True)

    def close(self) -> None:
        """Cancel what runs, and stop the cluster if it was started here."""
        super().close()
        if self._owns_cluster:
            self._ray.shutdown()


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
