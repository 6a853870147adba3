"""coacd in a process of its own."""

import numpy as np
import pytest
import trimesh

from symbrion_gym._src.contact.coacd import MAX_HULL_VERTICES, decompose, make_piece
from symbrion_gym._src.errors import ArenaError


def test_two_boxes_apart_become_two_pieces():
    boxes = [trimesh.creation.box((1, 1, 1)), trimesh.creation.box((1, 1, 1)).apply_translation([3, 0, 0])]
    pieces = decompose(boxes[0] + boxes[1], 0)
    assert len(pieces) == 2
    assert sum(piece.volume for piece in pieces) == pytest.approx(2.0, rel=0.02)


def test_the_caller_survives_what_coacd_does_not():
    nonsense = trimesh.Trimesh(np.full((3, 3), np.inf), [[0, 1, 2]], process=False)
    with pytest.raises(ArenaError, match="coacd"):
        decompose(nonsense, 0)


def test_pieces_are_small_hulls_and_never_flat():
    points = trimesh.creation.icosphere(subdivisions=4).vertices
    piece = make_piece(points)
    assert piece is not None
    assert len(piece.vertices) <= MAX_HULL_VERTICES
    assert make_piece(points * [1, 1, 0]) is None
