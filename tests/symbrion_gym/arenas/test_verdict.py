"""Verdicts: made floors with known faults, the axis that points up, ground that nobody saw, and their files."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

import reconstruction as rc
import symbrion_gym as sg
from evolution._src.cli.main import run
from symbrion_gym._src.arenas.scanned import ScannedSurface, add_scan_quality, find_unseen
from symbrion_gym._src.contact.quality import ArenaQuality
from symbrion_gym._src.tasks.paths import propose_way

FLOOR = trimesh.creation.box((3.0, 2.0, 0.1)).apply_translation([0.0, 0.0, -0.05])


def make_floor(shift: float = 0.0, **changes: float) -> sg.Arena:
    """Return a floor of 3 m by 2 m whose contact is shifted up [m]."""
    piece = FLOOR.copy().apply_translation([0.0, 0.0, shift])
    quality = replace(ArenaQuality(mean=0.0, p95=0.0, max=0.0, num_pieces=1), **changes)
    return sg.Arena("floor", [piece], FLOOR, quality)


def test_an_exact_floor_is_good() -> None:
    verdict = make_floor().verdict
    assert (verdict.answer, verdict.reasons, str(verdict)) == ("yes", (), "good for a robot of 0.105 m: yes")


def test_ground_that_is_too_narrow_says_how_wide_it_is() -> None:
    boxes = [((-1, -0.06, -0.1), (1, 0.06, 0))]
    boxes += [((-1, low, -0.1), (1, low + 0.1, 0.3)) for low in (-0.16, 0.06)]
    lane = sg.make_arena(
        trimesh.boolean.union([trimesh.creation.box(bounds=each) for each in boxes]), cache=False
    )
    assert lane.verdict.answer == "no"
    assert "m wide at most between walls and rims, of 0.15 m needed" in str(lane.verdict)
    assert "by --up" in str(lane.verdict)
    assert "--up" not in str(replace(lane, provenance={**lane.provenance, "up": "z"}).verdict)


@pytest.mark.parametrize(
    ("shift", "changes", "figure", "answer"),
    [
        (-0.03, {}, "loose_ground", "no"),
        (0.0, {"uncovered": 0.06}, "uncovered", "in part"),
        (0.0, {"beams_surface": 0.9, "beams_contact": 0.4}, "beams", "no"),
    ],
)
def test_a_figure_decides(shift: float, changes: dict[str, float], figure: str, answer: str) -> None:
    floor = replace(make_floor(shift, **changes), provenance={"remedy": "more pieces"})
    (reason,) = floor.verdict.reasons
    assert (reason.figure, reason.answer) == (figure, answer)
    assert reason.remedy.endswith("more pieces")


@pytest.mark.parametrize(("rise", "answer"), [(0.05, "yes"), (0.3, "no")])
def test_no_robot_stands_in_a_gap_lower_than_itself(rise: float, answer: str) -> None:
    """Below a second floor the first has no contact: nothing is lost where the gap is lower than the robot."""
    lid = FLOOR.copy().apply_translation([0.0, 0.0, rise])
    arena = replace(make_floor(rise), surface=trimesh.util.concatenate([FLOOR, lid]))
    assert arena.verdict.answer == answer


@pytest.mark.parametrize(("off", "answer"), [(0.005, "yes"), (0.06, "in part"), (0.4, "no")])
def test_a_surface_far_from_its_readings_is_good_for_no_robot(off: float, answer: str) -> None:
    """Readings of the floor are spread evenly up to so far above it: the median is half of that."""
    readings = np.random.default_rng(0).uniform([-1.5, -1.0, 0.0], [1.5, 1.0, off], (40_000, 3))
    readings[:, 2] += FLOOR.vertices[:, 2].max()
    walls = np.random.default_rng(1).uniform(
        [2.5, -1.0, -0.09], [2.6, 1.0, -0.01], (90_000, 3)
    )  # not of the ground
    readings = np.concatenate([readings, walls])
    floor = make_floor()
    quality = add_scan_quality(floor.quality, ScannedSurface(FLOOR, points=readings), floor.pieces, FLOOR)
    assert quality.readings == pytest.approx(off / 2, rel=0.1)
    arena = replace(floor, quality=quality)
    assert arena.verdict.answer == answer
    reasons = [each.meaning for each in arena.verdict.reasons if each.figure == "readings"]
    assert len(reasons) == (answer != "yes")
    assert all("off the surface" in each for each in reasons)


def test_ground_that_nobody_saw_is_not_driven_on(tmp_path: Path) -> None:
    mesh = trimesh.Trimesh(*trimesh.remesh.subdivide_to_size(FLOOR.vertices, FLOOR.faces, 0.2)[:2])
    readings = np.random.default_rng(0).uniform([-1.5, -1.0, 0.0], [0.0, 1.0, 0.0], (4000, 3))
    arena = replace(make_floor(), surface=mesh, unseen=find_unseen(mesh, readings))
    ground = arena.traversability()
    assert -0.4 < ground.positions[ground.is_drivable, 0].max() < 0.45
    assert arena.find_route().goal[0] < 0.45
    assert [each.figure for each in arena.verdict.reasons] == ["unseen_ground"]
    arena.save(tmp_path)
    loaded = sg.Arena.load(tmp_path)
    assert loaded.verdict == arena.verdict
    assert loaded.unseen == arena.unseen


def test_a_mesh_whose_floor_lies_along_y_is_turned_upright(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> None:
    turned = FLOOR.copy().apply_transform(trimesh.transformations.rotation_matrix(-np.pi / 2, [1, 0, 0]))
    turned.export(tmp_path / "floor.ply")
    with caplog.at_level("WARNING"):
        arena = sg.make_arena(tmp_path / "floor.ply", cache=False)
    assert "y is taken for up" in caplog.text
    assert (arena.verdict.answer, arena.provenance["up"]) == ("yes", "y")
    assert arena.surface.extents == pytest.approx([3.0, 2.0, 0.1])
    command = ["arena", str(tmp_path / "floor.ply"), "--up", "z", "--strict", "--out", str(tmp_path / "a")]
    assert run(command) == 3  # what is said is believed, and so it is a wall
    assert "the largest area to drive on has" in capsys.readouterr().out


@pytest.mark.parametrize("is_turned", [True, False])
def test_the_axis_that_a_format_states_is_known_and_checked(tmp_path: Path, is_turned: bool) -> None:
    """Many programs write .glb with z up, though y is what the format says."""
    floor = FLOOR.copy().apply_translation([0.0, 0.0, -1.95])
    if is_turned:
        floor.apply_transform(trimesh.transformations.rotation_matrix(-np.pi / 2, [1, 0, 0]))
    floor.export(tmp_path / "floor.glb")
    arena = sg.make_arena(tmp_path / "floor.glb", cache=False)
    assert (arena.verdict.answer, arena.provenance["up"]) == ("yes", "y" if is_turned else "z")
    np.testing.assert_allclose(arena.surface.bounds, [[-1.5, -1.0, -2.05], [1.5, 1.0, -1.95]], atol=1e-6)


@pytest.mark.parametrize("up", [None, "z"])
def test_an_axis_that_the_user_gives_is_not_doubted(up: str | None, tmp_path: Path) -> None:
    """In a shaft the walls are most of what is square; of points, too, and once saved."""
    shaft = trimesh.creation.box((3.0, 2.5, 12.0)).subdivide().subdivide()
    shaft.update_faces(shaft.face_normals[:, 2] < 0.5)
    shaft.invert()
    arena = sg.make_arena(shaft, up=up, cache=False)
    arena.save(tmp_path / "arena")
    cloud = rc.Cloud(
        trimesh.sample.sample_surface(shaft, 4000, seed=0)[0], viewpoints=np.zeros((1, 3)), up=up
    )
    rc.reconstruct(cloud, units=300, seed=0).save(tmp_path / "made.npz")
    again = rc.Reconstruction.load(tmp_path / "made.npz").refine(cloud.points, origins=np.zeros(3))
    made = sg.make_arena(again, cache=False)
    for each in (sg.Arena.load(tmp_path / "arena"), made):
        assert ("up_axis" in [reason.figure for reason in each.verdict.reasons]) == (up is None)
        assert ("give --up" in str(each.verdict)) == (up is None)


@pytest.mark.parametrize(("turns", "answer"), [(0, "yes"), (2, "no")])
def test_a_room_upside_down_is_good_for_no_robot(turns: int, answer: str) -> None:
    room = trimesh.creation.box([4.0, 3.0, 2.5]).subdivide()
    room.update_faces(room.triangles_center[:, 2] < 1.2)
    room.invert()
    room.apply_transform(trimesh.transformations.rotation_matrix(turns * np.pi / 2, [1, 0, 0]))
    for up, opposite in ((None, "-z"), ("y", "-y"), ("-z", "z")):
        arena = sg.make_arena(room, cache=False)
        verdict = replace(arena, provenance={**arena.provenance, "up": up}).verdict
        assert verdict.answer == answer
        assert (f"give --up {opposite}, or" in str(verdict)) == (answer == "no")


def test_a_closed_block_is_driven_on_from_above() -> None:
    """Its sides hang below its top as those of a ceiling do, but its file winds it outwards."""
    assert sg.make_arena(trimesh.creation.box((3.0, 3.0, 1.0)), cache=False).verdict.answer == "yes"


def test_a_way_keeps_off_rims() -> None:
    way = propose_way(make_floor(), sg.snake(1))
    assert way is not None
    assert np.abs(np.array(way)[:, 1]).max() < 1.0 - 0.14
