"""`symbrion view`: look at an arena."""

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple

import tyro

import symbrion_gym as sg
from evolution._src.cli.command import SeededCommand, UsageError, check_arena, require_writable_file
from evolution._src.cli.console import Console
from reconstruction._src.base.atomic_write import write_atomically
from reconstruction._src.base.extras import require_extras
from reconstruction._src.base.range_checks import format_count, format_extents
from symbrion_gym._src.headless import has_display

if TYPE_CHECKING:
    from symbrion_gym._src.tasks.paths import Pair
    from symbrion_gym._src.traversability.drivable import TraversabilityMap
    from symbrion_gym._src.traversability.routes import DrivingRoute

Layer = Literal["surface", "contact", "drivable", "route"]


class _Ground(NamedTuple):
    """Where the robot can drive, as far as it is known.

    Attributes:
        places: the map.
        route: a way around obstacles.
        way: start and goal of a straight way.
    """

    places: "TraversabilityMap | None" = None
    route: "DrivingRoute | None" = None
    way: "Pair | None" = None


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

    def __post_init__(self) -> None:
        super().__post_init__()
        check_arena(self.arena)
        self.require_least(modules=1)
        if not self.layers:
            raise UsageError("--layers is empty; give at least one of surface, contact, drivable, route")
        if self.picture is not None:
            require_writable_file(self.picture, "--picture", (".png",))
        elif not has_display():
            raise UsageError("no display for MuJoCo's viewer; give --picture FILE.png to draw the arena")

    def run(self, console: Console) -> dict[str, Any]:
        """Show or draw the arena."""
        if self.picture is not None:
            require_extras("`symbrion view --picture`", "report")
        with console.track(f"Arena {self.arena}"):
            arena = sg.load_arena(self.arena)
            ground = self._find_ground(arena, console)
        low, high = arena.surface.bounds.tolist()
        console.print_line(f"it extends over {format_extents(low, high)}")
        summary: dict[str, Any] = {
            "arena": self.arena,
            "pieces": arena.quality.num_pieces,
            "bounds": [low, high],
        }
        summary |= self._report_ground(ground, console)
        if self.picture is None:
            self._show(arena, ground)
            return summary
        with console.track(f"Picture {self.picture.name}"):
            self._draw(arena, ground)
        console.print_line(f"{self.picture}")
        return summary | {"picture": self.picture}

    def _find_ground(self, arena: "sg.Arena", console: Console) -> _Ground:
        """Return drivable ground and ways on it, as far as they are wanted and exist."""
        if not {"drivable", "route"} & set(self.layers):
            return _Ground()
        body = sg.snake(self.modules)
        places = arena.traversability(body)
        if "route" not in self.layers:
            return _Ground(places)
        from symbrion_gym._src.tasks.paths import propose_way

        way = propose_way(arena, body)
        try:
            return _Ground(places, arena.find_route(body), way)
        except sg.ArenaError as error:
            console.print_line(f"no route: {error}")
            return _Ground(places, None, way)

    def _report_ground(self, ground: _Ground, console: Console) -> dict[str, Any]:
        """Print where the robot can drive, and return it as a summary."""
        summary: dict[str, Any] = {}
        if ground.places is not None:
            summary["ground"] = ground.places.as_dict()
            areas = ground.places.region_areas
            text = f", the largest {areas[0]:.1f} m²" if len(areas) else ""
            console.print_line(
                f"{format_count(len(areas), 'drivable region')}, {areas.sum():.1f} m² in all{text}"
            )
        robot, route = format_count(self.modules, "module"), ground.route
        if route is not None:
            summary["route"] = {"start": route.start, "goal": route.goal, "length": route.length}
            ends = " to ".join(f"({x:.2f}, {y:.2f})" for x, y, _ in (route.start, route.goal))
            console.print_line(f"route for {robot}: {ends}, {route.length:.1f} m")
        if ground.way is not None:
            summary["straight_way"] = ground.way
            start, goal = (" ".join(f"{value:g}" for value in place) for place in ground.way)
            console.print_line(
                f"straight way for {robot}, for symbrion evolve: --start {start} --goal {goal}"
            )
        return summary

    def _show(self, arena: "sg.Arena", ground: _Ground) -> None:
        from symbrion_gym._src.arenas.viewing import make_view_spec, open_viewer

        open_viewer(make_view_spec(arena, self.layers, ground.places, ground.route, sg.snake(self.modules)))

    def _draw(self, arena: "sg.Arena", ground: _Ground) -> None:
        assert self.picture is not None
        from evolution._src.report.arena_view import draw_arena
        from evolution._src.report.figures import to_png

        robot = sg.snake(self.modules)
        self.picture.parent.mkdir(parents=True, exist_ok=True)
        figure = draw_arena(
            arena, self.layers, ground.places, ground.route, robot, has_plan=True, way=ground.way
        )
        with write_atomically(self.picture) as beside:
            beside.write_bytes(to_png(figure, is_reduced=False))
