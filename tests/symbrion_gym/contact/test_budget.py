"""Time limits that a busy machine does not change."""

import time

from symbrion_gym.contact.deadline import TimeBudget


def test_waiting_is_not_work():
    budget = TimeBudget(0.4)
    time.sleep(0.1)
    assert not budget.is_exceeded(0.2)
    assert budget.left() < 0.31


def test_work_uses_up_the_limit():
    budget = TimeBudget(0.2)
    while budget.spent < 0.11:
        sum(range(1000))
    assert budget.is_exceeded(0.5)
    assert not TimeBudget(1e6).is_exceeded(0.5)


def test_the_clock_guards():
    budget = TimeBudget(0.01)
    time.sleep(0.02)
    assert budget.is_exceeded()
    assert budget.left() == 0.0
    assert budget.is_disturbed


def test_own_work_is_no_waiting(monkeypatch):
    monkeypatch.setattr(TimeBudget, "elapsed", property(lambda budget: budget.spent))
    budget = TimeBudget(0.1)
    while budget.spent < 0.06:
        sum(range(1000))
    assert budget.is_exceeded(0.5)
    assert not budget.is_disturbed
