"""Pictures of an arena show the layers that are asked for."""

import io
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from matplotlib.figure import Figure
from PIL import Image

import symbrion_gym as sg
from evolution._src.report.arena_view import ROBOT_COLOR, add_scale, draw_arena, mute
from evolution._src.report.figures import to_png
from evolution._src.report.raster import OVERSAMPLING, make_view


@pytest.fixture(scope="module")
def truth() -> sg.Arena:
    return sg.load_arena("truth")


@pytest.fixture(autouse=True)
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("evolution._src.report.arena_view.WIDTH", 300)


def draw(arena: sg.Arena, *layers: str) -> np.ndarray:
    ground, route = arena.traversability(), arena.find_route()
    png = to_png(draw_arena(arena, layers, ground, route), is_reduced=False)
    return np.asarray(Image.open(io.BytesIO(png)).convert("RGB"), dtype=float)


def compute_share(pixels: np.ndarray, channel: int) -> float:
    """Return the share of pixels in which one channel is much larger than the others."""
    others = np.delete(pixels, channel, axis=2).max(axis=2)
    return float((pixels[..., channel] - others > 25).mean())


@pytest.mark.slow
def test_layers_have_their_colors(truth: sg.Arena) -> None:
    surface, ground = draw(truth, "surface"), draw(truth, "surface", "drivable")
    assert compute_share(surface, 1) == 0.0
    assert compute_share(ground, 1) > 0.03
    assert compute_share(ground, 2) > 0.03  # the smaller region
    contact = draw(truth, "surface", "contact")
    assert (np.ptp(contact, axis=2) > 25).mean() > 0.05
    assert (np.ptp(surface, axis=2) > 25).mean() < 0.001
    route = draw(truth, "surface", "route")
    assert ((route[..., 0] > 120) & (route[..., 1] < 40)).sum() > 100


@pytest.mark.slow
def test_colors_of_a_scan_are_grays_below_other_layers() -> None:
    arena = sg.Arena.from_course(sg.Course(color_pattern="gradient"))
    assert (np.ptp(draw(arena, "surface"), axis=2) > 60).mean() > 0.2
    grays = mute(np.array([[1.0, 1.0, 1.0], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]))
    np.testing.assert_allclose(grays.max(axis=1), [0.92, 0.57, 0.57 + 0.35 * 0.2126])
    assert np.ptp(grays, axis=1).max() == 0.0
    ground = draw(arena, "surface", "drivable")
    plain = draw(sg.load_arena("truth"), "surface", "drivable")
    assert abs(compute_share(ground, 1) - compute_share(plain, 1)) < 0.05


@pytest.mark.slow
def test_the_plan_has_coordinates_a_robot_and_a_way(truth: sg.Arena) -> None:
    route = truth.find_route()
    figures = [
        draw_arena(
            truth,
            ("surface", "route"),
            None,
            route,
            robot,
            views=("sides", "plan"),
            way=((-2.0, 0.0), (-1.0, 0.2)),
        )
        for robot in (None, sg.snake(4))
    ]
    plan = figures[1].axes[2]
    assert (plan.get_xlabel(), plan.get_ylabel()) == ("x [m]", "y [m]")
    plain, with_robot = (
        np.asarray(Image.open(io.BytesIO(to_png(each, is_reduced=False))).convert("RGB"), dtype=float)
        for each in figures
    )
    yellow = [(np.abs(each / 255.0 - ROBOT_COLOR).max(axis=2) < 0.08).sum() for each in (plain, with_robot)]
    assert yellow[0] == 0
    assert yellow[1] > 20
    names = [text.get_text() for text in figures[1].legends[0].get_texts()]
    assert {"robot, 4 modules", "straight way for it"} <= set(names)


def test_the_star_is_the_goal_wherever_the_path_ends(truth: sg.Arena) -> None:
    route = truth.find_route()
    back = replace(route, goal=route.start)  # a path that ends elsewhere
    lines = draw_arena(truth, ("surface", "route"), None, back).axes[0].lines
    star, circle = [next(line for line in lines if line.get_marker() == marker) for marker in "*o"]
    assert star.get_xydata() == pytest.approx(circle.get_xydata())


def test_a_way_in_a_house_is_seen_through_its_roof_with_ground_and_goal_around_it() -> None:
    bounds = ((-3, -3, -0.1), (3, 3, 0)), ((-3, -3, 2.4), (3, 3, 2.5))
    house = sg.make_arena(trimesh.util.concatenate([trimesh.creation.box(bounds=each) for each in bounds]))
    route = house.find_route(start=(0, 0, 0), goal=(0.5, 0, 0))
    cut = replace(route, path=route.path[:4])  # one that drove there stops before the goal
    figure = draw_arena(house, ("surface", "drivable", "route"), house.traversability(), cut, views=("plan",))
    (solid,) = [
        line for line in figure.axes[0].lines if line.get_linestyle() == "-" and line.get_linewidth() == 2.0
    ]
    assert len(solid.get_xydata()) == len(cut.path)
    pixels = figure.axes[0].images[0].get_array()
    assert (pixels.max(axis=2) < 0.99).mean() > 0.9  # ground up to the edges
    star = next(line for line in figure.axes[0].lines if line.get_marker() == "*")
    (column, row), (height, width) = star.get_xydata()[0], pixels.shape[:2]
    assert 0.1 * width < column < 0.9 * width
    assert 0.1 * height < row < 0.9 * height


def test_coordinates_are_those_of_the_view() -> None:
    points = np.array([[1.3, -2.0, 0.0], [9.1, 1.0, 0.5]])
    view = make_view(points, 90.0, -90.0, OVERSAMPLING * 400)
    axes = Figure().add_subplot()
    add_scale(axes, view)
    for axis, other in ((axes.xaxis, 0), (axes.yaxis, 1)):
        places = [
            (place, float(text.get_text()))
            for place, text in zip(axis.get_ticklocs(), axis.get_ticklabels(), strict=True)
        ]
        assert len(places) >= 3
        for pixel, meters in places:
            point = np.zeros(3)
            point[other] = meters
            assert view.project(point)[other] / OVERSAMPLING == pytest.approx(pixel)
