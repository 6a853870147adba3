"""Configurations: they survive JSON, keep their digest, and refuse values out of range."""

import json
from dataclasses import replace

import pytest
import toys

from evolution._src.backends.settings import RolloutConfig
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


def test_parameters_of_rollouts_belong_to_a_run():
    default, rollout = EvolutionConfig(), RolloutConfig(stuck_time=3.0)
    config = EvolutionConfig(rollout=rollout)
    assert EvolutionConfig.from_json(json.loads(json.dumps(config.to_json()))) == config
    content = default.to_json()
    former = {name: content[name] for name in content if name != "rollout"}
    assert EvolutionConfig.from_json(former) == default
    assert default.digest() != config.digest()
    seen = []

    def simulate(jobs, threads=1):
        seen.extend(job.trials.rollout for job in jobs)
        return toys.bowl(jobs, threads)

    run = evolve(EvolutionConfig(controller="network", generations=1, rollout=rollout), simulate=simulate)
    assert set(seen) == {rollout}
    assert run.champion is not None
    assert Champion.from_dict(json.loads(json.dumps(run.champion.as_dict()))) == run.champion
