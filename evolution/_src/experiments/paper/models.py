"""Beyond the paper: does success in the true arena depend on the model in which a robot evolved?"""

from pathlib import Path
from typing import Any

import reconstruction as rc
import symbrion_gym as sg
from evolution._src.experiments.paper.config import PaperConfig
from evolution._src.experiments.paper.networks import list_networks
from evolution._src.experiments.paper.robots import evolve_champion, judge_champion, scale_progress


def measure_resolutions(
    folder: Path, config: PaperConfig, workers: int, progress: rc.Progress = rc.silent
) -> list[dict[str, Any]]:
    """Evolve once in the arena of every size of the networks, and judge the champions in the true arena.

    Args:
        folder: contains the surfaces; arenas and runs are written to it.
        config: sizes, generations, trials and seed.
        workers: threads; the results do not depend on their number.
        progress: called with a message and the share that is done.

    Returns:
        Rows with `model`, `triangles`, `pieces`, `genotypes`, `validated` (successes of the fresh trials in the
        model, and their number), `successes` and `trials` in the true arena.

    Raises:
        ArenaError: a surface cannot become an arena.
        RunError: an evolution fails.
    """
    names = list(list_networks(config))
    rows = []
    for index, name in enumerate(names):
        within = scale_progress(progress, name, index / len(names), 1 / len(names))
        within("arena", 0.0)
        mesh = rc.Reconstruction.load(folder / "surfaces" / f"{name}.npz").mesh
        arena = sg.make_arena(mesh, name=name, seed=config.seed)
        arena.save(folder / "arenas" / name)
        run = evolve_champion(folder, name, f"runs/{name}", config, config.model_generations, workers, within)
        assert run.champion is not None
        judged = judge_champion(run.champion, {"truth": "truth"}, config, workers)["truth"]
        rows.append(
            {
                "model": name,
                "triangles": len(mesh.faces),
                "pieces": len(arena.pieces),
                "genotypes": int(run.history["evaluations"][-1]),
                "validated": [run.champion.successes, run.champion.trials],
                **judged,
            }
        )
    return rows
