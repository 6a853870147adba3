"""Jobs over processes of this machine.

Workers are started by `python -m evolution._src.backends.processes`, not by fork (MuJoCo and JAX hold threads) nor by
`multiprocessing`'s spawn (which runs the caller's script again).
"""

import contextlib
import multiprocessing.connection
import os
import subprocess
import sys
from collections.abc import Sequence
from multiprocessing.connection import Connection
from typing import NamedTuple

from evolution._src.backends.pool import (
    Reply,
    Simulate,
    WorkerPool,
    find_simulate,
    name_simulate,
    run_isolated,
)
from evolution._src.backends.trials import Job
from evolution._src.errors import RunError

READY = "ready"  # First message of a worker
EXIT_TIMEOUT = 5.0  # How long a worker process may take to end before it is killed [s]


class _Worker(NamedTuple):
    process: subprocess.Popen[bytes]
    connection: Connection


class ProcessBackend(WorkerPool[_Worker]):
    """Workers are processes that keep their compiled arenas between calls; only genotypes are sent."""

    def __init__(self, simulate: Simulate, workers: int) -> None:
        if sys.platform == "win32":
            raise RunError("backend 'processes' needs Linux or macOS; 'batch' gives equal results")
        super().__init__(workers)
        self._simulate = name_simulate(simulate)

    @property
    def process_ids(self) -> list[int]:
        """Process ids of the workers."""
        return [worker.process.pid for worker in self._workers]

    def _start(self) -> _Worker:
        ours, theirs = multiprocessing.Pipe()
        environment = os.environ | {"PYTHONPATH": os.pathsep.join(path or os.getcwd() for path in sys.path)}
        command = [sys.executable, "-P", "-m", "evolution._src.backends.processes"]
        process = subprocess.Popen[bytes](
            [*command, str(theirs.fileno()), self._simulate],
            env=environment,
            stdin=subprocess.DEVNULL,
            pass_fds=[theirs.fileno()],
        )
        theirs.close()
        try:
            if ours.recv() == READY:
                return _Worker(process, ours)
        except (EOFError, OSError):
            pass
        raise RunError(
            f"a worker process for {self._simulate} ended at its start (exit status {process.wait()}); "
            "its error is printed above; the backend 'batch' needs no processes"
        )

    def _submit(self, worker: _Worker, jobs: list[Job]) -> None:
        with contextlib.suppress(OSError):  # dead: `_wait` reads the end of its pipe
            worker.connection.send(jobs)

    def _wait(self, busy: Sequence[_Worker]) -> list[Reply[_Worker]]:
        ready = multiprocessing.connection.wait([worker.connection for worker in busy])
        return [self._receive(worker) for worker in busy if worker.connection in ready]

    def _receive(self, worker: _Worker) -> Reply[_Worker]:
        try:
            result = worker.connection.recv()
        except (EOFError, OSError):
            return worker, None
        if isinstance(result, RunError):
            raise result
        return worker, result

    def _stop(self, worker: _Worker) -> None:
        worker.connection.close()  # the worker reads the end and leaves
        try:
            worker.process.wait(EXIT_TIMEOUT)
        except subprocess.TimeoutExpired:
            worker.process.kill()
            worker.process.wait()


def main(descriptor: int, simulate_name: str) -> None:
    """Serve until the other end closes."""
    connection = Connection(descriptor)
    simulate = find_simulate(simulate_name)
    try:
        connection.send(READY)
        while True:
            jobs = connection.recv()
            try:
                reply = run_isolated(simulate, jobs, 1)
            except RunError as error:
                reply = error
            connection.send(reply)
    except (EOFError, OSError, KeyboardInterrupt):
        connection.close()


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2])
