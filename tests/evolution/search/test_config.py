"""Configurations: they survive JSON, keep their digest, and refuse values out of range."""

import json
from dataclasses import replace
from typing import Any

import pytest
import toys
from histories import TOY, without_times

from evolution._src.backends.trials import RolloutConfig
from evolution._src.controllers.controller import ControllerConfig
from evolution._src.errors import RunError
from evolution._src.search.cmaes import CmaesConfig
from evolution._src.search.config import EvolutionConfig
from evolution._src.search.loop import evolve, resume
from evolution._src.search.stages import Stage
from evolution._src.search.validation import FORMER_VALIDATION_NAMES, Champion, Validation


def test_configs_survive_json():
    config = EvolutionConfig(
        arena="simple",
        stages=(Stage("simple", 5), Stage("truth")),
        body_lengths=(4, 9),
        environment={"pit": 0.35, "bottomless": True},  # pyright: ignore[reportArgumentType]
    )
    again = EvolutionConfig.from_json(json.loads(json.dumps(config.to_json())))
    assert again == config
    assert again.digest() == config.digest()
    assert replace(config, workers=7).digest() == config.digest()
    assert replace(config, seed=7).digest() != config.digest()


def test_options_that_are_none_are_left_out_of_the_digest():
    digest = TOY.digest()
    assert replace(TOY, restart_after=None, body_lengths=None).digest() == digest
    assert len({digest, *(replace(TOY, restart_after=count).digest() for count in (5, 6))}) == 3
    content = {name: value for name, value in TOY.to_json().items() if name != "restart_after"}
    assert EvolutionConfig.from_json(content).digest() == digest


@pytest.mark.parametrize(
    "arguments",
    [
        {"population_size": 2},
        {"workers": 0},
        {"modules": 1},
        {"sigma": 0.0},
        {"backend": "cloud"},
        {"start": "sky"},
        {"body_lengths": (8, 4)},
        {"restart_after": 0},
        {"arena": object()},
        {"seed": -1},
        {"generations": 1.5},
    ],
)
def test_configs_refuse(arguments):
    with pytest.raises(RunError):
        EvolutionConfig(**arguments)


OLD_CONTENT: dict[str, Any] = {
    "arena": "simple",
    "modules": 5,
    "seed": 7,
    "controller": "travelling",
    "trials": 4,
    "stages": [{"arena": "simple", "generations": 3}, {"arena": "truth"}],
    "body_lengths": [4, 9],
    "restart_after": None,
    "randomisation": {"friction": [0.6, 0.7], "stretch": [0.975, 1.0, 1.025]},
    "validation": {"candidates": 2, "centre": 0.5, "rounds": [6, 5], "go_on": 0.5, "solved": 0.9},
    "environment": {"pit": 0.3},
}
"""As the version before the fields were renamed wrote it, and the digest that it found."""
OLD_DIGEST = "b713bb7d8628eb6ccd08d2a7adc6e53faf1d7412e0deca022c4ed9f2bdc665e8"


@pytest.mark.filterwarnings("error::DeprecationWarning")
def test_a_config_of_an_earlier_version_is_read_with_its_digest():
    config = EvolutionConfig.from_json(OLD_CONTENT)
    assert config.randomization.friction == (0.6, 0.7)
    assert config.validation == Validation(
        candidates=2, mean_share=0.5, rounds=(6, 5), continue_share=0.5, solved_share=0.9
    )
    assert config.digest() == OLD_DIGEST
    assert EvolutionConfig.from_json(config.to_json()).digest() == OLD_DIGEST


def test_fields_that_were_added_are_in_the_digest_once_they_are_used():
    digests = {
        TOY.digest(),
        replace(TOY, cmaes=CmaesConfig(max_doublings=1)).digest(),
        replace(TOY, validation=Validation(success_threshold=0.9)).digest(),
    }
    assert len(digests) == 3


def test_a_run_folder_of_an_earlier_version_is_resumed(tmp_path):
    config = replace(TOY, generations=6)
    whole = evolve(config, simulate=toys.bowl)
    evolve(replace(config, generations=3, folder=str(tmp_path)), simulate=toys.bowl)
    content = json.loads((tmp_path / "config.json").read_text())
    old = content["config"]
    old["randomisation"] = old.pop("randomization")
    assert old.pop("cmaes")
    assert old["validation"].pop("success_threshold")
    for former, present in FORMER_VALIDATION_NAMES.items():
        old["validation"][former] = old["validation"].pop(present)
    (tmp_path / "config.json").write_text(json.dumps(content))
    run = resume(tmp_path, generations=6, simulate=toys.bowl)
    assert without_times(run.history) == without_times(whole.history)
    assert run.champion == whole.champion


def test_parameters_of_controllers_and_rollouts_belong_to_a_run():
    default = EvolutionConfig()
    config = EvolutionConfig(
        controller_config=ControllerConfig(num_hidden=2), rollout=RolloutConfig(stuck_time=3.0)
    )
    assert EvolutionConfig.from_json(json.loads(json.dumps(config.to_json()))) == config
    content = default.to_json()
    former = {name: content[name] for name in content if name not in ("controller_config", "rollout")}
    assert EvolutionConfig.from_json(former) == default
    assert len({default.digest(), replace(default, rollout=config.rollout).digest(), config.digest()}) == 3


def test_parameters_of_a_run_reach_its_trials_and_its_champion():
    controller_config, rollout = ControllerConfig(num_hidden=2), RolloutConfig(stuck_time=3.0)
    seen = []

    def simulate(jobs, threads=1):
        seen.extend((job.trials.controller_config, job.trials.rollout) for job in jobs)
        return toys.bowl(jobs, threads)

    config = EvolutionConfig(
        controller="network", generations=1, controller_config=controller_config, rollout=rollout
    )
    run = evolve(config, simulate=simulate)
    assert set(seen) == {(controller_config, rollout)}
    assert run.champion is not None
    assert run.champion.controller_config == controller_config
    assert Champion.from_dict(json.loads(json.dumps(run.champion.as_dict()))) == run.champion
