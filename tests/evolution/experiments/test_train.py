"""From a scan to a robot that drives there, on a small floor."""

import html
import re
import shutil
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
import trimesh
from scipy.spatial import cKDTree

import evolution as ev
import reconstruction as rc
import symbrion_gym as sg
from evolution._src.cli.commands.experiments import Train
from evolution._src.cli.main import run
from evolution._src.experiments import folders
from evolution._src.experiments import train as training
from evolution._src.experiments.train import choose_task, crop_part, find_part, keep_low, split_readings
from evolution._src.experiments.train_page import _make_scene
from evolution._src.experiments.training import Training
from reconstruction._src.base.progress import silent
from symbrion_gym._src.arenas.verdict import Reason, Verdict
from symbrion_gym._src.contact.distances import find_nearest
from symbrion_gym._src.contact.quality import ArenaQuality
from symbrion_gym._src.tasks.paths import find_path
from symbrion_gym._src.tasks.route import Start


def make_scan(seed: int = 0) -> rc.Cloud:
    """Return readings of a floor of 2.4 m by 2.4 m with 1 mm of noise, seen from above."""
    rng = np.random.default_rng(seed)
    places = np.stack(np.meshgrid(*[np.linspace(-1.2, 1.2, 80)] * 2), axis=-1).reshape(-1, 2)
    points = np.column_stack([places, np.zeros(len(places))]) + rng.normal(0.0, 1e-3, (len(places), 3))
    return rc.Cloud(rng.permutation(points), viewpoints=np.array([[0.0, 0.0, 1.0]]))


def test_halves_share_no_reading() -> None:
    ranges = np.random.default_rng(0).uniform(1.0, 2.0, (20, 30))
    log = rc.ScanLog(ranges, np.linspace(0.0, 1.0, 30), np.tile(np.eye(4), (20, 1, 1)))
    clouds = split_readings(make_scan()), [rc.make_log_cloud(half) for half in split_readings(log)]
    for halves, count in zip(clouds, (6400, 600), strict=True):
        rows = np.concatenate([half.points for half in halves])  # pyright: ignore[reportAttributeAccessIssue]
        assert len(np.unique(rows, axis=0)) == len(rows) == count


@pytest.mark.long
def test_a_scan_becomes_a_robot_that_drives_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(training, "GENERATIONS", 4)
    monkeypatch.setattr(training, "TRIALS", 6)
    result = ev.train(make_scan(), tmp_path / "mine", workers=2)
    assert result.verdict == result.arena.verdict
    assert result.held_in_training >= 5
    assert result.held_in_other_half >= 5
    for drivers in result.held.values():
        assert max(drivers["doing nothing"], drivers["tracks forward"]) <= 1
    page = html.unescape(result.page.read_text(encoding="utf-8"))
    assert "succeeds in" in page
    found = re.search(r"gym\.make\((.*?)\)</code>", page)
    assert found is not None
    env = eval(f"gym.make({found[1]})", {"gym": gym})  # what the page advises
    assert env.reset(seed=0)[0].shape == env.observation_space.shape
    env.close()

    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("done again")

    evolve = folders.evolve
    monkeypatch.setattr(training, "_make_model", refuse)
    monkeypatch.setattr("evolution._src.experiments.folders.evolve", refuse)
    again = ev.train(make_scan(), tmp_path / "mine", workers=1)
    assert (again.held, again.run.champion) == (result.held, result.run.champion)
    with pytest.raises(ev.RunError, match=r"other options \(scan\)"):
        ev.train(make_scan(seed=1), tmp_path / "mine")
    with pytest.raises(ev.RunError, match=r"other options \(goal\).* its models serve another way"):
        ev.train(make_scan(), tmp_path / "mine", goal=(0.5, 0.0))
    monkeypatch.setattr("evolution._src.experiments.folders.evolve", evolve)
    shutil.rmtree(tmp_path / "mine" / "run")
    other = ev.train(make_scan(), tmp_path / "mine", goal=(0.5, 0.0), workers=2)
    assert other.run.config.goal == (0.5, 0.0)


