"""Specs to look at: the layers that are asked for, and nothing that is touched."""

import mujoco
import numpy as np
import pytest

import symbrion_gym as sg
from symbrion_gym._src.arenas.spec import CONTACT_GROUP
from symbrion_gym._src.arenas.viewing import CONTACT_OPACITY, LAYERS, make_view_spec, open_viewer
from symbrion_gym._src.errors import OptionError


@pytest.fixture(scope="module")
def truth() -> sg.Arena:
    return sg.load_arena("truth")


def find_names(model: mujoco.MjModel) -> set[str]:
    return {model.geom(index).name for index in range(model.ngeom)}


def test_all_layers(truth: sg.Arena):
    model = make_view_spec(truth, LAYERS, truth.traversability(), truth.find_route()).compile()
    names = find_names(model)
    assert {"arena_surface", "arena_piece_0", "ground_0", "ground_2", "route_0", "start", "goal"} <= names
    assert (model.geom_group != CONTACT_GROUP).all()  # which the viewer does not show at first
    assert model.geom("arena_piece_0").rgba[3] == pytest.approx(CONTACT_OPACITY)
    added = [index for index in range(model.ngeom) if not model.geom(index).name.startswith("arena_piece")]
    assert not model.geom_contype[added].any()
    assert not model.geom_conaffinity[added].any()


def test_start_and_goal_are_where_the_route_says(truth: sg.Arena):
    route = truth.find_route()
    model = make_view_spec(truth, ("route",), None, route).compile()
    assert model.geom("start").pos[:2] == pytest.approx(route.start[:2])
    assert model.geom("goal").pos[:2] == pytest.approx(route.goal[:2])


def test_the_robot_stands_at_the_start(truth: sg.Arena):
    route, robot = truth.find_route(), sg.snake(3)
    model = make_view_spec(truth, ("route",), None, route, robot).compile()
    places = np.array([model.geom(f"robot_{index}").pos for index in range(3)])
    assert places.mean(axis=0)[:2] == pytest.approx(route.start[:2])
    assert places[:, 2] == pytest.approx(route.start[2] + 0.105 / 2)
    ahead = [np.cos(route.heading), np.sin(route.heading)]
    assert (places[0] - places[2])[:2] == pytest.approx(np.multiply(2 * robot.scout.pitch, ahead))
    assert model.geom("robot_0").size == pytest.approx([0.0525] * 3)
    assert not model.geom("robot_0").contype.any()


def test_a_missing_display_is_refused(truth: sg.Arena, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("symbrion_gym._src.arenas.viewing.has_display", lambda: False)
    with pytest.raises(OptionError, match="no display"):
        open_viewer(truth.spec())
