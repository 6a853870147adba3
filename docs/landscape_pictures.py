"""Draw the pictures of docs/landscape.md from the published table: `python docs/landscape_pictures.py`."""

from pathlib import Path

from evolution._src.landscape.longer import load_longer
from evolution._src.landscape.scores import BUDGET, SMALL, list_searches, run_search
from evolution._src.landscape.table import load_landscape
from evolution._src.report.landscape import (
    draw_distribution,
    draw_longer,
    draw_searches,
    draw_sizes,
    draw_truth,
    draw_winners,
)
from evolution._src.report.pictures import to_png
from reconstruction._src.base.atomic_write import write_atomically
from symbrion_gym._src.assets import find_assets

IMAGES = Path(__file__).parent / "images"
SEEDS = 10


def main() -> None:
    """Draw and write all pictures."""
    table = load_landscape()
    budgets = {name: BUDGET * float(table.seconds[task].sum()) for task, name in enumerate(table.tasks)}
    runs = {
        task: {
            name: [run_search(table, task, name, seed, budgets[task], SMALL) for seed in range(SEEDS)]
            for name in list_searches()
        }
        for task in table.tasks
    }
    figures = {
        "landscape-sizes": draw_sizes(table),
        "landscape-distribution": draw_distribution(table),
        "landscape-truth": draw_truth(table),
        "landscape-longer": draw_longer(table, load_longer(find_assets() / "landscape")),
        "landscape-searches": draw_searches(table, runs, budgets),
        **{f"landscape-{task}": draw_winners(table, task) for task in table.tasks},
    }
    for name, figure in figures.items():
        with write_atomically(IMAGES / f"{name}.png") as temporary:
            temporary.write_bytes(to_png(figure))


if __name__ == "__main__":
    main()
