"""Work on the tiles of a large scan over a Ray cluster."""

from collections.abc import Iterator, Sequence

from evolution._src.backends.cluster import connect_cluster
from evolution._src.errors import RunError
from reconstruction._src.tiles.workers import Job, RunJobs, Work

_CONNECT_TIMEOUT = 10.0
"""How long a cluster may take to answer [s]."""


def run_in_cluster(workers: int, address: str | None = None) -> RunJobs:
    """Return a function that runs jobs over a Ray cluster, one CPU each; for `rc.reconstruct_tiles(run_jobs=...)`.

    Jobs name files: the folder of the tiles must be one that all nodes see at the same place.
    """
    try:
        import ray
    except ImportError as error:
        raise RunError(
            "tiles on a cluster need Ray: pip install 'symbrion-gym[cluster]'; processes need nothing"
        ) from error

    def run(work: Work, jobs: Sequence[Job]) -> Iterator[Job]:
        owns_cluster = not ray.is_initialized()
        if owns_cluster:
            connect_cluster(ray, workers, address, _CONNECT_TIMEOUT)
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
