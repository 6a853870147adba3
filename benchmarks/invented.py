"""Faces that a network invented, of made scenes: found by how far readings are, and by a second model.

    python -m benchmarks.invented [--scenes room table]

The readings are split into halves, as in a training, and a network is fitted to each. A face is invented where it lies
more than 5 cm off the truth. Two rules look for such faces: those far from the readings (`find_far_faces`, which cuts
them off, and `find_unseen`, which keeps robots off them), and those more than 2 cm off the other half's model. Shares
are of areas.
"""

from __future__ import annotations

import argparse

import numpy as np
import trimesh

import reconstruction as rc
from benchmarks.evidence.judge import measure_distances
from benchmarks.material.made_scenes import SCENES
from evolution._src.experiments.train import split_readings
from reconstruction._src.geometry.rows import compute_areas, drop_unused
from reconstruction._src.surfaces.far_faces import find_far_faces, select_faces
from symbrion_gym._src.arenas.scanned import find_unseen

INVENTED, CONFIRMED = 0.05, 0.02


def measure_scene(name: str, places: int) -> dict[str, float]:
    """Return the share of the area that is invented, and what each rule finds of it and loses of the rest.

    Args:
        name: of a made scene.
        places: the scanner stood at so many of its places: from one, much lies in shadows.
    """
    made = SCENES[name]()
    cloud = rc.Cloud(made.points, viewpoints=made.viewpoints, seen_from=made.seen_from)
    cloud = cloud.select(np.asarray(cloud.seen_from) < places)
    models = []
    for seed, half in enumerate(split_readings(cloud)):
        points = rc.preprocess_cloud(half)
        network = rc.reconstruct(points, readings=half, seed=seed).state  # before far faces are cut off
        models.append((*drop_unused(network.units.reshape(-1, 3), network.faces.astype(np.int64)), points))
    (vertices, faces, points), other = models[0], trimesh.Trimesh(*models[1][:2], process=False)
    area = compute_areas(vertices, faces)

    def lies_off(mesh, limit):
        return select_faces(vertices, faces, lambda places: measure_distances(places, mesh) > limit)

    invented = lies_off(made.truth, INVENTED)
    far = find_far_faces(vertices, faces, points.points, points.viewpoints, points.seen_from)
    far[list(find_unseen(trimesh.Trimesh(vertices, faces, process=False), points.points))] = True
    rules = {"far": far, "other": lies_off(other, CONFIRMED)}
    rules["both"] = rules["far"] | rules["other"]
    real = ~invented
    row = {"invented": float(area[invented].sum() / area.sum())}
    for rule, found in rules.items():
        row[f"{rule} finds"] = float(area[found & invented].sum() / max(area[invented].sum(), 1e-12))
        row[f"{rule} loses"] = float(area[found & real].sum() / area[real].sum())
    return row


def main() -> None:
    """Print a line for each scene."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", nargs="*", default=[*SCENES])
    for name in parser.parse_args().scenes:
        for places, text in ((1, "one place"), (99, "all places")):
            row = measure_scene(name, places)
            shares = (f"{key} {100 * value:.1f} %" for key, value in row.items())
            print(f"{name:14s}{text:12s}", *shares, sep="  ", flush=True)


if __name__ == "__main__":
    main()
