"""From a real scan of a staircase to a snake on its steps: every stage compared with known values.

`python -m benchmarks.staircase [--quick] [--pictures FOLDER]`

The scan has 3 to 6 lines on a riser and one or two on a tread, beams 1 degree apart. Three surfaces are
compared: "points": reconstructed from the raw points; "beams": from points interpolated between neighboring beams, in
a frame compressed across the stairs; "ground": the same with the hollows under the nosings filled, as convex solids
require. The arena is made of the lower steps of the ground.
"""

import argparse
import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import trimesh

import symbrion_gym as sg
from benchmarks.material.stairs import (
    FIRST_RISER,
    NUM_STEPS,
    RISE,
    TREAD,
    compare_stairs,
    crop_stairs,
    fill_between_beams,
    fill_undercuts,
    order_beams,
    squeeze_stairs,
    stretch_stairs,
)
from benchmarks.report import write_results
from evolution._src.champions.policy import ChampionPolicy
from evolution._src.controllers.controller import SENSORS
from evolution._src.search.validation import Champion
from reconstruction._src.base.atomic_write import write_atomically
from reconstruction._src.geometry.elevation import Elevation
from reconstruction._src.reconstruct import reconstruct
from reconstruction._src.scans.formats import load_points
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.arenas.making import make_arena

SCAN = Path(__file__).parents[2] / "shared" / "data" / "octomap_stairs_scan.dat.bz2"
UNITS, SPACING, SQUEEZE = 1500, 0.03, 0.15
"""Selected by inspection: units, spacing of interpolated points [m], and the factor on distances across the stairs."""
ARENA_UNITS, ARENA_END = 800, 7.1
"""Units and end of the arena with six steps [m], at the resolution of the whole staircase."""
ACCURACY, MAX_PIECES = 0.003, 64
LANE, START, GOAL = -1.0, 4.8, 6.95
"""Position of the snake across the stairs, start and goal of its head along them [m]."""
MODULES = 8
CLEARANCE = 0.02
"""A module counts as above a tread if its center is this much higher [m]: a track's radius."""
PIT_CHAMPION = (
    -0.011702629175884882,
    -0.3957574763667217,
    -0.09401420690379272,
    0.03543388241247189,
    -0.13150066341647731,
    1.1027444859748208,
    0.21524464613261396,
    -0.5344502937609202,
)
"""Evolved in the "gsrm" arena to cross its pit."""
STAIRS_CHAMPION = (0.011, 0.238, 0.031, -0.801, 0.253, 1.504, -0.011, -1.092)
"""Evolved from `PIT_CHAMPION` on the scanned stairs, in the arena that `make_stairs_arena` makes, and then adapted by
random steps to its finer pieces."""
_GENES = (
    "bias",
    "head_bias",
    "tail_bias",
    "pitch_ahead",
    "pitch_behind",
    "front_air",
    "rear_air",
    "head_pitch",
)


class Drive(NamedTuple):
    """The motion of a snake on the stairs; heights above the floor before them.

    Attributes:
        head_height: largest height of the head's center [m].
        head_way: largest distance of the head from the first riser [m].
        rear_way: largest distance of the rearmost module's center from the first riser [m].
        rear_height: largest height of its center [m].
        on_steps: largest number of modules at one time past riser 1, 2, 3 ... and above its tread.
        rolled_over: whether the episode ended because a module rolled over.
        seconds: simulated [s].
    """

    head_height: float
    head_way: float
    rear_way: float
    rear_height: float
    on_steps: list[int]
    rolled_over: bool
    seconds: float


