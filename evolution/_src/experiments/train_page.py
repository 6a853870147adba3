"""The page of a training: the verdict, the plan with the way, the site with the body driving, trials, what is next."""

from __future__ import annotations

import shlex
from collections.abc import Sequence

import numpy as np
import trimesh

import symbrion_gym as sg
from evolution._src.champions.playback import play
from evolution._src.experiments.training import GOOD, TRIALS, Training
from evolution._src.report.arena_view import BEHIND, draw_arena, find_cover
from evolution._src.report.body_page import describe_machine
from evolution._src.report.figures import draw_learning_curve, draw_tracks, to_png
from evolution._src.report.page import Page
from evolution._src.report.scene import Scene
from evolution._src.report.video import encode_video
from reconstruction._src.base.progress import Progress
from reconstruction._src.base.range_checks import format_count
from symbrion_gym._src.arenas.verdict import ROBOT
from symbrion_gym._src.traversability.routes import DrivingRoute

_GROUND, _UNSEEN = "#cfd3da", "#e7a08f"  # Colors of the surface, and of what both halves do not confirm

_STEEP, _HIDING = 0.5, 0.8
"""Faces whose normal, of length 1, rises less are of walls or ceilings if they reach so far above the body [m], higher
than tables and chairs do."""


def write_train_page(
    result: Training, judged_in: sg.Arena, source: str, options: str, progress: Progress
) -> None:
    """Write the page of a training as one self-contained HTML file, with a film in the last arena that judges."""
    run, arena, config = result.run, result.arena, result.run.config
    champion = run.champion
    assert champion is not None
    goal = config.goal if isinstance(config.goal, tuple) else None
    speed = 5.0 if goal is None else 2.0  # a way takes a few seconds
    progress("writing the page: film", 0.0)
    film = play(champion, judged_in, config.seed, film=True, speed=speed)
    body, where = format_count(champion.modules, "module"), list(result.held)[-1]
    organism = champion.find_organism()
    page = Page(
        "From a scan to a robot that drives there",
        summary=f"{_describe_models(result)} A controller evolves from zero in the first; whether it drives is judged "
        "in the other, which evolution never saw.",
        footer=f"symbrion train {source} {options} · {describe_machine()}",
    )
    for name, model in zip(result.held, (arena, result.other), strict=False):
        good = {"yes": True, "in part": None}.get(model.verdict.answer, False)
        page.add_verdict(f"Model, {name}: {model.verdict}.", good=good)
    for place, drivers in result.held.items():
        text = f"The champion ({body}) succeeds in {drivers['champion']} of {TRIALS} fresh trials: {place}."
        page.add_verdict(text, good=drivers["champion"] >= GOOD * TRIALS)
    for fault in result.list_faults():
        page.add_verdict(f"{fault[0].upper()}{fault[1:]}.", good=False)
    places = [config.start, *dict(config.environment).get("places", ()), config.goal]
    named = [f"({', '.join(f'{value:.2f}' for value in each)})" for each in places if isinstance(each, tuple)]
    route = _make_route(film.positions, organism.scout.size[2], goal)
    way = f"From {', then '.join(named)} [m]" if len(named) > 1 else "Across the gap"
    progress("writing the page: plan", 0.4)
    size = " x ".join(f"{length:.3g}" for length in arena.surface.extents)
    page.add_section("The way", f"{way}; the model of training measures {size} m, the robot {ROBOT:g} m.")
    layers, ground, shown = ("surface", "route"), None, "the way that it drove"
    if len(named) > 1:  # what leads over a gap is no ground that a body can drive on
        layers, ground = ("surface", "drivable", "route"), arena.traversability(organism)
        shown = f"ground that the body can drive on, and {shown}"
    plan = draw_arena(arena, layers, ground, route, organism, views=("plan",))
    page.add_figure(to_png(plan, is_reduced=False), f"The model of training from above: {shown} ({where}).")
    if film.frames:
        shown = f"it {'arrives' if film.success else 'does not arrive'}{' at the red pole' if goal else ''}"
        page.add_video(
            encode_video(film.frames, film.fps),
            f"The champion ({where}), at {speed:g} times real time; {shown}.",
        )
    page.add_scene(
        _make_scene(arena, film.positions),
        "The site, and the champion on its way. Drag to turn it, scroll to zoom.",
    )
    if champion.modules > 1:
        page.add_figure(
            draw_tracks(film.positions, judged_in.surface), "Side view of the body at seven times."
        )
    page.add_section("Trials")
    rows = [
        [name, *(f"{held[name]} of {TRIALS}" for held in result.held.values())] for name in result.held[where]
    ]
    page.add_table(
        ["driver", *result.held], rows, "Trials that succeed; start, heading, friction and strength vary."
    )
    history = run.history
    page.add_section(
        "Evolution",
        f"CMA-ES from zero: {int(history[-1]['evaluations'])} genotypes in {format_count(len(history), 'generation')}; "
        "it ends with the first champion that is confirmed in fresh trials.",
    )
    if len(history) > 1:
        page.add_figure(
            draw_learning_curve(history["evaluations"], history["best"], history["median"]),
            "Fitness of the generations.",
        )
    genes = [[name, f"{value:.3f}"] for name, value in zip(champion.names, champion.genotype, strict=True)]
    page.add_table(["gene", "value"], genes, f"The champion; controller: {champion.controller}.")
    folder = shlex.quote(str(result.folder))
    page.add_section("Going on")
    site = f"arena={str(result.folder / 'arena')!r}, start={config.start}, goal={config.goal}"
    made = f"import gymnasium as gym, symbrion_gym; gym.make('symbrion_gym/Reach-easy-v0', {site}, sensors=('goal',))"
    seen = "the goal is seen ahead and to the left [m], actions are speeds of the left and right track:"
    page.add_list([
        *([f"In Python, {seen} `{made}`"] if goal and champion.modules == 1 else []),
        f"The site, and where to drive: `symbrion view {folder}/arena`",
        f"Another way, by places on the plan: `symbrion train {source} --out NEW --start X Y --goal X Y`",
        f"The champion: `symbrion replay {folder}/run --arena {folder}/other --video champion.mp4`",
    ])  # fmt: skip
    page.write(result.page)


