"""Former public names work, with a warning that names the present one."""

from dataclasses import replace

import numpy as np
import pytest
import toys

import evolution as ev
from evolution.backends.trials import Randomization
from evolution.search.validation import FORMER_VALIDATION_NAMES


def test_former_names_of_the_package_are_the_present_objects():
    with pytest.warns(DeprecationWarning, match="Randomisation is now called Randomization"):
        assert ev.Randomisation is ev.Randomization  # pyright: ignore[reportAttributeAccessIssue]
    with pytest.raises(AttributeError, match="Randomised"):
        _ = ev.Randomised  # pyright: ignore[reportAttributeAccessIssue]
    assert "Randomisation" not in ev.__all__


def test_former_fields_are_accepted_replaced_and_read():
    exact = Randomization(stretch=(1.0,))
    with pytest.warns(DeprecationWarning, match="randomisation is now called randomization"):
        config = ev.EvolutionConfig(randomisation=exact)  # pyright: ignore[reportCallIssue]
    assert config.randomization == exact
    with pytest.warns(DeprecationWarning, match="randomization"):
        config = replace(ev.EvolutionConfig(), randomisation=exact)  # pyright: ignore[reportCallIssue]
    assert config.randomization == exact
    with pytest.warns(DeprecationWarning, match="randomization"):
        assert config.randomisation == exact  # pyright: ignore[reportAttributeAccessIssue]


@pytest.mark.parametrize(("former", "present"), FORMER_VALIDATION_NAMES.items())
def test_former_fields_of_validation_are_accepted(former, present):
    with pytest.warns(DeprecationWarning, match=f"{former} is now called {present}"):
        assert ev.Validation(**{former: 0.5}) == ev.Validation(**{present: 0.5})


def test_former_arguments_are_accepted():
    exact = Randomization(stretch=(1.0,))
    with pytest.warns(DeprecationWarning, match="randomisation is now called randomization"):
        fitness, _ = ev.evaluate(np.zeros(8), randomisation=exact, simulate=toys.bowl)
    assert fitness[0] == ev.evaluate(np.zeros(8), randomization=exact, simulate=toys.bowl).fitness[0]


@pytest.mark.filterwarnings("error::DeprecationWarning")
def test_present_names_warn_of_nothing():
    config = replace(ev.EvolutionConfig(), validation=ev.Validation(solved_share=1.0))
    assert ev.EvolutionConfig.from_json(config.to_json()) == config
