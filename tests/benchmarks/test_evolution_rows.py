"""Only confirmed champions count; each judgement has a seed that nothing has used."""

from types import SimpleNamespace
from typing import Any

import pytest

from benchmarks import evolution_judging as judging
from benchmarks.champions_table import make_champions_table
from benchmarks.evolution_runs import Results
from benchmarks.evolution_summary import find_gaps, is_robust, summarize
from evolution.search.validation import Champion

MOMENT = {"date": "2026-11-21", "commit": "0123456789", "dirty": False}


def make_row(seed: int, held: int, is_confirmed: bool, **others: Any) -> dict[str, Any]:
    successes = 48 if is_confirmed else 40
    return {
        "seed": seed, "held_in_truth": held, "confirmed": is_confirmed, "validated": [successes, 48],
        "gap_of_20": round(20 * successes / 48 - held, 2), "genotypes": 100, "wall_seconds": 1.0,
        "cpu_seconds": 2.0, "origin": MOMENT, **others,
    }  # fmt: skip


ROWS = [make_row(0, 20, True), make_row(1, 17, True), make_row(2, 19, False), make_row(3, 12, False)]


def test_only_confirmed_champions_hold() -> None:
    assert [is_robust(row) for row in ROWS] == [True, False, False, False]
    found = summarize(ROWS)
    assert (found["champions_that_hold"], found["of"]) == (1, 4)
    assert (found["confirmed"], found["unconfirmed"], found["unconfirmed_that_hold"]) == (2, 2, 1)
    assert found["median_held_in_truth"] == 18.5
    assert found["judged_by_drawn_seeds"] == 0


def test_unconfirmed_champions_do_not_cancel_the_gap() -> None:
    gaps = find_gaps(ROWS)
    assert (gaps["of"], gaps["mean_of_20"], gaps["largest_of_20"]) == (2, 1.5, 3.0)
    assert (gaps["unconfirmed"]["of"], gaps["unconfirmed"]["mean_of_20"]) == (2, 1.17)
    assert find_gaps(ROWS[:2])["unconfirmed"] == {"of": 0, "mean_of_20": "-", "largest_of_20": "-"}


def test_the_table_has_columns_for_both() -> None:
    figures = {**summarize(ROWS), "runs": ROWS}
    origins = {"champions": MOMENT | {"is_quick": False}}
    records = {"evolution": {"origins": origins, "results": {"champions": figures, "gap": {}}}}
    line = make_champions_table(records, None).splitlines()[-1]
    assert line == "| champions | 4 | 2 | 1 | 2 | 1 | 100 | 2 | 2026-11-21, code commit 0123456 ‡ |"
    assert make_champions_table({}, None) == ""


class Memory(Results):
    """Results that stay in memory."""

    def __init__(self, content: dict[str, Any]) -> None:
        self.kept = content

    @property
    def content(self) -> dict[str, Any]:
        return self.kept

    def put(self, part: str, figures: dict[str, Any]) -> None:
        self.kept = self.kept | {part: figures}


@pytest.fixture
def seeds(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The seeds by which champions were judged; the first gene says how many trials succeed."""
    used: list[int] = []

    def judge(champion: Champion, arena: object, trials: int, seed: int, workers: int) -> SimpleNamespace:
        used.append(seed)
        return SimpleNamespace(successes=round(trials * champion.genotype[0]))

    monkeypatch.setattr(judging, "judge", judge)
    return used


def keep(first_gene: float, genotypes: int) -> dict[str, Any]:
    champion = Champion(
        (first_gene, 0.2), ("a", "b"), "reactive", 8, "/tmp/somewhere/gsrm_800", 3, 1.0, 48, 48
    )
    return judging.describe_champion(
        champion, {"genotypes": genotypes, "wall_seconds": 1.0, "cpu_seconds": 1.0}
    )


def make_unjudged(seed: int, *champions: dict[str, Any]) -> dict[str, Any]:
    return {
        "seed": seed, "confirmed": True, "validated": [48, 48], "genotypes": 300, "wall_seconds": 1.0,
        "cpu_seconds": 2.0, "origin": MOMENT, "course": {"pit": 0.4}, "champions": list(champions),
    }  # fmt: skip


def test_a_row_keeps_its_seed_and_its_champions(seeds: list[int]) -> None:
    champions = [keep(0.95, 12), keep(0.2, 24), keep(1.0, 36), keep(0.9, 48)]
    row = judging.judge_row(make_unjudged(0, *champions), frozenset(), 1)
    assert row["held_in_truth"] == 18
    assert row["gap_of_20"] == 2.0
    assert row["holds_from_genotypes"] == 36, "from there on every champion holds"
    assert set(seeds) == {row["judging_seed"]}
    assert row["judging_seed"] > 10**6, "drawn, not counted"
    assert Champion.from_dict(row["champions"][-1]["champion"]).arena == "gsrm_800", "no path of this machine"


def test_a_seed_is_never_used_again(monkeypatch: pytest.MonkeyPatch, seeds: list[int]) -> None:
    drawn = iter([5, 5, 6, 5, 6, 7])
    monkeypatch.setattr(judging.secrets, "randbits", lambda bits: next(drawn))
    results = Memory({})
    for seed in range(3):
        row = judging.judge_row(make_unjudged(seed, keep(1.0, 12)), results.find_judging_seeds(), 1)
        results.add_run("champions", row)
    assert [row["judging_seed"] for row in results.find_runs("champions")] == [5, 6, 7]


def test_judged_again_by_new_seeds(seeds: list[int]) -> None:
    row = judging.judge_row(make_unjudged(0, keep(1.0, 12)), frozenset(), 1)
    old = make_row(1, 17, True)
    results = Memory(
        {
            "champions": {"runs": [row, old]},
            "models/gsrm 2200": {"runs": [row]},
            "abyss": {"runs": [row]},
            "gap": {},
        }
    )
    messages: list[str] = []
    judging.judge_again(results, ("champions", "models"), messages.append)
    again, left = results.find_runs("champions")
    assert again["judging_seed"] != row["judging_seed"]
    assert [past["judging_seed"] for past in again["judged_before"]] == [row["judging_seed"]]
    assert again["origin"] == row["origin"], "it was not evolved again"
    assert left == old
    assert any("seed 1" in text and "not stored" in text for text in messages)
    assert results.find_runs("models/gsrm 2200") == [again], "the same run has one judgement"
    assert results.find_runs("abyss") == [row]
    assert results.content["champions"]["judged_by_drawn_seeds"] == 1
    assert results.find_judging_seeds() == {row["judging_seed"], again["judging_seed"]}
    judging.judge_again(results, (), messages.append)
    assert len(results.find_runs("champions")[0]["judged_before"]) == 2
    assert len(set(seeds)) == len(seeds)
