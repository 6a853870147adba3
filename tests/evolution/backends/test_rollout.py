"""Jobs in the real environment: equal with any batch size, number of threads and other jobs."""

import logging
from collections import OrderedDict
from dataclasses import replace

import numpy as np
import pytest

import evolution as ev
import symbrion_gym as sg
from evolution._src.backends import rollout
from evolution._src.backends.cluster import make_backend
from evolution._src.backends.rollout import make_environment_options, simulate, split_job
from evolution._src.backends.scoring import Outcome
from evolution._src.backends.settings import Randomization, RolloutConfig
from evolution._src.backends.trials import FAILED_PROGRESS, Job, Trials, make_failure
from evolution._src.champions.playback import ChampionPolicy
from evolution._src.controllers.controller import REACTIVE_HINT, SENSORS, make_controller
from evolution._src.errors import NoEnvironmentError, RunError
from evolution._src.search.bodies.genome import BodyGenome
from evolution._src.search.evaluation import evaluate
from evolution._src.search.validation import Champion
from symbrion_gym._src.environment.organism_env import OrganismEnv
from symbrion_gym._src.tasks.goals import FarEnd

SHORT = Trials(modules=4, count=3, seed=(4,), environment=(("duration", 3.0),))


def make_jobs(trials: Trials = SHORT, count: int = 3) -> list[Job]:
    genotypes = np.random.default_rng(0).uniform(-0.5, 0.5, (count, 8))
    return [Job(genotype, trials) for genotype in genotypes]


@pytest.mark.slow
def test_batch_sizes_threads_and_other_jobs_change_nothing(monkeypatch):
    jobs = make_jobs()
    expected = simulate(jobs, 1)
    assert simulate(jobs, 2) == expected
    assert [simulate([job], 1)[0] for job in jobs] == expected
    monkeypatch.setattr(rollout, "_BATCH_SIZES", (2,))
    monkeypatch.setattr(rollout, "_environments", OrderedDict())
    assert simulate(jobs[::-1], 1)[::-1] == expected


@pytest.mark.slow
def test_jobs_of_several_bodies_and_starts_are_grouped():
    jobs = (
        make_jobs(count=2)
        + make_jobs(replace(SHORT, modules=5), 2)
        + make_jobs(replace(SHORT, start="floor"), 1)
    )
    assert simulate(jobs, 1) == [simulate([job], 1)[0] for job in jobs]


@pytest.mark.slow
@pytest.mark.parametrize("law", ["reactive", "path"])
def test_the_single_environment_agrees_to_the_bit(law):
    controller = make_controller(law, 4)
    job = Job(np.array(controller.initial), replace(SHORT, controller=law))
    progress, seconds = [], 0.0
    for trial in split_job(0, job):
        environment = OrganismEnv(**make_environment_options(job.trials), stretch=trial.stretch)
        observation, info = environment.reset(seed=trial.seed, options=dict(trial.conditions))
        state, ended = controller.begin(1), False
        while not ended:
            actions, state = controller.act(
                observation[None], job.genotype, environment.observation_structure, state
            )
            observation, _, terminated, truncated, info = environment.step(actions[0])
            ended = terminated or truncated
        progress.append(float(info["progress"]))
        seconds += float(info["time"])
    outcome = simulate([job], 1)[0]
    assert outcome.progress == np.mean(progress)
    assert outcome.seconds == pytest.approx(seconds)


@pytest.mark.slow
def test_processes_agree_to_the_bit():
    jobs = make_jobs()
    backend = make_backend("processes", 2)
    try:
        assert backend.run(jobs) == simulate(jobs, 1)
    finally:
        backend.close()


@pytest.mark.slow
def test_diverged_physics_affects_its_genotype_only(monkeypatch):
    jobs = make_jobs()
    expected = simulate(jobs, 1)
    run_trials = rollout._run_trials

    def diverge(groups, controller):
        results = run_trials(groups, controller)
        return {key: result._replace(diverged=key[0] == 1) for key, result in results.items()}

    monkeypatch.setattr(rollout, "_run_trials", diverge)
    outcomes = simulate(jobs, 1)
    assert outcomes[1].diverged == 3
    assert outcomes[1].progress == -1.0
    assert [outcomes[0], outcomes[2]] == [expected[0], expected[2]]


def test_an_arena_that_is_not_there_is_an_error_not_a_bad_genotype():
    with pytest.raises(RunError, match="nowhere"):
        evaluate(np.zeros(8), arena="nowhere")


