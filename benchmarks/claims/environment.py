"""Speed and honesty of the environment."""

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
        "robot-seconds per second, 8 modules, one thread: truth / gsrm / gg",
        "{0:.0f} / {1:.0f} / {2:.0f}",
        (_speed("truth"), _speed("gsrm"), _speed("gg")),
        bar=">= 60 on gsrm",
        judged=1,
        is_headline=True,
    ),
    Claim(
        "`env.step` against bare `mj_step`, gsrm",
        "{0:.2f}",
        (Value("environment", "speed/gsrm: over bare mj_step"),),
        bar="<= 1.10",
    ),
    Claim(
        "the same for 16 simulations at once, one thread",
        "{0:.2f}",
        (Value("environment", "speed/gsrm: 16 at once over bare"),),
        bar="<= 1.10",
        set_after=True,
    ),
    Claim(
        "`reset`, gsrm",
        "{0:.1f} ms",
        (Value("environment", "speed/gsrm: reset [ms]"),),
        bar="<= 2 ms",
    ),
    Claim(
        "vector environment: two threads over one",
        "{0:.2f}",
        (Value("environment", "threads/two threads over one"),),
        bar=">= 1.7 on an idle machine",
    ),
    Claim(
        "5 ms physics agrees with 1 ms on who crosses, pit 0.30 m",
        "{0} of {1}",
        _agreement("timestep", "pit 0.30"),
        bar=">= 28 of 30",
        is_headline=True,
    ),
    Claim(
        "5 ms physics agrees with 1 ms on who crosses, pit 0.35 m",
        "{0} of {1}",
        _agreement("timestep", "pit 0.35"),
        bar=">= 28 of 30",
    ),
    Claim(
        "sphere tracks agree with wheels on joints, pit 0.35 m",
        "{0} of {1}",
        _agreement("tracks", "pit 0.35: wheels"),
        bar=">= 27 of 30",
    ),
    Claim(
        "sphere tracks agree with the authors' cylinders, pit 0.35 m",
        "{0} of {1}",
        _agreement("tracks", "pit 0.35: cylinders"),
        bar=">= 27 of 30",
    ),
    Claim(
        "of these 30 controllers cross a pit of 0.30 m: spheres / wheels / cylinders",
        "{0} / {1} / {2}",
        _successes("0.30"),
    ),
    Claim(
        "the same at 0.35 m",
        "{0} / {1} / {2}",
        _successes("0.35"),
    ),
    Claim(
        "cheats found by a second judge among the successes of random and of evolved episodes",
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
        "steps with random options and with actions that no one should send; numbers that were not finite",
        "{0:,}; {1}",
        (
            Value("environment", "robustness/counts/steps"),
            Value("environment", "robustness/counts/not finite"),
        ),
        bar="<= 0",
        judged=1,
    ),
    Claim(
        "growth of the process over 1,000 resets",
        "{0:.1f} MB",
        (Value("environment", "memory/after resets [MB]"),),
    ),
)
