"""Numbers as text for people."""

import pytest

from reconstruction._src.base.range_checks import format_count, format_distance, format_extents, format_share


@pytest.mark.parametrize(
    ("distance", "text"),
    [
        (0.0, "0.00 mm"),
        (1.25e-15, "0.00 mm"),
        (5.1e-6, "0.0051 mm"),
        (0.01234, "12.3 mm"),
        (0.9996, "1000 mm"),
        (-0.02, "-20 mm"),
        (12.345, "12.3 m"),
        (123456.7, "123457 m"),
    ],
)
def test_distances(distance, text):
    assert format_distance(distance) == text


@pytest.mark.parametrize(
    ("share", "text"), [(0.0, "0 %"), (1e-9, "below 0.01 %"), (0.01234, "1.23 %"), (1.0, "100 %")]
)
def test_shares(share, text):
    assert format_share(share) == text


def test_extents_are_places_in_meters():
    assert format_extents([-0.004, -1.256], [12345.678, 3.0]) == "x 0 to 12345.68 m, y -1.26 to 3 m"
    assert format_extents([0.0, 0.0, 0.1], [1.0, 2.0, 3.0]).endswith("z 0.1 to 3 m")


def test_one_thing_is_not_many():
    assert [format_count(count, "module") for count in (0, 1, 2)] == ["0 modules", "1 module", "2 modules"]
    assert [format_count(count, "body", "bodies") for count in (1, 2)] == ["1 body", "2 bodies"]
