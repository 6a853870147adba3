"""Draw the pictures of the pages: `python docs/pictures.py [crossing | course | rover | bodies]`, from the root.
Without a display, films need the environment variable `MUJOCO_GL=egl`.

"crossing" draws only the crossing of a champion that it evolves, "course" only the course and its success check,
"rover" only the rover of the examples, "bodies" only all small bodies.
"""

import io
import sys
from pathlib import Path
from typing import Any

import matplotlib as mpl
import mujoco

mpl.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
import trimesh
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from PIL import Image

import evolution as ev
import reconstruction as rc
import symbrion_gym as sg
from evolution._src.report.arena_view import draw_arena
from evolution._src.report.figures import draw_bodies, to_png
from evolution._src.search.bodies.genome import enumerate_bodies

FOLDER = Path(__file__).parent / "images"
GAP = 8
"""Gap between the moments of a crossing [pixel]."""
FILM_FROM = -1.2
"""x of the head where the moving picture starts [m]."""
FILM_STEP = 8
"""Every eighth frame is shown: recorded at 25 frames per second and shown for 80 ms each, four times real speed."""
FILM_SIZE = (480, 300)
GROUND, SNAKE, MARK = "#cfc4b2", "#3c5a78", "#b0413e"
"""Colors of the ground, of modules and of what is explained."""
HALF_CHECKED = 0.05
"""Half the edge of the square of a module that must be past the edge of the pit [m]."""
STANDING = (0.02, 0.075)
"""Height of a module's center above the ground that counts as standing [m]."""
FLOOR_MARGIN, PIT_MARGIN = 0.10, 0.20
"""Distance of the front of the head from the ramp and from the pit at the start [m]."""
LIGHT = (0.4, -0.5, 0.77)
COLORS = plt.get_cmap("Set2").colors  # pyright: ignore[reportAttributeAccessIssue]


def draw_cleaning(log: rc.ScanLog, points: np.ndarray) -> None:
    """Draw a strip along the course before and after pre-processing, from the side."""
    figure, axes = plt.subplots(2, 1, figsize=(9, 4.2), sharex=True)
    for axis, cloud, title in ((axes[0], log.points(), "as scanned"), (axes[1], points, "pre-processed")):
        strip = cloud[np.abs(cloud[:, 1]) < 0.1]
        axis.plot(strip[:, 0], strip[:, 2], ".", ms=0.8, color="#1f5f8b", rasterized=True)
        axis.set(title=title, ylabel="z [m]", xlim=(-1.6, 1.6), ylim=(-0.15, 0.4), aspect="equal")
    axes[1].set_xlabel("x [m]")
    _save(figure, "cleaning.png")


def draw_networks(surfaces: dict[str, trimesh.Trimesh]) -> None:
    """Draw wireframes of the meshes around the pit, seen obliquely from above."""
    figure, axes = plt.subplots(1, len(surfaces), figsize=(11, 3.6), subplot_kw={"projection": "3d"})
    for axis, (title, mesh) in zip(axes, surfaces.items(), strict=True):
        centers = mesh.triangles_center
        near = (np.abs(centers[:, 0]) < 1.0) & (centers[:, 1] < 0.3)
        light = 0.5 + 0.5 * np.clip(mesh.face_normals[near] @ LIGHT, 0, 1)
        _add_faces(axis, mesh.triangles[near], light[:, None] * np.array([0.86, 0.80, 0.68]), "#00000055")
        axis.set_title(title, y=0.98, fontsize=10)
    _save(figure, "networks.png")


def draw_colors() -> None:
    """Draw the arena of a survey with a camera from two sides, in the colors of its readings."""
    readings = rc.preprocess(sg.survey("truth", seed=0, camera=True))
    assert isinstance(readings, rc.Cloud)
    made = rc.reconstruct(rc.thin(readings, 0.015), units=2200, readings=readings)
    _save(draw_arena(sg.make_arena(made, name="scanned with a camera"), ("surface",)), "colors.png")


