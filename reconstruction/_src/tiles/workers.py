"""Work on tiles, here or in processes of this machine; any other place needs a function like these.

A job and its result are plain data, and files hold the rest: on several machines the folder must be a shared one.
"""

from __future__ import annotations

import importlib
import json
import os
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from reconstruction._src.base.errors import ReconstructionError

Job = dict[str, Any]  # Plain data, as JSON has it
Work = Callable[[Job], Job]  # A function of a module
RunJobs = Callable[[Work, Sequence[Job]], Iterator[Job]]
"""Runs jobs anywhere and yields their results in order. `evolution` has one for Ray."""


def run_here(work: Work, jobs: Sequence[Job]) -> Iterator[Job]:
    """Run jobs one after the other in this process."""
    return map(work, jobs)


def run_in_processes(workers: int) -> RunJobs:
    """Return a function that runs jobs in processes of this machine.

    Processes are started by `python -m`, not by fork (JAX holds threads) nor by `multiprocessing`'s spawn (which runs
    the caller's script again).
    """
    if workers < 1:
        raise ReconstructionError(f"workers is {workers}; 1 or more are needed")
    if workers == 1:
        return run_here

    def run(work: Work, jobs: Sequence[Job]) -> Iterator[Job]:
        processes: list[subprocess.Popen[str]] = []
        own = threading.local()  # each thread has a process

        def begin() -> None:
            own.process = _start(work)
            processes.append(own.process)

        try:
            with ThreadPoolExecutor(workers, initializer=begin) as threads:
                yield from threads.map(lambda job: _ask(own.process, job), jobs)
        finally:
            for process in processes:
                process.kill()
                process.wait()

    return run


def _start(work: Work) -> subprocess.Popen[str]:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(path or os.getcwd() for path in sys.path)}
    words = [sys.executable, "-P", "-m", "reconstruction._src.tiles.workers", work.__module__, work.__name__]
    return subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment)


def _ask(process: subprocess.Popen[str], job: Job) -> Job:
    assert process.stdin is not None
    assert process.stdout is not None
    try:
        process.stdin.write(json.dumps(job) + "\n")
        process.stdin.flush()
        line = process.stdout.readline()
    except OSError:
        line = ""
    if not line:
        raise ReconstructionError(
            f"a worker died on tile {job.get('place')}; take fewer workers or smaller tiles"
        )
    return json.loads(line)


def serve(module: str, name: str) -> None:
    """Answer jobs on standard input, one a line, until it ends."""
    work = getattr(importlib.import_module(module), name)
    answers = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)  # whatever a library prints goes to standard error
    for line in sys.stdin:
        answers.write(json.dumps(work(json.loads(line))) + "\n")


if __name__ == "__main__":
    serve(*sys.argv[1:3])
