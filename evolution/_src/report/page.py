"""One self-contained HTML page: text, tables, figures and video are inside the file."""

import base64
import dataclasses
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import jinja2
from markupsafe import Markup, escape
from matplotlib.figure import Figure

from evolution._src.report.figures import compute_width, to_png
from evolution._src.report.scene import Scene
from reconstruction._src.base.atomic_write import write_file


def make_templates(*folders: Path) -> jinja2.Environment:
    """Return the templates of folders, which may extend the one of all pages."""
    templates = jinja2.Environment(
        loader=jinja2.FileSystemLoader([*folders, Path(__file__).parent]),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    templates.filters["anchor"] = lambda title: re.sub(r"[^a-z0-9]+", "-", title.lower()).strip("-")
    templates.filters["mark_options"] = lambda text: Markup(
        re.sub(r"--[a-z-]+", r"<code>\g<0></code>", str(escape(text)))
    )
    templates.filters["mark_commands"] = lambda text: Markup(
        re.sub("`(.+?)`", r"<code class=command>\1</code>", str(escape(text)))
    )
    return templates


@dataclasses.dataclass(frozen=True)
class Card:
    """A picture that opens."""

    picture: bytes | Figure  # figure, or PNG
    label: str  # below the picture
    text: str  # shown when it is open
    # H.264 in MP4, likewise; None for none. The closed card says that there is one.
    video: bytes | None = None
    mark: str = ""  # a word on the card, which is framed; empty for none


@dataclasses.dataclass
class Page:
    """A page to which blocks are added one after the other, and which is written at the end."""

    title: str  # the heading, and the title of the browser tab
    summary: str = ""  # one paragraph below the heading
    footer: str = ""  # machine, versions, command
    _blocks: list[dict[str, Any]] = dataclasses.field(default_factory=list)

    def add_section(self, title: str, text: str = "") -> None:
        """Start a section; the blocks that follow belong to it."""
        self._blocks.append({"kind": "section", "title": title, "text": text})

    def add_text(self, text: str) -> None:
        """Add a paragraph."""
        self._blocks.append({"kind": "text", "text": text})

    def add_verdict(self, text: str, good: bool | None) -> None:
        """Add a highlighted line, green where the result is good, yellow where it is so in part (None), else red."""
        self._blocks.append({"kind": "verdict", "text": text, "good": good})

    def add_list(self, entries: Sequence[str]) -> None:
        """Add a bulleted list."""
        self._blocks.append({"kind": "list", "entries": list(entries)})

    def add_figure(self, picture: bytes | Figure, caption: str) -> None:
        """Add a figure, or a PNG image, with a caption."""
        self._blocks.append({"kind": "figure", "picture": inline_picture(picture), "caption": caption})

    def add_cards(self, cards: Sequence[Card], caption: str) -> None:
        """Add a grid of pictures; a click opens the text, and the video where there is one."""
        shown = [
            vars(card)
            | inline_picture(card.picture)
            | {"video": inline_video(card.video) if card.video else ""}
            for card in cards
        ]
        self._blocks.append({"kind": "cards", "cards": shown, "caption": caption})

    def add_scene(self, scene: Scene, caption: str) -> None:
        """Add an interactive scene and its switches; a page can have one."""
        if any(block["kind"] == "scene" for block in self._blocks):
            raise ValueError("a page can have one scene, and has one already")
        self._blocks.append({"kind": "scene", "scene": scene, "caption": caption})

    def add_video(self, mp4: bytes, caption: str) -> None:
        """Add an H.264 video with controls."""
        self._blocks.append({"kind": "video", "source": inline_video(mp4), "caption": caption})

    def add_table(self, columns: Sequence[str], rows: Sequence[Sequence[object]], caption: str) -> None:
        """Add a table; the first column contains the headings of the rows."""
        words = [index for index in range(len(columns)) if any(str(row[index])[:1].isalpha() for row in rows)]
        table = {"columns": columns, "rows": rows, "words": words}
        self._blocks.append({"kind": "table", **table, "caption": caption})

    def write(self, path: Path) -> None:
        """Write the page as one file, atomically."""
        has_scene = any(block["kind"] == "scene" for block in self._blocks)
        context = {
            "title": self.title,
            "summary": self.summary,
            "footer": self.footer,
            "blocks": self._blocks,
        }
        write_page(path, make_templates().get_template("page.html.j2"), context, has_scene)


def write_page(path: Path, template: jinja2.Template, context: Mapping[str, Any], has_scene: bool) -> None:
    """Write a page from a template as one file, atomically."""
    program = ""
    if has_scene:
        import plotly.offline

        program = Markup(plotly.offline.get_plotlyjs())
    html = template.render(program=program, **context)
    write_file(path, html.encode(errors="backslashreplace"))


def inline_picture(picture: bytes | Figure) -> dict[str, Any]:
    """Return a figure, or a PNG image, as `source` and `width` [pixel] of an image in a page."""
    png = picture if isinstance(picture, bytes) else to_png(picture)
    return {"source": f"data:image/png;base64,{base64.b64encode(png).decode()}", "width": compute_width(png)}


def inline_video(mp4: bytes) -> str:
    """Return the source of a video in a page."""
    return f"data:video/mp4;base64,{base64.b64encode(mp4).decode()}"
