"""A robot updates the model of a place that has changed: survey, champion, drive, refine, update, judge."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import trimesh

import evolution as ev
import reconstruction as rc
import symbrion_gym as sg
from evolution._src.experiments.demo.demo import Track
from evolution._src.experiments.live.drive import DriveConfig, Readings, drive_round
from evolution._src.experiments.live.ground import FeltFriction, compare_friction, feel_ground, load_slip
from evolution._src.experiments.live.matching import DrivenPoints, MatchConfig, find_points
from evolution._src.experiments.live.route import plan_round
from evolution._src.experiments.live.scene import SceneConfig, find_regions, make_truth
from evolution._src.experiments.output_folder import refuse_foreign_files
from evolution._src.experiments.run_champion import find_run_champion
from reconstruction._src.base.atomic_write import write_atomically
from reconstruction._src.base.bounded_read import read_npz
from reconstruction._src.base.typed_json import JsonError, read_json
from reconstruction._src.geometry.sampling import sample_area
from reconstruction._src.networks.change.absence import AbsenceConfig
from reconstruction._src.networks.change.detection import ChangeConfig
from reconstruction._src.networks.change.free_space import FreeSpaceConfig
from reconstruction._src.networks.gsrm.refinement_config import GSRMRefinementConfig
from reconstruction._src.slip.readings import SlipReadings
from reconstruction._src.surfaces.quality import find_distances
from symbrion_gym._src.ready_made import SPACING
from symbrion_gym._src.sensing.friction_robot import FrictionRobot

MARKER = "live.json"
"""The file that the command writes first; it holds what the other files were made with."""
OUTPUTS = (
    *("before.npz", "readings.npz", "refined.npz", "slip.npz", "after.npz"),
    *("arenas", "run", "models.png", "results.json"),
)
_SAMPLES = 40_000
"""Places of the true surface on which the error of a model is measured."""
RAYS_ONLY = ChangeConfig(
    moved_share=0.03,
    compared_per_face=12,
    absence=AbsenceConfig(complete_share=2.0, min_patch=1_000_000),
    free_space=FreeSpaceConfig(max_rays=65_536),
    num_probes=20_000,
)
"""A part is gone only where rays go through it: one fan of beams leaves gaps between readings, which show nothing.

