"""Controllers of users: found by object, class, function or name, recorded by reference, restored or refused."""

import json
import pickle
from dataclasses import dataclass

import numpy as np
import own_controllers
import pytest
from own_controllers import Hold, Wave, hold_4, make_driving_wave, make_wave

from evolution._src.controllers.controller import CONTROLLERS
from evolution._src.controllers.finding import (
    ControllerSource,
    controller_to_json,
    find_controller,
    find_of_module,
    refer_to_controller,
)
from evolution._src.controllers.protocol import Controller, check_genotypes, find_arrays, reset_rows
from evolution._src.errors import RunError
from symbrion_gym._src.robot.organism import cross, snake

BODY = snake(5)
FOUND = {
    "class": (Wave, "own_controllers:Wave"),
    "function": (make_wave, "own_controllers:make_wave"),
    "name of a class": ("own_controllers:Wave", "own_controllers:Wave"),
    "name of an object": ("own_controllers:hold_4", "own_controllers:hold_4"),
    "object of a module": (hold_4, "own_controllers:hold_4"),
    "dataclass": (Hold(4, 0.5), "own_controllers:Hold"),
}


def read(content):
    """Return the controller of a record whose module is allowed."""
    return find_controller(refer_to_controller(content, BODY).allow(("own_controllers", "gone")), BODY)


def test_laws_are_found_and_recorded_by_name():
    for name in CONTROLLERS:
        controller = find_controller(name, BODY)
        assert isinstance(controller, Controller)
        assert controller.name == refer_to_controller(name, BODY) == controller_to_json(controller) == name


@pytest.mark.parametrize("kind", FOUND)
def test_a_controller_of_a_user_is_found_recorded_and_restored(kind):
    spec, source = FOUND[kind]
    controller = find_controller(spec, BODY)
    assert isinstance(controller, Controller)
    reference = refer_to_controller(spec, BODY, must_be_found=True)
    assert isinstance(reference, ControllerSource)
    assert reference.source == source
    assert {reference: 1}[pickle.loads(pickle.dumps(reference))] == 1
    content = json.loads(json.dumps(controller_to_json(controller)))
    assert refer_to_controller(content, BODY) == reference
    assert controller_to_json(reference) == controller_to_json(controller)
    genotypes = np.full((3, len(controller.parameters)), 0.4)
    (action, _), (again, _), (restored, _) = (
        each.act(np.zeros((3, 4)), genotypes, {}, each.begin(3))
        for each in (controller, find_controller(reference, BODY), read(content))
    )
    assert np.array_equal(action, again)
    assert np.array_equal(action, restored)


def test_the_record_names_controller_version_and_source():
    assert controller_to_json(find_controller(Wave, BODY)) == {
        "name": "wave",
        "version": "3",
        "source": "own_controllers:Wave",
    }
    assert json.loads(json.dumps(controller_to_json(find_controller(Hold(4, 0.5), BODY)))) == {
        "name": "hold",
        "version": "1",
        "source": "own_controllers:Hold",
        "arguments": [["num_hinges", 4], ["angle", 0.5]],
    }


def test_makers_get_the_body_and_the_number_of_tracks():
    for make, body, tracks, length in ((Wave, cross(1), 0, 4), (make_driving_wave, BODY, 10, 14)):
        controller = find_controller(make, body, tracks)
        action, _ = controller.act(np.zeros((2, 1)), np.ones(2), {}, np.zeros((2, 1)))
        assert action.shape == (2, length)


def test_what_cannot_be_found_again_works_but_is_not_recorded():
    @dataclass(frozen=True)
    class Local(Hold):
        pass

    specs = {
        "is a lambda or defined inside": lambda organism: Wave(organism),
        "is an object that no module names": Wave(BODY),
        "defined inside a function": Local(4),
    }
    for message, spec in specs.items():
        assert find_controller(spec, BODY).begin(2) is not None
        assert refer_to_controller(spec, BODY) is spec
        with pytest.raises(RunError, match=message):
            refer_to_controller(spec, BODY, must_be_found=True)
        with pytest.raises(RunError, match=message):
            controller_to_json(find_controller(spec, BODY))


def test_a_controller_of_the_program_that_runs_is_not_recorded(monkeypatch):
    monkeypatch.setattr(Wave, "__module__", "__main__")
    with pytest.raises(RunError, match="move it into a module"):
        refer_to_controller(Wave, BODY, must_be_found=True)


def test_a_class_that_was_replaced_is_not_recorded(monkeypatch):
    original = Wave
    monkeypatch.setattr(own_controllers, "Wave", Hold)
    with pytest.raises(RunError, match="has been replaced"):
        controller_to_json(find_controller(original, BODY))


def test_another_version_is_refused(monkeypatch):
    content = controller_to_json(find_controller(Wave, BODY))
    monkeypatch.setattr(Wave, "version", "4")
    with pytest.raises(RunError, match=r"version '4', the record of '3'"):
        read(content)


