"""A worker process: reads jobs from the pipe it was given, answers with outcomes, ends with the pipe."""

import sys

from evolution._src.backends.processes import READY, open_pipe
from evolution._src.backends.simulation import find_simulate, run_isolated
from evolution._src.errors import RunError


def main(descriptor: int, simulate_name: str) -> None:
    """Serve until the other end closes."""
    connection = open_pipe(descriptor)
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
