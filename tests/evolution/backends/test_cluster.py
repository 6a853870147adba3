"""A Ray cluster of two nodes, one of which is killed while it works."""

import os
import sys
import threading
import time
from dataclasses import replace

import pytest
import toys
from histories import read_without_times

from evolution._src.backends.cluster import make_backend
from evolution._src.errors import RunError
from evolution._src.search.config import EvolutionConfig
from evolution._src.search.loop import evolve

try:
    import ray
    from ray.cluster_utils import Cluster
except ImportError:
    ray = None
needs_ray = pytest.mark.skipif(
    ray is None, reason="Ray is not installed: pip install 'symbrion-gym[cluster]'"
)


def test_without_ray_the_remedy_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(RunError, match=r"pip install 'symbrion-gym\[cluster\]'"):
        make_backend("ray", 2, simulate=toys.bowl)


@pytest.mark.long
@needs_ray
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


@pytest.mark.long
@needs_ray
def test_batch_processes_and_ray_write_the_same_history(tmp_path):
    config = EvolutionConfig(arena="truth", generations=4, stop_when_solved=False, workers=2)
    histories = []
    for backend in ("batch", "processes", "ray"):
        evolve(replace(config, backend=backend, folder=str(tmp_path / backend)), simulate=toys.bowl)
        histories.append(read_without_times(tmp_path / backend))
    assert histories[0] == histories[1] == histories[2]


@pytest.mark.long
@needs_ray
def test_a_genotype_that_kills_its_process_is_recorded():
    assert ray is not None
    jobs = toys.make_jobs(6)
    backend = make_backend("ray", 2, simulate=toys.deadly)
    try:
        outcomes = backend.run(jobs)
    finally:
        backend.close()
    for job, outcome, good in zip(jobs, outcomes, toys.bowl(jobs, 1), strict=True):
        assert outcome.error == "its worker died 2 times" if job.genotype[0] > 0.3 else outcome == good


@needs_ray
def test_no_cluster_at_an_address_is_a_run_error():
    with pytest.raises(RunError, match="no Ray cluster"):
        make_backend("ray", 1, address="127.0.0.1:1", simulate=toys.bowl)
