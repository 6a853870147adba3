"""Files that name code: nothing of it is imported, made or called unless the caller allows its module.

The attacks are written into files that are otherwise whole, with their digests computed anew. A module `intruder` lies
in the working directory and on the path; it leaves a mark as soon as it is imported.
"""

import json
import logging
import sys
from dataclasses import replace

import own_task
import pytest
import toys

import evolution as ev
from evolution._src.champions.playback import ChampionPolicy
from evolution._src.cli.main import PrintableFormatter
from evolution._src.cli.main import run as run_command
from evolution._src.controllers.finding import ControllerSource
from evolution._src.errors import RunError
from evolution._src.search.config import EvolutionConfig
from evolution._src.search.record import Record
from evolution._src.suite.exam import hold_exam
from evolution._src.suite.submission import Entry, Submission, load_submission
from symbrion_gym._src.errors import TaskError
from symbrion_gym._src.robot.body_plans import organism_to_text
from symbrion_gym._src.robot.organism import snake
from symbrion_gym._src.tasks.task import Task, read_task

INTRUDER = """
from dataclasses import dataclass
from pathlib import Path
MARK = Path({mark!r})
MARK.write_text("imported")
def term(state=None, body=None, **others):
    MARK.write_text("called")
    return 0.0
@dataclass(frozen=True)
class Term:
    name: str = "term"
    def __post_init__(self):
        MARK.write_text("made")
    def __call__(self, *given):
        return 0.0
class Maker:
    name, version, sensors, parameters, lower, upper, initial = "intruder", "1", (), ("a",), (-1.0,), (1.0,), (0.0,)
    def __init__(self, organism): ...
    def begin(self, count): return ()
    def act(self, observation, genotype, structure, state): return observation[:, :0], state
"""
RUN = EvolutionConfig(arena="truth", generations=1, population_size=4, trials=1, stop_when_solved=False)
SHELL = {"type": "subprocess:Popen", "fields": {"args": ["touch", "MARK"]}}
TERMS = {
    "process": SHELL,
    "process by keyword": {"function": "subprocess:run", "keywords": {"args": ["touch", "MARK"]}},
    "function of the system": {"function": "os:system"},
    "reached through a room": {"function": "symbrion_gym._src.tasks.storage:importlib.import_module"},
    "private": {"function": "symbrion_gym._src.tasks.storage:_find"},
    "method": {"function": "symbrion_gym._src.arenas.arena:Arena.save"},
    "another room": {"type": "symbrion_gym._src.arenas.arena:Arena", "fields": {}},
    "dataclass of an intruder": {"type": "intruder:Term", "fields": {}},
    "function of an intruder": {"function": "intruder:term"},
    "class without fields": {"type": "subprocess:Popen"},
}  # fmt: skip


@pytest.fixture
def mark(tmp_path, monkeypatch):
    """Put the intruder within reach, and return the file that it leaves."""
    mark, here = tmp_path / "mark", tmp_path / "here"
    here.mkdir()
    (here / "intruder.py").write_text(INTRUDER.format(mark=str(mark)))
    monkeypatch.chdir(here)
    monkeypatch.syspath_prepend(here)
    sys.modules.pop("intruder", None)
    yield mark
    sys.modules.pop("intruder", None)


def point_at(content, mark):
    """Return an attack whose command leaves the mark."""
    return json.loads(json.dumps(content).replace('"MARK"', json.dumps(str(mark))))


def alter(folder, **changes):
    """Change fields of a run's configuration, and give its record the digest of the changed one."""
    path = folder / "config.json"
    content = json.loads(path.read_text())
    content["config"] |= changes
    path.write_text(json.dumps(content))
    try:
        digest = EvolutionConfig.from_json(content["config"]).digest()
    except RunError:  # refused as it is read
        digest = "none"
    record, _ = Record.from_bytes((folder / "record.npz").read_bytes(), "record")
    (folder / "record.npz").write_bytes(record.to_bytes(digest))
    champion = json.loads((folder / "champion.json").read_text())
    champion |= {name: value for name, value in changes.items() if name in ("task", "controller")}
    (folder / "champion.json").write_text(json.dumps(champion))


@pytest.fixture
def folder(tmp_path, mark):
    """Return the folder of a finished run of one generation."""
    path = tmp_path / "run"
    ev.evolve(replace(RUN, folder=str(path)), simulate=toys.bowl)
    return path


def use_everywhere(folder, has_champion=True):
    """Do with a run all that reads its configuration, and its champion if wanted, and yield the error of each."""
    structure = {"hinge_angle": slice(0, 7)}
    of_run = (
        lambda: ev.resume(folder, generations=2, simulate=toys.bowl),
        lambda: run_command(["resume", str(folder), "--generations", "2", "--quiet"]),
    )
    of_champion = (
        lambda: ev.judge(ev.load_champion(folder), "truth", 1),
        lambda: ev.play(ev.load_champion(folder), "truth"),
        lambda: ChampionPolicy(folder, structure),
        lambda: run_command(["replay", str(folder), "--trials", "1", "--quiet"]),
    )
    for use in (*of_run, *(of_champion if has_champion else ())):
        try:
            yield use()
        except (RunError, TaskError) as error:
            yield error


def make_task(term):
    """Return a task as files hold it, with one more reward."""
    content = Task("attack").as_dict()
    content["fields"]["rewards"] = [*content["fields"]["rewards"], term]
    return content


