"""The error of colors."""

import numpy as np
import pytest
import trimesh

from reconstruction._src.base.errors import ReconstructionError
from reconstruction._src.surfaces.color import add_alpha, measure_color_error


def make_colored(value: int) -> trimesh.Trimesh:
    mesh = trimesh.creation.box()
    mesh.visual = trimesh.visual.ColorVisuals(
        mesh, vertex_colors=add_alpha(np.full((len(mesh.vertices), 3), value, np.uint8))
    )
    return mesh


def test_edges_are_told_apart():
    def paint(places):
        return np.repeat(np.where(places[:, :1] < 0, 0.4, 0.9), 3, axis=1)

    error = measure_color_error(make_colored(102), paint)
    assert 0.8 < error.away < 1.0
    assert error.rmse_everywhere > 0


def test_a_colored_mesh_can_be_the_truth():
    assert measure_color_error(make_colored(51), make_colored(51)).rmse == pytest.approx(0.0, abs=1e-12)
    assert measure_color_error(make_colored(51), make_colored(102)).rmse == pytest.approx(0.2)


def test_what_has_no_colors_is_refused():
    with pytest.raises(ReconstructionError, match="vertex colors"):
        measure_color_error(trimesh.creation.box(), lambda places: places)
    with pytest.raises(ReconstructionError, match="true mesh"):
        measure_color_error(make_colored(1), trimesh.creation.box())
