"""The sequential rules, one by one, and what they make of a cloud."""

import numpy as np
import pytest
import trimesh
from shapes import make_sheet, sample_mesh

from reconstruction._src.networks.gsrm.gsrm import GSRMConfig, train
from reconstruction._src.networks.gsrm.paper import (
    PaperMap,
    PaperMesh,
    Rates,
    close_surface,
    compute_dihedral,
    drop_incorrect_faces,
    join_winners,
    merge_edges,
)
from reconstruction._src.surfaces.quality import compute_distances, count_topology

SQUARE = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])


def _make_mesh(num_units: int, edges: list[tuple[int, int]], faces: list[tuple[int, int, int]]) -> PaperMesh:
    mesh = PaperMesh()
    for _ in range(num_units):
        mesh.add_unit()
    for a, b in edges:
        mesh.add_edge(a, b)
    for face in faces:
        assert mesh.add_face(*face)
    return mesh


def test_winners_are_joined_with_faces_to_common_neighbors() -> None:
    mesh = _make_mesh(4, [(0, 1), (1, 2), (2, 3), (3, 0)], [])
    join_winners(mesh, SQUARE, 0, 2)
    assert {tuple(face) for face in mesh.gather_faces().tolist()} == {(0, 1, 2), (0, 2, 3)}


def test_a_new_edge_replaces_the_one_between_common_neighbors() -> None:
    mesh = _make_mesh(4, [(0, 1), (1, 2), (2, 3), (3, 0), (1, 3)], [(0, 1, 3), (1, 2, 3)])
    join_winners(mesh, SQUARE, 0, 2)
    assert not mesh.has_edge(1, 3)
    assert len(mesh.gather_faces()) == 2


def test_an_edge_seen_at_more_than_a_right_angle_goes() -> None:
    positions = np.array([[0.0, 0, 0], [2, 0, 0], [1, 0.5, 0]])
    mesh = _make_mesh(3, [(0, 1), (1, 2), (2, 0)], [(0, 1, 2)])
    join_winners(mesh, positions, 0, 1)
    assert not mesh.has_edge(0, 1)
    assert len(mesh.gather_faces()) == 0


def test_an_edge_never_has_three_faces() -> None:
    mesh = _make_mesh(5, [(0, 1), (0, 2), (1, 2), (0, 3), (1, 3), (0, 4), (1, 4)], [(0, 1, 2), (0, 1, 3)])
    assert not mesh.add_face(0, 1, 4)
    assert not mesh.add_face(0, 1, 2)


def test_a_signal_moves_winner_and_neighbors_and_counts_the_error_after_the_move() -> None:
    network = PaperMap(SQUARE[:3], 8, Rates())
    signal = np.array([-1.0, 0, 0])
    network.learn(signal)
    np.testing.assert_allclose(network.positions[0], [-0.05, 0, 0])
    np.testing.assert_allclose(network.positions[1], [1 - 0.0006 * 2, 0, 0])
    np.testing.assert_allclose(network.errors[0], 0.95**2 * 0.9995)


def test_a_new_unit_parts_the_worst_from_its_worst_neighbor() -> None:
    network = PaperMap(SQUARE[:3], 8, Rates())
    for a, b in ((0, 1), (1, 2), (2, 0)):
        network.mesh.add_edge(a, b)
    network.errors[:3] = [4.0, 2.0, 1.0]
    network.insert_unit()
    assert not network.mesh.has_edge(0, 1)
    assert set(network.mesh.neighbors[3]) == {0, 1}
    np.testing.assert_allclose(network.positions[3], [0.5, 0, 0])
    np.testing.assert_allclose(network.errors[:4], [3.8, 1.9, 1.0, 2.85])


def test_edges_that_are_not_confirmed_go() -> None:
    network = PaperMap(SQUARE[:3], 8, Rates(max_age=3, winner_rate=0.0, neighbor_rate=0.0))
    network.mesh.add_edge(0, 2)
    for _ in range(4):
        network.learn(np.array([0.1, -0.1, 0.0]))
    assert not network.mesh.has_edge(0, 2)
    assert network.mesh.has_edge(0, 1)
    assert network.num_alive == 2


def test_patching_rules() -> None:
    assert np.isclose(compute_dihedral(SQUARE, 0, 2, 1, 3), np.pi)
    folded = np.array([[0.0, 0, 0], [1, 0, 0], [0.5, 1, 0], [0.5, 1, 0.2]])
    mesh = _make_mesh(4, [(0, 1), (1, 2), (2, 0), (1, 3), (3, 0)], [(0, 1, 2), (0, 1, 3)])
    drop_incorrect_faces(mesh, folded)
    assert len(mesh.gather_faces()) == 1
    line = np.array([[0.0, 0, 0], [1, 0.01, 0], [2, 0, 0]])
    mesh = _make_mesh(3, [(0, 1), (1, 2)], [])
    merge_edges(mesh, line)
    assert mesh.has_edge(0, 2)
    assert not mesh.neighbors[1]
    mesh = _make_mesh(4, [(0, 1), (1, 2), (2, 0), (2, 3), (3, 0)], [(0, 1, 2)])
    close_surface(mesh, SQUARE)
    assert len(mesh.gather_faces()) == 2


@pytest.mark.slow
def test_the_rules_cover_a_sheet_and_a_sphere() -> None:
    sheet = make_sheet(4000)
    state = train(sheet, GSRMConfig(units=120, mode="paper"), 0)
    topology = count_topology(state.faces, len(state.units))
    assert topology.non_manifold_edges == 0
    assert 170 < topology.num_faces < 230
    assert compute_distances(sheet, state.units, state.faces).mean() < 0.02
    ball = sample_mesh(trimesh.creation.icosphere(3), 4000, 0.005)
    state = train(ball, GSRMConfig(units=100, mode="paper"), 0)
    assert count_topology(state.faces, len(state.units)).boundary_edges < 30


def test_equal_seeds_give_equal_maps() -> None:
    sheet = make_sheet(2000)
    first, second = (train(sheet, GSRMConfig(units=40, mode="paper"), 2) for _ in range(2))
    np.testing.assert_array_equal(first.units, second.units)
    np.testing.assert_array_equal(first.faces, second.faces)
