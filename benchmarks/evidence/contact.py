"""Is contact right: does a robot touch what the scanner saw?"""

from __future__ import annotations

import time

import coacd
import mujoco
import numpy as np
import trimesh

import reconstruction as rc
import symbrion_gym as sg
from benchmarks.evidence.judge import CONTACT, SURFACE, Casts, judge_beams
from benchmarks.evidence.row import DATA, Figures, row
from benchmarks.evidence.surfaces import load_scan, make_course_cloud

GROUP = "Is contact right?"
_BODIES = 24
"""Bodies that are dropped on contact to time it: about the wheels of four modules."""


@row(GROUP, "Contact of the course, made of GSRM (2,200 units) and of the growing grid (13,860 triangles), beside "
     "coacd's defaults on GSRM's mesh, closed below, and a height field of it in cells of 5 cm: mean height error to "
     "the truth (2 cm at the walls left out), geoms, processor time", "ours at most 1.0 mm",
     lambda found: max(found["gsrm"]["mean_mm"], found["gg"]["mean_mm"]) <= 1.0)  # fmt: skip
def measure_course_contact() -> Figures:
    """Measure heights of contact along vertical rays against those of the truth."""
    points, _ = make_course_cloud()
    truth = Casts(sg.load_arena("truth").spec())
    x, y = (part.ravel() for part in np.meshgrid(np.linspace(-3.2, 3.2, 321), np.linspace(-0.9, 0.9, 19)))
    is_wall = np.abs(np.abs(x) - 0.225) < 0.02
    places = np.column_stack([x, y])[~is_wall]
    wanted = truth.measure_heights(places, SURFACE)
    found: Figures = {}
    for method, options in (("gsrm", {"units": 2200}), ("gg", {"triangles": 13860})):
        mesh = rc.reconstruct(points, method, seed=0, **options).mesh
        begin = time.process_time()
        arena = sg.make_arena(mesh, cache=False)
        seconds = time.process_time() - begin
        found[method] = _judge_contact(arena.spec(), places, wanted, seconds)
        if method == "gsrm":
            for name, make in (("coacd", _make_coacd), ("height field", _make_height_field)):
                begin = time.process_time()
                spec = make(mesh)
                found[name] = _judge_contact(spec, places, wanted, time.process_time() - begin)
    said = "; ".join(
        f"{name} {each['mean_mm']:.2f} mm, {each['pieces']}, {each['cpu_s']:.1f} s"
        for name, each in found.items()
    )
    return found | {"said": said}


def _judge_contact(
    spec: mujoco.MjSpec, places: np.ndarray, wanted: np.ndarray, seconds: float
) -> dict[str, float]:
    errors = 1e3 * np.abs(Casts(spec).measure_heights(places, CONTACT) - wanted)
    return {
        "mean_mm": float(np.nanmean(errors)),
        "p95_mm": float(np.nanpercentile(errors, 95)),
        "uncovered": float(np.isnan(errors).mean()),
        "pieces": sum(geom.group == CONTACT for geom in spec.geoms),
        "cpu_s": seconds,
    }


def _make_coacd(mesh: trimesh.Trimesh) -> mujoco.MjSpec:
    """Return the pieces of coacd's defaults, of the mesh closed by walls and a floor 0.3 m below."""
    vertices, faces = np.asarray(mesh.vertices, float), np.asarray(mesh.faces)
    _, first, count = np.unique(mesh.edges_sorted, axis=0, return_index=True, return_counts=True)
    a, b = mesh.edges[first[count == 1]].T
    n = len(vertices)
    floor = np.column_stack([vertices[:, :2], np.full(n, vertices[:, 2].min() - 0.3)])
    walls = np.vstack([np.column_stack([b, a, a + n]), np.column_stack([b, a + n, b + n])])
    solid = coacd.Mesh(np.vstack([vertices, floor]), np.vstack([faces, faces[:, ::-1] + n, walls]))
    spec = mujoco.MjSpec()
    coacd.set_log_level("error")
    pieces = coacd.run_coacd(solid)
    for number, (vertices, _) in enumerate(pieces):
        spec.add_mesh(name=f"piece_{number}", uservert=np.asarray(vertices, float).ravel())
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=f"piece_{number}", group=CONTACT)
    return spec