def run(quick: bool = False, pictures: str | None = None) -> dict[str, Any]:
    """Measure and write the results.

    Args:
        quick: leave out the surface of the raw points and the champion of the pit.
        pictures: folder for pictures of the surface, the pieces and the snake.
    """
    if not SCAN.exists():
        print(f"staircase: left out, no {SCAN}")
        return {}
    scan = load_points(SCAN)
    points = scan[crop_stairs(scan)]
    meshes = {} if quick else {"points": reconstruct(points, units=1200).mesh}
    meshes |= {"beams": grow_stairs(scan), "ground": grow_stairs(scan, is_filled=True)}
    results: dict[str, Any] = {"scan": describe_scan(points)}
    results["surfaces"] = {name: compare(mesh, points) for name, mesh in meshes.items()}
    _print_surfaces(results)
    arena, surface = make_stairs_arena(scan)
    results["arena"] = arena.quality.as_dict() | {"way": arena.provenance["way"]}
    results["arena_surface"] = compare(surface, points[find_way(points) < ARENA_END])
    quality, lower = arena.quality, results["arena_surface"]
    print(
        f"surface of the arena: {lower['told_apart']} of {lower['judged']} treads within 10 mm, worst "
        f"{1e3 * lower['worst_height']:.1f} mm; hollows beneath nosings are filled, risers moved forward"
    )
    print(
        f"arena: {quality.num_pieces} pieces, {1e3 * quality.mean:.1f} mm from the surface on average, "
        f"95 % within {1e3 * quality.p95:.1f} mm, all within {1e3 * quality.max:.1f} mm "
        f"({arena.provenance['way']})"
    )
    champions = {"stairs": STAIRS_CHAMPION} | ({} if quick else {"pit": PIT_CHAMPION})
    results["drives"] = {name: drive(arena, genes)[0]._asdict() for name, genes in champions.items()}
    for name, row in results["drives"].items():
        print(
            f"champion of the {name}: head {row['head_height']:.2f} m high, {row['head_way']:+.2f} m from the "
            f"first riser; rearmost module {row['rear_height']:.2f} m, {row['rear_way']:+.2f} m; modules on "
            f"treads 1, 2 ...: {row['on_steps']}; {row['seconds']:.0f} s"
        )
    if pictures:
        draw(meshes["beams"], points, arena, Path(pictures))
    write_results("staircase", results)
    return results


def grow_stairs(
    scan: np.ndarray, is_filled: bool = False, end: float = 9.7, units: int = UNITS
) -> trimesh.Trimesh:
    """Reconstruct the stairs up to `end` along them [m], with or without filled undercuts."""
    beams = order_beams(scan)
    samples = fill_between_beams(fill_undercuts(beams) if is_filled else beams, SPACING, SQUEEZE)
    samples = samples[crop_stairs(samples) & (find_way(samples) < end)]
    mesh = reconstruct(squeeze_stairs(samples, SQUEEZE), units=units).mesh
    return trimesh.Trimesh(stretch_stairs(np.asarray(mesh.vertices), SQUEEZE), mesh.faces, process=False)


def make_stairs_arena(scan: np.ndarray) -> tuple[Arena, trimesh.Trimesh]:
    """Make the arena of the lower steps; also return its surface."""
    surface = grow_stairs(scan, is_filled=True, end=ARENA_END, units=ARENA_UNITS)
    return make_arena(surface, accuracy=ACCURACY, max_pieces=MAX_PIECES, name="staircase"), surface


def find_way(points: np.ndarray) -> np.ndarray:
    """Return the positions of points along the stairs [m]."""
    return squeeze_stairs(points, 1.0)[..., 0]


def describe_scan(points: np.ndarray) -> dict[str, Any]:
    """Count the points of every tread."""
    along = find_way(points)
    starts = FIRST_RISER + TREAD * np.arange(NUM_STEPS)
    counts = [int(((along > start + 0.08) & (along < start + 0.27)).sum()) for start in starts]
    return {"points": len(points), "points_on_tread": counts}


def compare(mesh: trimesh.Trimesh, points: np.ndarray) -> dict[str, Any]:
    """Compare a surface with the scan and with regular stairs of the known rise and tread."""
    result = compare_stairs(mesh, points)
    steps, scanned, heights, _ = np.array(result["treads"]).T
    for name, values in (("mesh", heights), ("scan", scanned)):
        off = values - RISE * steps
        result[f"{name}_from_regular"] = (off - np.median(off)).tolist()
    edges = find_risers(mesh)
    seen = np.isfinite(edges)
    result["risers"] = [float(x) if is_seen else None for x, is_seen in zip(edges, seen, strict=True)]
    result["tread"] = float(np.polyfit(np.flatnonzero(seen), edges[seen], 1)[0]) if seen.sum() > 1 else None
    return result


