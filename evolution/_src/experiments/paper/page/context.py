"""What every section of the page needs: the records, the files, and the page to which it adds."""

import dataclasses
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from jaxtyping import Float
from markupsafe import Markup
from matplotlib.figure import Figure

import reconstruction as rc
import symbrion_gym as sg
from evolution._src.errors import RunError
from evolution._src.experiments.paper.cloud import CLOUD, LOG
from evolution._src.experiments.paper.config import QUICK, PaperConfig
from evolution._src.experiments.paper.page.tables import Table
from evolution._src.report.page import Page
from evolution._src.report.pictures import to_png, to_svg
from reconstruction._src.base.atomic_write import write_atomically
from reconstruction._src.base.bounded_read import UnreadableFileError, read_npz


@dataclasses.dataclass
class PaperContext:
    """The results of the experiments, and the page about them.

    Attributes:
        folder: folder of the experiments; figures are written to its subfolder `figures`.
        config: configuration of the experiments.
        records: experiment -> record.
        page: the sections are added to it.
    """

    folder: Path
    config: PaperConfig
    records: Mapping[str, Mapping[str, Any]]
    page: Page

    @property
    def command(self) -> str:
        """The command that repeats these experiments."""
        is_quick = self.config == dataclasses.replace(QUICK, seed=self.config.seed)
        return f"symbrion paper{' --quick' if is_quick else ''} --seed {self.config.seed}"

    @cached_property
    def log(self) -> rc.ScanLog:
        """The scan log of the survey."""
        return rc.load_scan_log(self.folder / LOG)

    @cached_property
    def points(self) -> Float[np.ndarray, "N 3"]:
        """The pre-processed points [m]."""
        return rc.load_points(self.folder / CLOUD)

    def load_positions(self, film: str) -> Float[np.ndarray, "ticks modules 3"]:
        """Return the positions of the modules during a video [m].

        Raises:
            RunError: the file is absent or damaged.
        """
        path = self.folder / "films" / f"{film}.npz"
        try:
            return read_npz(path, ("positions",))["positions"]
        except UnreadableFileError as error:
            raise RunError(f"{path}: {error}; remove {self.folder} and repeat `symbrion paper`") from error

    @cached_property
    def truth(self) -> trimesh.Trimesh:
        """The true surface."""
        return sg.load_arena("truth").surface

    def load_network(self, name: str) -> trimesh.Trimesh:
        """Return the mesh of a network that the experiments saved."""
        return rc.Reconstruction.load(self.folder / "surfaces" / f"{name}.npz").mesh

    def sign(self, text: str) -> Markup:
        """Return a caption that ends with seed and command."""
        return Markup("{} Seed {}; <code>{}</code>.").format(text, self.config.seed, self.command)

    def add_figure(self, name: str, figure: Figure, caption: str) -> None:
        """Add a figure, and save it as `figures/NAME.png` and `.svg`."""
        self.page.add_figure(self._save(name, figure), self.sign(caption))

    def add_gallery(self, pictures: Mapping[str, tuple[str, Figure]], caption: str) -> None:
        """Add figures side by side: label -> name of the files and figure."""
        shown = {label: self._save(name, figure) for label, (name, figure) in pictures.items()}
        self.page.add_gallery(shown, self.sign(caption))

    def add_table(self, table: Table) -> None:
        """Add a table."""
        self.page.add_table(*table)

    def _save(self, name: str, figure: Figure) -> bytes:
        """Save a figure as PNG and SVG; return the PNG."""
        (self.folder / "figures").mkdir(exist_ok=True)
        png = to_png(figure)
        for ending, content in (("png", png), ("svg", to_svg(figure))):
            with write_atomically(self.folder / "figures" / f"{name}.{ending}") as beside:
                beside.write_bytes(content)
        return png