@pytest.mark.slow
def test_environments_follow_the_config_and_the_options(monkeypatch):
    environments = OrderedDict()
    monkeypatch.setattr(rollout, "_environments", environments)
    monkeypatch.setattr(rollout, "MAX_ENVIRONMENTS", 1)
    monkeypatch.setattr(rollout, "_BATCH_SIZES", (2,))
    once = Randomization(stretch=(1.0,))
    short = replace(SHORT, count=1, rollout=RolloutConfig(stuck_time=1.5), randomization=once)
    for options, stuck_time in ((), 1.5), ((("stuck_time", 0.5),), 0.5):
        simulate([Job(np.zeros(8), replace(short, environment=(("duration", 0.1), *options)))], 1)
        (environment,) = environments.values()
        assert (environment.config.stuck_time, environment.num_envs) == (stuck_time, 2)
    with pytest.raises(RunError, match="stuck_time"):
        RolloutConfig(stuck_time=0.0)


@pytest.fixture
def champion() -> Champion:
    controller = make_controller("reactive", 4)
    return Champion(
        genotype=REACTIVE_HINT, names=controller.parameters, controller="reactive", modules=4, arena="truth"
    )


def test_a_champion_is_a_policy(champion, tmp_path):
    environment = OrganismEnv(modules=4, start="pit", duration=2.0, sensors=SENSORS)
    policy = ChampionPolicy(champion, environment.observation_structure)
    observation, info = environment.reset(seed=0)
    state, ended = None, False
    while not ended:
        action, state = policy.predict(observation, state)
        assert environment.action_space.contains(action)
        observation, _, terminated, truncated, info = environment.step(action)
        ended = terminated or truncated
    rest = Randomization((0.7, 0.7), (1.0, 1.0), (0.0, 0.0), (0.0, 0.0))
    _, outcomes = evaluate(np.array(REACTIVE_HINT), modules=4, trials=1, randomization=rest, duration=2.0)
    assert isinstance(outcomes[0], Outcome)
    assert outcomes[0].progress == info["progress"]


def test_a_policy_forgets_between_episodes_and_refuses_another_body(champion):
    environment = OrganismEnv(modules=4, sensors=SENSORS)
    policy = ChampionPolicy(champion, environment.observation_structure)
    rows = np.zeros((2, environment.observation_structure["contact"].stop))
    _, state = policy.predict(rows)
    _, state = policy.predict(rows, state, episode_start=np.array([True, False]))
    assert state.ticks_since_contact[:, 0].tolist() == [1, 2]
    with pytest.raises(RunError, match="lacks contact"):
        ChampionPolicy(champion, {"hinge_angle": slice(0, 3), "pitch": slice(3, 7)})
    with pytest.raises(RunError, match="has 4 modules"):
        ChampionPolicy(champion, OrganismEnv(modules=5, sensors=SENSORS).observation_structure)


ROW, WIDE = "b(.)", "l(l(.))r(.)"
"""Two modules in a row; four modules across the way."""


def make_bodies_config(arena):
    return ev.BodyEvolutionConfig(
        arena=str(arena),
        task="traverse",
        track_control="skid",
        duration=2.0,
        bodies=ev.BodiesConfig("exhaustive", largest=2),
        learning=ev.LearningConfig(levels=(2,), population_size=4),
        iterations=1,
    )


@pytest.mark.slow
def test_a_search_goes_on_where_a_body_does_not_fit(monkeypatch, caplog):
    config = make_bodies_config("stairs")
    usual = ev.evolve(config)
    find = FarEnd.find

    def refuse_two(self, arena, organism, start):
        if organism.num_modules == 2:
            raise sg.ArenaError("no way is wide enough")
        return find(self, arena, organism, start)

    monkeypatch.setattr(FarEnd, "find", refuse_two)
    monkeypatch.setattr(rollout, "_environments", OrderedDict())
    with caplog.at_level(logging.WARNING):
        run = ev.evolve(config)
    known, found = (
        {result.body.num_modules: result for result in each.results if result.level == 0}
        for each in (usual, run)
    )
    assert known[2].seconds > 0.0
    assert (found[2].successes, found[2].seconds, found[2].fitness) == (0, 0.0, FAILED_PROGRESS)
    assert found[1].fitness == known[1].fitness
    assert "a body of 2 modules counts as failed: the environment cannot be made: no way" in caplog.text


def test_jobs_of_the_others_are_tried_together(monkeypatch):
    config = make_bodies_config("gsrm")
    trials = {text: config.make_trials(BodyGenome.parse(text), 3, ()) for text in (ROW, WIDE, ".")}
    calls = []

    def simulate(jobs, threads):
        calls.append(len(jobs))
        if any(job.trials == trials[WIDE] for job in jobs):
            raise NoEnvironmentError("the environment cannot be made: too wide")
        return [make_failure(job.trials, f"tried {job.genotype[0]:g}") for job in jobs]

    monkeypatch.setattr(rollout, "simulate", simulate)
    jobs = [
        Job(np.array([float(number)]), trials[text])
        for number, text in enumerate((ROW, WIDE, ".", ROW, WIDE))
    ]
    outcomes = rollout.simulate_bodies(jobs, 2)
    wide = "the environment cannot be made: too wide"
    assert [outcome.error for outcome in outcomes] == ["tried 0", wide, "tried 2", "tried 3", wide]
    assert calls == [5, 2, 2, 1]
