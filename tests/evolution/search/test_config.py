"""Configurations: they survive JSON, keep their digest, and refuse values out of range."""

import json
from dataclasses import replace

import pytest
import toys

from evolution._src.backends.settings import RolloutConfig
from evolution._src.controllers.controller import ControllerConfig
from evolution._src.errors import RunError
from evolution._src.search.config import EvolutionConfig
from evolution._src.search.loop import evolve
from evolution._src.search.validation import Champion


def test_configs_survive_json():
    config = EvolutionConfig(
        arena="simple",
        environment={"pit": 0.35, "bottomless": True},  # pyright: ignore[reportArgumentType]
    )
    again = EvolutionConfig.from_json(json.loads(json.dumps(config.to_json())))
    assert again == config
    assert again.digest() == config.digest()
    assert replace(config, workers=7).digest() == config.digest()
    assert replace(config, seed=7).digest() != config.digest()


@pytest.mark.parametrize(
    "arguments",
    [
        {"population_size": 2},
        {"workers": 0},
        {"modules": 1},
        {"sigma": 0.0},
        {"backend": "cloud"},
        {"start": "sky"},
        {"restart_after": 0},
        {"arena": object()},
        {"seed": -1},
        {"generations": 1.5},
    ],
)
def test_configs_refuse(arguments):
    with pytest.raises(RunError):
        EvolutionConfig(**arguments)


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
