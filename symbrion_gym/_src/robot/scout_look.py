"""How a Scout module looks: a few meshes of plain solids, one per color, shared by all modules.

Sizes are in meters, estimated from photographs. They change images alone: rays and contacts meet other geoms.
"""

from __future__ import annotations

import mujoco
import numpy as np
import trimesh

from symbrion_gym._src.robot.scout_constants import ARM_RADIUS, ScoutConfig

VISUAL_GROUP = 1
"""Geom group of what is drawn; rays pass through it and hit the chassis boxes instead, which is faster."""
_COLORS = {
    "dark": (0.17, 0.18, 0.20, 1.0),
    "rubber": (0.07, 0.07, 0.08, 1.0),
    "steel": (0.74, 0.76, 0.78, 1.0),
    "green": (0.28, 0.62, 0.30, 1.0),
    "lens": (0.85, 0.16, 0.12, 1.0),
}
_UNSEEN = "scout_unseen_by_rays"
"""A material without opacity: rays pass, while the color of the geom itself is drawn."""
_BELT_WIDTH = 0.019  # Of the tracks' belts [m]


def add_chassis_visual(
    spec: mujoco.MjSpec, frame: mujoco.MjsFrame, body: mujoco.MjsBody, config: ScoutConfig
) -> None:
    """Add the visual geoms of a chassis: hull, belts, docking plates, board, eyes."""
    _add_visual(spec, frame, body, "chassis", _make_chassis(config))


def add_arm_visual(
    spec: mujoco.MjSpec, frame: mujoco.MjsFrame, body: mujoco.MjsBody, config: ScoutConfig
) -> None:
    """Add the visual geoms of the hinged arm: two plates to the hinge and the docking plate in front."""
    _add_visual(spec, frame, body, "arm", _make_arm(config))


def _add_visual(
    spec: mujoco.MjSpec, frame: mujoco.MjsFrame, body: mujoco.MjsBody, part: str, solids: dict[str, list]
) -> None:
    if spec.material(_UNSEEN) is None:
        spec.add_material(name=_UNSEEN, rgba=[1.0, 1.0, 1.0, 0.0], specular=0.3, shininess=0.4)
    for color, parts in solids.items():
        name = f"scout_{part}_{color}"
        if spec.mesh(name) is None:
            mesh = _join(parts)
            spec.add_mesh(
                name=name,
                uservert=np.asarray(mesh.vertices, dtype=np.float64).ravel(),
                userface=np.asarray(mesh.faces, dtype=np.int32).ravel(),
                inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
            )
        geom = body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_MESH,
            meshname=name,
            material=_UNSEEN,
            mass=0,
            group=VISUAL_GROUP,
            contype=0,
            conaffinity=0,
            rgba=_COLORS[color],
        )
        geom.set_frame(frame)


def _make_chassis(config: ScoutConfig) -> dict[str, list[trimesh.Trimesh]]:
    half_x, half_y, half_z = np.array(config.size) / 2
    inner = half_y - _BELT_WIDTH
    hull = _bevel((half_x - 0.006, inner, half_z - 0.008), 0.008)
    belts, discs = [], []
    for side in (1.0, -1.0):
        y = side * (half_y - _BELT_WIDTH / 2)
        belts.append(_make_belt(half_x, half_z, config.track_radius, y))
        discs += [
            _disc(0.0125, 0.004, (x, side * half_y, z))
            for x in (half_x - 0.02, -half_x + 0.02)
            for z in (half_z - 0.02, -half_z + 0.02)
        ]
        discs.append(_disc(0.020, 0.005, (0.0, side * half_y, 0.0)))
    plate = _box((0.003, 0.034, 0.034), (-half_x + 0.0005, 0.0, 0.0))
    bars = [
        _box((0.005, 0.008, 0.030), (-half_x, 0.0, 0.0)),
        _box((0.005, 0.030, 0.008), (-half_x, 0.0, 0.0)),
    ]
    board = _box((0.052, 0.044, 0.004), (-0.006, 0.0, half_z - 0.007))
    eyes = [_disc(0.006, 0.006, (half_x - 0.004, 0.0, 0.020), axis="x")]
    eyes += [_disc(0.0035, 0.004, (half_x - 0.005, side * 0.022, 0.020), axis="x") for side in (1.0, -1.0)]
    return {"dark": [hull, *bars], "rubber": belts, "steel": [*discs, plate], "green": [board], "lens": eyes}


def _make_arm(config: ScoutConfig) -> dict[str, list[trimesh.Trimesh]]:
    near, reach = config.size[0] / 2 - 0.012, config.arm_reach
    plates = [
        _box((reach - near, 0.004, 0.020), ((near + reach) / 2 - 0.004, y, 0.0)) for y in (-0.024, 0.024)
    ]
    front = _bevel((0.005, 0.030, 0.5 * 0.046), 0.004)
    front.apply_translation((reach - 0.006, 0.0, 0.0))
    bars = [_box((0.004, 0.008, 0.036), (reach, 0.0, 0.0)), _box((0.004, 0.036, 0.008), (reach, 0.0, 0.0))]
    axle = _disc(ARM_RADIUS * 0.6, 0.056, (near + 0.008, 0.0, 0.0))
    return {"steel": [*plates, front, axle], "dark": bars}


def _make_belt(half_x: float, half_z: float, radius: float, y: float) -> trimesh.Trimesh:
    """Return a belt with treads round four corners."""
    angles = np.linspace(0.0, 2 * np.pi, 48, endpoint=False)
    corners = np.stack(
        [np.sign(np.cos(angles)) * (half_x - radius), np.sign(np.sin(angles)) * (half_z - radius)]
    )
    rim = corners + (radius - 0.001) * np.stack([np.cos(angles), np.sin(angles)])
    outline = np.concatenate(
        [[(x, y + dy, z) for x, z in rim.T] for dy in (-_BELT_WIDTH / 2, _BELT_WIDTH / 2)]
    )
    belt = trimesh.convex.convex_hull(outline)
    treads = []
    for x in np.linspace(-half_x + 0.012, half_x - 0.012, 9):
        treads += [_box((0.004, _BELT_WIDTH, 0.002), (x, y, z)) for z in (half_z - 0.001, -half_z + 0.001)]
    for z in np.linspace(-half_z + 0.018, half_z - 0.018, 7):
        treads += [_box((0.002, _BELT_WIDTH, 0.004), (x, y, z)) for x in (half_x - 0.001, -half_x + 0.001)]
    return _join([belt, *treads])


def _join(parts: list[trimesh.Trimesh]) -> trimesh.Trimesh:
    offsets = np.cumsum([0, *(len(part.vertices) for part in parts)])
    faces = [part.faces + offset for part, offset in zip(parts, offsets, strict=False)]
    return trimesh.Trimesh(
        np.concatenate([part.vertices for part in parts]), np.concatenate(faces), process=False
    )


def _box(size: tuple[float, float, float], center: tuple[float, float, float]) -> trimesh.Trimesh:
    box = trimesh.creation.box(size)
    box.apply_translation(center)
    return box


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
    disc.apply_translation(center)
    return disc
