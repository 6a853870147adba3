"""Work on tiles, here or in processes of this machine: a job and its result are plain data, files hold the rest."""

import importlib
import itertools
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from reconstruction._src.base.errors import ReconstructionError

Job = dict[str, Any]  # Plain data, as JSON has it
Work = Callable[[Job], Job]  # A function of a module
RunJobs = Callable[[Work, Sequence[Job]], Iterator[Job]]
"""Runs jobs and yields their results in order."""


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
        processes = [_start(work, jobs[first::workers]) for first in range(min(workers, len(jobs)))]
        try:
            for process, job in zip(itertools.cycle(processes), jobs, strict=False):
                assert process.stdout is not None
                line = process.stdout.readline()
                if not line:
                    place = job.get("place")
                    raise ReconstructionError(
                        f"a worker died on tile {place}; take fewer workers or smaller tiles"
                    )
                yield json.loads(line)
        finally:
            for process in processes:
                process.kill()
                process.wait()

    return run


def _start(work: Work, jobs: Sequence[Job]) -> subprocess.Popen[str]:
    """Start a process that does some jobs and writes each result as a line."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(path or os.getcwd() for path in sys.path)}
    words = [sys.executable, "-P", "-m", "reconstruction._src.tiles.workers", work.__module__, work.__name__]
    with tempfile.TemporaryFile("w+") as file:  # a pipe for them could be full while that of the results is
        file.writelines(f"{json.dumps(job)}\n" for job in jobs)
        file.seek(0)
        return subprocess.Popen(words, stdin=file, stdout=subprocess.PIPE, text=True, env=environment)


def serve(module: str, name: str) -> None:
    """Answer jobs on standard input, one a line, until it ends."""
    work = getattr(importlib.import_module(module), name)
    answers = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)  # whatever a library prints goes to standard error
    for line in sys.stdin:
        answers.write(json.dumps(work(json.loads(line))) + "\n")


if __name__ == "__main__":
    serve(*sys.argv[1:3])