def _make_height_field(mesh: trimesh.Trimesh, cell: float = 0.05) -> mujoco.MjSpec:
    """Return the heights of a mesh from above, on a grid."""
    low, high = np.asarray(mesh.bounds)
    counts = np.ceil((high - low)[:2] / cell).astype(int) + 1
    x, y = (np.linspace(low[k], high[k], counts[k]) for k in range(2))
    origins = np.array([(a, b, high[2] + 1.0) for b in y for a in x])
    heights = np.full(len(origins), low[2])
    ends, rays, _ = mesh.ray.intersects_location(origins, np.tile([0.0, 0.0, -1.0], (len(origins), 1)))
    np.maximum.at(heights, rays, ends[:, 2])
    spec = mujoco.MjSpec()
    size = [*(high - low)[:2] / 2, float(high[2] - low[2]), 0.1]
    spec.add_hfield(name="ground", size=size, nrow=counts[1], ncol=counts[0],
                    userdata=((heights - low[2]) / (high[2] - low[2])).tolist())  # fmt: skip
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_HFIELD, hfieldname="ground", group=CONTACT,
                            pos=[*(low + high)[:2] / 2, float(low[2])])  # fmt: skip
    return spec


SCENES = ("apartment", "lobby", "depth camera")


@row(GROUP, "Three public scans: beams that end within 5 cm of their reading on contact (on the surface); beams that "
     "contact stops earlier; a step of the engine with bodies on it, over the same on a plane",
     "contact at least 0.97 of the surface, step at most 2.0",
     lambda found: all(
         found[name]["contact"] >= 0.97 * found[name]["surface"] and found[name]["step_over_plane"] <= 2.0
         for name in SCENES
     ))  # fmt: skip
def measure_scan_contact() -> Figures:
    """Measure contact made of real scans by the scanner's own beams."""
    if not DATA.is_dir():
        return {"missing": "the public scans are not here"}
    found: Figures = {}
    for name in SCENES:
        points, viewpoint = load_scan(name)
        assert viewpoint is not None
        surface = rc.reconstruct(rc.preprocess(points), viewpoints=viewpoint)
        begin = time.process_time()
        arena = sg.make_arena(surface, cache=False)
        seconds = time.process_time() - begin
        offset = np.asarray(arena.offset, float)
        found[name] = {
            **judge_beams(arena, viewpoint - offset, points - offset),
            "pieces": len(arena.pieces),
            "arena_cpu_s": seconds,
            "step_over_plane": _compare_steps(arena),
        }
    said = [
        f"{name} {each['contact']:.0f} ({each['surface']:.0f}) %, {each['blocked']:.1f} %, "
        f"{each['step_over_plane']:.1f}"
        for name, each in found.items()
    ]
    return found | {"said": "; ".join(said)}


def _compare_steps(arena: sg.Arena) -> float:
    """Return the time of a step with bodies that rest on an arena over that with the same bodies on a plane."""
    low, high = np.asarray(arena.surface.bounds)
    rng = np.random.default_rng(0)
    places = rng.uniform(low[:2] + 0.2 * (high - low)[:2], high[:2] - 0.2 * (high - low)[:2], (_BODIES, 2))
    heights = np.nan_to_num(
        Casts(arena.spec()).measure_heights(places, CONTACT, float(high[2]) + 1.0), nan=float(high[2])
    )
    plane = mujoco.MjSpec()
    plane.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[50.0, 50.0, 1.0])
    ours, theirs = _make_world(arena.spec(), places, heights), _make_world(plane, places, np.zeros(_BODIES))
    pairs = [(_time_steps(*ours), _time_steps(*theirs)) for _ in range(9)]
    return float(np.median([a for a, _ in pairs]) / np.median([b for _, b in pairs]))


def _make_world(
    spec: mujoco.MjSpec, places: np.ndarray, heights: np.ndarray
) -> tuple[mujoco.MjModel, mujoco.MjData]:
    for place, height in zip(places, heights, strict=True):
        body = spec.worldbody.add_body(pos=[*place, height + 0.06])
        body.add_freejoint()
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.05, 0.05, 0.05], mass=1.0)
    spec.option.timestep = 0.005
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 400)
    return model, data


def _time_steps(model: mujoco.MjModel, data: mujoco.MjData, count: int = 300) -> float:
    begin = time.process_time()
    mujoco.mj_step(model, data, count)
    return time.process_time() - begin
