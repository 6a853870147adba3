"""What every section of the paper's page needs: the records, the files, and the page that grows."""

import dataclasses
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from markupsafe import Markup
from matplotlib.figure import Figure

import reconstruction as rc
import symbrion_gym as sg
from evolution.errors import RunError
from evolution.experiments.paper.cloud import CLOUD, LOG
from evolution.experiments.paper.config import QUICK, PaperConfig
from evolution.experiments.paper_page.tables import Table
from evolution.report.page import Page
from evolution.report.pictures import to_png, to_svg
from reconstruction.files.atomic_write import write_atomically
from reconstruction.files.bounded_read import UnreadableFileError, read_npz


@dataclasses.dataclass
class PaperContext:
    """The folder of the experiments, and the page of it.

    Attributes:
        folder: holds what the experiments made; `figures` appears there.
        config: what was measured.
        records: experiment -> record.
        page: grows section by section.
    """

    folder: Path
    config: PaperConfig
    records: Mapping[str, Mapping[str, Any]]
    page: Page

    @property
    def command(self) -> str:
        """The command that makes all of this again."""
        is_quick = self.config == dataclasses.replace(QUICK, seed=self.config.seed)
        return f"symbrion paper{' --quick' if is_quick else ''} --seed {self.config.seed}"

    @cached_property
    def log(self) -> rc.ScanLog:
        """The survey's scan log."""
        return rc.load_scan_log(self.folder / LOG)

    @cached_property
    def points(self) -> np.ndarray:
        """The pre-processed cloud, `[N, 3]` [m]."""
        return rc.load_points(self.folder / CLOUD)

    def load_positions(self, film: str) -> np.ndarray:
        """Return where the modules were through a film.

        Raises:
            RunError: the file is absent or damaged.
        """
        path = self.folder / "films" / f"{film}.npz"
        try:
            return read_npz(path, ("positions",))["positions"]
        except UnreadableFileError as error:
            raise RunError(f"{path}: {error}; remove {self.folder} and make the paper again") from error

    @cached_property
    def truth(self) -> trimesh.Trimesh:
        """The true surface."""
        return sg.load_arena("truth").surface

    def load_network(self, name: str) -> trimesh.Trimesh:
        """Return the mesh of a network that the experiments kept."""
        return rc.Reconstruction.load(self.folder / "surfaces" / f"{name}.npz").mesh

    def sign(self, text: str) -> Markup:
        """Return a caption that ends with the seed and the command."""
        return Markup("{} Seed {}; <code>{}</code>.").format(text, self.config.seed, self.command)

    def add_figure(self, name: str, figure: Figure, caption: str) -> None:
        """Add a figure, and keep it as `figures/NAME.png` and `.svg`."""
        self.page.add_figure(self._keep(name, figure), self.sign(caption))

    def add_gallery(self, pictures: Mapping[str, tuple[str, Figure]], caption: str) -> None:
        """Add figures beside each other: label -> name of the files and figure."""
        shown = {label: self._keep(name, figure) for label, (name, figure) in pictures.items()}
        self.page.add_gallery(shown, self.sign(caption))

    def add_table(self, table: Table) -> None:
        """Add a table."""
        self.page.add_table(*table)

    def _keep(self, name: str, figure: Figure) -> bytes:
        (self.folder / "figures").mkdir(exist_ok=True)
        png = to_png(figure)
        for ending, content in (("png", png), ("svg", to_svg(figure))):
            with write_atomically(self.folder / "figures" / f"{name}.{ending}") as beside:
                beside.write_bytes(content)
        return png
