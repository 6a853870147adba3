"""Time limits that a busy machine does not change."""

import time

from symbrion_gym.contact.budget import Watch


def test_waiting_is_not_work():
    watch = Watch(0.4)
    time.sleep(0.1)
    assert not watch.is_late(0.2)
    assert watch.left() < 0.31


def test_work_uses_up_the_limit():
    watch = Watch(0.2)
    while watch.spent < 0.11:
        sum(range(1000))
    assert watch.is_late(0.5)
    assert not Watch(1e6).is_late(0.5)


def test_the_clock_guards():
    watch = Watch(0.01)
    time.sleep(0.02)
    assert watch.is_late()
    assert watch.left() == 0.0
    assert watch.was_kept_waiting


def test_own_work_is_no_waiting(monkeypatch):
    monkeypatch.setattr(Watch, "elapsed", property(lambda watch: watch.spent))
    watch = Watch(0.1)
    while watch.spent < 0.06:
        sum(range(1000))
    assert watch.is_late(0.5)
    assert not watch.was_kept_waiting
