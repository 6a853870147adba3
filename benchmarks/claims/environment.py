"""Speed and validity of the environment."""

from benchmarks.figures import Claim, Value


def _speed(arena: str) -> Value:
    return Value("environment", f"speed/{arena}: robot-seconds per second")


def _agreement(part: str, key: str) -> tuple[Value, Value]:
    path = f"{part}/{key}"
    return (
        Value("environment", path, pattern=r"(\d+) of \d+ agree"),
        Value("environment", path, pattern=r"of (\d+) agree"),
    )


def _successes(pit: str) -> tuple[Value, ...]:
    paths = (f"tracks/pit {pit}: {tracks}" for tracks in ("spheres", "wheels", "cylinders"))
    return tuple(Value("environment", path, pattern=r"(\d+) successes") for path in paths)


ENVIRONMENT = (
    Claim(
        "Real-time factor of the whole snake of 8 modules (simulated time divided by processor time), one thread, in "
        "the arenas truth / gsrm / gg",
        "{0:.0f} / {1:.0f} / {2:.0f}",
        (_speed("truth"), _speed("gsrm"), _speed("gg")),
        bar=">= 60 on gsrm",
        bar_index=1,
        is_headline=True,
    ),
    Claim(
        "Processor time of `env.step` relative to the `mj_step` calls alone, arena gsrm",
        "{0:.2f}",
        (Value("environment", "speed/gsrm: over bare mj_step"),),
        bar="<= 1.10",
    ),
    Claim(
        "Processor time of a vector environment of 16 on one thread relative to `mj_step` alone, arena gsrm",
        "{0:.2f}",
        (Value("environment", "speed/gsrm: 16 at once over bare"),),
        bar="<= 1.10",
        set_after=True,
    ),
    Claim(
        "Processor time of `reset`, arena gsrm",
        "{0:.1f} ms",
        (Value("environment", "speed/gsrm: reset [ms]"),),
        bar="<= 2 ms",
    ),
    Claim(
        "Vector environment: speedup by a second thread",
        "{0:.2f}",
        (Value("environment", "threads/two threads over one"),),
        bar=">= 1.7 on an idle machine",
    ),
    Claim(
        "30 random controllers, pit of 0.30 m: same outcome (crosses or fails) with a physics timestep of 5 ms as "
        "with 1 ms",
        "{0} of {1}",
        _agreement("timestep", "pit 0.30"),
        bar=">= 28 of 30",
    ),
    Claim(
        "30 random controllers, pit of 0.35 m: same outcome with a physics timestep of 5 ms as with 1 ms",
        "{0} of {1}",
        _agreement("timestep", "pit 0.35"),
        bar=">= 28 of 30",
    ),
    Claim(
        "30 random controllers, pit of 0.35 m: same outcome with tracks made of spheres as with wheels on joints",
        "{0} of {1}",
        _agreement("tracks", "pit 0.35: wheels"),
        bar=">= 27 of 30",
    ),
    Claim(
        "30 random controllers, pit of 0.35 m: same outcome with tracks made of spheres as with the authors' cylinders",
        "{0} of {1}",
        _agreement("tracks", "pit 0.35: cylinders"),
        bar=">= 27 of 30",
    ),
    Claim(
        "30 random controllers, pit of 0.30 m: number that cross on tracks made of spheres / on wheels / on the "
        "authors' cylinders",
        "{0} / {1} / {2}",
        _successes("0.30"),
    ),
    Claim(
        "30 random controllers, pit of 0.35 m: number that cross on tracks made of spheres / on wheels / on the "
        "authors' cylinders",
        "{0} / {1} / {2}",
        _successes("0.35"),
    ),
    Claim(
        "Audit (an independent second check) of all successes in episodes of random + evolved controllers: successes "
        "rejected",
        "{0} in {1:,} + {2:,}",
        (
            Value("environment", "cheats/cheats"),
            Value("environment", "cheats/counts/random episodes | cheats/episodes/random"),
            Value("environment", "cheats/counts/evolved episodes | cheats/episodes/evolved"),
        ),
        bar="<= 0",
        is_headline=True,
    ),
    Claim(
        "Audit of all successes of six tasks with 11 bodies in 4 arenas, random + evolved controllers: successes "
        "rejected; cells of 264 with both",
        "{0} of {1:,} + {2:,} in {3:,} + {4:,} episodes; {5}",
        (
            Value("audit", "cheats/cheats"),
            Value("audit", "cheats/counts/random successes"),
            Value("audit", "cheats/counts/evolved successes"),
            Value("audit", "cheats/counts/random episodes"),
            Value("audit", "cheats/counts/evolved episodes"),
            Value("audit", "cheats/cells"),
        ),
        bar="<= 0",
    ),
    Claim(
        "Steps with random options and invalid actions; values that were not finite",
        "{0:,}; {1}",
        (
            Value("environment", "robustness/counts/steps"),
            Value("environment", "robustness/counts/not finite"),
        ),
        bar="<= 0",
        bar_index=1,
    ),
    Claim(
        "Memory growth over 1,000 resets",
        "{0:.1f} MB",
        (Value("environment", "memory/after resets [MB]"),),
    ),
)