All readings are compared, and few that disagree suffice: the floor beside a new wall has many more that agree. They are
compared with many old readings: with one or two of them for each unit, all new ones at a box may disagree by chance.
"""
LOCAL = GSRMRefinementConfig(min_confirmations=1e9)
"""Units that a few readings have missed next to a change are not gone with it."""
Made = TypeVar("Made")


@dataclass(frozen=True)
class LiveConfig:
    """Configuration of `run_live`.

    Attributes:
        folder: output folder.
        seed: decides everything, as its results are equal for equal seeds.
        scene: what has changed.
        drive: how the Scout drives and is localized.
        match: how its readings become points.
        feel: how docked Scouts feel the ground.
        modules: number of modules of the champion.
        units: units of the network.
        generations: limit of the champion's evolution in the model before.
        trials: randomized trials in which the champion is judged in each arena.
        workers: threads; the results do not depend on their number.
    """

    folder: Path
    seed: int = 0
    scene: SceneConfig = field(default_factory=SceneConfig)
    drive: DriveConfig = field(default_factory=DriveConfig)
    match: MatchConfig = field(default_factory=MatchConfig)
    feel: FrictionRobot = field(default_factory=lambda: FrictionRobot(spacing=0.25))
    modules: int = 8
    units: int = 2200
    generations: int = 4
    trials: int = 20
    workers: int = 1

    def describe(self) -> dict[str, Any]:
        """Return what decides the results, for JSON."""
        fields = dataclasses.asdict(self)
        return json.loads(
            json.dumps({name: fields[name] for name in fields if name not in ("folder", "workers")})
        )


@dataclass
class LiveResult:
    """What a robot has learned of a place that has changed.

    Attributes:
        errors: change, or "elsewhere" -> mean distance of the true surface there from the model, before and after [m].
        friction: "ice" or "other ground" -> friction there; the model after has what docked Scouts felt.
        successes: control ("champion", "zero", "random") -> arena ("model before", "model after", "truth before",
            "truth now") -> trials in which it succeeded.
        trials: of these.
        update: what `update_arena` noted.
        localization: mean error of the Scout's position, as told and as matched [m].
        num_points: points that the drive gave.
        arenas: "before" and "after".
        truths: "before" and "after".
    """

    errors: dict[str, tuple[float, float]]
    friction: dict[str, FeltFriction]
    successes: dict[str, dict[str, int]]
    trials: int
    update: dict[str, Any]
    localization: tuple[float, float]
    num_points: int
    arenas: dict[str, sg.Arena]
    truths: dict[str, sg.Arena]

    def as_dict(self) -> dict[str, Any]:
        """Return the figures, for JSON."""
        return {
            "errors": {name: list(pair) for name, pair in self.errors.items()},
            "friction": {name: felt._asdict() for name, felt in self.friction.items()},
            "successes": self.successes,
            "trials": self.trials,
            "update": self.update,
            "localization": list(self.localization),
            "points": self.num_points,
        }


def run_live(config: LiveConfig, track: Track) -> LiveResult:
    """Run all steps; those that an earlier run with the same configuration has finished are read from the folder.

    Args:
        config: the configuration.
        track: starts a step of the progress display.

    Raises:
        RunError: the folder holds other files, or the results of another configuration; or a step fails.
    """
    claim_folder(config)
    folder = config.folder
    truths = {
        "before": make_truth(config.scene, is_changed=False),
        "after": make_truth(config.scene, is_changed=True),
    }
    with track("1/7 survey and model before") as step:
        before = _make_or_load(
            folder / "before.npz", rc.Reconstruction.load, lambda: _scan(config, truths, step.progress)
        )
        arena = _make_or_load(
            folder / "arenas" / "before",
            sg.Arena.load,
            lambda: _without_time(sg.make_arena(before, name="before", cache=False, progress=step.progress)),
        )
    with track("2/7 champion in the model before") as step:
        champion = _find_champion(config, step.progress)
    with track("3/7 a Scout drives through the changed place") as step:
        readings = _make_or_load(
            folder / "readings.npz",
            _load_readings,
            lambda: drive_round(
                truths["after"], plan_round(config.scene), config.drive, config.seed, step.progress
            ),
        )
        driven = find_points(readings, before.mesh, config.match, config.drive)
    with track("4/7 refine") as step:
        refined = _make_or_load(
            folder / "refined.npz",
            rc.Reconstruction.load,
            lambda: before.refine(
                driven.points, config.seed, step.progress, origins=driven.origins, free_rays=driven.free_rays
            ),
        )
    with track("5/7 docked Scouts feel the ground") as step:
        slip = _make_or_load(
            folder / "slip.npz",
            load_slip,
            lambda: feel_ground(
                truths["after"], arena, refined.mesh, config.scene, config.feel, config.seed, step.progress
            ),
        )
        after = _make_or_load(folder / "after.npz", rc.Reconstruction.load, lambda: refined.refine(slip=slip))
    with track("6/7 arena, where it has changed") as step:
        updated = _make_or_load(
            folder / "arenas" / "after",
            sg.Arena.load,
            lambda: _without_time(
                dataclasses.replace(sg.update_arena(arena, after, progress=step.progress), name="after")
            ),
        )
    arenas = {"before": arena, "after": updated}
    with track("7/7 the champion is judged") as step:
        successes = _judge(config, champion, arenas, truths, step.progress)
    result = _summarize(config, arenas, truths, driven, successes)
    with write_atomically(folder / "results.json") as beside:
        beside.write_text(json.dumps(result.as_dict(), indent=2) + "\n")
    return result


def claim_folder(config: LiveConfig) -> None:
    """Write `live.json`, which tells a later run what the files were made with.

    Raises:
        RunError: the folder holds files that this command did not write, or results of another configuration.
    """
    marker = config.folder / MARKER
    refuse_foreign_files(config.folder, MARKER, OUTPUTS)
    try:
        known = read_json(marker) if marker.exists() else None
    except JsonError as error:
        raise ev.RunError(f"{marker} is damaged ({error}); name another folder, or remove it") from error
    if known is not None and known != config.describe():
        raise ev.RunError(
            f"{config.folder} holds results of other options; name another folder, or remove it to begin again"
        )
    config.folder.mkdir(parents=True, exist_ok=True)
    with write_atomically(marker) as beside:
        beside.write_text(json.dumps(config.describe(), indent=2) + "\n")


def measure_errors(
    scene: SceneConfig, truth: trimesh.Trimesh, meshes: list[trimesh.Trimesh]
) -> dict[str, tuple[float, ...]]:
    """Return for each change, and elsewhere, the mean distance of the true surface from each mesh [m].

    Args:
        scene: what has changed.
        truth: the true surface now.
        meshes: of models.
    """
    places = sample_area(np.asarray(truth.vertices), np.asarray(truth.faces), _SAMPLES)
    found, is_elsewhere = {}, np.ones(len(places), dtype=bool)
    for region in find_regions(scene):
        own = places[region.contains(places)]
        distances = [
            find_distances(own, np.asarray(mesh.vertices), np.asarray(mesh.faces)) for mesh in meshes
        ]
        found[region.name] = tuple(float(distance.mean()) for distance in distances)
        is_elsewhere &= ~region.contains(places)
    rest = [
        find_distances(places[is_elsewhere], np.asarray(mesh.vertices), np.asarray(mesh.faces))
        for mesh in meshes
    ]
    found["elsewhere"] = tuple(float(distance.mean()) for distance in rest)
    return found


def _make_or_load(path: Path, load: Callable[[Path], Made], make: Callable[[], Any]) -> Made:
    """Return what an earlier run has saved, else make it, save it, and return what was saved."""
    if not path.exists():
        made = make()
        path.parent.mkdir(parents=True, exist_ok=True)
        if isinstance(made, Readings | SlipReadings):
            arrays: dict[str, Any] = made._asdict() if isinstance(made, Readings) else made.as_arrays()
            with write_atomically(path) as beside, beside.open("wb") as file:
                np.savez_compressed(file, **arrays)
        else:
            made.save(path)
    return load(path)


def _load_readings(path: Path) -> Readings:
    arrays = read_npz(path)
    try:
        return Readings(*(arrays[name] for name in Readings._fields))
    except KeyError as error:
        raise ev.RunError(
            f"{path} holds no readings of a drive ({error}); remove it to drive again"
        ) from error


def _scan(config: LiveConfig, truths: dict[str, sg.Arena], progress: rc.Progress) -> rc.Reconstruction:
    log = sg.survey(truths["before"], seed=config.seed, progress=progress)
    points = rc.thin(rc.preprocess(log), SPACING)
    return rc.reconstruct(
        points, units=config.units, seed=config.seed, change=RAYS_ONLY, refinement=LOCAL, progress=progress
    )


def _without_time(arena: sg.Arena) -> sg.Arena:
    """Return the arena without the time that it took: equal seeds make equal files."""
    return dataclasses.replace(arena, quality=dataclasses.replace(arena.quality, seconds=0.0))


def _find_champion(config: LiveConfig, progress: rc.Progress) -> ev.Champion:
    """Return the champion of the model before; an unfinished evolution goes on."""
    arena = str(config.folder / "arenas" / "before")
    return find_run_champion(
        config.folder / "run",
        arena,
        config.modules,
        config.seed,
        config.generations,
        config.workers,
        progress,
    )


def _judge(
    config: LiveConfig,
    champion: ev.Champion,
    arenas: dict[str, sg.Arena],
    truths: dict[str, sg.Arena],
    progress: rc.Progress,
) -> dict[str, dict[str, int]]:
    """Return the successes of the champion, of no control, and of a random one in each arena."""
    rng = np.random.default_rng((config.seed, 2))
    genes = {
        "champion": np.asarray(champion.genotype),
        "zero": np.zeros(len(champion.genotype)),
        "random": rng.uniform(-1.0, 1.0, len(champion.genotype)),
    }
    places = {
        "model before": arenas["before"],
        "model after": arenas["after"],
        "truth before": truths["before"],
        "truth now": truths["after"],
    }
    found: dict[str, dict[str, int]] = {name: {} for name in genes}
    for number, (name, place) in enumerate(places.items()):
        progress(name, number / len(places))
        for control, genotype in genes.items():
            tried = champion if control == "champion" else dataclasses.replace(champion, genotype=genotype)
            outcome = ev.judge(tried, place, config.trials, config.seed, workers=config.workers)
            found[control][name] = int(outcome.successes)
    return found


def _summarize(
    config: LiveConfig,
    arenas: dict[str, sg.Arena],
    truths: dict[str, sg.Arena],
    driven: DrivenPoints,
    successes: dict[str, dict[str, int]],
) -> LiveResult:
    meshes = [arenas["before"].surface, arenas["after"].surface]
    errors = measure_errors(config.scene, truths["after"].surface, meshes)
    return LiveResult(
        errors={name: (pair[0], pair[1]) for name, pair in errors.items()},
        friction=compare_friction(config.scene, truths["after"], arenas["before"], arenas["after"]),
        successes=successes,
        trials=config.trials,
        update=dict(arenas["after"].provenance.get("update", {})),
        localization=(driven.told_error, driven.matched_error),
        num_points=len(driven.points),
        arenas=arenas,
        truths=truths,
    )