@pytest.mark.parametrize(
    ("remedies", "given", "asked"),
    [
        ([], None, [None]),
        (["allow more pieces: --max-pieces 4400"], None, [None, 4400]),
        (["allow more pieces: --max-pieces 4400"], 2200, [2200]),
        (["allow more pieces: --max-pieces 4400", "scan more ground"], None, [None]),
    ],
)
def test_an_arena_that_wants_only_pieces_gets_twice_as_many(
    monkeypatch: pytest.MonkeyPatch, remedies: list[str], given: int | None, asked: list[int | None]
) -> None:
    seen: list[int | None] = []
    reasons = tuple(Reason("uncovered", 0.2, "no", "some", each) for each in remedies)

    def make(_: object, max_pieces: int | None = None) -> object:
        seen.append(max_pieces)
        provenance = {"options": {"max_pieces": max_pieces or 2200}}
        return SimpleNamespace(verdict=Verdict("no", reasons), provenance=provenance)

    monkeypatch.setattr(sg, "make_arena", make)
    training._make_arena("scan", given)
    assert seen == asked


def test_who_is_interrupted_between_two_models_does_not_make_the_first_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[int] = []
    floors = {0: make_floor(2.0), 1: make_floor(1.9), 2: make_floor(1.8)}

    def make(half: rc.Cloud, seed: int, *_: object) -> sg.Arena:
        asked.append(seed)
        if asked == [0, 1]:
            raise KeyboardInterrupt
        return floors[seed]

    monkeypatch.setattr(training, "_make_model", make)
    with pytest.raises(KeyboardInterrupt):
        training.make_models(make_scan(), tmp_path / "a", 0)
    resumed = training.make_models(make_scan(), tmp_path / "a", 0)
    assert asked == [0, 1, 1]
    for one, other in zip(resumed, training.make_models(make_scan(), tmp_path / "b", 0), strict=True):
        assert one.unseen == other.unseen
        np.testing.assert_array_equal(one.surface.vertices, other.surface.vertices)
    training.make_models(make_scan(), tmp_path / "a", 1)
    assert asked[5:] == [1, 2], "of another seed both are made again"


@pytest.mark.slow
def test_a_mesh_is_checked_by_the_model_of_a_scan_of_it(tmp_path: Path) -> None:
    """The scan sees a floor of few faces with a wall on it from both sides, but not the bottom of the floor."""
    bounds = ((-1.5, -1.5, -0.1), (1.5, 1.5, 0.0)), ((-0.05, -1.5, 0.0), (0.05, 0.9, 0.2))
    mesh = trimesh.util.concatenate([trimesh.creation.box(bounds=each) for each in bounds])
    mesh.visual.vertex_colors = np.where(
        mesh.vertices[:, :1] < 0.0, [[200, 40, 40, 255]], [[40, 40, 200, 255]]
    )
    site = sg.make_arena(mesh)
    scan = training.scan_mesh(site, 0)
    is_red = scan.colors[:, 0] > 120
    assert is_red[scan.points[:, 0] < -0.2].all()
    assert not is_red[scan.points[:, 0] > 0.2].any()
    away = find_nearest(scan.points, np.asarray(site.surface.vertices), np.asarray(site.surface.faces))[0]
    assert away.max() < 1e-6
    assert scan.points[:, 2].min() > -1e-3  # grazing beams see so much of its sides
    one, other = training.make_models(site, tmp_path, 0, silent)
    assert other.height(0.0, 0.0) == pytest.approx(0.2, abs=0.02)
    assert np.abs(np.asarray(other.height(np.array([-1.0, 1.0]), np.zeros(2)))).max() < 0.01
    assert one.unseen == ()
    places = training._find_confirmed([one, other], sg.snake(1), None, 2.0)[0]
    assert len(places) > 0.3 * one.traversability(sg.snake(1)).is_drivable.sum()


