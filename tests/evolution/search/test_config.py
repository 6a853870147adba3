"""Configurations: they survive JSON, keep their digest, and refuse values out of range."""

import json
from dataclasses import replace

import pytest
from histories import TOY

from evolution.errors import RunError
from evolution.search.config import EvolutionConfig
from evolution.search.stages import Stage


def test_configs_survive_json():
    config = EvolutionConfig(
        arena="simple",
        stages=(Stage("simple", 5), Stage("truth")),
        body_lengths=(4, 9),
        environment={"pit": 0.35, "abyss": True},  # pyright: ignore[reportArgumentType]
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
