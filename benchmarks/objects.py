"""Known objects in scans of made rooms: recall, false finds, errors of the pose, time; and what can be seen at all.

Run as `python -m benchmarks.objects [--only PART ...] [--quick]`. Rooms have random sizes, 0 to 6 sockets on their
walls at any angle, and clutter, some of it on the walls and as large as a socket; a simulated scanner with a noise of
5 mm and beams 0.4° apart stands at four places (`benchmarks/material/object_rooms.py`). Seeds 0 to 99 were used for
development; the figures are those of the 20 surveys from seed 1000 on. The table of what can be found goes over four
objects, the noise and the distance of the beams. `depth` searches depth images, `real` real scans without such objects.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import reconstruction as rc
from benchmarks.material.known_objects import OBJECTS, make_socket
from benchmarks.material.object_depth import make_depth_survey
from benchmarks.material.object_rooms import MIN_READINGS, RoomScan, RoomSurvey, make_survey
from benchmarks.report import write_results
from reconstruction._src.objects.finding import FoundObject
from reconstruction._src.objects.model import compute_angle, make_model

PARTS = ("sockets", "detectability", "depth", "real")
HELD_OUT, NUM_SURVEYS = 1000, 20
SAME_PLACE = 0.1
"""A find belongs to the nearest object of its kind within this distance [m]; else it is false."""
CONDITIONS = {
    "noise 3.6 mm": RoomScan(noise=0.0036),
    "noise 5 mm": RoomScan(),
    "noise 10 mm": RoomScan(noise=0.010),
    "noise 5 mm, beams 0.8° apart": RoomScan(step=0.8),
}
SCANS = Path(__file__).parents[2] / "shared" / "data"
REAL_SCANS = ("pcl_depth_camera_room.pcd", "libpointmatcher_apartment_cloud_0.vtk", "3dtk_scan000.3d")
"""A depth camera in an office, a laser in a flat, a laser in a building."""
NUM_IMAGES = 10
NUM_PLACED = 5
"""Objects in a room of the table."""


class Judged(NamedTuple):
    """What a search found, compared with the truth.

    Attributes:
        wanted: objects with enough readings on them.
        found: those of them that were found.
        false: finds that are no object.
        position_mm: error of the origin of each that was found [mm].
        angle_deg: error of its rotation, symmetries left out of account [deg].
    """

    wanted: int
    found: int
    false: int
    position_mm: list[float]
    angle_deg: list[float]


def run(quick: bool = False, parts: tuple[str, ...] = PARTS) -> dict[str, Any]:
    """Measure and return the parts; each is written as soon as it is done.

    Args:
        quick: two surveys, and one condition.
        parts: of `PARTS`.
    """
    results: dict[str, Any] = {}
    for part in parts:
        if part == "sockets":
            results[part] = measure_sockets(2 if quick else NUM_SURVEYS)
        elif part == "detectability":
            results[part] = measure_detectability(quick)
        elif part == "depth":
            results[part] = measure_depth(2 if quick else NUM_IMAGES)
        else:
            results[part] = measure_real(REAL_SCANS[: 1 if quick else None])
        print(part, results[part])
        write_results("objects", {part: results[part]})
    return results


def measure_sockets(num_surveys: int) -> dict[str, Any]:
    """Search the held-out surveys for sockets."""
    meshes = {"socket": make_socket()}
    rc.find_objects(make_survey(meshes, 0, 0, RoomScan(step=3.0)).cloud, meshes)  # imports
    judged, seconds = [], []
    for seed in range(HELD_OUT, HELD_OUT + num_surveys):
        survey = make_survey(meshes, seed)
        begin = time.process_time()
        found = rc.find_objects(survey.cloud, meshes)
        seconds.append(time.process_time() - begin)
        judged.append(judge(survey, found, meshes))
        print(f"seed {seed}: {judged[-1]}, {seconds[-1]:.1f} s", flush=True)
    return summarize(judged) | {
        "surveys": num_surveys,
        "cpu_s_median": float(np.median(seconds)),
        "cpu_s_max": float(np.max(seconds)),
    }


def measure_detectability(quick: bool) -> dict[str, dict[str, Any]]:
    """Search a room with five objects of one kind, for every kind and condition; seeds from 2000 on."""
    rows: dict[str, dict[str, Any]] = {}
    for number, (name, make) in enumerate(OBJECTS.items()):
        meshes = {name: make()}
        for condition, how in list(CONDITIONS.items())[: 1 if quick else None]:
            survey = make_survey(meshes, 2000 + number, NUM_PLACED, how)
            found = rc.find_objects(survey.cloud, meshes)
            rows[f"{name}, {condition}"] = summarize([judge(survey, found, meshes)])
            print(f"{name}, {condition}: {rows[f'{name}, {condition}']}", flush=True)
    return rows


def measure_depth(num_images: int) -> dict[str, Any]:
    """Search depth images of rooms for sockets: as many with one, 0.6 to 1.2 m away, as without; seeds from 3000 on."""
    meshes = {"socket": make_socket()}
    judged, seconds = [], []
    with tempfile.TemporaryDirectory() as folder:
        for number in range(2 * num_images):
            distance = 0.6 + 0.6 * (number // 2) / max(num_images - 1, 1)
            survey = make_depth_survey(meshes, 3000 + number, Path(folder), distance, number % 2 == 0)
            begin = time.process_time()
            found = rc.find_objects(survey.cloud, meshes)
            seconds.append(time.process_time() - begin)
            judged.append(judge(survey, found, meshes))
            print(f"image {number}, {distance:.2f} m: {judged[-1]}, {seconds[-1]:.1f} s", flush=True)
    return summarize(judged) | {"images": 2 * num_images, "cpu_s_median": float(np.median(seconds))}


def measure_real(names: tuple[str, ...]) -> dict[str, Any]:
    """Search real scans of rooms for sockets of a kind that none of them has: every find is false."""
    meshes, rows = {"socket": make_socket()}, {}
    for name in names:
        cloud = rc.load_cloud(SCANS / name)
        begin = time.process_time()
        found = rc.find_objects(cloud, meshes)
        rows[name] = {"readings": cloud.num_points, "false": len(found), "cpu_s": time.process_time() - begin}
        print(name, rows[name], flush=True)
    return {"scans": rows, "false": sum(row["false"] for row in rows.values())}


def judge(survey: RoomSurvey, found: list[FoundObject], meshes: dict[str, Any]) -> Judged:
    """Compare finds with the truth; an object counts with `MIN_READINGS` readings on it."""
    left, position, angle, wanted = list(found), [], [], 0
    for each in survey.objects:
        mates = [one for one in left if one.name == each.name]
        off = [float(np.linalg.norm(_find_center(one, meshes) - _find_center(each, meshes))) for one in mates]
        is_found = bool(off) and min(off) < SAME_PLACE
        if is_found:
            mate = mates[int(np.argmin(off))]
            left = [one for one in left if one is not mate]
        if each.readings < MIN_READINGS:
            continue
        wanted += 1
        if is_found:
            symmetries = make_model(each.name, meshes[each.name]).symmetries
            position.append(1000 * min(off))
            angle.append(float(np.degrees(compute_angle(mate.rotation, each.rotation, symmetries))))
    return Judged(wanted, len(position), len(left), position, angle)


def summarize(judged: list[Judged]) -> dict[str, Any]:
    """Return sums and largest errors."""
    position = [off for each in judged for off in each.position_mm]
    angle = [off for each in judged for off in each.angle_deg]
    wanted, found = sum(each.wanted for each in judged), sum(each.found for each in judged)
    return {
        "wanted": wanted,
        "found": found,
        "recall": found / wanted if wanted else None,
        "false": sum(each.false for each in judged),
        "position_mm_median": float(np.median(position)) if position else None,
        "position_mm_max": max(position, default=None),
        "angle_deg_median": float(np.median(angle)) if angle else None,
        "angle_deg_max": max(angle, default=None),
    }


def _find_center(each: Any, meshes: dict[str, Any]) -> np.ndarray:
    """Return the middle of the object's area, which symmetries leave where it is [m]."""
    return each.position + each.rotation @ make_model(each.name, meshes[each.name]).center


def main() -> None:
    """Read the command line and run."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="two surveys and one condition")
    parser.add_argument("--only", choices=PARTS, nargs="+", default=PARTS, help="parts that are measured")
    given = parser.parse_args()
    run(given.quick, tuple(given.only))


if __name__ == "__main__":
    main()
