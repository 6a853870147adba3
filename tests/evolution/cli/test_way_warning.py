"""The warning before a search whose way leaves drivable ground."""

import pytest

import evolution as ev
import symbrion_gym as sg
from evolution._src.cli.commands.evolve import warn_of_way


def warn(arena, task, **options):
    config = ev.BodyEvolutionConfig(arena=str(arena), task=task, track_control="skid", **options)
    warn_of_way(config)


@pytest.fixture(scope="module")
def stairs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("arenas") / "mine"
    sg.load_arena("stairs").save(folder)
    return folder


def test_one_line_names_the_way_and_the_remedy(stairs, caplog):
    warn(stairs, "traverse")
    (record,) = caplog.records
    assert "leaves the ground on which bodies of 1 to 8 modules are known to drive" in record.getMessage()
    words = record.getMessage().split()
    start, goal = (words.index(flag) for flag in ("--start", "--goal"))
    places = [tuple(float(word) for word in words[index + 1 : index + 3]) for index in (start, goal)]
    caplog.clear()
    warn(stairs, "traverse", start=places[0], goal=places[1])
    assert not caplog.records


@pytest.mark.parametrize("task", ["climb", "cross_gap", None])
def test_tasks_whose_point_is_crossing_are_not_warned_of(stairs, caplog, task):
    warn(stairs, task)
    assert not caplog.records


def test_arenas_of_the_package_and_ways_that_fail_are_left_alone(stairs, caplog):
    warn("stairs", "traverse")
    warn(stairs, "traverse", start=(50.0, 0.0), goal=(0.0, 0.0))
    assert not caplog.records
