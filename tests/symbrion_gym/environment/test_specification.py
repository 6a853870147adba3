"""The docstring of the environment is its specification: what it lists is what there is."""

import ast
import inspect
import math
import re
from dataclasses import MISSING, fields

import numpy as np
import pytest
from side_by_side import FLAGS, NUMBERS

from symbrion_gym._src.environment.config import DEFAULT_SENSORS, RANDOM_OPTIONS, SENSORS, EnvironmentConfig
from symbrion_gym._src.environment.organism_env import OrganismEnv

TEXT = inspect.getdoc(OrganismEnv) or ""
ELSEWHERE = "see above"
"""A default that another table lists."""


def read_table(title: str) -> list[list[str]]:
    """Return the cells of the rows of the table under a title of the docstring."""
    _, _, section = TEXT.partition(f"## {title}\n")
    lines = [line for line in section.partition("\n## ")[0].splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[2:]]


def find_defaults() -> dict[str, object]:
    """Return option -> default of the environment."""
    parameters = inspect.signature(OrganismEnv).parameters.values()
    defaults = {each.name: each.default for each in parameters if each.default is not each.empty}
    for field in fields(EnvironmentConfig):
        factory = field.default_factory
        defaults[field.name] = field.default if factory is MISSING else factory()
    return defaults


def read_range(text: str) -> tuple[float, float]:
    """Return the bounds that "±π/2" or "0 ... 4" means."""
    low, _, high = text.partition(" ... ")
    if high:
        return float(low), float(high)
    whole, _, part = text.removeprefix("±").replace("π", str(math.pi)).partition("/")
    bound = float(whole) / float(part or 1)
    return -bound, bound


def test_options_are_all_listed_with_their_defaults() -> None:
    listed: dict[str, str] = {}
    for names, values, _ in read_table("Options"):
        options = re.findall(r"`(\w+)`", names)
        listed |= zip(options, values.split(", ") if len(options) > 1 else [values], strict=True)
    defaults = find_defaults()
    assert list(listed) == list(defaults)[3:] + list(defaults)[:3], "in the order of the fields, images last"
    for name, text in listed.items():
        if text != ELSEWHERE:
            assert ast.literal_eval(text) == defaults[name], name


def test_sensors_are_all_listed_with_size_and_range() -> None:
    env = OrganismEnv(modules=5, sensors=SENSORS)
    sizes = {"n": 5, "h": 4, "A": 4, "2 a free side": 2 * (4 * 5 - 2 * 4)}
    rows = read_table("Observation")
    assert tuple(row[0].strip("`*") for row in rows) == SENSORS
    assert tuple(row[0].strip("`") for row in rows if not row[0].endswith("*")) == DEFAULT_SENSORS
    for name, size, _, limits in rows:
        part = env.observation_structure[name.strip("`*")]
        factor, letter = re.fullmatch(r"(\d*)(.*)", size).groups() if size not in sizes else ("", size)
        assert part.stop - part.start == int(factor or 1) * sizes.get(letter, 1), name
        space = env.observation_space
        bounds = np.array([space.low[part], space.high[part]]).T
        each = [read_range(text) for text in limits.split(", ")]
        wanted = each if len(each) > 1 else each * len(bounds)
        np.testing.assert_allclose(bounds, wanted, atol=0.005, err_msg=name)


@pytest.mark.parametrize("name", [*NUMBERS, *FLAGS, *RANDOM_OPTIONS])
def test_info_and_reset_options_are_listed(name: str) -> None:
    assert f"`{name}`" in TEXT