@pytest.mark.parametrize(
    ("name", "box", "message"),
    [
        ("a.xyz", "0 0 0 1 0 1", "is empty"),
        ("a.stl", "0 1 0 1 0 1", "is for points"),
        ("a.xyz", "5 6 5 6 0 1", "leaves none"),
    ],
)
def test_a_part_of_a_scan_is_cropped_or_refused(tmp_path, capsys, name, box, message) -> None:
    path = tmp_path / name
    if name.endswith("stl"):
        trimesh.creation.box().export(path)
    else:
        np.savetxt(path, make_scan().points)
    assert run(["train", str(path), "--out", str(tmp_path / "x"), "--crop", *box.split()]) in (1, 2)
    assert message in capsys.readouterr().err


def crop_large(site: rc.Cloud, ends=()) -> rc.Cloud:
    return crop_part(site, find_part(site, ends))


@pytest.mark.parametrize(
    ("ends", "middle"),
    [
        ((), 0.0),
        (((12.0, 0.0), (16.0, 0.0)), 14.0),
        (((-30.0, 0.0),), -25.0),
        (((6.0, 0.0), (8.0, 2.0)), 0.0),
    ],
)
def test_of_a_large_scan_the_part_around_ends_outside_of_it_is_used(ends, middle, caplog) -> None:
    x, y = np.meshgrid(np.linspace(-30, 30, 241), np.linspace(-4, 4, 33))
    part = crop_large(rc.Cloud(np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])), ends)
    low, high = part.points.min(axis=0), part.points.max(axis=0)
    assert (low[0] + high[0]) / 2 == pytest.approx(middle, abs=0.3)
    assert "of 60 m x 8 m the 20 m around" in caplog.text
    millimeters = rc.Cloud(1000.0 * make_scan().points)
    with pytest.raises(ev.RunError, match=r"^\d+ of \d+ readings lie there, too few .*--unit, --scale"):
        crop_large(millimeters)


def test_where_no_ground_is_confirmed_no_other_way_is_advised(tmp_path: Path) -> None:
    floor = make_floor(2.0)
    elsewhere = replace(floor, surface=floor.surface.copy().apply_translation([9.0, 0.0, 0.0]))
    with pytest.raises(ev.RunError, match="nowhere on ground that both models confirm") as error:
        choose_task([floor, elsewhere], tmp_path, None, None, None, 0, 1)
    assert "--start" not in str(error.value)


def test_no_way_is_chosen_on_which_who_drives_straight_on_arrives(tmp_path: Path, monkeypatch) -> None:
    floor = make_floor(2.0)
    ends = {"start": (-0.5, 0.0), "goal": (0.1, 0.0), "places": ()}
    at_times = ends | {"goal": (0.1, 0.11)}  # on which it depends on the start
    turn = {"start": (-0.5, 0.0), "goal": (0.1, 0.4), "places": ((0.0, 0.0),)}
    monkeypatch.setattr(training, "_list_ways", lambda *_: iter([ends, at_times, turn]))
    assert choose_task([floor, floor], tmp_path, None, None, None, 0, 1).goal == turn["goal"]
    given = choose_task([floor, floor], tmp_path, None, ends["start"], ends["goal"], 0, 1)
    assert given.goal == ends["goal"], "a way that is asked for is taken"
    monkeypatch.setattr(training, "_list_ways", lambda *_: iter([ends]))
    with pytest.raises(ev.RunError, match="who drives straight on arrives"):
        choose_task([floor, floor], tmp_path, None, None, None, 0, 1)


def test_of_a_large_scan_the_part_with_most_level_ground_is_used() -> None:
    """Not where most readings are: those of a thicket, as dense, are no ground."""
    rng = np.random.default_rng(0)
    thicket, meadow = (
        rng.uniform([-40, -10, 0], [0, 10, 4], (40_000, 3)),
        rng.uniform([10, -10], [30, 10], (20_000, 2)),
    )
    below = rng.normal(0.0, 0.01, len(meadow))
    points = np.concatenate([thicket, np.column_stack([meadow, below])])
    part = crop_large(rc.Cloud(points))
    assert len(part.points) > 0.9 * len(meadow)
    assert part.points[:, 0].min() > 5.0
    scattered = rc.Cloud(
        rng.uniform([-40, -10, 0], [40, 10, 40], (2_000, 3))
    )  # no ground at all: about the middle
    assert np.abs(np.median(crop_large(scattered).points[:, 0])) < 5.0


