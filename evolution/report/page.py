"""One self-contained HTML page: text, tables, figures and video inside the file, nothing fetched."""

import base64
import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jinja2

from reconstruction.whole_file import write_whole

_TEMPLATE = jinja2.Environment(
    loader=jinja2.FileSystemLoader(Path(__file__).parent),
    autoescape=True,
    trim_blocks=True,
    lstrip_blocks=True,
    undefined=jinja2.StrictUndefined,
).get_template("page.html.j2")


@dataclasses.dataclass
class Page:
    """A page that grows section by section and is written at once.

    Attributes:
        title: the heading and the name of the browser's tab.
        summary: one paragraph below it.
        footer: machine, versions, command.
    """

    title: str
    summary: str = ""
    footer: str = ""
    _blocks: list[dict[str, Any]] = dataclasses.field(default_factory=list)

    def add_section(self, title: str, text: str = "") -> None:
        """Start a section; what follows belongs to it."""
        self._blocks.append({"kind": "section", "title": title, "text": text})

    def add_text(self, text: str) -> None:
        """Add a paragraph."""
        self._blocks.append({"kind": "text", "text": text})

    def add_verdict(self, text: str, good: bool) -> None:
        """Add a line that stands out, green or red."""
        self._blocks.append({"kind": "verdict", "text": text, "good": good})

    def add_figure(self, png: bytes, caption: str) -> None:
        """Add a PNG picture; the caption says what is seen."""
        self._blocks.append({"kind": "figure", "source": _inline(png, "image/png"), "caption": caption})

    def add_video(self, mp4: bytes, caption: str) -> None:
        """Add an H.264 video with controls."""
        self._blocks.append({"kind": "video", "source": _inline(mp4, "video/mp4"), "caption": caption})

    def add_table(self, columns: Sequence[str], rows: Sequence[Sequence[object]], caption: str) -> None:
        """Add a table; the first column is its rows' heading."""
        self._blocks.append({"kind": "table", "columns": columns, "rows": rows, "caption": caption})

    def write(self, path: Path) -> None:
        """Write the page; it appears whole or not at all."""
        html = _TEMPLATE.render(
            title=self.title, summary=self.summary, footer=self.footer, blocks=self._blocks
        )
        with write_whole(path) as beside:
            beside.write_text(html, encoding="utf-8")


def _inline(content: bytes, media_type: str) -> str:
    return f"data:{media_type};base64,{base64.b64encode(content).decode()}"
