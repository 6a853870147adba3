"""Swarms: docks, levels of physics, docking beside real robots, the whole story."""

from benchmarks.figures import PERCENT, Claim, Value

_LEVELS = {
    "kinematic": "moved simply",
    "mixed": "of which docked ones and those near them are in full contact",
    "dynamic": "in full contact",
}
_GROUNDS = {
    "flat": "on level ground",
    "ramp": "on the ramp of the course, 14 degrees",
    "6 deg": "on a ramp of 6 degrees",
    "12 deg": "on a ramp of 12 degrees",
    "16 deg": "on a ramp of 16 degrees",
}
_PLACES = {"gsrm": "the scanned arena", "truth": "the true course"}

SWARM = (
    Claim(
        "Eight robots that dock and part while they drive: largest jump of position and angle where the model changes",
        "{0:.3f} mm, {1:.3f}°",
        (Value("swarm", "docks/jump_mm"), Value("swarm", "docks/jump_deg")),
        bar="<= 0.1 mm",
    ),
    Claim(
        "The same changes: largest jump of an angle",
        "{0:.3f}°",
        (Value("swarm", "docks/jump_deg"),),
        bar="<= 0.1 °",
    ),
    Claim(
        "The same changes: momentum lost, at most; number of changes",
        "{0:.2g} % ({1})",
        (Value("swarm", "docks/momentum_share", scale=PERCENT), Value("swarm", "docks/changes")),
        bar="<= 1 %",
    ),
    Claim(
        "A latch under 100 N in any direction: displacement",
        "{0:.2f} mm",
        (Value("swarm", "docks/drift_mm"),),
        bar="<= 1 mm",
    ),
    Claim(
        "A latch under 100 N in any direction: rotation",
        "{0:.2f}°",
        (Value("swarm", "docks/drift_deg"),),
        bar="<= 0.5 °",
    ),
    Claim(
        "A champion evolved as an organism crosses in robots that have docked, and in robots placed as one body: "
        "trials; probability of such a difference by chance",
        "{0} and {1} of {2}; {3:.2f}",
        tuple(
            Value("swarm", f"crossing/{name}")
            for name in ("assembled", "placed", "trials", "probability_of_chance")
        ),
        bar=">= 0.05",
        bar_index=3,
    ),
    Claim(
        "50 kinematic Scouts with all sensors and signals, slowest of three arenas, one core: simulated over processor "
        "time",
        "{0:.1f}",
        (Value("swarm", "kinematic/speed/*/times_real_time", "min"),),
        bar=">= 20",
    ),
    Claim(
        "Eight free Scouts in full contact, slower of two arenas, one core: simulated over processor time",
        "{0:.1f}",
        (Value("swarm", "speed/times_real_time/*", "min"),),
        bar=">= 15",
    ),
    *(
        Claim(
            f"Time to random places {where}, kinematic against full contact: largest difference (median of all)",
            "{0:.1f} % ({1:+.1f} %)",
            tuple(
                Value("swarm", f"kinematic/times/{ground}/{which}_difference", scale=PERCENT)
                for which in ("largest", "median")
            ),
            bar="<= 10 %",
        )
        for ground, where in _GROUNDS.items()
    ),
    Claim(
        "Many swarms of eight stepped at once: times faster than one after the other, at most; numbers of their states "
        "that differ",
        "{0:.1f}; {1}",
        (Value("swarm", "batch/times_faster"), Value("swarm", "batch/different_numbers")),
        bar="<= 0",
        bar_index=1,
    ),
    *(
        Claim(
            f"Random commands for robots {how}: robots lost, states that are not finite, of decisions",
            "{0}, {1} of {2}",
            tuple(Value("swarm", f"random/{level}/{name}") for name in ("lost", "not_finite", "steps")),
            bar="<= 0",
        )
        for level, how in _LEVELS.items()
    ),
    *(
        Claim(
            f"The same commands for robots {how}: deepest contact; largest gain of energy of robots at rest",
            "{0:.1f} mm; {1:.2g} mJ",
            (
                Value("swarm", f"random/{level}/deepest", scale=1e3),
                Value("swarm", f"random/{level}/gain", scale=1e3),
            ),
            bar="<= 1 mJ",
            bar_index=1,
        )
        for level, how in _LEVELS.items()
    ),
    Claim(
        "Docking trials as those of real robots, on the half that nothing was fitted to: locked; 1 if the rate lies "
        "within the 95 % interval of the real ones",
        "{1} of {2}; {0:d}",
        (
            Value("swarm", "docking/rate_within"),
            Value("swarm", "docking/simulated_judged/locked"),
            Value("swarm", "docking/simulated_judged/trials"),
        ),
        bar=">= 1",
    ),
    Claim(
        "The same trials: median time from LocateBeacon to Locking (real robots on the same half); 1 if within 25-45 s",
        "{1:.1f} s ({2:.1f} s); {0:d}",
        (
            Value("swarm", "docking/median_within"),
            Value("swarm", "docking/simulated_judged/quantiles_s/0.5"),
            Value("swarm", "docking/hardware_judged/quantiles_s/0.5"),
        ),
        bar=">= 1",
    ),
    *(
        Claim(
            f"Eight scattered robots gather, cross the pit of {where} as one body and part: successes of trials",
            "{0} of {1}",
            (
                Value("swarm", f"story/{arena}/successes"),
                Value("swarm", f"story/{arena}/stories/*/success", "count"),
            ),
            bar=">= 16",
        )
        for arena, where in _PLACES.items()
    ),
    Claim(
        "The same without docking: successes of trials",
        "{0} of {1}",
        (
            Value("swarm", "story/without_docking/successes"),
            Value("swarm", "story/without_docking/trials"),
        ),
        bar="<= 0",
    ),
    *(
        Claim(
            f"Weights of the behaviors evolved by CMA-ES, five searches: median time in which four robots assemble in "
            f"{words} (the first weights); 1 if the 95 % intervals are disjoint",
            "{1:.0f} s ({2:.0f} s); {0:d}",
            (
                Value("swarm", f"weights/{arena}/disjoint"),
                Value("swarm", f"weights/{arena}/evolved/median"),
                Value("swarm", f"weights/{arena}/authors/median"),
            ),
            bar=">= 1",
        )
        for arena, words in (("gsrm", "the scanned arena"), ("truth", "the true course"))
    ),
)
