"""Tiles over a Ray cluster: the same results as here; without Ray, its extra is named."""

import sys
from pathlib import Path

import numpy as np
import pytest

from evolution._src.backends.cluster import run_in_cluster
from evolution._src.errors import RunError
from reconstruction._src.tiles.tiling import reconstruct_tile
from reconstruction._src.tiles.workers import run_here


def test_without_ray_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(RunError, match=r"pip install 'symbrion-gym\[cluster\]'"):
        run_in_cluster(2)


@pytest.mark.slow
def test_a_cluster_gives_what_this_process_gives(tmp_path: Path) -> None:
    pytest.importorskip("ray", reason="Ray is not installed: pip install 'symbrion-gym[cluster]'")
    points = np.random.default_rng(0).uniform(0, 4, (2000, 3)) * [1, 1, 0.01]
    (tmp_path / "points.f4").write_bytes(points.astype(np.float32).tobytes())
    common = {
        "points": str(tmp_path / "points.f4"),
        "method": "gsrm",
        "is_raw": True,
        "columns": 3,
        "viewpoints": None,
        "config": {"tile": 4.0},
    }

    def make_jobs(name: str) -> list[dict]:
        return [
            common | {"place": [i, 0], "seed": i, "surface": str(tmp_path / f"{name}_{i}.npz")}
            for i in range(3)
        ]

    assert list(run_in_cluster(2)(reconstruct_tile, make_jobs("a"))) == list(
        run_here(reconstruct_tile, make_jobs("b"))
    )
    for i in range(3):
        assert (tmp_path / f"a_{i}.npz").read_bytes() == (tmp_path / f"b_{i}.npz").read_bytes()
