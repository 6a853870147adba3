"""Draw the picture of docs/gpu.md from the stored results: `python docs/gpu_pictures.py`."""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from benchmarks.report import load_record
from evolution._src.report.figures import to_png
from reconstruction._src.base.atomic_write import write_atomically

IMAGES = Path(__file__).parent / "images"
_WINDOW = 5
"""Updates over which the share of successes while learning is taken."""
_TARGET = 0.8


def find_shares(curve: list[dict[str, float]]) -> np.ndarray:
    """Return the share of episodes that succeeded in the last `_WINDOW` updates; NaN where none ended."""
    ended, succeeded = (
        np.convolve([row[name] for row in curve], np.ones(_WINDOW))[: len(curve)]
        for name in ("episodes", "successes")
    )
    return np.divide(succeeded, ended, out=np.full(len(curve), np.nan), where=ended > 0)


def draw_learning(found: dict[str, Any]) -> Figure:
    """Draw the successes of PPO by the number of decisions, beside zero and random actions and the target.

    Args:
        found: as `benchmarks.material.warp_ppo.measure_ppo` returned it.
    """
    figure = Figure(figsize=(6.4, 3.6), layout="constrained")
    axes = figure.subplots()
    trials = found["trials"]
    decisions = np.array([row["decisions"] for row in found["curve"]]) / 1000
    judged = [(row["decisions"] / 1000, row["judged"] / trials) for row in found["curve"] if "judged" in row]
    axes.plot(
        decisions, find_shares(found["curve"]), color="tab:gray", lw=1.2, label="while learning, with noise"
    )
    axes.plot(
        *zip(*judged, strict=True),
        "o-",
        color="tab:blue",
        ms=4,
        label=f"judged: {trials} fresh starts (C engine)",
    )
    for name, style in (("zero", ":"), ("random", "-.")):
        axes.axhline(
            found[name] / trials,
            color="tab:red",
            ls=style,
            lw=1,
            label=f"{name} actions: {found[name]} of {trials}",
        )
    axes.axhline(_TARGET, color="tab:green", ls="--", lw=1, label="target")
    engine = "MuJoCo's C engine" if found["device"] == "mujoco" else f"Warp on {found['device']}"
    axes.set_title(f"PPO, 8 modules, pit of 0.40 m: {found['num_envs']} simulations on {engine}", fontsize=9)
    axes.set(
        xlabel="decisions [thousands]", ylabel="share of strict successes", ylim=(-0.03, 1.03), xlim=(0, None)
    )
    axes.legend(loc="upper left", bbox_to_anchor=(0.0, 0.76), fontsize=8, frameon=False)  # below the target
    axes.grid(alpha=0.25)
    return figure


def main() -> None:
    """Draw and write the picture."""
    results = load_record("warp")["results"]
    found = results["ppo"] if "ppo" in results else results["ppo_host"]["runs"][0]
    figure = draw_learning(found)
    with write_atomically(IMAGES / "ppo.png") as temporary:
        temporary.write_bytes(to_png(figure))


if __name__ == "__main__":
    main()
