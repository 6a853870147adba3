"""Cost of imports and of the first call."""

from benchmarks.figures import Claim, Value

IMPORTS = (
    Claim(
        "`import symbrion_gym`: processor time relative to `import mujoco, gymnasium, trimesh` (memory)",
        "{0:.2f} ({1:.0f} MB)",
        (
            Value("imports", "import symbrion_gym/cpu_ratio"),
            Value("imports", "import symbrion_gym/memory_mb"),
        ),
        bar="<= 1.4",
    ),
    Claim(
        "`gym.make` and `reset` with the arena gsrm, import included: processor time relative to `import mujoco, "
        "gymnasium, trimesh` (memory)",
        "{0:.2f} ({1:.0f} MB)",
        (
            Value("imports", "gym.make and reset, gsrm/cpu_ratio"),
            Value("imports", "gym.make and reset, gsrm/memory_mb"),
        ),
    ),
    Claim(
        "Error message of `symbrion evolve --arena nonsense`: processor time until it appears",
        "{0:.1f} s",
        (Value("imports", "symbrion evolve --arena nonsense/cpu_seconds"),),
        bar="<= 2 s",
    ),
)