def test_crowns_and_ceilings_are_left_out_and_trunks_and_slopes_are_not(caplog) -> None:
    rng = np.random.default_rng(0)
    plan = rng.uniform(-8, 8, (30_000, 2))
    height = rng.choice([0.0, 6.0], len(plan), p=[0.3, 0.7]) + rng.normal(0.0, 0.2, len(plan))
    slope = 0.5 * plan[:, 0]
    trunk = np.column_stack([rng.normal(3.0, 0.05, (2_000, 2)), rng.uniform(1.5, 7.5, 2_000)])
    kept = keep_low(rc.Cloud(np.concatenate([np.column_stack([plan, slope + height]), trunk])))
    above = kept.points[:, 2] - 0.5 * kept.points[:, 0]
    assert (above < 3.0).all()
    assert (above < 1.0).sum() >= (height < 1.0).sum()  # all of the ground, and of the trunk, too
    assert f"{len(plan) + len(trunk) - kept.num_points} are left out" in caplog.text


def test_ways_and_places_to_scan_from_are_in_a_house_and_not_on_its_roof(monkeypatch) -> None:
    bounds = [((-1, -1, -0.1), (1, 1, 0)), ((-1.1, -1.1, 2.4), (1.1, 1.1, 2.5))]
    bounds += [((x, -1, 0), (x + 0.1, 1, 2.4)) for x in (-1.0, 0.9)]
    house = sg.make_arena(trimesh.util.concatenate([trimesh.creation.box(bounds=each) for each in bounds]))
    assert house.traversability(sg.snake(1)).positions[:, 2].max() == pytest.approx(2.5, abs=0.01)
    places = training._find_confirmed([house, house], sg.snake(1), None, 2.0)[0]
    assert len(places)
    assert places[:, 2].max() < 0.01
    heights = training.scan_mesh(house, 0).viewpoints[:, 2]  # some may be on the eaves
    assert np.median(heights) == pytest.approx(training._EYE, abs=0.01)
    monkeypatch.setattr(training, "_SITE", 0.8)
    near = training.scan_mesh(house, 0, (0.4, 0.2)).viewpoints[:, :2]
    assert np.abs(near - (0.4, 0.2)).max() < 0.4


def test_a_way_leads_over_the_most_level_ground_that_both_models_confirm() -> None:
    x, y = np.meshgrid(np.linspace(-3, 3, 121), np.linspace(-1, 1, 41), indexing="ij")
    bumps = np.where(x < 0, 0.02 * np.sin(8 * x) * np.sin(8 * y), 0.0)
    index = np.arange(x.size).reshape(x.shape)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    faces = np.concatenate([np.stack(each, axis=-1).reshape(-1, 3) for each in ((a, b, c), (a, c, d))])
    arenas = [
        sg.make_arena(trimesh.Trimesh(np.column_stack([x.ravel(), y.ravel(), height.ravel()]), faces))
        for height in (bumps, np.zeros_like(x))  # as rough as in the rougher model
    ]
    body, known = sg.snake(1), (-1.5, 0.0)
    for models in (arenas, arenas[::-1]):
        ways = list(training._list_ways(models, body, None, None, np.random.default_rng(0)))
        assert ways
        for way in ways:
            corners = np.array([way["start"], *way["places"], way["goal"]])
            assert corners[:, 0].min() > 0.0
            assert np.abs(corners[:, 2]).max() < 0.01  # with its height, which tells the storey
    assert {
        way["goal"] for way in training._list_ways(arenas, body, None, known, np.random.default_rng(0))
    } == {known}


