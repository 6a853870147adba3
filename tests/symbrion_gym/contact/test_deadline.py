"""The emergency stop."""

import time

from symbrion_gym._src.contact.deadline import Deadline


def test_work_that_asks_too_late_is_told_and_remembered():
    deadline = Deadline(0.01)
    time.sleep(0.02)
    assert not deadline.has_cut_short
    assert deadline.is_over()
    assert deadline.has_cut_short
    assert deadline.left() == 0.0


def test_work_in_time_is_not_cut_short():
    deadline = Deadline(1e6)
    assert not deadline.is_over()
    assert not deadline.has_cut_short
    assert 0 < deadline.left() <= 1e6
