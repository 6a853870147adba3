"""The task at known objects, by both judges."""

from dataclasses import replace

import numpy as np
import pytest
import recorded
import trimesh
from recorded import check

import evolution as ev
import symbrion_gym as sg
from symbrion_gym._src.arenas.placed_objects import PlacedObject
from symbrion_gym._src.environment.organism_env import OrganismEnv
from symbrion_gym._src.errors import ArenaError, TaskError
from symbrion_gym._src.tasks.audit import Trajectory
from symbrion_gym._src.tasks.reach import ReachObject

FACING = np.diag([-1.0, -1.0, 1.0])
"""The front points along -x, to the start."""
BOX = trimesh.creation.box((0.2, 0.2, 0.2))


def make_arena(rotation=FACING, y=0.3):
    each = PlacedObject("station", np.array([-2.0, y, 0.1]), rotation, BOX)
    return replace(sg.load_arena("truth"), objects=(each,))


def drive(task, arena=None, modules=1, **options):
    """Drive straight ahead to an object."""
    arena = make_arena() if arena is None else arena
    return recorded.drive(task, arena=arena, modules=modules, **({"start": (-2.6, 0.3)} | options))


def test_a_body_that_drives_to_the_front_succeeds():
    env, info, trajectory = drive("reach", goal="object_station_0")
    assert info["success"], info
    assert check(env, trajectory).faults == ()
    faults = check(env, Trajectory(*(each[: len(each) // 2] for each in trajectory))).faults
    assert any("from the object" in text for text in faults), faults


def test_a_task_at_an_object_is_stored():
    task = sg.make_task("reach", goal="object_socket_0")
    assert sg.read_task(task.as_dict()) == task
    assert isinstance(task.goal, ReachObject)


def test_an_object_that_is_not_there_is_named():
    with pytest.raises(ArenaError, match="no objects 'socket' in the arena; there are: object_station_0"):
        OrganismEnv(task="reach", arena=make_arena(), modules=1, goal="socket")


def test_an_object_in_the_air_beyond_the_rim_is_not_reached():
    away = PlacedObject("station", np.array([-8.0, 0.3, 0.1]), FACING, BOX)
    with pytest.raises(ArenaError, match="no way to the front of 'station'"):
        OrganismEnv(task="reach", arena=replace(make_arena(), objects=(away,)), modules=1, goal="station")


@pytest.mark.parametrize("wrong", [{"goal": ""}, {"goal": "socket", "tolerance": 0.0}])
def test_parameters_out_of_range_are_refused(wrong):
    with pytest.raises(TaskError):
        sg.make_task("reach", **wrong)


def test_an_object_is_the_goal_of_a_run(tmp_path):
    make_arena().save(tmp_path / "arena")
    options = {"task": "reach", "goal": "object_station_0", "modules": 1, "arena": str(tmp_path / "arena")}
    config = ev.EvolutionConfig(
        **options,
        controller="reactive",
        environment={"duration": 0.5, "track_control": "skid"},
        generations=1,
        population_size=4,
        trials=1,
        folder=str(tmp_path / "run"),
    )
    ev.evolve(config)
    champion = ev.load_run(tmp_path / "run").champion
    assert champion is not None
    assert champion.goal == "object_station_0"
    with pytest.raises(ev.RunError, match="needs a task"):
        ev.EvolutionConfig(goal="object_station_0")
