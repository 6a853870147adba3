"""A Ray cluster of two nodes, one of which is killed while it works."""

import os
import sys
import threading
import time
from dataclasses import replace

import pytest
import toys

from evolution._src.errors import RunError
from evolution._src.search.config import EvolutionConfig
from evolution._src.search.evaluation import make_backend
from evolution._src.search.loop import evolve

try:
    import ray
    from ray.cluster_utils import Cluster
except ImportError:
    ray = None


@pytest.mark.skipif(ray is not None, reason="Ray is installed")
def test_without_ray_the_remedy_is_named():
    with pytest.raises(RunError, match=r"symbrion-gym\[cluster\]"):
        make_backend("ray", 2, simulate=toys.bowl)


@pytest.mark.slow
@pytest.mark.skipif(ray is None, reason="Ray is not installed: pip install 'symbrion-gym[cluster]'")
def test_a_node_killed_in_mid_generation_loses_nothing():
    assert ray is not None
    os.environ["PYTHONPATH"] = os.pathsep.join(sys.path)
    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1, "include_dashboard": False})
    victim = cluster.add_node(num_cpus=2)
    backend = make_backend("ray", 3, address=cluster.address, simulate=toys.slow_bowl)
    try:
        jobs = toys.make_jobs(60)
        assert backend.run(jobs) == toys.bowl(jobs, 1)
        killer = threading.Thread(
            target=lambda: (time.sleep(0.03), cluster.remove_node(victim, allow_graceful=False))
        )
        killer.start()
        many = toys.make_jobs(2000)
        assert backend.run(many) == toys.bowl(many, 1)
        killer.join()
        assert backend.run(jobs) == toys.bowl(jobs, 1)
    finally:
        backend.close()
        ray.shutdown()
        cluster.shutdown()


@pytest.mark.slow
@pytest.mark.skipif(ray is None, reason="Ray is not installed: pip install 'symbrion-gym[cluster]'")
def test_a_local_cluster_gives_what_the_batch_gives():
    jobs = toys.make_jobs()
    backend = make_backend("ray", 2, simulate=toys.bowl)
    try:
        assert backend.run(jobs) == toys.bowl(jobs, 1)
    finally:
        backend.close()


@pytest.mark.slow
@pytest.mark.skipif(ray is None, reason="Ray is not installed: pip install 'symbrion-gym[cluster]'")
def test_batch_processes_and_ray_write_the_same_history(tmp_path):
    config = EvolutionConfig(arena="truth", generations=4, stop_when_solved=False, workers=2)
    histories = []
    for backend in ("batch", "processes", "ray"):
        folder = tmp_path / backend
        evolve(replace(config, backend=backend, folder=str(folder)), simulate=toys.bowl)
        header, *rows = [line.split(",") for line in (folder / "history.csv").read_text().splitlines()]
        seconds = header.index("wall_seconds")
        histories.append([row[:seconds] + row[seconds + 1 :] for row in rows])
    assert histories[0] == histories[1] == histories[2]


def test_no_cluster_at_an_address_is_a_run_error():
    if ray is None:
        pytest.skip("Ray is not installed: pip install 'symbrion-gym[cluster]'")
    with pytest.raises(RunError, match="no Ray cluster"):
        make_backend("ray", 1, address="127.0.0.1:1", simulate=toys.bowl)