def _describe_models(result: Training) -> str:
    if "other half" in result.held:
        return "Two models of the site are those of two halves of a scan, which share no reading."
    return "The second model of the site is that of a scan of the first: it shares what that has wrong."


def _make_route(positions: np.ndarray, height: float, goal: Sequence[float] | None) -> DrivingRoute:
    """Return the way that a body has driven, on the ground, with the goal that it had."""
    path = positions.mean(axis=1) - [0.0, 0.0, height / 2]
    steps = np.linalg.norm(np.diff(path, axis=0), axis=1)
    ahead = positions[0, 0] - positions[0, -1] if positions.shape[1] > 1 else path[-1] - path[0]
    heading = float(np.arctan2(ahead[1], ahead[0]))
    first, last = (tuple(each.tolist()) for each in path[[0, -1]])
    last = last if goal is None else (goal[0], goal[1], last[2])
    return DrivingRoute(first, last, heading, path, float(steps.sum()), 0.0, 0)


def _make_scene(arena: sg.Arena, positions: np.ndarray) -> Scene:
    """Return the site and the path of the body; what nobody saw in another color, walls and ceilings on a switch."""
    scene = Scene(focus=positions.reshape(-1, 3))
    mesh, top = arena.surface, float(positions[..., 2].max()) + _HIDING
    heights, middles = mesh.triangles[:, :, 2], positions.mean(axis=1)
    is_high = (mesh.face_normals[:, 2] < _STEEP) & (heights.max(axis=1) > top)
    is_high |= heights.min(axis=1) > find_cover(arena, middles) - BEHIND
    is_unseen = np.isin(np.arange(len(mesh.faces)), arena.unseen)
    for name, chosen, color, is_shown in (
        ("surface", ~is_high & ~is_unseen, _GROUND, True),
        ("not confirmed", ~is_high & is_unseen, _UNSEEN, True),
        ("walls and ceilings", is_high, _GROUND, False),
    ):
        if chosen.any():
            part = (
                mesh.copy() if color == _GROUND else trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
            )
            part.update_faces(chosen)
            part.remove_unreferenced_vertices()
            scene.add_surface(name, part, color, is_shown)
    scene.add_path("champion", positions)
    return scene
