"""The landscape as a table: for each task and body what it has learned, with what it cost and how it fared in truth.

landscape.npz     the arrays of `Landscape`; equal computations give equal bytes
landscape.json    bodies, names of genes, configuration, digest of the arrays, versions
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import cached_property
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from evolution._src.bodies.genome import BodyGenome, parse_genome
from evolution._src.errors import RunError
from evolution._src.landscape.config import LandscapeConfig
from reconstruction._src.base.atomic_write import write_atomically
from reconstruction._src.base.typed_json import JsonError, read_json

FORMAT = "symbrion landscape 1"
ARRAYS, TEXT = "landscape.npz", "landscape.json"
_SHAPED = (
    "fitness",
    "successes",
    "seconds",
    "effort",
    "again_fitness",
    "again_successes",
    "truth_fitness",
    "truth_successes",
)
"""Arrays of one number for each task and body."""


@dataclass(frozen=True, eq=False)
class Landscape:
    """What every small body can learn.

    Attributes:
        tasks: names of the tasks.
        bodies: genomes of the bodies, the small ones first.
        gene_names: names of the genes of each body.
        fitness: in the exam, on the scan.
        successes: successful trials of the exam.
        seconds: simulated while learning and in the exam [s].
        effort: mean effort in the exam.
        curve: best fitness of each generation of learning.
        genotypes: the learned genotypes, the rest filled with NaN.
        again_fitness: of the same genotype on the scan, under other conditions: the noise of the exam.
        again_successes: successful trials there.
        truth_fitness: of the same genotype in the truth, under the conditions of the exam.
        truth_successes: successful trials there.
        config: what decided the numbers.
        provenance: versions and commands; no number depends on it.
    """

    tasks: tuple[str, ...]
    bodies: tuple[BodyGenome, ...]
    gene_names: tuple[tuple[str, ...], ...]
    fitness: Float[np.ndarray, "T B"]
    successes: Int[np.ndarray, "T B"]
    seconds: Float[np.ndarray, "T B"]
    effort: Float[np.ndarray, "T B"]
    curve: Float[np.ndarray, "T B G"]
    genotypes: Float[np.ndarray, "T B N"]
    again_fitness: Float[np.ndarray, "T B"]
    again_successes: Int[np.ndarray, "T B"]
    truth_fitness: Float[np.ndarray, "T B"]
    truth_successes: Int[np.ndarray, "T B"]
    config: LandscapeConfig
    provenance: Mapping[str, Any]

    def __post_init__(self) -> None:
        shape = len(self.tasks), len(self.bodies)
        for name in (*_SHAPED, "curve", "genotypes"):
            found = getattr(self, name).shape[:2]
            if found != shape:
                raise RunError(f"{name} has {found} tasks and bodies, and there are {shape}; make it again")

    @cached_property
    def num_modules(self) -> Int[np.ndarray, " B"]:
        """Number of modules of each body."""
        return np.array([body.num_modules for body in self.bodies])

    @cached_property
    def index(self) -> dict[str, int]:
        """Place of each body by its canonical text."""
        return {body.canonical_text: place for place, body in enumerate(self.bodies)}

    def find_task(self, name: str) -> int:
        """Return the place of a task.

        Raises:
            RunError: there is no such task.
        """
        if name not in self.tasks:
            raise RunError(f"no task {name!r}; there are: {', '.join(self.tasks)}")
        return self.tasks.index(name)

    def find_genotype(self, task: int, body: int) -> tuple[float, ...]:
        """Return what a body has learned."""
        return tuple(self.genotypes[task, body, : len(self.gene_names[body])].tolist())

    def to_bytes(self) -> bytes:
        """Return the arrays as the content of an npz file."""
        buffer = BytesIO()
        np.savez_compressed(
            buffer, **{name: getattr(self, name) for name in (*_SHAPED, "curve", "genotypes")}
        )
        return buffer.getvalue()

    def save(self, folder: Path) -> None:
        """Write both files."""
        folder.mkdir(parents=True, exist_ok=True)
        content = self.to_bytes()
        about = {
            "format": FORMAT,
            "sha256": hashlib.sha256(content).hexdigest(),
            "tasks": self.tasks,
            "config": asdict(self.config),
            "provenance": dict(self.provenance),
            "bodies": [
                {"body": body.text, "plan": body.to_plan(), "genes": list(names)}
                for body, names in zip(self.bodies, self.gene_names, strict=True)
            ],
        }
        with write_atomically(folder / ARRAYS) as temporary:
            temporary.write_bytes(content)
        with write_atomically(folder / TEXT) as temporary:
            temporary.write_text(json.dumps(about, indent=1) + "\n", encoding="utf-8")


def load_landscape(folder: Path | None = None) -> Landscape:
    """Read a landscape.

    Args:
        folder: where it is; None for the published one.

    Raises:
        RunError: a file is missing or damaged, or they do not belong together.
    """
    if folder is None:
        from symbrion_gym._src.assets import find_assets

        folder = find_assets() / "landscape"
    try:
        content = (folder / ARRAYS).read_bytes()
        about: Any = read_json(folder / TEXT)
        if about["format"] != FORMAT or about["sha256"] != hashlib.sha256(content).hexdigest():
            raise RunError(f"{folder}: {ARRAYS} and {TEXT} do not belong together; make them again")
        with np.load(BytesIO(content), allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
        stored = about["config"] | {"generations": tuple(about["config"]["generations"])}
        return Landscape(
            tasks=tuple(about["tasks"]),
            bodies=tuple(parse_genome(each["body"]) for each in about["bodies"]),
            gene_names=tuple(tuple(each["genes"]) for each in about["bodies"]),
            config=LandscapeConfig(**stored),
            provenance=about["provenance"],
            **arrays,
        )
    except RunError:
        raise
    except (OSError, JsonError, KeyError, TypeError, ValueError) as error:
        raise RunError(
            f"{folder} contains no landscape, or a damaged one ({error}); `python -m benchmarks.landscape` makes it"
        ) from error