def find_risers(mesh: trimesh.Trimesh) -> np.ndarray:
    """Return where the surface reaches half the height of each riser, `[NUM_STEPS]` along the stairs [m]; NaN if never.

    This is the median of 25 lines up the stairs.
    """
    elevation = Elevation(mesh)
    x = np.arange(FIRST_RISER - 0.3, FIRST_RISER + NUM_STEPS * TREAD, 0.005)
    risers = []
    for y in np.linspace(-3.2, 0.9, 25):
        place = stretch_stairs(np.stack([x, np.full_like(x, y), np.zeros_like(x)], axis=-1), 1.0)
        heights = elevation.height(place[:, 0], place[:, 1])
        floor = np.nanmedian(heights[x < FIRST_RISER - 0.1])
        first = floor + 0.09  # the first riser is higher than the others
        levels = first + RISE * np.arange(NUM_STEPS)
        risers.append([x[heights >= level][0] if np.nanmax(heights) > level else np.nan for level in levels])
    risers = np.array(risers)
    few = np.isnan(risers).mean(axis=0) > 0.5
    return np.where(few, np.nan, np.nanmedian(np.where(few, 0.0, risers), axis=0))


def drive(
    arena: Arena, genes: tuple[float, ...], render_mode: str | None = None, duration: float = 60.0
) -> tuple[Drive, np.ndarray | None]:
    """Run a champion from the floor up the stairs; also return a picture at its largest height."""
    start, goal = (stretch_stairs(np.array([x, LANE, 0.0]), 1.0)[:2] for x in (START, GOAL))
    snake = sg.OrganismEnv(
        arena=arena,
        modules=MODULES,
        start=tuple(start),
        goal=tuple(goal),
        sensors=SENSORS,
        duration=duration,
        stuck_time=8.0,
        render_mode=render_mode,
    )
    champion = Champion(genes, _GENES, "reactive", MODULES, arena.name, 0, 0.0)
    policy = ChampionPolicy(champion, snake.observation_structure)
    observation, info = snake.reset(seed=0)
    state, is_over, track, highest = None, False, [], -math.inf
    picture: Any = None
    while not is_over:
        action, state = policy.predict(observation, state)
        observation, _, terminated, truncated, info = snake.step(action)
        is_over = terminated or truncated
        track.append(snake.physics.position[0].copy())
        mean_height = float(track[-1][:, 2].mean())
        if render_mode and mean_height > highest + 0.02:
            highest, picture = mean_height, snake.render()
    snake.close()
    return _describe_drive(arena, np.array(track), info), picture


def _describe_drive(arena: Arena, track: np.ndarray, info: dict[str, Any]) -> Drive:
    along = find_way(track)
    floor_x, floor_y = stretch_stairs(np.array([START, LANE, 0.0]), 1.0)[:2]
    height = track[..., 2] - float(arena.height(floor_x, floor_y))
    middles = FIRST_RISER + TREAD * (np.arange(6) + 0.5)
    places = stretch_stairs(np.stack([middles, np.full(6, LANE), np.zeros(6)], axis=-1), 1.0)
    treads = arena.height(places[:, 0], places[:, 1])
    on_steps = [
        int(((track[..., 2] > tread + CLEARANCE) & (along > middle - TREAD / 2)).sum(axis=1).max())
        for tread, middle in zip(treads, middles, strict=True)
    ]
    return Drive(
        head_height=float(height[:, 0].max()),
        head_way=float(along[:, 0].max() - FIRST_RISER),
        rear_way=float(along[:, -1].max() - FIRST_RISER),
        rear_height=float(height[:, -1].max()),
        on_steps=on_steps,
        rolled_over=bool(info["rolled_over"]),
        seconds=float(info["time"]),
    )


