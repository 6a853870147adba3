"""The paper's measurements on this machine: Table I (networks), II (physics) and III (laser scan)."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import trimesh

import evolution as ev
import reconstruction as rc
import symbrion_gym as sg
from evolution.controller import SENSORS
from evolution.policy import ChampionPolicy
from symbrion_gym.sensing.rangefinder import RangeFinder

SCAN_SITE = "module_0"


@dataclass(frozen=True)
class PaperConfig:
    """How much is measured.

    Attributes:
        gsrm_units: sizes of the GSRM, Table I.
        gg_triangles: sizes of the growing grid, Table I.
        runs: crossings that are timed for each arena, Table II.
        steps: physics steps of each.
        scans: laser scans that are timed for each arena, Table III.
        seed: of the networks and the runs.
    """

    gsrm_units: tuple[int, ...] = (800, 2200, 5000)
    gg_triangles: tuple[int, ...] = (210, 1500, 13860)
    runs: int = 100
    steps: int = 3500
    scans: int = 1000
    seed: int = 0


QUICK = PaperConfig(gsrm_units=(800, 2200), gg_triangles=(1500,), runs=3, scans=100)


class NetworkRow(NamedTuple):
    """A line of Table I.

    Attributes:
        network: name and size.
        triangles: of the mesh.
        first_seconds: wall time of the first call, compilation included [s].
        seconds: of a second call [s].
        truth_to_mesh: mean distance [m].
        truth_to_mesh_p95: 95th percentile [m].
        mesh_to_truth: mean distance [m].
        boundary_loops: 1 is the rim.
    """

    network: str
    triangles: int
    first_seconds: float
    seconds: float
    truth_to_mesh: float
    truth_to_mesh_p95: float
    mesh_to_truth: float
    boundary_loops: int


class CostRow(NamedTuple):
    """Mean and standard deviation of a cost in one arena [µs].

    Attributes:
        arena: name.
        pieces: convex pieces that touch.
        triangles: of the exact surface.
        costs: name of the cost -> (mean, deviation).
    """

    arena: str
    pieces: int
    triangles: int
    costs: dict[str, tuple[float, float]]


def measure_networks(
    points: np.ndarray, truth: trimesh.Trimesh, config: PaperConfig, progress: rc.Progress = rc.silent
) -> list[NetworkRow]:
    """Reconstruct the cloud at every size, twice (Table I).

    Args:
        points: `[N, 3]` the pre-processed cloud [m].
        truth: the true surface.
        config: sizes and seed.
        progress: told how far it is.
    """
    jobs = [(f"GSRM {units}", {"method": "gsrm", "units": units}) for units in config.gsrm_units]
    jobs += [(f"GG {count} triangles", {"method": "gg", "triangles": count}) for count in config.gg_triangles]
    rows = []
    for index, (name, options) in enumerate(jobs):
        progress(name, index / len(jobs))
        seconds, result = [], None
        for _ in range(2):
            start = time.perf_counter()
            result = rc.reconstruct(points, seed=config.seed, **options)
            seconds.append(time.perf_counter() - start)
        assert result is not None
        quality = result.quality(truth)
        assert quality.truth_to_mesh is not None
        assert quality.mesh_to_truth is not None
        rows.append(
            NetworkRow(
                network=name,
                triangles=len(result.mesh.faces),
                first_seconds=seconds[0],
                seconds=seconds[1],
                truth_to_mesh=quality.truth_to_mesh.mean,
                truth_to_mesh_p95=quality.truth_to_mesh.p95,
                mesh_to_truth=quality.mesh_to_truth.mean,
                boundary_loops=quality.topology.boundary_loops,
            )
        )
    return rows


def measure_costs(
    champion: ev.Champion,
    arenas: Mapping[str, sg.Arena],
    config: PaperConfig,
    progress: rc.Progress = rc.silent,
) -> list[CostRow]:
    """Time physics, collision detection and laser scans while the champion crosses (Tables II and III).

    The arenas take turns run by run, so that a machine that slows down slows all of them down.

    Args:
        champion: drives the body.
        arenas: name -> arena.
        config: runs, steps, scans and seed.
        progress: told how far it is.
    """
    environments = {
        name: sg.SnakePitEnv(
            arena=arena, modules=champion.modules, sensors=SENSORS, start="pit", timers=True, stuck_time=90.0
        )
        for name, arena in arenas.items()
    }
    samples: dict[str, dict[str, list[float]]] = {
        name: {"physics": [], "collision": [], "scan": []} for name in arenas
    }
    for run in range(config.runs):
        for name, environment in environments.items():
            progress(f"run {run + 1} in {name}", run / config.runs)
            _time_run(environment, champion, config, run, samples[name])
    for environment in environments.values():
        environment.close()
    return [
        CostRow(
            name,
            len(arena.pieces),
            len(arena.surface.faces),
            {cost: _summarise(values) for cost, values in samples[name].items()},
        )
        for name, arena in arenas.items()
    ]


def _time_run(
    environment: sg.SnakePitEnv,
    champion: ev.Champion,
    config: PaperConfig,
    run: int,
    samples: dict[str, list[float]],
) -> None:
    policy = ChampionPolicy(champion, environment.observation_structure)
    finder = RangeFinder(environment.model, SCAN_SITE)
    ticks = config.steps // environment.config.frame_skip
    scan_every = max(1, ticks * config.runs // config.scans)
    observation, info = environment.reset(seed=config.seed + run)
    state = None
    physics, collision = [], []
    for tick in range(ticks):
        action, state = policy.predict(observation, state, position=info["x_position"])
        observation, _, terminated, truncated, info = environment.step(action)
        physics.append(info["physics_us"])
        collision.append(info["collision_us"])
        if tick % scan_every == 0:
            start = time.perf_counter()
            finder.read(environment.data)
            samples["scan"].append(1e6 * (time.perf_counter() - start))
        if terminated or truncated:
            break
    samples["physics"].append(float(np.mean(physics)))
    samples["collision"].append(float(np.mean(collision)))


def _summarise(values: Sequence[float]) -> tuple[float, float]:
    return float(np.mean(values)), float(np.std(values))
