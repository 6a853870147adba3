"""Which code each part of the results measures: once it changes, the figures are shown as old.

Places are folders, files, or `file.py::name` for one definition. Of a benchmark's own script only what measures
counts, not what chooses parts, prints and writes. The longest key that begins a part's "file/part" decides; a claim
may name others by `sources`.
"""

_NETWORKS = (
    "reconstruction/reconstruct.py",
    "reconstruction/reconstruction.py",
    "reconstruction/geometry",
    "reconstruction/networks",
    "reconstruction/surfaces",
)
_COURSE = ("symbrion_gym/arenas/course.py",)
_PIECES = ("reconstruction/geometry", "symbrion_gym/arenas", "symbrion_gym/contact")
_ROBOT = (
    "symbrion_gym/robot",
    "symbrion_gym/environment",
    "symbrion_gym/tasks",
    *_COURSE,
    "symbrion_gym/arenas/spec.py",
)
_READY_MADE = ("assets/arenas",)
_SCANS = ("reconstruction/scans", "benchmarks/scans.py")
_SURFACES = ("benchmarks/material/arena_surfaces.py",)
_REAL_SCANS = (
    "cloud_to_arena",
    "contact_judge",
    "goal_driving",
    "made_scenes",
    "open3d_peer",
    "pursuit",
    "scan_sources",
    "snake_steps",
    "tracked_robot",
)
_PHYSICS = ("worlds", "theory", "wheels", "laws", "energy", "bars", "published")
_RECORDS = ("evolution/search/record.py", "evolution/search/run.py")
_TRIAL = ("evolution/controllers", "evolution/backends", "evolution/search/evaluation.py")
_SEARCH = (
    *_TRIAL,
    *(
        f"evolution/search/{name}.py"
        for name in ("cmaes", "config", "loop", "stages", "restarting_search", "validation")
    ),
)
_TRIALS = (*_TRIAL, *_ROBOT)
"""What tries a genotype, without any search."""
_EVOLUTION = (*_SEARCH, "evolution/champions/playback.py", *_ROBOT, *_READY_MADE)
_RUNS = (*_EVOLUTION, "benchmarks/evolution.py::BASE")
_MACHINE = "benchmarks/evolution_machine.py"
_SWARM = (
    "symbrion_gym/robot",
    *(
        f"symbrion_gym/swarm/{name}"
        for name in (
            "docks.py",
            "dynamic",
            "kinematic",
            "mixed.py",
            "senses.py",
            "sight.py",
            "signals",
            "starts.py",
        )
    ),
    *_COURSE,
    *_READY_MADE,
)