@pytest.mark.parametrize(
    ("spec", "message"),
    [
        ("psychic", "there are: path, reactive"),
        ("no_such_module:Wave", "no_such_module' cannot be imported"),
        ("own_controllers:Walk", "there is no 'Walk' in it; there are: .*Wave"),
        ("own_controllers:", '"module:name" is needed'),
        ("own controllers:Wave", '"module:name" is needed'),
        ("own_controllers:fail", "cannot be made: ZeroDivisionError: no legs"),
        ("own_controllers:np", "no controller"),
        (7, "is 7, which is no controller"),
        (None, "is None, which is no controller"),
        (type("Lame", (), {"__init__": lambda self, organism: None}), "lacks name, version, sensors"),
    ],
)
def test_what_is_no_controller_is_refused_at_once(spec, message):
    with pytest.raises(RunError, match=message):
        refer_to_controller(spec, BODY)
    with pytest.raises(RunError, match=message):
        find_controller(spec, BODY)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"name": "wave", "source": "own_controllers:Wave"}, "version"),
        ({"name": "wave", "version": "3", "source": "own_controllers."}, "module:name"),
        ({"name": "wave", "version": "3", "source": "gone:Wave"}, "'gone' cannot be imported"),
        ({"name": "wave", "version": "3", "source": "own_controllers:Wave", "more": 1}, "more"),
        ({"name": "wave", "version": "3"}, "source"),
        (
            {"name": "hold", "version": "1", "source": "own_controllers:Hold", "arguments": [["x", 1]]},
            "cannot be made",
        ),
    ],
)
def test_records_that_cannot_be_restored_are_refused(content, message):
    with pytest.raises(RunError, match=message):
        read(content)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"name": ""}, "name of controller"),
        ({"version": 3}, "version of controller"),
        ({"sensors": ("crystal_ball",)}, "crystal_ball"),
        ({"lower": (0.0,)}, "one number for each parameter"),
        ({"initial": (5.0, 0.0)}, "gene 'size'"),
        ({"upper": (np.inf, 3.0)}, "gene 'size'"),
    ],
)
def test_wrong_members_are_named(monkeypatch, changes, message):
    for name, value in changes.items():
        monkeypatch.setattr(Wave, name, value)
    with pytest.raises(RunError, match=message):
        find_controller(Wave, BODY)


@pytest.mark.parametrize(
    ("method", "returned", "message"),
    [
        ("act", lambda *_: (np.zeros((2, 3)), ()), r"actions of shape \(2, 3\); \(2, 4\) is needed"),
        ("act", lambda *_: None, "act of controller 'wave' failed: TypeError"),
        ("act", lambda *_: 1 / 0, "act of controller 'wave' failed: ZeroDivisionError"),
        ("begin", lambda *_: 1 / 0, "begin of controller 'wave' failed"),
        ("begin", lambda *_: (np.zeros(2), np.zeros(3)), "first axis must have length 2"),
    ],
)
def test_mistakes_while_running_end_the_run_and_are_named(monkeypatch, method, returned, message):
    monkeypatch.setattr(Wave, method, returned)
    controller = find_controller(Wave, BODY)
    with pytest.raises(RunError, match=message):
        controller.act(np.zeros((2, 4)), np.zeros((2, 2)), {}, controller.begin(2))


def test_rows_of_any_state_begin_anew():
    @dataclass(frozen=True)
    class Counter(Hold):
        def begin(self, count):
            return np.full(count, 7.0), (np.zeros((count, 2), dtype=int), None)

    controller = find_controller(Counter(4), BODY)
    used = (np.arange(3.0), (np.ones((3, 2), dtype=int), None))
    for rows in ([0, 2], np.array([True, False, True])):
        state = reset_rows(controller, used, rows)
        assert state[0].tolist() == [7.0, 1.0, 7.0]
        assert state[1][0].tolist() == [[0, 0], [1, 1], [0, 0]]
        assert state[1][1] is None
    assert used[0].tolist() == [0.0, 1.0, 2.0]
    assert len(find_arrays(used)) == 2
    assert reset_rows(find_controller(hold_4, BODY), (), [0]) == ()
    law = find_controller("reactive", BODY)
    state = reset_rows(law, law.begin(2)._replace(ticks_since_contact=np.full((2, 5), 9)), [1])
    assert state.ticks_since_contact.tolist() == [[9] * 5, [0] * 5]


def test_genotypes_that_do_not_fit_are_refused():
    controller = find_controller(Wave, BODY)
    check_genotypes(controller, np.zeros((4, 2)))
    for genotypes in (np.zeros((4, 3)), np.zeros(1)):
        with pytest.raises(RunError, match="reads 2: size, lag"):
            check_genotypes(controller, genotypes)
    with pytest.raises(RunError, match="not finite"):
        check_genotypes(controller, np.array([0.0, np.nan]))


def test_a_file_names_what_its_module_defines_alone():
    """And not what that module imports, NumPy for instance."""
    assert find_of_module("own_controllers:hold_4") is hold_4
    with pytest.raises(RunError, match="is of numpy, not of own_controllers"):
        find_of_module("own_controllers:np.zeros")
