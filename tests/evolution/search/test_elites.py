"""MAP-Elites over controllers: the fittest of each cell is kept, varied, and found again in the record."""

from dataclasses import replace

import numpy as np
import pytest
from histories import TOY, without_times

import reconstruction._src.base.extras
from evolution._src.backends.outcome import Outcome
from evolution._src.errors import RunError
from evolution._src.search.archive import ArchiveConfig
from evolution._src.search.elites_of_record import find_elites
from evolution._src.search.loop import evolve, resume
from evolution._src.search.restarting_search import RestartingSearch
from evolution._src.search.stages import Stage
from reconstruction._src.base.extras import MissingExtraError

ARCHIVE = ArchiveConfig(axes=("effort", "seconds"), cells=(4, 5), lower=(0.0, 0.0), upper=(2.0, 5.0))
RUN = replace(TOY, generations=8, population_size=10, archive=ARCHIVE)


@pytest.fixture(autouse=True)
def _needs_ribs(request):
    if "without_the_extra" not in request.node.name and "refused" not in request.node.name:
        pytest.importorskip("ribs", reason="the extra ribs is not installed")


def behave(jobs, threads):
    """Effort and time are read from the first two genes; progress is highest where all genes are 0.5."""
    return [
        Outcome(
            -float(((job.genotype - 0.5) ** 2).sum()),
            float(1.0 + job.genotype[0]),
            (False,) * job.trials.count,
            seconds=job.trials.count * float(2.5 + 2.0 * job.genotype[1]),
        )
        for job in jobs
    ]


def find_cell(outcome):
    effort, seconds = ARCHIVE.measure(outcome)
    return min(max(int(effort / 0.5), 0), 3), min(max(int(seconds / 1.0), 0), 4)


def test_each_elite_is_the_fittest_of_its_cell():
    run = evolve(RUN, simulate=behave)
    elites = find_elites(run)
    samples = [entry for entry in run.record.entries if entry.kind == 0]
    best = {}
    for entry in samples:
        cell = find_cell(entry.outcome)
        best[cell] = max(best.get(cell, -np.inf), entry.fitness)
    assert {find_cell(entry.outcome): entry.fitness for entry in elites} == best
    assert [entry.fitness for entry in elites] == sorted(best.values(), reverse=True)
    assert len(samples) == 80


def test_the_archive_fills_more_cells_than_cmaes():
    archive, plain = (
        find_elites(evolve(replace(config, generations=30), simulate=behave), ARCHIVE)
        for config in (RUN, replace(RUN, archive=ArchiveConfig()))
    )
    assert len(archive) > len(plain)


def test_a_resumed_run_is_the_same_to_the_bit_and_equal_seeds_are_equal(tmp_path):
    whole = evolve(replace(RUN, folder=str(tmp_path / "whole")), simulate=behave)
    evolve(replace(RUN, folder=str(tmp_path / "parts"), generations=3), simulate=behave)
    resumed = resume(tmp_path / "parts", generations=8, simulate=behave)
    other = evolve(replace(RUN, seed=1), simulate=behave)
    np.testing.assert_array_equal(without_times(resumed.history), without_times(whole.history))
    genotypes = [[entry.genotype.tolist() for entry in run.record.entries] for run in (whole, resumed, other)]
    assert genotypes[0] == genotypes[1] != genotypes[2]


def test_elites_stay_within_bounds_and_failures_are_left_out():
    def fail(jobs, threads):
        return [
            replace(outcome, error="fell apart") if job.genotype[0] > 0.2 else outcome
            for job, outcome in zip(jobs, behave(jobs, threads), strict=True)
        ]

    config = replace(RUN, archive=replace(ARCHIVE, noise=2.0))
    run = evolve(config, simulate=fail)
    genotypes = np.array([entry.genotype for entry in run.record.entries])
    space = RestartingSearch(config).strategy.space
    assert (genotypes >= space.lower).all()
    assert (genotypes <= space.upper).all()
    assert (genotypes == space.upper).any()
    assert all(entry.genotype[0] <= 0.2 for entry in find_elites(run))


def test_descriptors_are_axes():
    outcome = Outcome(0.0, 0.0, (True, True), descriptors=({"far": np.array([1.0, 2.0])},) * 2)
    config = ArchiveConfig(("far:1", "progress"), (2, 2), (0.0, 0.0), (1.0, 1.0))
    assert config.measure(outcome) == [2.0, 0.0]
    for axis in ("near", "far:2", "far:x"):
        with pytest.raises(RunError, match=f"axis '{axis}'; there are effort, seconds, progress.*: far"):
            replace(config, axes=(axis, "progress")).measure(outcome)
    with pytest.raises(RunError, match="keep: none"):
        config.measure(Outcome(0.0, 0.0, (True,)))


@pytest.mark.parametrize(
    "changes",
    [
        {"cells": (4,)},
        {"cells": (0, 5)},
        {"cells": (4, 1.5)},
        {"cells": (4000, 5000)},
        {"upper": (0.0, 5.0)},
        {"noise": -1.0},
        {"line": np.nan},
    ],
)
def test_bad_values_are_refused(changes):
    with pytest.raises(RunError, match=next(iter(changes))):
        replace(ARCHIVE, **changes)


def test_what_does_not_fit_is_refused():
    for changes in ({"stages": (Stage("simple", 3), Stage("truth"))}, {"body_lengths": (4, 6)}):
        with pytest.raises(RunError, match="leave out stages and body_lengths"):
            replace(RUN, **changes)
    with pytest.raises(RunError, match="handle_noise and archive"):
        replace(RUN, handle_noise=True)
    with pytest.raises(RunError, match="has no archive"):
        find_elites(evolve(replace(TOY, generations=1), simulate=behave))


def test_without_the_extra_one_line_names_the_command(monkeypatch):
    monkeypatch.setattr(reconstruction._src.base.extras, "find_spec", lambda name: None)
    with pytest.raises(MissingExtraError, match=r"pip install 'symbrion-gym\[ribs\]'"):
        evolve(RUN, simulate=behave)


def test_the_genotype_at_which_the_search_begins_is_tried_if_asked():
    run = evolve(replace(RUN, generations=2, origin="zero", is_start_tried=True), simulate=behave)
    genotypes = run.record.columns()["genotype"]
    assert np.flatnonzero(np.abs(genotypes).max(axis=1) == 0.0).tolist() == [0]
