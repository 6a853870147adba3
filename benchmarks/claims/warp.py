"""MuJoCo Warp beside MuJoCo's C engine, on Warp's CPU device: agreement. Speed is measured on a GPU alone."""

from benchmarks.figures import Claim, Value

_ARENAS = ("truth", "simple", "gsrm", "gg")


def _find(path: str) -> tuple[Value, ...]:
    return tuple(Value("warp", f"ticks/{arena}/{path}") for arena in _ARENAS)


WARP = (
    Claim(
        "MuJoCo Warp against C, 200 physics steps of 20 random controllers on truth, simple, gsrm and gg: controllers "
        "whose positions agree within 1e-4 m or rad until other geoms touch",
        "{0}, {1}, {2}, {3}",
        _find("steps/within_1e-4"),
        bar=">= 20",
        set_after=True,
    ),
    Claim(
        "MuJoCo Warp against C, the same: largest difference of a position until other geoms touch",
        "{0:.0e}, {1:.0e}, {2:.0e}, {3:.0e} m or rad",
        _find("steps/largest"),
        bar="<= 1e-4",
        bar_index=3,
        set_after=True,
    ),
    Claim(
        "The same controllers on C, begun 1e-6 m beside the start: mean number of steps until other geoms touch; and "
        "on Warp",
        "{0:.0f}, {1:.0f}, {2:.0f}, {3:.0f} and {4:.0f}, {5:.0f}, {6:.0f}, {7:.0f} of 200",
        _find("steps_beside/steps_of_same_contacts") + _find("steps/steps_of_same_contacts"),
    ),
    Claim(
        "MuJoCo Warp against C, the same: largest difference of an observation, of its range, without forces and "
        "accelerations, until other geoms touch",
        "{0:.0e}, {1:.0e}, {2:.0e}, {3:.0e}",
        _find("agreeing/observation"),
        bar="<= 1e-4",
    ),
    Claim(
        "MuJoCo Warp against C, the same: largest difference of forces and accelerations, of their range",
        "{0:.0e}, {1:.0e}, {2:.0e}, {3:.0e}",
        _find("agreeing/force"),
    ),
    Claim(
        "MuJoCo Warp against C, the same: largest difference of the reward of a control step",
        "{0:.0e}, {1:.0e}, {2:.0e}, {3:.0e}",
        _find("agreeing/reward"),
        bar="<= 1e-4",
    ),
    Claim(
        "MuJoCo Warp against C: equal outcomes of 30 random controllers at a pit of 0.30 m (successes on C, on Warp)",
        "{0} of 30 ({1} and {2})",
        (
            Value("warp", "crossings/truth/agree"),
            Value("warp", "crossings/truth/successes/0"),
            Value("warp", "crossings/truth/successes/1"),
        ),
        bar=">= 28",
        set_after=True,
    ),
    Claim(
        "Warp's deterministic mode on the processor, 16 simulations: processor time of a control step, in times of the "
        "usual mode",
        "{0:.2f} of it",
        (Value("warp", "determinism/16 worlds/processor_ratio"),),
    ),
    Claim(
        "PPO of `examples/train_ppo_gpu.py` on the C engine, 112,640 decisions: strict successes of 50 fresh starts "
        "(zero, random actions)",
        "{0} ({1}, {2})",
        (
            Value("warp", "ppo_host/runs/0/judged"),
            Value("warp", "ppo_host/runs/0/zero"),
            Value("warp", "ppo_host/runs/0/random"),
        ),
        bar=">= 40",
    ),
)
