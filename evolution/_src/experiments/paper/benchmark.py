"""The results of the benchmark of evolution that exist so far: champions by training model, and coarse to fine."""

import json
from pathlib import Path
from typing import Any

RESULTS = Path(__file__).parents[4] / "benchmarks" / "results" / "evolution.json"
"""Where a checkout has them; an installed package has none."""
MODELS = ("simple", "gsrm 200", "gsrm 800", "gsrm 2200", "gsrm 5000", "gg 210", "gg 13860")
"""The models that champions are evolved in."""
COARSE = "gsrm 800"
"""The model that coarse to fine starts with."""
FINES = ("gsrm 2200", "gg 13860")
"""The models that coarse to fine ends with and is compared with."""
PARTS = ("models", "stages", "champions")
"""Prefixes of the result names that the page quotes."""

Part = dict[str, Any] | None
"""Figures over the seeds that have been run; None where none has."""


def load_benchmark(path: Path = RESULTS) -> dict[str, Any]:
    """Return the results so far of champions by training model, and of coarse to fine.

    Args:
        path: file of the benchmark's results; may be absent.

    Returns:
        `models`: model -> part; `stages`: fine model -> "fine_only" and "coarse_to_fine" -> part, and "compared":
        genotypes and processor time of the fine model alone divided by those of coarse to fine, None where unknown;
        `date` (first to last), `machine` and `versions` (of the last), None where nothing was measured.
    """
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
        results, origins = dict(record["results"]), dict(record["origins"])
    except (OSError, ValueError, KeyError, TypeError):
        results, origins = {}, {}
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
        **_describe_origin([origins[part] for part in results if part.startswith(PARTS)]),
    }


def _describe_origin(origins: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the days of the measurements, and machine and versions of the last one."""
    if not origins:
        return dict.fromkeys(("date", "machine", "versions"))
    first, *_, last = sorted([origins[0], *origins], key=lambda origin: origin["date"])
    days = dict.fromkeys((first["date"], last["date"]))
    return {"date": " to ".join(days), "machine": last["machine"], "versions": last["versions"]}
