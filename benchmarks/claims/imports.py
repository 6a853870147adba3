"""What it costs to begin."""

from benchmarks.figures import Claim, Value

IMPORTS = (
    Claim(
        "`import symbrion_gym`, processor time, as a share of that of `import mujoco, gymnasium, trimesh` (memory)",
        "{0:.2f} ({1:.0f} MB)",
        (
            Value("imports", "import symbrion_gym/cpu_ratio"),
            Value("imports", "import symbrion_gym/memory_mb"),
        ),
        bar="<= 1.4",
    ),
    Claim(
        "the same for `gym.make` and `reset` on gsrm, import included (memory)",
        "{0:.2f} ({1:.0f} MB)",
        (
            Value("imports", "gym.make and reset, gsrm/cpu_ratio"),
            Value("imports", "gym.make and reset, gsrm/memory_mb"),
        ),
    ),
    Claim(
        "a refusal, `symbrion evolve --arena nonsense`, processor time (on an idle machine the clock shows the same)",
        "{0:.1f} s",
        (Value("imports", "symbrion evolve --arena nonsense/cpu_seconds"),),
        bar="<= 2 s",
    ),
)
