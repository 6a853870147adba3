"""What the benchmark of evolution has kept: champions by training model, coarse to fine; it grows run by run."""

import json
from pathlib import Path
from typing import Any

RESULTS = Path(__file__).parents[2] / "benchmarks" / "results" / "evolution.json"
"""Where a checkout keeps it; an installed package has none."""
MODELS = ("simple", "gsrm 200", "gsrm 800", "gsrm 2200", "gsrm 5000", "gg 210", "gg 13860")
"""The models that it trains on."""
COARSE = "gsrm 800"
"""The model that coarse to fine begins on."""
FINES = ("gsrm 2200", "gg 13860")
"""The models that coarse to fine ends on and is compared with."""

Part = dict[str, Any] | None
"""Figures over the seeds that are done; None where none is."""


def find_benchmark(path: Path = RESULTS) -> dict[str, Any]:
    """Return what is known so far of champions by training model, and of coarse to fine.

    Args:
        path: of the benchmark's results; may be absent.

    Returns:
        `models`: model -> part; `stages`: fine model -> "fine_only" and "coarse_to_fine" -> part, and "compared":
        how many times less genotypes and processor seconds coarse to fine needs, None where unknown; `date`,
        `machine` and `versions`, None where nothing was measured.
    """
    try:
        record = json.loads(path.read_text())
        results = dict(record["results"])
    except (OSError, ValueError, KeyError, TypeError):
        record, results = {}, {}
    models: dict[str, Part] = {name: results.get(f"models/{name}") for name in MODELS}
    models["gsrm 2200"] = models["gsrm 2200"] or results.get("champions")  # the same runs, under another name
    return {
        "models": models,
        "stages": {
            fine: {
                "fine_only": models[fine],
                "coarse_to_fine": results.get(f"stages/{fine}"),
                "compared": results.get(f"stages_compared/{fine}"),
            }
            for fine in FINES
        },
        **{key: record.get(key) for key in ("date", "machine", "versions")},
    }
