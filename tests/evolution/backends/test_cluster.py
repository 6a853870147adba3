"""A Ray cluster of two nodes, one of which is killed while it works; tiles over a cluster."""

import os
import sys
import threading
import time
from dataclasses import replace

import numpy as np
import pytest
import toys
from histories import read_without_times

from evolution._src.backends.cluster import make_backend, run_in_cluster
from evolution._src.errors import RunError
from evolution._src.search.config import EvolutionConfig
from evolution._src.search.loop import evolve
from reconstruction._src.tiles.tiling import reconstruct_tile
from reconstruction._src.tiles.workers import run_here

try:
    import ray
    from ray.cluster_utils import Cluster
except ImportError:
    ray = None
needs_ray = pytest.mark.skipif(
    ray is None, reason="Ray is not installed: pip install 'symbrion-gym[cluster]'"
)


@pytest.mark.parametrize(
    "use", [lambda: make_backend("ray", 2, simulate=toys.bowl), lambda: run_in_cluster(2)]
)
def test_without_ray_the_remedy_is_named(use, monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(RunError, match=r"pip install 'symbrion-gym\[cluster\]'"):
        use()


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


@needs_ray
def test_no_cluster_at_an_address_is_a_run_error():
    with pytest.raises(RunError, match="no Ray cluster"):
        make_backend("ray", 1, address="127.0.0.1:1", simulate=toys.bowl)


@pytest.mark.long
@needs_ray
def test_tiles_on_a_cluster_are_those_of_this_process(tmp_path):
    points = np.random.default_rng(0).uniform(0, 4, (2000, 3)) * [1, 1, 0.01]
    (tmp_path / "points.f4").write_bytes(points.astype(np.float32).tobytes())
    common = {"method": "gsrm", "is_raw": True, "columns": 3, "viewpoints": None, "config": {"tile": 4.0}}
    common["points"] = str(tmp_path / "points.f4")

    def make_jobs(name: str) -> list[dict]:
        places = ((number, str(tmp_path / f"{name}_{number}.npz")) for number in range(3))
        return [common | {"place": [number, 0], "seed": number, "surface": out} for number, out in places]

    there = list(run_in_cluster(2)(reconstruct_tile, make_jobs("a")))
    assert there == list(run_here(reconstruct_tile, make_jobs("b")))
    for number in range(3):
        assert (tmp_path / f"a_{number}.npz").read_bytes() == (tmp_path / f"b_{number}.npz").read_bytes()