@pytest.mark.parametrize("attack", TERMS)
def test_a_task_runs_nothing(attack, folder, mark):
    term = point_at(TERMS[attack], mark)
    for task in (
        term,
        make_task(term),
        {"type": "symbrion_gym._src.tasks.task:Task", "fields": {"name": term}},
    ):
        with pytest.raises(TaskError):
            read_task(task)
    for task in (term, make_task(term)):
        alter(folder, task={"value": task})
        for found in use_everywhere(folder):
            assert isinstance(found, RunError) or found in (1, 2), found
    assert not mark.exists()


def test_no_name_or_version_of_a_task_is_imported(folder, mark):
    value = {"value": make_task(TERMS["private"]), "versions": {"intruder:term": "1"}}
    for task in ("intruder:term", value):
        alter(folder, task=task)
        with pytest.raises(RunError):
            ev.resume(folder, generations=2, simulate=toys.bowl)
    assert not mark.exists()


@pytest.mark.parametrize(
    "changes",
    [
        {"descriptors": [SHELL]},
        {"descriptors": {"value": [SHELL], "versions": {}}},
        {"descriptors": {"value": [TERMS["dataclass of an intruder"]], "versions": {"intruder:Term": "1"}}},
        {"scoring": {"value": SHELL, "versions": {}}},
        {"scoring": {"value": {"function": "intruder:term"}}},
        {"scoring": {"value": {"function": "evolution._src.cli.main:main"}}},
        {"validation": {"value": TERMS["dataclass of an intruder"], "versions": {}}},
        {"controller": {"name": "intruder", "version": "1", "source": "intruder:Maker"}},
        {"controller": {"name": "intruder", "version": "1", "source": "intruder:Maker", "is_allowed": True}},
        {"controller": {"name": "shell", "version": "1", "source": "subprocess:Popen", "arguments": [["args", "ls"]]}},
    ],
)  # fmt: skip
def test_other_fields_run_nothing(changes, folder, mark):
    alter(folder, **point_at(changes, mark))
    first, *_ = use_everywhere(folder, has_champion="controller" in changes)
    assert isinstance(first, RunError)
    assert not mark.exists()


def test_a_submission_runs_nothing_unless_allowed_and_is_then_not_ranked(tmp_path, mark, monkeypatch):
    monkeypatch.setattr("evolution._src.suite.exam.make_exam_scan", lambda *place: "truth")
    entry = Entry("stairs, 5 in a row", 0, organism_to_text(snake(5)), "intruder:Maker", (0.0,), 1.0)
    Submission("attack", (entry,)).save(tmp_path / "attack.json")
    exam = hold_exam([load_submission(tmp_path / "attack.json")], 0)
    assert not exam.results
    assert "allow=('intruder',)" in exam.untried[0][1]
    board = f"{tmp_path}/attack.json --out {tmp_path}/a.html --quiet".split()
    assert run_command(["bench-suite", "board", *board]) == 1
    assert not mark.exists()


def test_the_working_directory_is_on_the_path_only_where_code_is_named(folder, mark, monkeypatch):
    here = str(mark.parent / "here")
    monkeypatch.setattr(sys, "path", [each for each in sys.path if each != here])
    run_command(["resume", str(folder), "--generations", "1", "--quiet"])
    assert here not in sys.path
    run_command(["resume", str(folder), "--generations", "1", "--quiet", "--allow-code", "intruder"])
    assert here in sys.path


def test_code_of_a_user_runs_where_it_is_allowed(tmp_path):
    folder = tmp_path / "run"
    ev.evolve(replace(RUN, task=own_task.TASK, folder=str(folder)), simulate=toys.bowl)
    with pytest.raises(RunError, match="--allow-code own_task"):
        ev.resume(folder, generations=2, simulate=toys.bowl)
    assert len(ev.resume(folder, generations=2, simulate=toys.bowl, allow=("own_task",)).history) == 2


def test_a_run_folder_chooses_no_cluster(folder, monkeypatch):
    seen = []
    monkeypatch.setattr(
        "evolution._src.search.loop.make_backend",
        lambda kind, workers, address, simulate: seen.append(address) or sys.exit(3),
    )
    config = folder / "config.json"
    content = json.loads(config.read_text())
    content["config"] |= {"backend": "ray", "address": "ray://10.0.0.1:1", "generations": 2}
    config.write_text(json.dumps(content))
    with pytest.raises(SystemExit):
        ev.resume(folder)
    assert seen == [None]


@pytest.mark.parametrize(
    ("name", "arguments"), [("MARK.touch", ()), ("Path", None), ("json.loads", (("s", "1"),))]
)
def test_a_module_that_is_allowed_opens_none_that_it_imports(name, arguments, mark):
    source = ControllerSource("wave", "1", f"intruder:{name}", arguments, is_allowed=False).allow(
        ["intruder"]
    )
    with pytest.raises(RunError, match=r"not of intruder|there is no 'json'"):
        source.make(snake(2), 0)
    assert mark.read_text() == "imported"


def test_names_of_files_do_not_command_the_terminal(tmp_path):
    path = tmp_path / "a\x1b[31m.xyz"
    record = logging.makeLogRecord({"msg": "%s: dropped 1 row", "args": (path,)})
    assert "\x1b" not in PrintableFormatter("symbrion: %(message)s").format(record)
