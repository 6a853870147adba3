"""Draw the pictures of the pages: `python docs/pictures.py [results]`, from the repository's root.

"results" alone draws what comes from `benchmarks/results`: the map of what doing nothing crosses, and the crossing of
the first champion.
"""

import io
import json
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
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from PIL import Image

import evolution as ev
import reconstruction as rc
import symbrion_gym as sg

FOLDER = Path(__file__).parent / "images"
RESULTS = Path(__file__).parents[1] / "benchmarks" / "results"
GAP = 8
"""Between the moments of a crossing [pixel]."""
FILM_FROM = -1.2
"""Place of the head on the course where the moving picture starts [m]."""
FILM_STEP = 8
"""One frame in so many is shown: at 25 frames a second and 80 ms a frame, four times real speed."""
FILM_SIZE = (480, 300)
LIGHT = (0.4, -0.5, 0.77)
COLOURS = plt.get_cmap("Set2").colors  # pyright: ignore[reportAttributeAccessIssue]


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
    """Draw meshes around the pit as wires, from above one side."""
    figure, axes = plt.subplots(1, len(surfaces), figsize=(11, 3.6), subplot_kw={"projection": "3d"})
    for axis, (title, mesh) in zip(axes, surfaces.items(), strict=True):
        centres = mesh.triangles_center
        near = (np.abs(centres[:, 0]) < 1.0) & (centres[:, 1] < 0.3)
        light = 0.5 + 0.5 * np.clip(mesh.face_normals[near] @ LIGHT, 0, 1)
        _add_faces(axis, mesh.triangles[near], light[:, None] * np.array([0.86, 0.80, 0.68]), "#00000055")
        axis.set_title(title, y=0.98, fontsize=10)
    _save(figure, "networks.png")


def draw_pieces(arena: sg.Arena) -> None:
    """Draw the convex pieces, each in its colour, a little apart."""
    spec = mujoco.MjSpec()
    spec.visual.global_.offwidth, spec.visual.global_.offheight = 1400, 480
    spec.visual.headlight.ambient = [0.45] * 3
    spec.worldbody.add_light(pos=[-2, -3, 5], dir=[0.35, 0.5, -0.8], diffuse=[0.6] * 3)
    for index, piece in enumerate(sorted(arena.pieces, key=lambda piece: piece.centroid[0])):
        name, colour = f"piece {index}", (*COLOURS[index % len(COLOURS)][:3], 1.0)
        spec.add_mesh(name=name, uservert=np.ravel(piece.vertices), userface=np.ravel(piece.faces))
        shift = (0.25 * piece.centroid[0], 0.0, 0.3 if piece.bounds[1, 2] > 0.05 else 0.0)
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, pos=shift, rgba=colour)
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


def draw_crossing(results: dict[str, Any]) -> None:
    """Draw six moments of the first champion's trial in the true course, and the whole trial as a moving picture."""
    found = results["champions"]["runs"][0]["champions"][-1]["champion"]
    champion = ev.Champion.from_dict(found)
    film = ev.play(champion, "truth", film=True, speed=1.0)
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


def draw_baselines(results: dict[str, Any]) -> None:
    """Draw which share of trials a body crosses that does nothing, by pit, modules and friction."""
    rows = {
        "modules": {name[7:]: part for name, part in results.items() if name.startswith("widths/")},
        "friction": {name[10:]: part for name, part in results.items() if name.startswith("frictions/")},
    }
    figure, axes = plt.subplots(2, 1, figsize=(9, 4.6), height_ratios=[3, 4], layout="constrained")
    for axis, (label, parts) in zip(axes, rows.items(), strict=True):
        pits = list(next(iter(parts.values()))["successes"])
        shares = [[100 * part["successes"][pit] / part["trials"] for pit in pits] for part in parts.values()]
        picture = axis.imshow(shares, vmin=0, vmax=100, cmap="Oranges", aspect="auto")
        for (row, column), share in np.ndenumerate(np.array(shares)):
            axis.text(column, row, f"{share:.0f}", ha="center", va="center", color="w" if share > 60 else "k")
        axis.set_yticks(range(len(parts)), list(parts))
        axis.set_xticks(range(len(pits)), [pit[2:] for pit in pits])
        trials = next(iter(parts.values()))["trials"]
        within = "friction 0.55 to 0.9" if label == "modules" else "8 modules"
        axis.set(ylabel=label, title=f"{within}, {trials} trials a cell")
    axes[-1].set_xlabel("width of the pit [cm]")
    figure.colorbar(picture, ax=axes, label="trials that cross [%]")
    _save(figure, "baselines.png")


def _add_faces(axis: Any, triangles: np.ndarray, colours: np.ndarray, edge: str) -> None:
    axis.add_collection3d(
        Poly3DCollection(
            triangles, facecolors=colours, edgecolors=edge, linewidths=0.25, antialiased=edge != "none"
        )
    )
    low, high = triangles.reshape(-1, 3).min(0), triangles.reshape(-1, 3).max(0)
    axis.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    axis.set_box_aspect(high - low, zoom=1.5)
    axis.view_init(elev=28, azim=-62)
    axis.set_axis_off()


def _load_results(name: str) -> dict[str, Any]:
    return json.loads((RESULTS / f"{name}.json").read_text())["results"]


def _save(figure: Figure, name: str) -> None:
    buffer = io.BytesIO()
    figure.savefig(buffer, dpi=140, format="png")
    _write(np.asarray(Image.open(buffer).convert("RGB")), name)
    plt.close(figure)


def _write(pixels: np.ndarray, name: str) -> None:
    """Write a picture cut to what is drawn on it."""
    rows, columns = (np.flatnonzero((pixels < 250).any(axis=(axis, 2))) for axis in (1, 0))
    cut = pixels[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    Image.fromarray(np.ascontiguousarray(cut)).quantize(128).save(FOLDER / name, optimize=True)


def _write_film(frames: list[np.ndarray], name: str) -> None:
    """Write frames as a GIF that repeats, all in the colors of the middle one."""
    pictures = [Image.fromarray(frame).resize(FILM_SIZE, Image.Resampling.LANCZOS) for frame in frames]
    palette = pictures[len(pictures) // 2].quantize(96)
    first, *others = [picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures]
    first.save(FOLDER / name, save_all=True, append_images=others, duration=80, loop=0, optimize=True)


def main() -> None:
    """Survey, reconstruct, decompose, draw."""
    draw_baselines(_load_results("baselines"))
    draw_crossing(_load_results("evolution"))
    if sys.argv[1:] == ["results"]:
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
