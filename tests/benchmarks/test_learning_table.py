"""The table of learning: solved, spent in vain, and never run."""

from benchmarks.baselines import DEFAULT_IDS, Baselines, Lessons
from benchmarks.learning_table import NOT_RUN, make_learning_table
from benchmarks.material.learning import ALGORITHMS
from benchmarks.material.learning_run import Budget, Run

ORIGIN = {"date": "2026-11-22", "commit": None, "dirty": False, "is_quick": False}


def make_run(solved: bool, decisions: int) -> dict:
    return {
        "solved": solved,
        "decisions": decisions,
        "robot_seconds": decisions // 10,
        "processor_minutes": 1.5,
        "budget": {"robot_seconds": 100.0, "minutes": 2.0},
    }


def test_rows_say_what_was_spent_and_what_was_not_run():
    runs = {
        "learning/Reach-v0/cmaes/0": make_run(True, 1000),
        "learning/Reach-v0/cmaes/1": make_run(True, 3000),
        "learning/Climb-v0/ppo/0": make_run(False, 5000),
    }
    records = {"baselines": {"results": runs, "origins": dict.fromkeys(runs, ORIGIN)}}
    lines = make_learning_table(records, None).splitlines()
    rows = {tuple(cell.strip(" `") for cell in line.split("|")[1:3]): line for line in lines[4:]}
    assert len(rows) == len(DEFAULT_IDS) * len(ALGORITHMS)
    assert "| 2 of 2 | 2,000 | 200 | 1.5 |" in rows["Reach-v0", "CMA-ES"]
    assert "| 0 of 1 | (5,000) | (500) | (1.5) |" in rows["Climb-v0", "PPO"]
    assert NOT_RUN in rows["Climb-v0", "SAC"]
    assert make_learning_table({}, None) == ""


class Memory:
    """Results that are kept in memory."""

    def __init__(self, content: dict) -> None:
        self.content = content

    def put(self, part: str, figures: dict) -> None:
        self.content[part] = figures


def test_a_stored_run_is_repeated_only_with_a_larger_budget(monkeypatch):
    asked = []

    def learn(name: str, algorithm: str, seed: int, budget: Budget) -> dict:
        asked.append((name, algorithm, seed))
        return make_run(False, 1)

    monkeypatch.setattr("benchmarks.baselines.learn", learn)
    content = {
        "learning/Reach-v0/cmaes/0": make_run(True, 1),
        "learning/Reach-v0/cmaes/1": make_run(False, 1),
    }
    for budget, seeds in ((Budget(100.0, 2.0), [2]), (Budget(100.0, 3.0), [1, 2])):
        asked.clear()
        lessons = Lessons(("Reach-v0",), ("cmaes",), budget=budget)
        Baselines(Memory(dict(content)), False, lambda text: None, lessons).learning()
        assert asked == [("symbrion_gym/Reach-v0", "cmaes", seed) for seed in seeds]


def test_a_run_judges_only_what_is_promising(monkeypatch):
    monkeypatch.setattr("benchmarks.material.learning_run.judge", lambda name, policy: 41)
    run = Run("symbrion_gym/Reach-v0", Budget(robot_seconds=50.0))
    run.robot_seconds = 10.0
    run.note(0.5, lambda count: lambda observation: observation)
    assert not run.judged
    assert not run.is_over
    run.note(0.7, lambda count: lambda observation: observation)
    assert run.judged == [(10, 41)]
    assert run.is_solved
    assert run.is_over
    spent = Run("symbrion_gym/Reach-v0", Budget(robot_seconds=50.0))
    spent.robot_seconds = 50.0
    assert spent.is_over
    assert not spent.describe()["solved"]