def draw(mesh: trimesh.Trimesh, points: np.ndarray, arena: Arena, folder: Path) -> None:
    """Draw the surface, the pieces, a section of both along the snake's path, and the snake at its largest height."""
    import matplotlib
    from PIL import Image

    matplotlib.use("Agg")
    from matplotlib import pyplot
    from matplotlib.collections import LineCollection
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    folder.mkdir(parents=True, exist_ok=True)
    for name, bodies in {"mesh": [mesh], "pieces": arena.pieces}.items():
        figure = pyplot.figure(figsize=(14, 8))
        axes: Any = figure.add_subplot(projection="3d")
        colors = pyplot.get_cmap("tab20")(np.arange(len(bodies)) % 20)
        for body, color in zip(bodies, colors, strict=True):
            axes.add_collection3d(
                Poly3DCollection(body.triangles, facecolors=color, edgecolors="k", linewidth=0.2, shade=True)
            )
        low, high = np.array([body.bounds for body in bodies]).transpose(1, 0, 2)
        low, high = low.min(axis=0), high.max(axis=0)
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
        axes.set_box_aspect(high - low)
        axes.view_init(elev=25, azim=-110)
        with write_atomically(folder / f"staircase_{name}.png") as temporary:
            figure.savefig(temporary, dpi=90, bbox_inches="tight")
        pyplot.close(figure)
    figure, axes = pyplot.subplots(figsize=(18, 8))
    x = np.arange(4.6, 9.6, 0.005)
    place = stretch_stairs(np.stack([x, np.full_like(x, LANE), np.zeros_like(x)], axis=-1), 1.0)
    turned = squeeze_stairs(points, 1.0)
    axes.plot(turned[:, 0], turned[:, 2], ".", color="0.6", markersize=2, label="scan, whole width")
    normal = stretch_stairs(np.array([0.0, 1.0, 0.0]), 1.0)
    segments = squeeze_stairs(np.asarray(trimesh.intersections.mesh_plane(mesh, normal, place[0])), 1.0)[
        ..., [0, 2]
    ]
    axes.add_collection(LineCollection(list(segments), color="b", label="surface, on the snake's path"))
    heights = Elevation(*arena.pieces).height(place[:, 0], place[:, 1])
    axes.plot(x, heights, "r", label="pieces, on the snake's path")
    axes.set(xlim=(4.6, 9.7), xlabel="along the stairs [m]", ylabel="height [m]", aspect="equal")
    axes.legend()
    with write_atomically(folder / "staircase_section.png") as temporary:
        figure.savefig(temporary, dpi=70, bbox_inches="tight")
    pyplot.close(figure)
    _, picture = drive(arena, STAIRS_CHAMPION, render_mode="rgb_array")
    if picture is not None:
        with write_atomically(folder / "staircase_snake.png") as temporary:
            Image.fromarray(picture).save(temporary)


def _print_surfaces(results: dict[str, Any]) -> None:
    counts = results["scan"]["points_on_tread"]
    print(f"scan: {results['scan']['points']} points; on treads 1 to {NUM_STEPS}: {counts}")
    compared = {int(row[0]) for row in results["surfaces"]["beams"]["treads"]}
    left_out = [step for step in range(1, NUM_STEPS + 1) if step not in compared]
    print(f"treads {left_out} have too few scan points (below 20) and are left out;")
    print("from step 7 on a column of beams has at most one point on a tread: surfaces are ramps there")
    print(
        f"surface  parts  within 10 mm  worst mm  rise mm ({1e3 * RISE:.0f})  tread mm ({1e3 * TREAD:.0f})  cloud mm"
    )
    for name, row in results["surfaces"].items():
        print(
            f"{name:8} {row['components']:5} {row['told_apart']:6} of {row['judged']:2} "
            f"{1e3 * row['worst_height']:10.1f} {1e3 * row['rise']:13.1f} {1e3 * row['tread']:14.1f} "
            f"{1e3 * row['cloud_to_mesh']:9.1f}"
        )
        for what in ("mesh", "scan"):
            print(
                f"  {what} from regular stairs, mm: {[round(1e3 * v) for v in row[f'{what}_from_regular']]}"
            )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="From a real scan of a staircase to a snake on its steps.")
    parser.add_argument(
        "--quick", action="store_true", help="only the main surfaces and the champion of the stairs"
    )
    parser.add_argument("--pictures", help="folder for pictures")
    arguments = parser.parse_args()
    run(arguments.quick, arguments.pictures)
