"""The judge of contact, on shapes known by hand."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from benchmarks.material.contact_judge import Judge, Solid, cast, find_distances
from benchmarks.material.scan_sources import ScanCase


def make_box(low: list[float], high: list[float]) -> trimesh.Trimesh:
    return trimesh.creation.box(bounds=[low, high])


def make_floor(height: float = 0.0, size: float = 2.0) -> trimesh.Trimesh:
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * size / 2
    vertices = np.column_stack([corners, np.full(4, height)])
    return trimesh.Trimesh(vertices, [[0, 1, 2], [0, 2, 3]], process=False)


def make_case(height: float = 0.0) -> ScanCase:
    """Scan a floor of 2 x 2 m from 1.5 m above it."""
    side = np.linspace(-0.95, 0.95, 40)
    points = np.stack([*np.meshgrid(side, side), np.full((40, 40), height)], axis=-1).reshape(-1, 3)
    viewpoint = np.array([[0.0, 0.0, 1.5]])
    rows = np.zeros(len(points), int)
    return ScanCase("floor", points, viewpoint, rows, viewpoint[rows])


def test_a_point_is_solid_in_any_piece() -> None:
    solid = Solid.of_pieces([make_box([0, 0, 0], [1, 1, 1]), make_box([0.5, 0, 0], [3, 1, 1])])
    points = np.array([[0.25, 0.5, 0.5], [2.5, 0.5, 0.5], [0.75, 0.5, 0.5], [3.5, 0.5, 0.5], [0.5, 0.5, 1.1]])
    assert solid.is_inside(points).tolist() == [True, True, True, False, False]


def test_walls_between_pieces_are_no_boundary() -> None:
    solid = Solid.of_pieces([make_box([0, 0, 0], [1, 1, 1]), make_box([0.5, 0, 0], [3, 1, 1])])
    assert solid.boundary.is_watertight
    assert solid.boundary.volume == pytest.approx(3.0, rel=1e-6)
    assert find_distances(np.array([[1.0, 0.5, 0.5]]), solid.boundary) == pytest.approx(0.5, abs=1e-6)


def test_a_ray_ends_where_it_hits() -> None:
    ranges = cast(make_floor(), np.array([[0, 0, 2.0], [5, 5, 2.0]]), np.array([[0, 0, -1.0], [0, 0, -1.0]]))
    assert ranges[0] == pytest.approx(2.0)
    assert ranges[1] == np.inf


def test_contact_that_is_right_has_no_error() -> None:
    found = Judge(make_case()).judge_contact(
        make_floor(), Solid.of_pieces([make_box([-1, -1, -0.2], [1, 1, 0])])
    )
    assert found["contact_max"] < 1e-6
    assert found["uncovered"] == 0
    assert found["beams"] == 1
    assert found["free_space"] == 0


def test_contact_that_is_low_by_2_cm_is_off_by_2_cm() -> None:
    solid = Solid.of_pieces([make_box([-1, -1, -0.2], [1, 1, -0.02])])
    found = Judge(make_case()).judge_contact(make_floor(), solid)
    assert found["contact_mean"] == pytest.approx(0.02, abs=1e-6)
    assert found["contact_p95"] == pytest.approx(0.02, abs=1e-6)


def test_contact_that_grows_towards_the_scanner_is_found() -> None:
    """The surface lies on its boundary, so only beams and free space tell."""
    solid = Solid.of_pieces([make_box([-1, -1, 0.0], [1, 1, 0.4])])
    found = Judge(make_case()).judge_contact(make_floor(), solid)
    assert found["contact_mean"] < 1e-6
    assert found["beams"] == 0
    assert found["beams_before"] == 1
    assert found["free_space"] > 0.3


def test_a_scanner_within_the_solid_sees_nothing() -> None:
    solid = Solid.of_pieces([make_box([-2, -2, -2], [2, 2, 2])])
    found = Judge(make_case()).judge_contact(make_floor(), solid)
    assert found["beams_before"] == 1
    assert found["free_space"] == 1


def test_half_of_the_surface_without_contact_is_counted() -> None:
    solid = Solid.of_pieces([make_box([-1, -1, -0.2], [0, 1, 0])])
    assert Judge(make_case()).judge_contact(make_floor(), solid)["uncovered"] == pytest.approx(
        0.475, abs=0.01
    )


def test_a_height_field_is_solid_below() -> None:
    found = Judge(make_case()).judge_contact(make_floor(), Solid.of_ground(make_floor(0.1)))
    assert found["contact_mean"] == pytest.approx(0.1, abs=1e-6)
    assert found["uncovered"] == 1
    assert 0 < found["free_space"] < 0.2


def test_equal_calls_give_equal_figures() -> None:
    solid = Solid.of_pieces([make_box([-1, -1, -0.2], [1, 1, 0.03])])
    first, second = (Judge(make_case(0.01)).judge_contact(make_floor(), solid) for _ in range(2))
    assert first == second


def test_the_upper_side_of_a_ceiling_is_unseen() -> None:
    floor, ceiling = make_floor(), make_floor(2.0)
    room = trimesh.util.concatenate([floor, ceiling])
    assert isinstance(room, trimesh.Trimesh)
    case = make_case()
    above = np.concatenate([case.points, case.points + np.array([0.0, 0.0, 2.0])])
    assert case.origins is not None
    case = replace(case, points=above, origins=np.concatenate([case.origins, case.origins]))
    assert Judge(case).count_unseen(room, np.array([[0.5, 0.5, 0.0]])) == 0
    assert Judge(case).count_unseen(room, np.array([[0.5, 0.5, 0.0], [0.5, 0.5, 2.06]])) == 1
