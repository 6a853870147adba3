"""Rounds of the audit of every task: reproducible, and faults are reported with the cell."""

import pytest

from benchmarks.material import audited_tasks
from benchmarks.material.audited_tasks import ARENAS, BODIES, TASKS, Cell, list_cells
from symbrion_gym._src.tasks.audit import Audit


@pytest.fixture
def one_cell(monkeypatch):
    """Return a cell of short episodes, which every round takes."""
    cell = Cell("snake 2", "recover", "truth")
    monkeypatch.setattr(audited_tasks, "list_cells", lambda: (cell,))
    monkeypatch.setattr(audited_tasks, "DURATION", 3.0)
    monkeypatch.setattr(audited_tasks, "RANDOM_LANES", 6)
    return cell


def test_every_cell_comes_once():
    assert len(list_cells()) == len(set(list_cells())) == len(BODIES) * len(TASKS) * len(ARENAS) == 264


def test_rounds_of_equal_numbers_are_equal(one_cell):
    random, faults = audited_tasks.try_random(0)
    assert random["random episodes"] == 6
    assert random["random successes"] == random["random successes of recover"] > 0
    assert (random["random cheats"], faults) == (0, [])
    assert audited_tasks.try_random(0)[0] == random
    evolved, _ = audited_tasks.try_evolved(1)
    generations = audited_tasks.GENERATIONS - 1
    assert evolved["evolved episodes"] == generations * audited_tasks.POPULATION


def test_a_success_that_the_audit_rejects_is_reported_with_its_cell(one_cell, monkeypatch):
    monkeypatch.setattr(audited_tasks, "audit_task", lambda *args: Audit(False, ("flew",)))
    counts, faults = audited_tasks.try_random(0)
    assert counts["random cheats"] == counts["random successes"] == len(faults) > 0
    assert faults[0] == [*one_cell, "random", 0, "flew"]
