"""A cloud: what it holds, what goes with its points, what it refuses."""

import numpy as np
import pytest

from reconstruction._src.base.errors import ScanError
from reconstruction._src.scans.cloud import Cloud

POINTS = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
COLORS = np.arange(12, dtype=np.uint8).reshape(4, 3)
VIEWPOINTS = np.array([[0.0, 0.0, 2.0], [5.0, 0.0, 2.0]])
SEEN_FROM = np.array([0, 1, 1, 0])


def test_iterating_gives_points_colors_and_viewpoints() -> None:
    points, colors, viewpoints = Cloud(POINTS, COLORS, VIEWPOINTS)
    assert (points == POINTS).all()
    assert (colors == COLORS).all()
    assert (viewpoints == VIEWPOINTS).all()
    assert list(Cloud(POINTS))[1:] == [None, None]
    assert np.asarray(Cloud(POINTS), np.float32).dtype == np.float32


def test_selected_points_keep_their_colors_and_viewpoints() -> None:
    cloud = Cloud(POINTS, COLORS, VIEWPOINTS, SEEN_FROM, np.array([1e6, 0.0, 0.0]))
    for chosen in (np.array([False, True, False, True]), np.array([1, 3])):
        some = cloud.select(chosen)
        assert some.num_points == 2
        np.testing.assert_array_equal(some.colors, COLORS[[1, 3]])
        np.testing.assert_array_equal(some.seen_from, [1, 0])
        np.testing.assert_array_equal(some.offset, cloud.offset)
    np.testing.assert_array_equal(cloud.origins, VIEWPOINTS[SEEN_FROM])


def test_a_single_viewpoint_has_seen_every_point() -> None:
    cloud = Cloud(POINTS, viewpoints=VIEWPOINTS[:1])
    np.testing.assert_array_equal(cloud.seen_from, [0, 0, 0, 0])
    assert Cloud(POINTS, viewpoints=VIEWPOINTS).seen_from is None
    assert Cloud(POINTS, viewpoints=VIEWPOINTS).origins is None


def test_its_text_says_what_it_holds() -> None:
    assert repr(Cloud(POINTS)) == "Cloud(4 points)"
    text = repr(Cloud(POINTS, COLORS, VIEWPOINTS, offset=np.array([4e5, 5e6, 0.0])))
    assert "colors, 2 viewpoints (which point" in text
    assert "offset [400000.0, 5000000.0, 0.0] m" in text


@pytest.mark.parametrize(
    ("values", "reason"),
    [
        ({"points": POINTS[:, :2]}, "positions x, y, z"),
        ({"points": np.full((4, 3), np.nan)}, "finite"),
        ({"colors": COLORS.astype(float)}, "bytes"),
        ({"colors": COLORS[:2]}, "4 points"),
        ({"seen_from": SEEN_FROM}, "needs viewpoints"),
        ({"viewpoints": VIEWPOINTS, "seen_from": SEEN_FROM + 1}, "1 to 2; there are 2"),
        ({"viewpoints": VIEWPOINTS, "seen_from": SEEN_FROM[:2]}, "each of 4 points"),
        ({"viewpoints": np.empty((0, 3))}, "empty"),
        ({"offset": np.zeros(2)}, "offset"),
    ],
)
def test_what_does_not_fit_is_refused(values: dict[str, np.ndarray], reason: str) -> None:
    with pytest.raises(ScanError, match=reason):
        Cloud(**{"points": POINTS, **values})
