"""The examples work."""

import importlib.util
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType

import jax
import numpy as np
import pytest

import evolution as ev
import symbrion_gym as sg
from evolution._src.backends.trials import Job

EXAMPLES = Path(__file__).parents[1] / "examples"


def load(name: str) -> ModuleType:
    """Return an example as a module."""
    found = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    assert found is not None
    assert found.loader is not None
    module = importlib.util.module_from_spec(found)
    found.loader.exec_module(module)
    return module


def test_the_hand_written_controller_crosses() -> None:
    assert load("hand_written_controller").main()


def test_a_task_of_ones_own_takes_few_lines_and_is_solved() -> None:
    assert len((EXAMPLES / "own_task.py").read_text().splitlines()) <= 25
    own = load("own_task")
    assert own.env.unwrapped.world.task == own.task
    assert any(info["success"] for *_, info in own.results)
    assert sum(info["reward_rise"] for *_, info in own.results) > 0.1


def test_a_sensor_of_ones_own_takes_15_lines_in_single_and_vector_environments() -> None:
    assert len((EXAMPLES / "own_sensor.py").read_text().splitlines()) <= 15
    own = load("own_sensor")
    assert own.observations[:, own.part] == pytest.approx(np.full((2, 4), 0.0545))
    heights = own.env.step(np.zeros(4))[0][own.part]
    assert heights.tolist() == own.envs.step(np.zeros((2, 4)))[0][0, own.part].tolist()


def test_the_own_controller_is_evaluated_and_short() -> None:
    wave = load("own_controller").Wave
    evaluation = ev.evaluate(np.zeros((2, 3)), modules=4, controller=wave, trials=1, duration=1.0)
    assert not any(outcome.error for outcome in evaluation.outcomes)
    assert len((EXAMPLES / "own_controller.py").read_text().splitlines()) <= 25


@pytest.mark.long
def test_ppo_is_trained_saved_judged_and_filmed(tmp_path: Path) -> None:
    pytest.importorskip("stable_baselines3", reason="the extra rl is not installed")
    example = load("train_ppo")
    model, envs = example.train("gsrm", steps=2048, num_envs=4, verbose=0)
    example.save(tmp_path, model, envs)
    policy = example.load(tmp_path)
    observation = envs.observation_space.sample()[None]
    wanted = model.predict(envs.normalize_obs(observation), deterministic=True)[0]
    np.testing.assert_allclose(policy(observation), wanted, atol=1e-6)
    successes, progress = example.judge(policy, "truth", trials=4)
    assert 0 <= successes <= 4
    assert progress > 0
    example.OPTIONS["duration"] = 1.0
    example.film(policy, "truth", tmp_path / "film.mp4")
    assert (tmp_path / "film.mp4").stat().st_size > 1000


