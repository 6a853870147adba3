"""Beyond the paper: does it matter for the truth in which model a robot has evolved?"""

from pathlib import Path
from typing import Any

import reconstruction as rc
import symbrion_gym as sg
from evolution.experiments.paper.config import PaperConfig
from evolution.experiments.paper.networks import list_networks
from evolution.experiments.paper.robots import evolve_champion, judge_champion, make_part


def measure_resolutions(
    folder: Path, config: PaperConfig, workers: int, progress: rc.Progress = rc.silent
) -> list[dict[str, Any]]:
    """Evolve once in the arena of every size of the networks, and judge the champions in the true arena.

    Args:
        folder: holds the surfaces; keeps arenas and runs.
        config: sizes, generations, trials and seed.
        workers: threads.
        progress: told how far it is.

    Returns:
        Rows with `model`, `triangles`, `pieces`, `genotypes`, `validated` (fresh trials in the model that
        held, and their number), `successes` and `trials` in truth.
    """
    names = list(list_networks(config))
    rows = []
    for index, name in enumerate(names):
        within = make_part(progress, name, index / len(names), 1 / len(names))
        within("arena", 0.0)
        mesh = rc.Reconstruction.load(folder / "surfaces" / f"{name}.npz").mesh
        arena = sg.make_arena(mesh, name=name, course=sg.Course(), seed=config.seed)
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