def make_floor(size: float, *others: tuple[float, float]) -> sg.Arena:
    """Return the arena of a square floor, with bars across it between x of each of the others [m]."""
    boxes = [((-size / 2, -size / 2, -0.2), (size / 2, size / 2, 0.0))]
    boxes += [((low, -size / 2, -0.2), (high, size / 2, 0.1)) for low, high in others]
    return sg.make_arena(trimesh.util.concatenate([trimesh.creation.box(bounds=each) for each in boxes]))


def test_a_way_does_not_cross_what_one_model_lacks_and_none_is_squeezed_into_too_little() -> None:
    body, floor = sg.snake(1), make_floor(1.6)
    ways = list(
        training._list_ways(
            [floor, make_floor(1.6, (-0.02, 0.02))], body, None, None, np.random.default_rng(0)
        )
    )
    assert ways
    for way in ways:
        sides = np.sign([place[0] for place in (way["start"], *way["places"], way["goal"])])
        assert abs(sides.sum()) == 3
    for size, has_way in ((0.7, True), (0.6, False)):
        small = make_floor(size)
        assert len(training._find_confirmed([small], body, None, 1.0)[0])
        found = list(training._list_ways([small], body, None, None, np.random.default_rng(0)))
        assert bool(found) == has_way


def test_a_way_is_where_both_models_connect_it_and_has_little_room_only_where_there_is_no_more() -> None:
    """One model has bars that part the larger half of the floor."""
    body, floor = sg.snake(1), make_floor(2.4, (-0.6, -0.55))
    parted = make_floor(2.4, (-0.6, -0.55), *((x, x + 0.04) for x in (-0.15, 0.29, 0.73)))
    for models in ([floor, parted], [parted, floor]):
        ways = list(training._list_ways(models, body, None, None, np.random.default_rng(0)))
        assert ways
        for way in ways:
            corners = np.array([way["start"], *way["places"], way["goal"]])
            assert corners[:, 0].max() < -0.6
    lane = make_floor(1.6, (-0.5, -0.28), (0.05, 0.8))
    rooms = [training._find_confirmed([lane], body, None, room)[0] for room in training._ROOMS]
    assert 0 < len(rooms[0]) < len(rooms[1])


@pytest.mark.parametrize("order", [slice(None), slice(None, None, -1)])
def test_a_way_that_is_given_is_the_same_in_both_models(order: slice) -> None:
    """One of them has a block on it: around it in both, although the other one knows nothing of it."""
    block = trimesh.creation.box(bounds=((-0.2, -0.3, -0.2), (0.2, 0.1, 0.2)))
    floor = trimesh.creation.box(bounds=((-1.0, -1.0, -0.2), (1.0, 1.0, 0.0)))
    arenas = [sg.make_arena(floor), sg.make_arena(trimesh.util.concatenate([floor, block]))][order]
    start, goal, body = (-0.6, 0.0), (0.6, 0.0), sg.snake(1)
    way = next(training._list_ways(arenas, body, start, goal, np.random.default_rng(0)))
    assert (way["start"], way["goal"]) == (start, goal)
    assert max(place[1] for place in way["places"]) > 0.1
    line = np.concatenate([np.linspace(*leg, 100) for leg in pairwise([start, *way["places"], goal])])
    for arena in arenas:
        path = find_path(arena, body, Start(start), (*way["places"], goal))
        places = np.array(path.corners)[np.array(path.is_place)]
        assert places == pytest.approx(np.array([*way["places"], goal]), abs=1e-6)
        away = cKDTree(line).query(path.corners)[0]
        assert away.max() < 0.1, "a path on a grid leaves a straight line by less"


