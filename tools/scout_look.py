"""What a Scout is drawn by: the meshes in `assets/scout.npz`, and how they are made."""

from pathlib import Path

import numpy as np
import trimesh

from reconstruction._src.base.atomic_write import write_atomically
from symbrion_gym._src.robot.scout_constants import ARM_RADIUS, ScoutConfig

_BELT_WIDTH = 0.019  # Of the tracks' belts [m]; these and the sizes below are estimated from photographs


def make_scout_look() -> dict[str, np.ndarray]:
    """Return vertices [m] and faces of a mesh for each part and color."""
    config, arrays = ScoutConfig(), {}
    for part, solids in (("chassis", _make_chassis_look(config)), ("arm", _make_arm_look(config))):
        for color, parts in solids.items():
            mesh = trimesh.util.concatenate(parts)
            arrays[f"scout_{part}_{color}_vertices"] = np.asarray(mesh.vertices, dtype=np.float64)
            arrays[f"scout_{part}_{color}_faces"] = np.asarray(mesh.faces, dtype=np.int32)
    return arrays


def _make_chassis_look(config: ScoutConfig) -> dict[str, list[trimesh.Trimesh]]:
    """Return hull, belts, docking plates, board and eyes of a chassis by color."""
    half_x, half_y, half_z = np.array(config.size) / 2
    hull = _bevel((half_x - 0.006, half_y - _BELT_WIDTH, half_z - 0.008), 0.008)
    belts, discs = [], []
    for side in (1.0, -1.0):
        y = side * half_y
        belts += _make_belt(half_x, half_z, config.track_radius, y - side * _BELT_WIDTH / 2)
        corners = [(a * (half_x - 0.02), y, b * (half_z - 0.02)) for a in (1, -1) for b in (1, -1)]
        discs += [_disc(0.0125, 0.004, center) for center in corners]
        discs.append(_disc(0.020, 0.005, (0.0, y, 0.0)))
    plate = _box((0.003, 0.034, 0.034), (-half_x + 0.0005, 0.0, 0.0))
    bars = [_box((0.005, a, b), (-half_x, 0.0, 0.0)) for a, b in ((0.008, 0.030), (0.030, 0.008))]
    board = _box((0.052, 0.044, 0.004), (-0.006, 0.0, half_z - 0.007))
    eyes = [_disc(0.006, 0.006, (half_x - 0.004, 0.0, 0.020), axis="x")]
    eyes += [_disc(0.0035, 0.004, (half_x - 0.005, y, 0.020), axis="x") for y in (0.022, -0.022)]
    return {"dark": [hull, *bars], "rubber": belts, "steel": [*discs, plate], "green": [board], "lens": eyes}


def _make_arm_look(config: ScoutConfig) -> dict[str, list[trimesh.Trimesh]]:
    """Return two plates to the hinge and the docking plate in front by color."""
    near, reach = config.size[0] / 2 - 0.012, config.arm_reach
    middle = (near + reach) / 2 - 0.004
    plates = [_box((reach - near, 0.004, 0.020), (middle, y, 0.0)) for y in (-0.024, 0.024)]
    front = _bevel((0.005, 0.030, 0.5 * 0.046), 0.004)
    front.apply_translation((reach - 0.006, 0.0, 0.0))
    bars = [_box((0.004, a, b), (reach, 0.0, 0.0)) for a, b in ((0.008, 0.036), (0.036, 0.008))]
    axle = _disc(ARM_RADIUS * 0.6, 0.056, (near + 0.008, 0.0, 0.0))
    return {"steel": [*plates, front, axle], "dark": bars}


def _make_belt(half_x: float, half_z: float, radius: float, y: float) -> list[trimesh.Trimesh]:
    """Return a belt round four corners, and its treads."""
    angles = np.linspace(0.0, 2 * np.pi, 48, endpoint=False)
    turn = np.stack([np.cos(angles), np.sin(angles)])
    rim = np.sign(turn) * [[half_x - radius], [half_z - radius]] + (radius - 0.001) * turn
    outline = [(x, y + dy, z) for dy in (-_BELT_WIDTH / 2, _BELT_WIDTH / 2) for x, z in rim.T]
    parts = [trimesh.convex.convex_hull(np.array(outline))]
    for x in np.linspace(-half_x + 0.012, half_x - 0.012, 9):
        parts += [_box((0.004, _BELT_WIDTH, 0.002), (x, y, z)) for z in (half_z - 0.001, -half_z + 0.001)]
    for z in np.linspace(-half_z + 0.018, half_z - 0.018, 7):
        parts += [_box((0.002, _BELT_WIDTH, 0.004), (x, y, z)) for x in (half_x - 0.001, -half_x + 0.001)]
    return parts


def _box(size: tuple[float, float, float], center: tuple[float, float, float]) -> trimesh.Trimesh:
    return trimesh.creation.box(size).apply_translation(center)


def _bevel(half: tuple[float, float, float], edge: float) -> trimesh.Trimesh:
    """Return a box with its edges cut off."""
    corners = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
    points = [corners * (np.array(half) - edge * (1 - np.eye(3)[axis])) for axis in range(3)]
    return trimesh.convex.convex_hull(np.concatenate(points))


def _disc(
    radius: float, height: float, center: tuple[float, float, float], axis: str = "y"
) -> trimesh.Trimesh:
    turn = [1.0, 0.0, 0.0] if axis == "y" else [0.0, 1.0, 0.0]
    disc = trimesh.creation.cylinder(radius, height, sections=24)
    disc.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, turn))
    return disc.apply_translation(center)


if __name__ == "__main__":
    with write_atomically(Path(__file__).parents[1] / "assets" / "scout.npz") as beside:
        np.savez_compressed(beside, allow_pickle=False, **make_scout_look())
