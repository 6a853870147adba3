"""The picture of replayed searches shows each of them."""

import pytest

from evolution._src.landscape.replay import replay
from evolution._src.landscape.table import load_landscape

pytest.importorskip("matplotlib")


def test_every_search_has_a_curve_of_its_own():
    from evolution._src.report.landscape import draw_searches

    table = load_landscape()
    names = [f"search {number}" for number in range(9)]
    run = {task: replay(table, task, "random", 0, 500.0) for task in table.tasks}
    runs = {task: {name: [run[task]] for name in names} for task in table.tasks}
    figure = draw_searches(table, runs, dict.fromkeys(table.tasks, 500.0))
    labels = [text.get_text() for text in figure.axes[-1].get_legend().get_texts()]
    assert labels == names
    looks = [(line.get_color(), line.get_linestyle()) for line in figure.axes[0].get_lines()[: len(names)]]
    assert len(set(looks)) == len(names)