@pytest.mark.parametrize(("end", "place"), [("goal", (500.0, 1.0)), ("start", (0.0, -9.0))])
def test_what_lies_beside_the_scan_is_refused(tmp_path: Path, end: str, place: tuple[float, float]) -> None:
    words = rf"the {end} \({place[0]:g}, {place[1]:g}\) lies beside the scan, which extends over x -1.2"
    with pytest.raises(ev.RunError, match=words):
        ev.train(make_scan(), tmp_path / "a", **{end: place})
    with pytest.raises(ev.RunError, match="start and goal are the same place"):
        ev.train(make_scan(), tmp_path / "a", start=(0.1, 0.0), goal=(0.1, 0.0))
    assert not (tmp_path / "a").exists()


def test_an_axis_that_is_given_makes_it_another_scan() -> None:
    scan = make_scan()
    assert training._digest(scan) != training._digest(replace(scan, up="z"))


def test_options_are_repeated_as_they_were_given() -> None:
    assert (
        training._format_options({"start": (0.5, 1), "goal": None, "seed": 3}) == "--start 0.5 1.0 --seed 3"
    )
    assert training._format_options({"organism": "cross:2"}) == "--organism cross:2"


def test_files_of_others_are_refused_before_the_scan_is_read(tmp_path: Path) -> None:
    (tmp_path / "report.html").touch()
    with pytest.raises(ev.RunError, match=r"contains report\.html"):
        ev.train(tmp_path / "missing.ply", tmp_path)


def test_after_a_refusal_the_folder_takes_other_options(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scan, few = make_scan(), make_scan().select(np.arange(6400) < 30)
    made, make = [], training._make_model
    monkeypatch.setattr(training, "_make_model", lambda *some: made.append(some) or make(*some))
    for _ in range(2):
        with pytest.raises(ev.RunError, match=r"good for a robot of 0.105 m: no"):
            ev.train(few, tmp_path)
    assert len(made) == 1, "the second model is not made, and the first not again"
    training._claim(tmp_path, {"scan": training._digest(scan), "seed": 0})
    floors = [sg.make_arena(trimesh.creation.box((size, 1.0, 0.1))) for size in (1.0, 2.0)]
    for k, arena in enumerate(floors):  # each seed has models of its own, which replace those before
        monkeypatch.setattr(training, "_make_model", lambda *_, arena=arena: arena)
        for _ in range(2):
            models = training.make_models(scan, tmp_path, k)
            assert [float(np.ptp(model.surface.vertices[:, 0])) for model in models] == [k + 1.0] * 2
            monkeypatch.setattr(training, "_make_model", None)
        assert training.make_models(scan, tmp_path, k, ends=[(0.5, 0.5)])  # as small a site is used whole
    (tmp_path / "run").mkdir()
    with pytest.raises(ev.RunError, match="other options"):
        training._claim(tmp_path, {"scan": "another"})


@pytest.mark.parametrize(
    ("champion", "straight", "faults"), [(18, 2, []), (17, 0, ["fewer than 18"]), (20, 3, ["too"])]
)
def test_a_champion_is_good_only_where_straight_tracks_are_not(champion, straight, faults) -> None:
    held = {
        "training": {"champion": 20, "tracks forward": straight},
        "other half": {"champion": champion, "tracks forward": 0},
    }
    unused: Any = None
    found = Training(Path(), unused, unused, unused, unused, held, Path()).list_faults()
    assert len(found) == len(faults)
    assert all(part in text for part, text in zip(faults, found, strict=True))


def test_the_page_shows_a_room_without_what_hides_the_robot() -> None:
    box = trimesh.creation.box(bounds=((-1.0, -1.0, 0.0), (1.0, 1.0, 2.5)))
    roof = trimesh.creation.box(bounds=((-1.0, -1.0, 2.6), (1.0, 1.0, 2.8)))
    room = trimesh.util.concatenate([trimesh.Trimesh(box.vertices, box.faces[:, ::-1], process=False), roof])
    quality = ArenaQuality(mean=0.0, p95=0.0, max=0.0, num_pieces=1)
    arena = sg.Arena("room", [room], room, quality, unseen=(int(room.triangles_center[:, 2].argmin()),))
    scene = _make_scene(arena, np.full((5, 1, 3), [0.0, 0.0, 0.05]))
    shown = {layer.name: (layer.is_shown, layer.traces[0]) for layer in scene.layers[:3]}
    assert {name: switch for name, (switch, _) in shown.items()} == {
        "surface": True,
        "not confirmed": True,
        "walls and ceilings": False,
    }
    heights = {name: (trace["z"].min(), trace["z"].max()) for name, (_, trace) in shown.items()}
    assert heights == {"surface": (0, 0), "not confirmed": (0, 0), "walls and ceilings": (0, 2.8)}


def test_the_page_repeats_how_the_scan_was_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    scan = Path("a b.ply")
    scan.touch()
    command = Train(scan=scan, up="y", viewpoint=((1.0, 2.0, 0.5),), classes=(2, 6))
    assert command._describe() == "'a b.ply' --up y --viewpoint 1.0 2.0 0.5 --classes 2 6"
    assert Train(scan=scan)._describe() == "'a b.ply'"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("body", "ends", "modules", "controller"),
    [
        (8, (None, None), 8, "path"),  # across the pit that is there
        (None, ((-1.5, 0.0), (1.5, 0.0)), 8, "path"),  # as many as cross it
        (None, (None, None), 1, "posture"),  # where ground leads
        (1, ((-2.6, 0.0), None), 1, "posture"),
    ],
)
def test_a_site_asks_for_a_row_that_crosses_its_gap_or_for_a_scout_on_its_way(
    tmp_path, body, ends, modules, controller
) -> None:
    arenas = [sg.load_arena("gsrm"), sg.load_arena("truth")]
    config = choose_task(arenas, tmp_path, None if body is None else sg.snake(body), *ends, 0, 1)
    assert (config.find_organism().num_modules, config.controller) == (modules, controller)
    # As wide as it was scanned: what the scan has wrong, the other half tells.
    assert config.randomization.stretch == (1.0,)
    places = dict(config.environment).get("places")
    assert (places is None) == (controller == "path")
    if places is not None and ends[0] is not None:
        assert config.start == ends[0]


