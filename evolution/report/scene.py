"""An interactive 3-D scene inside a page: layers that can be turned, zoomed and switched on and off.

Drawn by Plotly, whose program travels inside the page: it works from the file system, without a network.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import matplotlib as mpl
import numpy as np
import trimesh
from markupsafe import Markup

from evolution.report.figures import PALETTE, shade

Trace = dict[str, Any]
MILLIMETRE_DIGITS = 3
CAMERA = {"eye": {"x": -0.56, "y": -2.26, "z": 1.24}, "center": {"x": 0.0, "y": 0.0, "z": -0.04}}


@dataclass
class Layer:
    """What a switch of the scene shows or hides.

    Attributes:
        name: beside the switch.
        traces: of Plotly, as plain dictionaries.
        is_shown: at the beginning.
    """

    name: str
    traces: list[Trace]
    is_shown: bool = True


@dataclass
class Scene:
    """Layers, in the order of their switches."""

    layers: list[Layer] = field(default_factory=list)

    def add_points(self, name: str, points: np.ndarray, limit: int = 15_000, is_shown: bool = True) -> None:
        """Add a cloud `[N, 3]` [m], coloured by height, thinned evenly to `limit`."""
        shown = points[:: max(1, -(-len(points) // limit))]
        marker = {"size": 1.6, "color": _round(shown[:, 2]), "colorscale": "Viridis"}
        self._add(name, [_make("scatter3d", **_place(shown), mode="markers", marker=marker)], is_shown)

    def add_surface(self, name: str, mesh: trimesh.Trimesh, colour: str, is_shown: bool = True) -> None:
        """Add a mesh with its edges."""
        edges = np.asarray(mesh.vertices)[mesh.edges_unique]
        gaps = np.full((len(edges), 1, 3), np.nan)
        lines = np.concatenate([edges, gaps], axis=1).reshape(-1, 3)
        wire = _make("scatter3d", **_place(lines), mode="lines", line={"color": "#3a4a5c", "width": 1})
        self._add(name, [_make_mesh(mesh, colour), wire], is_shown)

    def add_pieces(self, name: str, pieces: Sequence[trimesh.Trimesh], is_shown: bool = True) -> None:
        """Add convex pieces, each in a colour of its own."""
        colours = [PALETTE[index % len(PALETTE)] for index in range(len(pieces))]
        traces = [_make_mesh(piece, colour) for piece, colour in zip(pieces, colours, strict=True)]
        self._add(name, traces, is_shown)

    def add_path(self, name: str, positions: np.ndarray, snapshots: int = 9, is_shown: bool = True) -> None:
        """Add the path of a body: the head's line, and the whole body at several moments.

        Args:
            name: beside the switch.
            positions: `[T, n, 3]` of the modules, head first [m].
            snapshots: moments.
            is_shown: at the beginning.
        """
        head = _make(
            "scatter3d", **_place(positions[::5, 0]), mode="lines", line={"color": PALETTE[1], "width": 4}
        )
        chosen = positions[np.linspace(0, len(positions) - 1, snapshots).astype(int)]
        gap = np.full((snapshots, 1, 3), np.nan)
        bodies = _make("scatter3d",
            **_place(np.concatenate([chosen, gap], axis=1).reshape(-1, 3)),
            mode="lines+markers", line={"color": "#7a1f12", "width": 3},
            marker={"size": 4, "color": PALETTE[1]},
        )  # fmt: skip
        self._add(name, [head, bodies], is_shown)

    def switches(self) -> list[dict[str, Any]]:
        """Return for each layer its `name`, whether it `is_shown`, and the indices of its `traces`."""
        listed, first = [], 0
        for layer in self.layers:
            traces = list(range(first, first + len(layer.traces)))
            first += len(layer.traces)
            listed.append({"name": layer.name, "is_shown": layer.is_shown, "traces": traces})
        return listed

    def to_html(self) -> Markup:
        """Return the scene as a `div` and the script that fills it; the page holds Plotly itself."""
        import plotly.graph_objects as go
        import plotly.io

        figure = go.Figure([trace for layer in self.layers for trace in layer.traces])
        axis: Mapping[str, Any] = {"visible": False, "showspikes": False}
        figure.update_layout(
            scene={"aspectmode": "data", "xaxis": axis, "yaxis": axis, "zaxis": axis, "camera": CAMERA},
            margin={"l": 0, "r": 0, "t": 0, "b": 0},
            showlegend=False,
            paper_bgcolor="#eef1f5",
        )
        config = {"responsive": True, "displaylogo": False, "displayModeBar": False}
        return Markup(
            plotly.io.to_html(
                figure, config=config, include_plotlyjs=False, full_html=False, div_id="scene-3d",
                default_width="100%", default_height="100%",
            )
        )  # fmt: skip

    def _add(self, name: str, traces: list[Trace], is_shown: bool) -> None:
        for trace in traces:
            trace |= {"visible": is_shown, "hoverinfo": "skip", "name": name}
        self.layers.append(Layer(name, traces, is_shown))


def get_plotly_program() -> Markup:
    """Return Plotly's JavaScript, to be put into a page."""
    import plotly.offline

    return Markup(plotly.offline.get_plotlyjs())


def _make_mesh(mesh: trimesh.Trimesh, colour: str) -> Trace:
    """Return a mesh with its shading in the colours of its faces: Plotly's own light is not that of the figures."""
    i, j, k = np.asarray(mesh.faces, dtype=np.int32).T
    shaded = np.round(255 * shade(mesh, np.array(mpl.colors.to_rgb(colour)))).astype(np.uint8)
    facecolor = ["#" + bytes(rgb).hex() for rgb in shaded]
    return _make(
        "mesh3d",
        **_place(np.asarray(mesh.vertices)), i=i, j=j, k=k, facecolor=facecolor, flatshading=True,
        lighting={"ambient": 1.0, "diffuse": 0.0, "specular": 0.0, "fresnel": 0.0},
    )  # fmt: skip


def _make(kind: str, **values: Any) -> Trace:
    return {"type": kind, **values}


def _place(points: np.ndarray) -> dict[str, np.ndarray]:
    return dict(zip("xyz", _round(points).T.copy(), strict=True))


def _round(values: np.ndarray) -> np.ndarray:
    return np.round(values, MILLIMETRE_DIGITS).astype(np.float32)
