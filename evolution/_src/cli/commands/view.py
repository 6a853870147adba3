"""`symbrion view` and `symbrion export`: look at an arena, or write it for other simulators."""

import dataclasses
import shlex
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

import symbrion_gym as sg
from evolution._src.cli.command import (
    Command,
    SeededCommand,
    UsageError,
    check_arena,
    require_writable_file,
    require_writable_folder,
)
from evolution._src.cli.console import Console
from reconstruction._src.base.atomic_write import write_file
from reconstruction._src.base.extras import require_extras
from reconstruction._src.base.range_checks import format_count, format_extents
from symbrion_gym._src.headless import has_display

Layer = Literal["surface", "contact", "drivable", "route"]


@dataclasses.dataclass(frozen=True, kw_only=True)
class View(SeededCommand):
    """Show an arena in MuJoCo's viewer, or draw it in a file: surface, contact over it, drivable ground, a route.

    Example: symbrion view arenas/mine --picture mine.png
    """

    arena: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="ARENA")]
    """A ready-made arena by name, an arena folder, or a mesh file."""
    picture: Path | None = None
    """Draw the arena from two sides, and from above with coordinates in meters, in this file (.png), without a display;
    the viewer does not open."""
    layers: tuple[Layer, ...] = ("surface", "contact", "drivable", "route")
    """What is shown: the surface, the contact pieces (translucent), ground where the robot can drive, a route on it."""
    modules: int = 1
    """Number of Scouts in a row: the robot that drives. It is shown at the start of the route."""

    def check(self) -> None:
        super().check()
        check_arena(self.arena)
        self.require_least(modules=1)
        if not self.layers:
            raise UsageError("--layers is empty; give at least one of surface, contact, drivable, route")
        require_writable_file(self.picture, "--picture", (".png",))
        if self.picture is None and not has_display():
            raise UsageError("no display for MuJoCo's viewer; give --picture FILE.png to draw the arena")

    def run(self, console: Console) -> dict[str, Any]:
        if self.picture is not None:
            require_extras("`symbrion view --picture`", "report")
        from symbrion_gym._src.tasks.paths import propose_way

        places = route = way = None
        body, robot = sg.snake(self.modules), format_count(self.modules, "module")
        with console.track(f"Arena {self.arena}"):
            arena = sg.load_arena(self.arena)
            try:
                if {"drivable", "route"} & set(self.layers):
                    places = arena.traversability(body)
                if "route" in self.layers:
                    way = propose_way(arena, body)
                    route = arena.find_route(body)
            except sg.ArenaError as error:
                console.print_line(f"no route: {error}")
        low, high = arena.surface.bounds.tolist()
        console.print_line(f"it extends over {format_extents(low, high)}")
        summary: dict[str, Any] = {
            "arena": self.arena,
            "pieces": arena.quality.num_pieces,
            "bounds": [low, high],
        }
        if places is not None:
            summary["ground"] = places.as_dict()
            areas = places.region_areas
            text = f", the largest {areas[0]:.1f} m²" if len(areas) else ""
            regions = format_count(len(areas), "drivable region")
            console.print_line(f"{regions}, {areas.sum():.1f} m² in all{text}")
        if route is not None:
            summary["route"] = {"start": route.start, "goal": route.goal, "length": route.length}
            ends = " to ".join(f"({x:.2f}, {y:.2f})" for x, y, _ in (route.start, route.goal))
            console.print_line(f"route for {robot}: {ends}, {route.length:.1f} m")
        if way is not None:
            summary["straight_way"] = way
            start, goal = (" ".join(f"{value:g}" for value in place) for place in way)
            # one that is alone has no hinges to evolve
            alone = " --environment track_control skid" if self.modules == 1 else ""
            console.print_line(
                f"straight way for {robot}: symbrion evolve --arena {shlex.quote(self.arena)} "
                f"--modules {self.modules}{alone} --start {start} --goal {goal}"
            )
        if self.picture is None:
            from symbrion_gym._src.arenas.viewing import make_view_spec, open_viewer

            open_viewer(make_view_spec(arena, self.layers, places, route, body))
            return summary
        from evolution._src.report.arena_view import draw_arena
        from evolution._src.report.figures import to_png

        with console.track(f"Picture {self.picture.name}"):
            figure = draw_arena(arena, self.layers, places, route, body, views=("sides", "plan"), way=way)
            write_file(self.picture, to_png(figure, is_reduced=False))
        console.print_line(f"{self.picture}")
        return summary | {"picture": self.picture}


@dataclasses.dataclass(frozen=True, kw_only=True)
class Export(Command):
    """Write an arena as a folder that other simulators load without this package, with loaders and a license note.

    Example: symbrion export arenas/mine --to usd --out mine-usd
    """

    arena: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="ARENA")]
    """A folder by `symbrion arena`, a ready-made arena (truth, simple, gsrm, gg, stairs) or a mesh file."""
    to: Literal["mjcf", "urdf", "usd", "obj"] = "mjcf"
    """mjcf: MuJoCo, mjlab, Playground; urdf: PyBullet, Gazebo, Drake; usd: Isaac Lab, Newton (extra `usd`); obj."""
    out: Path = Path("export")
    """Output folder. An export in it is replaced, other files are kept."""

    def check(self) -> None:
        super().check()
        check_arena(self.arena)
        require_writable_folder(self.out, "--out")
        from symbrion_gym._src.arenas.export.export import find_own_files

        find_own_files(self.out)

    def run(self, console: Console) -> dict[str, Any]:
        if self.to == "usd":
            require_extras("`symbrion export --to usd`", "usd")
        with console.track(f"Export to {self.to}"):
            about = sg.load_arena(self.arena).export(self.out, self.to)
        solids = format_count(about["num_solids"], "convex solid")
        pieces = format_count(about["num_pieces"], "piece")
        readme = f"{self.out}/README.md says how to load it"
        console.print_line(f"{solids} in {self.out} (from {pieces}); {readme}")
        return {"folder": self.out, **about}