def draw_pieces(arena: sg.Arena) -> None:
    """Draw the convex pieces, each in its color, a little apart."""
    spec = mujoco.MjSpec()
    spec.visual.global_.offwidth, spec.visual.global_.offheight = 1400, 480
    spec.visual.headlight.ambient = [0.45] * 3
    spec.worldbody.add_light(pos=[-2, -3, 5], dir=[0.35, 0.5, -0.8], diffuse=[0.6] * 3)
    for index, piece in enumerate(sorted(arena.pieces, key=lambda piece: piece.centroid[0])):
        name, color = f"piece {index}", (*COLORS[index % len(COLORS)][:3], 1.0)
        spec.add_mesh(name=name, uservert=np.ravel(piece.vertices), userface=np.ravel(piece.faces))
        shift = (0.25 * piece.centroid[0], 0.0, 0.3 if piece.bounds[1, 2] > 0.05 else 0.0)
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, pos=shift, rgba=color)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    camera = mujoco.MjvCamera()
    camera.lookat, camera.distance, camera.azimuth, camera.elevation = (0, 0, 0.1), 5.2, 68, -24
    with mujoco.Renderer(model, 480, 1400) as renderer:
        renderer.scene.flags[mujoco.mjtRndFlag.mjRND_SKYBOX] = False
        renderer.update_scene(data, camera)
        pixels = renderer.render().copy()
    pixels[(pixels == 0).all(axis=2)] = 255
    _write(pixels, "pieces.png")


