"""Where the map says that a body can drive, does it? A tracked robot follows routes by pure pursuit.

`python -m benchmarks.driving [--quick] [--pictures FOLDER]`

In made arenas that are known exactly, a robot is put down at 16 random drivable places of the goal's region, in random
directions, and follows the route that `arena.find_route` finds to one goal. Standing still and random tracks are the
baselines: they say how many arrive by chance.
"""

import argparse
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from benchmarks.material.driving_scenes import (
    GALLERY,
    TABLE,
    make_furnished_room,
    make_terrain,
    make_two_storeys,
)
from benchmarks.material.goal_driving import DRIVERS, NUM_STARTS, drive
from benchmarks.report import write_results
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.robot.organism import Organism, snake
from symbrion_gym._src.traversability.drawing import draw_traversability
from symbrion_gym._src.traversability.routes import Place

SCENES: dict[str, tuple[Callable[[], Arena], Place | None]] = {
    "room": (make_furnished_room, None),
    "table": (make_furnished_room, (1.1, 1.1, TABLE)),
    "storeys": (make_two_storeys, (0.4, 2.6, GALLERY)),
    "terrain": (lambda: make_terrain(0, roughness=0.06), None),
    "rough terrain": (lambda: make_terrain(1), None),
}
"""Name -> arena, and the goal; None for that which is found."""


def measure_scene(
    arena: Arena,
    goal: Place | None,
    body: Organism,
    num_starts: int,
    drivers: Iterable[str],
    picture: Path | None,
) -> dict[str, Any]:
    """Return how many drives arrive, for each driver, and the time that the map takes."""
    begin = time.process_time()
    ground = arena.traversability(body)
    seconds = time.process_time() - begin
    route = arena.find_route(body, goal=goal)
    row: dict[str, Any] = {
        "ground_area": ground.as_dict()["ground_area"],
        "region_area": float(ground.region_areas[route.region]),
        "num_starts": num_starts,
        "map_seconds": seconds,
    }
    for driver in drivers:
        drives = drive(arena, route, range(num_starts), body, driver)
        row[driver] = sum(each.has_arrived for each in drives)
        row[f"{driver}_off_ground"] = sum(each.has_left_ground for each in drives)
        row[f"{driver}_tipped_over"] = sum(each.has_tipped_over for each in drives)
    if picture is not None:
        draw_traversability(ground, picture, route)
    return row


def run(quick: bool = False, pictures: Path | None = None) -> None:
    """Measure all scenes with one and with two modules, and write the results."""
    num_starts = 4 if quick else NUM_STARTS
    measured: dict[str, Any] = {}
    for scene, (make, goal) in SCENES.items():
        arena = make()
        for modules in (1, 2):
            name = f"{scene}, {modules} module{'s' * (modules > 1)}"
            drivers = DRIVERS if modules == 1 else ("pursuit",)
            picture = None if pictures is None else pictures / f"{name}.png"
            row = measure_scene(arena, goal, snake(modules), num_starts, drivers, picture)
            measured[name] = row
            _print_row(name, row)
    write_results("driving", measured)


def _print_row(name: str, row: dict[str, Any]) -> None:
    arrived = "  ".join(
        f"{driver} {row[driver]}/{row['num_starts']} (off ground {row[f'{driver}_off_ground']}, "
        f"tipped over {row[f'{driver}_tipped_over']})"
        for driver in DRIVERS
        if driver in row
    )
    areas = f"region {row['region_area']:5.1f} of {row['ground_area']:5.1f} m²"
    print(f"{name:26} {areas}  {arrived}  map {row['map_seconds']:.2f} s", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.driving", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="4 starts instead of 16")
    parser.add_argument("--pictures", type=Path, help="folder for pictures of the maps")
    options = parser.parse_args()
    run(options.quick, options.pictures)


if __name__ == "__main__":
    main()
