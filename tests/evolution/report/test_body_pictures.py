"""Pictures of bodies: as many squares as modules, where the modules lie."""

import numpy as np
from matplotlib.patches import Polygon

from evolution._src.report.figures import draw_bodies
from evolution._src.search.bodies.genome import BodyGenome


def test_every_module_is_a_square_where_it_lies():
    body = BodyGenome.parse("b(b(.)m(.))")
    figure = draw_bodies([body], ["a cross"])
    (axes,) = figure.axes
    squares = [np.mean(patch.get_xy()[:4], axis=0) for patch in axes.patches if isinstance(patch, Polygon)]
    poses = body.to_organism().compute_poses()
    assert np.allclose(sorted(map(tuple, squares)), sorted((-pose.y, pose.x) for pose in poses))
    assert axes.get_title() == "a cross"


def test_bodies_share_a_scale_and_none_may_be_given():
    figure = draw_bodies([BodyGenome.parse("."), BodyGenome.parse("b(b(b(b(.))))")], ["one", "five"])
    spans = [np.ptp(axes.get_xlim()) for axes in figure.axes]
    assert np.allclose(spans[0], spans[1])
    assert not draw_bodies([], []).axes