def draw_crossing() -> None:
    """Evolve a champion on the scan; draw six moments of its trial in the true course, and all of it as a film."""
    run = ev.evolve(ev.EvolutionConfig(arena="gsrm", seed=0, generations=30, workers=2))
    film = ev.play(run.champion, "truth", film=True, speed=1.0)
    heads = film.positions[:: max(1, len(film.positions) // len(film.frames)), 0, 0][: len(film.frames)]
    moments = [film.frames[int(np.argmax(heads > place))] for place in (-1.0, -0.35, -0.1, 0.12, 0.35, 0.9)]
    height, width, _ = moments[0].shape
    sheet = np.full((2 * height + GAP, 3 * width + 2 * GAP, 3), 255, dtype=np.uint8)
    for index, frame in enumerate(moments):
        row, column = divmod(index, 3)
        y, x = row * (height + GAP), column * (width + GAP)
        sheet[y : y + height, x : x + width] = frame
    picture = Image.fromarray(sheet).resize(
        (sheet.shape[1] * 3 // 5, sheet.shape[0] * 3 // 5), Image.Resampling.LANCZOS
    )
    picture.quantize(256).save(FOLDER / "crossing.png", optimize=True)
    _write_film(film.frames[int(np.argmax(heads > FILM_FROM)) :: FILM_STEP], "crossing.gif")


def draw_rover() -> None:
    """Draw four moments of the example's rover on its way up the ramp of the scanned course."""
    sys.path.insert(0, str(Path(__file__).parents[1] / "examples"))
    from tracked_rover import drive  # pyright: ignore[reportMissingImports]

    camera, frames, renderers = mujoco.MjvCamera(), [], []
    camera.lookat, camera.distance, camera.azimuth, camera.elevation = (-1.6, 0.0, 0.1), 2.6, 60.0, -28.0

    def watch(model: mujoco.MjModel, data: mujoco.MjData) -> None:
        if not renderers:
            renderers.append(mujoco.Renderer(model, 300, 440))
        if int(data.time / model.opt.timestep) % 100 == 0:
            renderers[0].update_scene(data, camera)
            frames.append(renderers[0].render())

    drive(watch=watch)
    moments = [frames[int(share * (len(frames) - 1))] for share in (0.02, 0.35, 0.7, 1.0)]
    gap = np.full((moments[0].shape[0], GAP, 3), 255, dtype=np.uint8)
    rows = [np.hstack([left, gap, right]) for left, right in (moments[:2], moments[2:])]
    sheet = np.vstack([rows[0], np.full((GAP, rows[0].shape[1], 3), 255, dtype=np.uint8), rows[1]])
    Image.fromarray(sheet).quantize(256).save(FOLDER / "rover.png", optimize=True)


def draw_course() -> None:
    """Draw the default course from the side with both starts and the finish, and the success check of a module."""
    course, scout = sg.Course(), sg.ScoutConfig()
    figure, axes = plt.subplots(2, 1, figsize=(10, 6.0), height_ratios=[1, 2.1], layout="constrained")
    _draw_starts(axes[0], course, scout)
    _draw_check(axes[1], course, scout)
    _save(figure, "course.png")


def _draw_starts(axis: Any, course: sg.Course, scout: Any) -> None:
    near, far = course.pit_edges
    foot, ahead = course.ramp_feet[0], scout.arm_reach
    _fill_ground(axis, course)
    for head, fill in ((foot - FLOOR_MARGIN - ahead, SNAKE), (near - PIT_MARGIN - ahead, "none")):
        for number in range(8):
            x = head - number * scout.pitch
            rear, front = np.interp([x - scout.pitch / 2, x + scout.pitch / 2], *course.profile()[:4].T)
            tilt, z = np.arctan2(front - rear, scout.pitch), (rear + front) / 2 + 1.05 * scout.size[2] / 2
            _draw_module(axis, x, z, scout.size[0], fill, tilt)
    axis.text(foot - 0.62, 0.16, 'start="floor"', ha="center", color=SNAKE)
    axis.text(near - 0.66, 0.45, 'start="pit"', ha="center", color=SNAKE)
    axis.axvline(far, color=MARK, lw=1.2, ls="--")
    axis.text(far + 0.05, 0.45, "finish: every module must be past this edge", color=MARK)
    for x, width, z, words in (
        (foot - course.floor / 2, course.floor, -0.1, "floor"),
        (foot + course.ramp / 2, course.ramp, -0.1, "ramp"),
        (near - course.plateau / 2, course.plateau, -0.1, "plateau"),
        (0.0, course.pit, -0.1, "pit"),
        (far + course.plateau / 2, course.plateau, -0.1, "plateau"),
        (-foot - course.ramp / 2, course.ramp, -0.1, "ramp"),
        (-foot + course.floor / 2, course.floor, -0.1, "floor"),
    ):
        axis.text(x, z, f"{words}\n{width:.2f} m", ha="center", va="center", fontsize=8)
    axis.plot([0], [0], "+", color="k", ms=7)
    axis.annotate("x = z = 0", (0, 0), (0.0, 0.1), ha="center", fontsize=8)
    end = course.length / 2
    axis.set(xlim=(-end, end), ylim=(-0.2, 0.6), aspect="equal", ylabel="z [m]", xlabel="x [m]")


def _draw_check(axis: Any, course: sg.Course, scout: Any) -> None:
    far, height = course.pit_edges[1], course.height
    _fill_ground(axis, course)
    axis.axvline(far, color=MARK, lw=1.2, ls="--")
    x, ground = course.profile()[5:].T
    axis.fill_between(x, ground + STANDING[0], ground + STANDING[1], color=MARK, alpha=0.12, lw=0)
    axis.text(far + 0.20, height + 0.04, "2. center 20 to 75 mm above the ground", color=MARK)
    tilt, (x, z) = np.radians(14.0), (far + 0.09, height + 0.065)
    _draw_module(axis, x, z, scout.size[0], "none", tilt)
    _draw_module(axis, x, z, 2 * HALF_CHECKED, "none", tilt, MARK)
    axis.plot([x], [z], "o", color=MARK, ms=4)
    rear = x - HALF_CHECKED * (np.cos(tilt) + np.sin(tilt))
    axis.annotate(
        "1. rearmost corner past the edge", (rear, z + 0.03), (far - 0.36, height + 0.12), color=MARK,
        arrowprops={"arrowstyle": "->", "color": MARK},
    )  # fmt: skip
    up = 0.11 * np.array([-np.sin(tilt), np.cos(tilt)])
    axis.annotate(
        "", (x + up[0], z + up[1]), (x, z), arrowprops={"arrowstyle": "->", "color": SNAKE, "lw": 1.8}
    )
    axis.plot([x, x], [z, z + 0.11], color=SNAKE, lw=0.8, ls=":")
    axis.text(x + 0.012, z + 0.085, "3. up axis less than 60° from the vertical", color=SNAKE)
    _draw_module(axis, far - 0.09, height - 0.09, scout.size[0], SNAKE, np.radians(62.0))
    axis.text(far - 0.16, height - 0.16, "not yet past the edge", ha="right", color=SNAKE)
    axis.text(far + 0.04, height - 0.06, "Success: 1, 2 and 3 are true for every module during 0.3 s.")
    axis.set(
        xlim=(far - 0.45, far + 0.75),
        ylim=(0.0, height + 0.2),
        aspect="equal",
        ylabel="z [m]",
        xlabel="x [m]",
    )


def _fill_ground(axis: Any, course: sg.Course) -> None:
    profile = course.profile()
    axis.fill_between(profile[:, 0], profile[:, 1], -0.2, color=GROUND, lw=0)
    axis.plot(*profile.T, color="k", lw=1.0)


def _draw_module(
    axis: Any, x: float, z: float, edge: float, fill: str, tilt: float = 0.0, color: str = SNAKE
) -> None:
    """Draw a square of this edge around (x, z), its nose up by `tilt` [rad]."""
    c, s = np.cos(tilt), np.sin(tilt)
    corners = edge / 2 * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) @ np.array([(c, s), (-s, c)])
    style = "-" if color == SNAKE else "--"
    axis.add_patch(Polygon(corners + np.array([x, z]), facecolor=fill, edgecolor=color, lw=1.2, ls=style))


def _add_faces(axis: Any, triangles: np.ndarray, colors: np.ndarray, edge: str) -> None:
    axis.add_collection3d(
        Poly3DCollection(
            triangles, facecolors=colors, edgecolors=edge, linewidths=0.25, antialiased=edge != "none"
        )
    )
    low, high = triangles.reshape(-1, 3).min(0), triangles.reshape(-1, 3).max(0)
    axis.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    axis.set_box_aspect(high - low, zoom=1.5)
    axis.view_init(elev=28, azim=-62)
    axis.set_axis_off()


def _save(figure: Figure, name: str) -> None:
    buffer = io.BytesIO()
    figure.savefig(buffer, dpi=140, format="png")
    _write(np.asarray(Image.open(buffer).convert("RGB")), name)
    plt.close(figure)


def _write(pixels: np.ndarray, name: str) -> None:
    """Write a picture cropped to its content."""
    rows, columns = (np.flatnonzero((pixels < 250).any(axis=(axis, 2))) for axis in (1, 0))
    cut = pixels[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    Image.fromarray(np.ascontiguousarray(cut)).quantize(128).save(FOLDER / name, optimize=True)


def _write_film(frames: list[np.ndarray], name: str) -> None:
    """Write frames as a looping GIF with the palette of the middle frame."""
    pictures = [Image.fromarray(frame).resize(FILM_SIZE, Image.Resampling.LANCZOS) for frame in frames]
    palette = pictures[len(pictures) // 2].quantize(96)
    first, *others = [picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures]
    first.save(FOLDER / name, save_all=True, append_images=others, duration=80, loop=0, optimize=True)


def draw_small_bodies() -> None:
    """Draw all bodies of 1 to 4 modules."""
    bodies = [body for count in range(1, 5) for body in enumerate_bodies(count)]
    figure = draw_bodies(bodies, [body.text for body in bodies], columns=8)
    (FOLDER / "bodies.png").write_bytes(to_png(figure))


def main() -> None:
    """Survey, reconstruct, decompose, draw."""
    if sys.argv[1:] in ([], ["rover"]):
        draw_rover()
    if sys.argv[1:] in ([], ["bodies"]):
        draw_small_bodies()
    if sys.argv[1:] in (["rover"], ["bodies"]):
        return
    if sys.argv[1:] != ["crossing"]:
        draw_course()
    if sys.argv[1:] == ["course"]:
        return
    draw_crossing()
    if sys.argv[1:] == ["crossing"]:
        return
    draw_colors()
    if sys.argv[1:] == ["colors"]:
        return
    log = sg.survey("truth", seed=0)
    points = rc.thin(rc.preprocess(log), 0.015)
    draw_cleaning(log, points)
    coarse, fine = (rc.reconstruct(points, units=units).mesh for units in (800, 5000))
    grid = rc.reconstruct(points, method="gg", units=2200).mesh
    draw_networks({"GSRM, 800 units": coarse, "GSRM, 5,000 units": fine, "growing grid, 2,200 units": grid})
    draw_pieces(sg.load_arena("gsrm"))


if __name__ == "__main__":
    main()
