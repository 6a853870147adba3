"""An evaluator stays warm between calls and equals a single call; what does not fit is refused at once."""

import warnings

import numpy as np
import pytest
import toys

from evolution._src.backends import rollout
from evolution._src.backends.settings import RolloutConfig
from evolution._src.controllers.protocol import OutOfBoundsWarning
from evolution._src.errors import RunError
from evolution._src.search.config import EvolutionConfig
from evolution._src.search.evaluation import Evaluator, evaluate
from symbrion_gym._src.robot.organism import cross, snake

SHORT = {"modules": 4, "trials": 2, "duration": 2.0, "controller": "reactive"}


@pytest.fixture
def compiled(monkeypatch):
    """Sizes of the vector environments made."""
    sizes = []
    original = rollout.OrganismVectorEnv

    def make(**options):
        sizes.append(options["num_envs"])
        return original(**options)

    monkeypatch.setattr(rollout, "OrganismVectorEnv", make)
    monkeypatch.setattr(rollout, "_environments", type(rollout._environments)())
    return sizes


def test_the_second_call_compiles_nothing(compiled):
    genotypes = np.random.default_rng(0).uniform(-0.5, 0.5, (10, 8))
    with Evaluator(**SHORT) as evaluator:
        first = evaluator(genotypes)
        assert compiled == [24]
        assert evaluator(genotypes).outcomes == first.outcomes
        assert evaluator(genotypes[:3]).outcomes == first.outcomes[:3]
    assert compiled == [24]
    assert (
        evaluate(genotypes[:3], **SHORT, rollout=RolloutConfig(batch_sizes=(2,))).outcomes
        == first.outcomes[:3]
    )


def test_worker_processes_stay_between_calls(monkeypatch):
    with Evaluator(backend="processes", workers=2, simulate=toys.bowl) as evaluator:
        one = evaluator(np.zeros((4, 8)))
        ids = evaluator._backend.process_ids
        two = evaluator(list(np.zeros((4, 8))))
        assert evaluator._backend.process_ids == ids
    assert one.outcomes == two.outcomes == evaluate(np.zeros((4, 8)), simulate=toys.bowl).outcomes


def test_genes_beyond_the_bounds_are_tried_as_they_are_with_a_warning():
    tried = []

    def simulate(jobs, threads):
        tried.extend(job.genotype.tolist() for job in jobs)
        return toys.bowl(jobs, threads)

    far = np.zeros((2, 8))
    far[1, 3] = -2.0
    with Evaluator(simulate=simulate) as evaluator:
        message = r"1 of 16 genes .* 'reactive', the first is pitch_ahead = -2, not in -1.5 to 1.5"
        with pytest.warns(OutOfBoundsWarning, match=message):
            evaluator(far)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            evaluator(np.full(8, 1.5))
    assert tried == [*far.tolist(), [1.5] * 8]


@pytest.mark.parametrize("modules", [8, 6])
def test_two_bodies_are_refused_by_name(modules):
    for make in (Evaluator, EvolutionConfig):
        with pytest.raises(
            RunError, match=rf"modules is {modules} and organism, too, is given, of 7 modules"
        ):
            make(modules=modules, organism="H")
    config = EvolutionConfig(modules=7, organism="H")
    assert EvolutionConfig.from_json(config.to_json()) == config == EvolutionConfig(organism="H")
    assert Evaluator(organism="H").trials.modules == 7
    assert Evaluator(organism=3).trials.find_organism() == snake(3)


def test_seeds_give_conditions():
    with Evaluator(simulate=toys.bowl, seed=3) as evaluator:
        default, same = evaluator(np.zeros(8)), evaluator(np.zeros(8))
        other, again = evaluator(np.zeros(8), seed=1), evaluator(np.zeros(8), seed=1)
    assert default.fitness == same.fitness
    assert other.fitness == again.fitness != default.fitness
    assert default.fitness == evaluate(np.zeros(8), seed=3, simulate=toys.bowl).fitness


def test_the_controller_has_names_bounds_and_a_start():
    with Evaluator(modules=5, controller="posture", simulate=toys.bowl) as evaluator:
        controller = evaluator.controller
        assert len(controller.parameters) == len(controller.lower) == len(controller.initial) == 4


def test_a_closed_evaluator_refuses():
    with Evaluator(simulate=toys.bowl) as evaluator:
        pass
    with pytest.raises(RunError, match="closed"):
        evaluator(np.zeros(8))


def test_a_call_refuses_a_wrong_seed():
    with Evaluator(simulate=toys.bowl) as evaluator, pytest.raises(RunError, match="seed must be"):
        evaluator(np.zeros(8), seed=-1)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"wings": 2}, "environment: .*wings"),
        ({"controller": "psychic"}, "there are: path"),
        ({"modules": cross(1), "organism": cross(1)}, "leave out one"),
        ({"scoring": 7}, "scoring"),
        ({"trials": 0}, "trials must be a whole number from 1"),
        ({"seed": -1}, "seed must be a whole number from 0"),
    ],
)
def test_evaluators_refuse(options, message):
    with pytest.raises(RunError, match=message):
        Evaluator(simulate=toys.bowl, **options)


def test_bodies_are_numbers_or_organisms():
    options = SHORT | {"duration": 1.0}
    by_number = evaluate(np.zeros(8), **options)
    by_organism = evaluate(np.zeros(8), **options | {"modules": snake(4)})
    assert by_number.outcomes == by_organism.outcomes
    options |= {"modules": cross(1), "scoring": lambda outcome, body: body.num_modules}
    fitness, outcomes = evaluate(np.zeros(8), **options)
    assert fitness == 5
    assert not outcomes[0].error


@pytest.mark.parametrize("track_control", ["body", "modules"])
def test_controllers_drive_the_tracks_where_these_are_part_of_the_action(track_control):
    options = SHORT | {"duration": 1.0, "track_control": track_control}
    with Evaluator(**options) as evaluator:
        _, outcomes = evaluator(np.zeros(len(evaluator.controller.parameters)))
    assert not outcomes[0].error
    with pytest.raises(RunError, match="genotypes of 2 numbers"):
        evaluate(np.zeros(2), **options)
