"""Confirmation in a run folder: stored, and the same after any interruption."""

import made_bodies
import pytest

import evolution as ev
from evolution._src.backends.trials import Outcome
from evolution._src.errors import RunError
from evolution._src.search.bodies.genome import genome_of
from evolution._src.search.bodies.run import CHAMPION, CONFIRMED, RECORD, TABLE
from evolution._src.search.record import CONFIRMATION

FILES = (RECORD, TABLE, CHAMPION, CONFIRMED)
COUNT = 8
"""Candidates."""
RELIABLE = 2
"""Modules of bodies that always succeed in fresh trials; the others succeed in three of four."""


LARGE = ev.BodiesConfig(algorithm="random", largest=8, children=3)


class Physics:
    """Larger bodies go farther, and do not hold; counts fresh trials, and is killed after some."""

    def __init__(self, most=10**6):
        self.most, self.fresh, self.jobs = most, 0, 0

    def __call__(self, jobs, threads):
        outcomes = []
        for job in jobs:
            modules, count = genome_of(job.trials.find_organism()).num_modules, job.trials.count
            is_fresh = job.trials.seed[1] == CONFIRMATION
            self.fresh += count * is_fresh
            self.jobs += 1
            if self.jobs > self.most:
                raise KeyboardInterrupt
            won = count if modules == RELIABLE or not is_fresh else 3 * count // 4
            progress = 0.1 * modules + 1e-3 * float(job.genotype.sum())
            outcomes.append(
                Outcome(progress, 0.0, (True,) * won + (False,) * (count - won), seconds=0.1 * count)
            )
        return outcomes


def make_config(**changes):
    bodies = ev.BodiesConfig(largest=3, children=4, population_size=4)
    return made_bodies.make_config(**{"bodies": bodies, "iterations": 4} | changes)


def read_files(folder):
    return [(folder / name).read_bytes() for name in FILES]


def search(folder, simulate=None, workers=1, **changes):
    simulate = simulate or Physics()
    run = ev.evolve_bodies(make_config(folder=folder, workers=workers, **changes), simulate=simulate)
    ev.confirm(run, COUNT, simulate=simulate)
    return run


def test_the_folder_keeps_the_confirmed_champion(tmp_path):
    run = search(tmp_path / "run")
    found = ev.load_bodies(tmp_path / "run")
    assert run.champion.modules == 3
    assert (found.champion.modules, found.champion.successes, found.champion.trials) == (RELIABLE, 48, 48)
    assert found.confirmation.result.body.num_modules == RELIABLE
    assert ev.load_champion(tmp_path / "run") == found.champion
    assert found.best == run.best


@pytest.mark.parametrize("workers", [1, 3])
def test_any_interruption_gives_the_same_files(tmp_path, workers):
    whole = Physics()
    search(tmp_path / "whole", whole)
    expected = read_files(tmp_path / "whole")
    for most in (5, whole.jobs // 2, whole.jobs - 9, whole.jobs - 2):
        folder = tmp_path / str(most)
        with pytest.raises(KeyboardInterrupt):
            search(folder, Physics(most), workers)
        run = ev.resume_bodies(folder, simulate=Physics(), workers=4 - workers)
        ev.confirm(run, COUNT, simulate=Physics())
        assert read_files(folder) == expected


def test_a_folder_that_has_gone_on_is_refused(tmp_path):
    run = search(tmp_path / "run", iterations=1)
    ev.resume_bodies(tmp_path / "run", iterations=3, simulate=Physics())
    with pytest.raises(RunError, match="read it again"):
        ev.confirm(run, simulate=Physics())


def test_a_longer_run_is_confirmed_again(tmp_path):
    search(tmp_path / "whole")
    search(tmp_path / "parts", iterations=1)
    assert ev.load_bodies(tmp_path / "parts").confirmation is not None
    run = ev.resume_bodies(tmp_path / "parts", iterations=4, simulate=Physics())
    assert run.confirmation is None
    ev.confirm(run, COUNT, simulate=Physics())
    assert read_files(tmp_path / "parts") == read_files(tmp_path / "whole")


def test_other_rules_give_another_confirmation(tmp_path):
    search(tmp_path / "run")
    run = ev.load_bodies(tmp_path / "run")
    assert ev.confirm(run, COUNT, ev.Validation(rounds=(4, 4)), Physics()).champion.trials == 8
    assert ev.load_bodies(tmp_path / "run").champion.trials == 8


@pytest.mark.parametrize("content", ["", "[]", "{}"])
def test_a_damaged_confirmation_is_named(tmp_path, content):
    search(tmp_path / "run")
    (tmp_path / "run" / CONFIRMED).write_text(content)
    with pytest.raises(RunError, match=r"confirmation.json is damaged.*remove it"):
        ev.load_bodies(tmp_path / "run")


def test_a_kill_between_champion_and_confirmation_is_made_good(tmp_path, monkeypatch):
    search(tmp_path / "whole")

    def kill(path, content):
        if path.name == CONFIRMED:
            raise KeyboardInterrupt
        path.write_bytes(content)

    with monkeypatch.context() as patched:
        patched.setattr("evolution._src.search.bodies.run._replace", kill)
        with pytest.raises(KeyboardInterrupt):
            search(tmp_path / "cut")
    run = ev.load_bodies(tmp_path / "cut")
    assert run.confirmation is None
    ev.confirm(run, COUNT, simulate=Physics())
    assert read_files(tmp_path / "cut") == read_files(tmp_path / "whole")