@pytest.mark.long
def test_ppo_submits_to_the_suite_what_it_has_learned() -> None:
    pytest.importorskip("stable_baselines3", reason="the extra rl is not installed")
    from evolution._src.controllers.finding import find_controller
    from evolution._src.suite.exam import hold_exam
    from evolution._src.suite.submission import Submission
    from evolution._src.suite.tasks import find_suite_task

    example, task = load("suite_ppo"), find_suite_task("stairs, 5 in a row")
    entry = example.train(task, 0, seconds=100.0)
    assert 50.0 < entry.seconds <= 110.0
    assert not hold_exam([Submission("ppo", (entry,))], 0, allow=("policy_network",)).untried

    trials = task.make_trials(task.find_scan(), task.body, example.CONTROLLER, 1, (0,))
    organism = trials.find_organism()
    network = find_controller(example.CONTROLLER, organism, 1).controller
    envs = example.make_envs(task, trials, network, 0)
    model = example.PPO("MlpPolicy", envs, policy_kwargs=example.POLICY, seed=0, **example.SETTINGS)
    model.learn(1)
    envs.training = False
    observation = envs.observation_space.sample()[None]
    wanted = model.predict(envs.normalize_obs(observation), deterministic=True)[0]
    order = np.argsort([envs.venv.venv.envs.observation_structure[name].start for name in network.sensors])
    assert order.tolist() == [0, 1, 2]
    genes = example.extract_weights(model, envs)[None]
    action, _ = network.act(observation, genes, envs.venv.venv.envs.observation_structure, network.begin(1))
    np.testing.assert_allclose(action, network.find_actions(wanted), atol=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("arena", ["truth", "gsrm"])
def test_a_scout_drives_to_random_places(arena: str) -> None:
    ground = sg.load_arena(arena)
    places = ground.traversability()
    rng, drive = np.random.default_rng(5), load("drive_to_a_place").drive
    for _ in range(2):
        goal = rng.choice(np.flatnonzero(places.region >= 0))
        start = rng.choice(np.flatnonzero(places.region == places.region[goal]))
        assert drive(ground, *(tuple(places.positions[place, :2]) for place in (start, goal)))


def test_a_scout_drives_by_dead_reckoning() -> None:
    example = load("drive_by_dead_reckoning")
    assert example.drive(sg.load_arena("truth"), (-2.7, -0.3), (-2.1, 0.2))
    assert 0 <= example.count("gsrm", 1, duration=2.0) <= 1


def test_pycma_searches_around_an_evaluator(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("evolution._src.backends.rollout.simulate", bowl)
    genotype, fitness = load("search_with_pycma").main(generations=3)
    assert len(genotype) == 8
    assert np.isfinite(fitness)


def test_ribs_fills_an_archive() -> None:
    pytest.importorskip("ribs", reason="the extra ribs is not installed")
    archive = load("search_with_ribs").main(1, 1, arena="truth", modules=3, duration=1.0, trials=1)
    assert archive.stats.num_elites > 0


def test_a_fitness_of_ones_own_is_kept_and_resumed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(EXAMPLES)
    example = load("own_fitness")
    run = example.main(0, str(tmp_path / "run"))
    assert run.config.scoring.__name__ == "far_and_low"
    assert len(ev.resume(tmp_path / "run", generations=2, simulate=bowl, allow=("own_fitness",)).history) == 2


def bowl(jobs: Sequence[Job], threads: int) -> list[ev.Outcome]:
    """Stand-in for physics: progress is highest where every gene is 0."""
    return [ev.Outcome(-float((job.genotype**2).sum()), 0.0, (False,) * job.trials.count) for job in jobs]


def test_a_tracked_rover_drives_up_the_ramp_of_a_scan() -> None:
    lines = (EXAMPLES / "tracked_rover.py").read_text().splitlines()
    assert sum(bool(line.strip()) for line in lines) <= 32  # with its docstrings
    place, goal = load("tracked_rover").drive()
    assert np.linalg.norm(place - goal) < 0.15


@pytest.mark.long
def test_ppo_learns_on_a_device() -> None:
    pytest.importorskip("mujoco_warp", reason="the extra gpu is not installed")
    example = load("train_ppo_gpu")
    few = example.Settings(horizon=4, epochs=2, minibatches=2)
    learner, curve = example.train(
        "truth", "cpu", num_envs=4, updates=2, settings=few, modules=3, num_starts=4, max_episode_steps=3
    )
    fresh = example.make_learner(
        jax.random.key(0), *(size.shape[0] for size in (learner.mean, learner.weights["spread"]))
    )
    assert all(np.isfinite(np.asarray(each)).all() for each in jax.tree.leaves(learner))
    assert np.abs(learner.weights["spread"] - fresh.weights["spread"]).max() > 0.0
    assert [row["decisions"] for row in curve] == [16, 32]
    assert sum(row["episodes"] for row in curve) > 0
    assert 0 <= example.judge(learner, "truth", trials=2, modules=3, duration=1.0) <= 2


@pytest.mark.slow
def test_a_second_survey_refines_the_model() -> None:
    before, after = load("refine_a_model").main()
    assert after < 0.5 * before