SOURCES: dict[str, tuple[str, ...]] = {
    "scans": (*_SCANS, "symbrion_gym/sensing", *_COURSE),
    "scans/real_scan": _SCANS,
    "reconstruction": (
        *_NETWORKS,
        *_COURSE,
        "benchmarks/material/clouds.py",
        "benchmarks/reconstruction.py::measure_sizes",
    ),
    "reconstruction/scaling": (*_NETWORKS, "benchmarks/reconstruction.py::measure_scaling"),
    "reconstruction/start": (*_NETWORKS, "benchmarks/reconstruction.py::measure_cold_start"),
    "folds": (*_NETWORKS, "benchmarks/folds.py::_count", "benchmarks/folds.py::survey_course"),
    "color": (
        *_NETWORKS,
        *_COURSE,
        "symbrion_gym/arenas/color_patterns.py",
        "symbrion_gym/arenas/texture.py",
        "symbrion_gym/arenas/texture_atlas.py",
        "symbrion_gym/sensing",
        "benchmarks/material/color_judge.py",
        "benchmarks/material/made_scenes.py",
        "benchmarks/color.py::color_scan",
        "benchmarks/color.py::measure_cost",
    ),
    "refine": (
        *_NETWORKS,
        *_COURSE,
        "benchmarks/material/changes.py",
        "benchmarks/refine.py::measure_change",
    ),
    "friction": (
        "reconstruction/slip",
        "symbrion_gym/sensing/friction_drive.py",
        "symbrion_gym/sensing/friction_robot.py",
        "symbrion_gym/sensing/slip_sensors.py",
        "symbrion_gym/arenas/friction_map.py",
        "symbrion_gym/arenas/friction_pieces.py",
        "symbrion_gym/robot",
        *_COURSE,
        "benchmarks/material/friction_courses.py",
        "benchmarks/friction.py::measure_patches",
    ),
    "beyond": (
        *_SEARCH,
        *_ROBOT,
        *_READY_MADE,
        "evolution/bodies",
        "evolution/body_search",
        "evolution/champions/playback.py",
        "benchmarks/material/beyond.py",
        "benchmarks/beyond.py::measure",
    ),
    "beyond/rubble": (
        *_SEARCH,
        *_ROBOT,
        "evolution/bodies",
        "evolution/body_search",
        "evolution/champions/playback.py",
        "benchmarks/material/beyond.py",
        "benchmarks/material/rubble.py",
        "benchmarks/beyond.py::measure",
    ),
    "landscape": (
        "assets/landscape",
        "evolution/bodies",
        "evolution/body_search/algorithms",
        "evolution/body_search/prediction.py",
        "evolution/landscape/reliability.py",
        "evolution/landscape/replay.py",
        "evolution/landscape/scores.py",
    ),
    "landscape/longer": (
        "evolution/bodies",
        "evolution/body_search/learner.py",
        "evolution/body_search/learning.py",
        "evolution/landscape/config.py",
        "evolution/landscape/longer.py",
    ),
    "cheap_trials": (
        "evolution/search",
        *_READY_MADE,
        "benchmarks/material/cheap_trials.py",
        "benchmarks/cheap_trials.py::_measure",
        "benchmarks/cheap_trials.py::summarize",
    ),
    "living": (
        *_NETWORKS,
        *_COURSE,
        *_PIECES,
        "evolution/experiments/live",
        "benchmarks/material/changes.py",
        "benchmarks/living.py::measure_change",
        "benchmarks/living.py::measure_update",
        "benchmarks/living.py::measure_room",
    ),
    "arena": (*_NETWORKS, *_PIECES, *_SURFACES, "benchmarks/arena.py::measure_accuracy"),
    "arena/behaviour": (
        *_NETWORKS,
        *_PIECES,
        *_ROBOT,
        *_SURFACES,
        "benchmarks/material/arena_drives.py",
        "benchmarks/material/crossings.py",
    ),
    "arena/sled": (*_PIECES, *_READY_MADE, "benchmarks/material/sleds.py"),
    "arena/wheel": (*_PIECES, *_READY_MADE, "benchmarks/material/sleds.py"),
    "arena/scans": (*_NETWORKS, *_PIECES, "symbrion_gym/sensing", "benchmarks/material/ray_casts.py"),
    "arena/random_rays": (*_NETWORKS, *_PIECES, "symbrion_gym/sensing", "benchmarks/material/ray_casts.py"),
    "arena/steps_us": (*_NETWORKS, *_PIECES, *_ROBOT, "benchmarks/material/arena_drives.py"),
    "real_scans": (
        *_NETWORKS,
        *_PIECES,
        "reconstruction/scans",
        *(f"benchmarks/material/{name}.py" for name in _REAL_SCANS),
    ),
    "primitives": (
        *_NETWORKS,
        "reconstruction/surfaces/primitives",
        "symbrion_gym/arenas/primitives.py",
        "benchmarks/material/plain_rooms.py",
        "benchmarks/primitives.py::measure_scene",
    ),
    "objects": (
        "reconstruction/objects",
        "reconstruction/geometry",
        "benchmarks/material/known_objects.py",
        "benchmarks/material/object_rooms.py",
        "benchmarks/objects.py::judge",
    ),
    "environment": (*_ROBOT, *_READY_MADE),
    "environment/cheats": (*_ROBOT, "benchmarks/material/cheats.py", "benchmarks/material/crossings.py"),
    "environment/robustness": (*_ROBOT, "benchmarks/material/robustness.py"),
    "environment/tracks": (*_ROBOT, "benchmarks/material/crossings.py"),
    "environment/timestep": (*_ROBOT, "benchmarks/material/crossings.py"),
    "environment/speed": (*_ROBOT, *_READY_MADE, "benchmarks/environment.py::_measure_speed"),
    "imports": (
        "reconstruction/__init__.py",
        "reconstruction/lazy.py",
        "symbrion_gym/__init__.py",
        "evolution/__init__.py",
        "evolution/cli",
    ),
    "baselines": (*_TRIALS, "benchmarks/baselines.py::count_crossings"),
    "baselines/learning": (
        *_ROBOT,
        *_READY_MADE,
        "evolution/controllers",
        "evolution/search/cmaes.py",
        "symbrion_gym/adapters",
        "benchmarks/material/learning.py",
        "benchmarks/material/learning_run.py",
        "benchmarks/material/simple_policy.py",
    ),
    "audit": (*_ROBOT, *_READY_MADE, "benchmarks/material/audited_tasks.py"),
    "evolution": _RUNS,
    "evolution/abyss": (*_RUNS, *_NETWORKS, *_PIECES),
    "evolution/models": (*_RUNS, *_NETWORKS, *_PIECES),
    "evolution/stages": (*_RUNS, *_NETWORKS, *_PIECES),
    "evolution/body_length": (*_RUNS, "benchmarks/evolution.py::BODIES"),
    "evolution/overhead": (*_EVOLUTION, f"{_MACHINE}::measure_overhead"),
    "evolution/workers": (*_EVOLUTION, f"{_MACHINE}::measure_workers"),
    "evolution/backends": (*_EVOLUTION, f"{_MACHINE}::measure_backends"),
    "evolution/kills": (*_SEARCH, *_RECORDS, f"{_MACHINE}::measure_kills"),
    "physics": (
        "symbrion_gym/robot",
        *(f"benchmarks/material/physics_{name}.py" for name in _PHYSICS),
    ),
    "physics/price": (*_TRIALS, *_READY_MADE, "benchmarks/material/physics_contact.py"),
    "swarm/docks": (*_SWARM, "benchmarks/material/swarm_docks.py"),
    "swarm/speed": (*_SWARM, "benchmarks/material/swarm_docks.py::measure_speed"),
    "swarm/crossing": (
        *_SWARM,
        "evolution/champions/docked.py",
        "benchmarks/material/swarm_docks.py::assemble",
        "benchmarks/material/swarm_crossing.py",
    ),
    "swarm/kinematic": (*_SWARM, "benchmarks/material/swarm_kinematic.py"),
    "swarm/batch": (*_SWARM, "benchmarks/material/swarm_batch.py"),
    "swarm/random": (*_SWARM, "benchmarks/material/swarm_random.py"),
    "swarm/weights": (
        *_SWARM,
        "symbrion_gym/swarm/behavior",
        "evolution/experiments/swarm",
        "benchmarks/material/swarm_weights.py",
    ),
    "swarm": (
        *_SWARM,
        "symbrion_gym/swarm/behavior",
        "evolution/experiments/swarm",
        "benchmarks/material/swarm_behavior.py",
    ),
    "warp": (
        *_ROBOT,
        *_READY_MADE,
        "symbrion_gym/warp/batch.py",
        "symbrion_gym/warp/model_fields.py",
        "symbrion_gym/warp/requirements.py",
        "benchmarks/material/warp_parity.py",
        "benchmarks/material/warp_steps.py",
    ),
    "warp/speed": (*_ROBOT, "symbrion_gym/warp", "benchmarks/material/warp_speed.py"),
    "warp/generation": (*_TRIALS, "symbrion_gym/warp", "benchmarks/material/warp_speed.py"),
    "warp/determinism": (*_ROBOT, "symbrion_gym/warp", "benchmarks/material/warp_determinism.py"),
    "warp/ppo": (
        *_ROBOT,
        "symbrion_gym/warp",
        *(
            f"examples/train_ppo_gpu.py::{name}"
            for name in ("OPTIONS", "Settings", "train", "take_step", "learn", "find_loss")
        ),
        "benchmarks/material/warp_ppo.py::measure_ppo",
        "benchmarks/material/warp_ppo.py::ON_PROCESSOR",
    ),
    "warp/networks": (*_NETWORKS, "benchmarks/material/warp_speed.py"),
    "searches": (
        *_SEARCH,
        *(f"evolution/search/{name}.py" for name in ("archive", "elites", "islands", "strategy")),
        *_ROBOT,
        *_READY_MADE,
        "benchmarks/searches.py",
    ),
    "staircase": (
        *_NETWORKS,
        *_PIECES,
        "reconstruction/scans/formats.py",
        "benchmarks/material/stairs.py",
        "benchmarks/staircase.py",
    ),
    "staircase/drives": (
        *_NETWORKS,
        *_PIECES,
        *_ROBOT,
        "evolution/controllers",
        "benchmarks/staircase.py",
    ),
}


def find_sources(file: str, part: str) -> tuple[str, ...]:
    """Return the places of the code that a part of a benchmark's results measures.

    Raises:
        KeyError: the benchmark has none.
    """
    whole = f"{file}/{part}"
    keys = [key for key in SOURCES if whole.startswith(key)]
    if not keys:
        raise KeyError(f"benchmarks/claims/sources.py names no code for the results of {file!r}")
    return SOURCES[max(keys, key=len)]
