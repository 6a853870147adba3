"""Runs and champions from a stranger: every field is checked by type and range, and named when it is wrong."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
import toys
from evil_json import DEEP, find_trouble, mutate

from evolution._src.backends.scoring import Scoring
from evolution._src.backends.settings import Randomization
from evolution._src.errors import RunError
from evolution._src.search.config import EvolutionConfig
from evolution._src.search.loop import evolve, load_run, resume
from evolution._src.search.run import RunFolder, load_champion
from evolution._src.search.validation import Validation

CONFIG = EvolutionConfig(
    arena="truth",
    generations=1,
    stop_when_solved=False,
    restart_after=7,
    environment={"pit": 0.35, "sensors": ["pitch", "contact", "hinge_angle"]},  # pyright: ignore[reportArgumentType]
)


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs") / "run"
    evolve(replace(CONFIG, folder=str(folder)), simulate=toys.bowl)
    return folder


@pytest.fixture
def folder(saved, tmp_path):
    return Path(shutil.copytree(saved, tmp_path / "run"))


@pytest.mark.slow
def test_every_field_of_a_config_is_checked(folder):
    path = folder / "config.json"
    content = {"config": json.loads(path.read_text())["config"]}
    troubles = find_trouble(mutate(content), path, lambda: use(RunFolder(folder).read_config()), RunError)
    assert not troubles, "\n".join(troubles)


def use(config: EvolutionConfig):
    """What is accepted is a config that can be kept again, and is the same then."""
    again = EvolutionConfig.from_json(json.loads(json.dumps(config.to_json())))
    assert again == config
    assert again.digest() == config.digest()
    assert hash(config)


def test_every_field_of_a_champion_is_checked(folder):
    path = folder / "champion.json"
    content = json.loads(path.read_text())
    troubles = find_trouble(mutate(content), path, lambda: hash(load_champion(path)), RunError)
    assert not troubles, "\n".join(troubles)


@pytest.mark.parametrize("text", ["null", "[]", "7", '"run"', "{", "", DEEP, "NaN", '{"config": 1}'])
@pytest.mark.parametrize("name", ["config.json", "champion.json"])
def test_files_of_another_kind_are_refused(folder, name, text):
    (folder / name).write_text(text)
    load = load_champion if name == "champion.json" else load_run
    with pytest.raises(RunError, match=name.replace(".", r"\.")) as refusal:
        load(folder)
    assert str(refusal.value).isprintable()


@pytest.mark.parametrize("name", ["config.json", "champion.json"])
def test_a_folder_in_place_of_a_file_is_refused(folder, name):
    (folder / name).unlink()
    (folder / name).mkdir()
    load = load_champion if name == "champion.json" else load_run
    with pytest.raises(RunError, match=rf"{name}: there is no such file"):
        load(folder)


def test_integers_are_taken_for_floats(folder):
    path = folder / "config.json"
    content = json.loads(path.read_text())
    content["config"]["scoring"]["success"] = 1
    path.write_text(json.dumps(content))
    assert isinstance(load_run(folder).config.scoring.success, float)


def test_a_run_configured_with_integers_is_resumed(tmp_path):
    config = EvolutionConfig(
        arena="truth",
        generations=1,
        sigma=1,
        scoring=Scoring(success=2),
        randomization=Randomization(friction=(1, 1), stretch=[1]),  # pyright: ignore[reportArgumentType]
        validation=Validation(rounds=[4, 4], solved_share=1),  # pyright: ignore[reportArgumentType]
        folder=str(tmp_path / "run"),
    )
    evolve(config, simulate=toys.bowl)
    assert len(resume(tmp_path / "run", generations=2, simulate=toys.bowl).history) == 2


@pytest.mark.parametrize(
    ("kind", "arguments"),
    [
        (Randomization, {"friction": (0.0, 1.0)}),
        (Randomization, {"yaw": (0.0, 9.0)}),
        (Randomization, {"torque_scale": (1.0,)}),
        (Randomization, {"stretch": ()}),
        (Randomization, {"stretch": (0.0,)}),
        (Scoring, {"effort": float("nan")}),
        (Scoring, {"success": 1e308}),
        (Validation, {"rounds": (1,) * 101}),
        (Validation, {"rounds": (10**6,)}),
        (Validation, {"mean_share": float("inf")}),
        (Validation, {"start": "sky"}),
    ],
)
def test_parts_of_a_config_refuse(kind, arguments):
    with pytest.raises(RunError, match=list(arguments)[-1]):
        kind(**arguments)
