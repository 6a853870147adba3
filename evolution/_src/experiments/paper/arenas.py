"""The arenas of Tables II and III: both networks' surfaces, the hand-made model, and other kinds of contact."""

from pathlib import Path
from typing import Any, Literal, NamedTuple

import reconstruction as rc
import symbrion_gym as sg
from evolution._src.experiments.paper.config import PaperConfig
from evolution._src.experiments.paper.networks import name_network
from symbrion_gym._src.contact.surface_error import measure_arena


class Recipe(NamedTuple):
    """How an arena of the tables is made.

    Attributes:
        method: the network whose surface it is made of; "hand" for the hand-made model.
        kind: contact geometry, as in `symbrion_gym.make_arena`; "exact" for the boxes that the model was drawn with.
        text: description in tables.
    """

    method: str
    kind: Literal["convex", "exact", "mixed", "hfield", "prisms"]
    text: str


RECIPES = {
    "gg": Recipe("gg", "convex", "growing grid, convex pieces"),
    "gsrm": Recipe("gsrm", "convex", "GSRM, convex pieces"),
    "simple": Recipe("hand", "convex", "hand-made model, convex pieces"),
    "boxes": Recipe("hand", "exact", "hand-made model, exact boxes"),
    "mixed": Recipe("gsrm", "mixed", "GSRM, primitives and mesh"),
    "hfield": Recipe("gsrm", "hfield", "GSRM, height field"),
    "prisms": Recipe("gsrm", "prisms", "GSRM, one prism per triangle"),
}


def load_surface(folder: Path, method: str, config: PaperConfig) -> rc.Reconstruction:
    """Return the saved network whose surface the arenas of a method are made of."""
    size = config.arena_units if method == "gsrm" else config.arena_triangles
    return rc.Reconstruction.load(folder / "surfaces" / f"{name_network(method, size)}.npz")


def load_arena(folder: Path, name: str) -> sg.Arena:
    """Return an arena that `build_arenas` saved."""
    return sg.Arena.load(folder / "arenas" / name)


def build_arenas(
    folder: Path, config: PaperConfig, progress: rc.Progress = rc.silent
) -> list[dict[str, Any]]:
    """Build the arenas and save each as a folder that MuJoCo's viewer opens.

    Args:
        folder: contains the surfaces; the arenas are written to it.
        config: sizes of the networks whose surfaces become arenas, and the seed of the decomposition into convex
            pieces.
        progress: called with a message and the share that is done.

    Returns:
        Rows with `arena`, `text`, `pieces`, `triangles` of the exact surface, `seconds` of building, and the
        distance of the contact geometry from the true surface, `mean` and `p95` [m]; None for a height field.

    Raises:
        ArenaError: a surface cannot become an arena.
    """
    truth = sg.load_arena("truth").surface
    rows = []
    for index, (name, recipe) in enumerate(RECIPES.items()):
        progress(recipe.text, index / len(RECIPES))
        arena = _build_arena(folder, name, recipe, config)
        arena.save(folder / "arenas" / name)
        region = arena.surface if recipe.method != "hand" else None
        quality = measure_arena(arena.pieces, truth, region=region) if arena.pieces else None
        rows.append(
            {
                "arena": name,
                "text": recipe.text,
                "pieces": len(arena.pieces),
                "triangles": len(arena.surface.faces),
                "seconds": arena.quality.seconds,
                "mean": quality.mean if quality else None,
                "p95": quality.p95 if quality else None,
            }
        )
    return rows


def _build_arena(folder: Path, name: str, recipe: Recipe, config: PaperConfig) -> sg.Arena:
    simple = sg.load_arena("simple")
    if recipe.kind == "exact":
        return simple
    mesh = simple.surface if recipe.method == "hand" else load_surface(folder, recipe.method, config).mesh
    # No cache: a cached arena carries the building time of the first time.
    return sg.make_arena(mesh, kind=recipe.kind, name=name, seed=config.seed, cache=False)