def test_what_the_other_half_does_not_confirm_is_unseen() -> None:
    floor = trimesh.creation.box((2.0, 2.0, 0.1)).subdivide().subdivide().subdivide()
    raised = floor.copy()
    raised.vertices[raised.vertices[:, 0] > 0.0, 2] += 0.1
    quality = ArenaQuality(mean=0.0, p95=0.0, max=0.0, num_pieces=1)
    one, other = (sg.Arena("half", [floor], mesh, quality) for mesh in (floor, raised))
    places = training._mark_unconfirmed(one, other).seen_surface.triangles_center[:, 0]
    assert 0.4 * len(floor.faces) < len(places) < 0.7 * len(floor.faces)
    assert np.median(places) < 0.0


def test_ways_are_looked_for_where_both_models_have_ground() -> None:
    def make(heights: tuple[float, float]) -> sg.Arena:
        plates = [
            trimesh.creation.box(
                [size, size, 0.2], trimesh.transformations.translation_matrix([x, 0.0, z - 0.1])
            )
            for size, x, z in zip((2.0, 1.2), (-2.0, 2.0), heights, strict=True)
        ]
        return sg.make_arena(trimesh.util.concatenate(plates))

    def find(second: sg.Arena, near: tuple[float, float] | None) -> np.ndarray:
        return training._find_confirmed([first, second], sg.snake(1), near, 2.0)[0][:, :2]

    first, other = make((0.0, 0.0)), make((0.1, 0.0))  # of the larger plate they do not agree
    for near in (None, (-2.0, 0.0)):
        places = find(other, near)
        assert len(places)
        assert np.abs(places - [2.0, 0.0]).max() < 0.6
    assert np.abs(find(first, None) - [-2.0, 0.0]).max() < 1.0
    assert np.abs(find(first, (1.5, 0.0)) - [2.0, 0.0]).max() < 0.6
    assert not len(find(make((0.1, 0.1)), None))
