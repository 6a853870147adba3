"""On snakes, the laws for trees give the bits of the formulas for rows of modules."""

import numpy as np
import pytest
from bodies import make_observations, make_structure

from evolution._src.controllers.controller import (
    CONTACT_TIMEOUT,
    KNOTS,
    MAX_AIRBORNE_TICKS,
    _interpolate,
    make_law,
)
from symbrion_gym._src.robot.organism import snake
from symbrion_gym._src.robot.scout_constants import ScoutConfig

SPACING = 0.1254


def reactive(pitch, angle, airborne, recent, head, genes):
    bias, head_bias, tail_bias, ahead, behind, front_air, rear_air, head_pitch = genes.T[:, :, None]
    front = np.multiply.accumulate(airborne, axis=1) * recent
    rear = np.multiply.accumulate(airborne[:, ::-1], axis=1)[:, ::-1] * recent
    target = bias + ahead * pitch[:, :-1]
    target += behind * pitch[:, 1:]
    target += front_air * front[:, :-1]
    target += rear_air * rear[:, 1:]
    target[:, :1] += head_bias + head_pitch * pitch[:, :1]
    target[:, -1:] += tail_bias
    return target


def path(pitch, angle, airborne, recent, head, genes):
    half = 0.5 * SPACING * np.cos(pitch)
    behind = np.cumsum(half[:, :-1] + half[:, 1:], axis=1)
    slopes = _interpolate(genes, head - np.pad(behind, ((0, 0), (1, 0))), KNOTS)
    return slopes[:, :-1] - slopes[:, 1:]


def posture(pitch, angle, airborne, recent, head, genes):
    return genes


@pytest.mark.parametrize("law", [reactive, path, posture])
@pytest.mark.parametrize("modules", [2, 3, 8])
def test_snakes_act_as_rows_of_modules(law, modules):
    organism, count = snake(modules), 11
    controller = make_law(law.__name__, organism)
    structure, _ = make_structure(organism)
    genes = np.random.default_rng(0).uniform(
        controller.lower, controller.upper, (count, len(controller.lower))
    )
    state, ticks = controller.begin(count), np.zeros((count, modules))
    for tick in range(200):
        observation = make_observations(organism, count, tick)
        observation[:, structure["contact"]] *= tick % 20 == 0
        pitch, angle, contact, head = (
            observation[:, structure[name]] for name in ("pitch", "hinge_angle", "contact", "track_odometry")
        )
        ticks = (ticks + 1) * (contact <= 0)
        airborne, recent = 1.0 * (ticks > CONTACT_TIMEOUT), 1.0 * (ticks <= MAX_AIRBORNE_TICKS)
        expected = law(pitch, angle, airborne, recent, head, genes)
        action, state = controller.act(observation, genes, structure, state)
        assert np.array_equal(action, np.clip(expected / ScoutConfig().hinge_range, -1.0, 1.0))
