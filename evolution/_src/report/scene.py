"""An interactive 3-D scene inside a page: it can be turned and zoomed, and its layers switched on and off.

Plotly draws it. Its script is part of the page, which therefore works from a file, without a network.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import matplotlib as mpl
import numpy as np
import trimesh
from jaxtyping import Float
from markupsafe import Markup

from evolution._src.report.figures import EDGE_COLOR, PALETTE
from evolution._src.report.raster import LIGHT
from reconstruction._src.surfaces.color import find_vertex_colors

Trace = dict[str, Any]
MILLIMETER_DIGITS = 3  # Decimals of coordinates in meters
_AWAY = np.array([-0.56, -2.26, 1.28])  # From what the camera looks at to the camera, in sizes of the scene
_AWAY_FROM_FOCUS = np.array([-0.45, -1.55, 2.1])  # Likewise, so steep that low walls hide little of a floor
_BELOW = np.array([0.0, 0.0, -0.04])  # It looks so far below the middle
BODY_COLOR = "#7a1f12"
BACKGROUND_COLOR = "#eef1f5"
_LEAST_SIZE = 1.5  # Of what is seen around a focus: half of its extent, but not less [m]
SNAPSHOTS = 9  # Times at which a body is shown on its path
PATH_STEP = 5  # Every fifth position of the head becomes a point of its path


@dataclass
class Layer:
    """A part of the scene that a switch shows or hides."""

    name: str  # label of the switch
    traces: list[Trace]  # Plotly traces, as plain dictionaries
    is_shown: bool = True  # whether it is visible at first


@dataclass
class Scene:
    """Layers, in the order of their switches."""

    layers: list[Layer] = field(default_factory=list)
    focus: Float[np.ndarray, "P 3"] | None = None  # places that the camera looks at [m]; None for all

    def add_points(
        self, name: str, points: Float[np.ndarray, "N 3"], limit: int = 15_000, is_shown: bool = True
    ) -> None:
        """Add a point cloud [m], colored by height; every n-th point is shown, `limit` at most."""
        shown = points[:: max(1, -(-len(points) // limit))]
        marker = {"size": 1.6, "color": _round(shown[:, 2]), "colorscale": "Viridis"}
        trace = {"type": "scatter3d", **_to_xyz(shown), "mode": "markers", "marker": marker}
        self._add(name, [trace], is_shown)

    def add_surface(self, name: str, mesh: trimesh.Trimesh, color: str, is_shown: bool = True) -> None:
        """Add a mesh with its edges, or in its own colors without them."""
        traces = [_make_mesh_trace(mesh, color)]
        if find_vertex_colors(mesh) is None:
            lines, look = _join(mesh.vertices[mesh.edges_unique]), {"color": EDGE_COLOR, "width": 1}
            traces.append({"type": "scatter3d", **_to_xyz(lines), "mode": "lines", "line": look})
        self._add(name, traces, is_shown)

    def add_pieces(self, name: str, pieces: Sequence[trimesh.Trimesh], is_shown: bool = True) -> None:
        """Add convex pieces, each in its own color."""
        colors = [PALETTE[index % len(PALETTE)] for index in range(len(pieces))]
        traces = [_make_mesh_trace(piece, color) for piece, color in zip(pieces, colors, strict=True)]
        self._add(name, traces, is_shown)

    def add_path(self, name: str, positions: Float[np.ndarray, "T modules 3"], is_shown: bool = True) -> None:
        """Add the path of a body: a line for the head, and the whole body at several times."""
        line = {"color": PALETTE[1], "width": 4}
        head = {"type": "scatter3d", **_to_xyz(positions[::PATH_STEP, 0]), "mode": "lines", "line": line}
        shown = positions[np.linspace(0, len(positions) - 1, SNAPSHOTS).astype(int)]
        look = {"line": {"color": BODY_COLOR, "width": 3}, "marker": {"size": 4, "color": PALETTE[1]}}
        bodies = {"type": "scatter3d", **_to_xyz(_join(shown)), "mode": "lines+markers", **look}
        self._add(name, [head, bodies], is_shown)

    def switches(self) -> list[dict[str, Any]]:
        """Return `name`, `is_shown` and the indices of the `traces` of each layer."""
        listed, first = [], 0
        for layer in self.layers:
            traces = list(range(first, first + len(layer.traces)))
            first += len(layer.traces)
            listed.append({"name": layer.name, "is_shown": layer.is_shown, "traces": traces})
        return listed

    def to_html(self) -> Markup:
        """Return the scene as a `div` with a script; the page must contain Plotly itself."""
        import plotly.graph_objects as go
        import plotly.io

        figure = go.Figure([trace for layer in self.layers for trace in layer.traces])
        axis: Mapping[str, Any] = {"visible": False, "showspikes": False}
        figure.update_layout(
            scene={"xaxis": axis, "yaxis": axis, "zaxis": axis, **self.make_view()},
            margin={"l": 0, "r": 0, "t": 0, "b": 0},
            showlegend=False,
            paper_bgcolor=BACKGROUND_COLOR,
        )
        config = {"responsive": True, "displaylogo": False, "displayModeBar": False}
        return Markup(
            plotly.io.to_html(
                figure, config=config, include_plotlyjs=False, full_html=False, div_id="scene-3d",
                default_width="100%", default_height="100%",
            )
        )  # fmt: skip

    def make_view(self) -> dict[str, Any]:
        """Return camera and scale: all of the scene, or what is around the focus."""
        if self.focus is None:
            center, away, aspect = _BELOW, _AWAY, {"aspectmode": "data"}
        else:
            traces = [trace for layer in self.layers for trace in layer.traces]
            ends = [(np.nanmin(trace[axis]), np.nanmax(trace[axis])) for axis in "xyz" for trace in traces]
            low, high = np.array(ends).reshape(3, -1, 2).T
            low, high = low.min(axis=0), high.max(axis=0)
            size = max(float(np.ptp(self.focus, axis=0).max()) / 2, _LEAST_SIZE)
            center = _BELOW + (self.focus.mean(axis=0) - (low + high) / 2) / size
            away, aspect = (
                _AWAY_FROM_FOCUS,
                {"aspectmode": "manual", "aspectratio": _name((high - low) / size)},
            )
        return {**aspect, "camera": {"eye": _name(center + away), "center": _name(center)}}

    def _add(self, name: str, traces: list[Trace], is_shown: bool) -> None:
        for trace in traces:
            trace |= {"visible": is_shown, "hoverinfo": "skip", "name": name}
        self.layers.append(Layer(name, traces, is_shown))


def _make_mesh_trace(mesh: trimesh.Trimesh, color: str) -> Trace:
    """Return a mesh in the colors of its vertices, lit so that its shape is seen, or shaded as in the figures."""
    (i, j, k), own = np.asarray(mesh.faces, dtype=np.int32).T, find_vertex_colors(mesh)
    if own is None:
        brightness = 0.45 + 0.55 * np.clip(mesh.face_normals @ (LIGHT / np.linalg.norm(LIGHT)), 0, 1)
        shaded = np.round(255 * (brightness[:, None] * mpl.colors.to_rgb(color))).astype(np.uint8)
        look = {"facecolor": ["#" + bytes(rgb).hex() for rgb in shaded], "flatshading": True}
        light = {"ambient": 1.0, "diffuse": 0.0}
    else:
        look = {"vertexcolor": ["#" + bytes(rgb).hex() for rgb in own]}
        light = {"ambient": 0.4, "diffuse": 0.8}
    light |= {"specular": 0.0, "fresnel": 0.0}
    look |= {"lighting": light, "lightposition": {"x": -1e5, "y": -4e4, "z": 1e5}}
    return {"type": "mesh3d", **_to_xyz(np.asarray(mesh.vertices)), "i": i, "j": j, "k": k, **look}


def _name(values: Float[np.ndarray, " 3"]) -> dict[str, float]:
    return dict(zip("xyz", values.tolist(), strict=True))


def _join(lines: Float[np.ndarray, "L P 3"]) -> Float[np.ndarray, "N 3"]:
    """Return lines as one, with gaps between them."""
    gaps = np.full((len(lines), 1, 3), np.nan)
    return np.concatenate([lines, gaps], axis=1).reshape(-1, 3)


def _to_xyz(points: Float[np.ndarray, "N 3"]) -> dict[str, np.ndarray]:
    return dict(zip("xyz", _round(points).T.copy(), strict=True))


def _round(values: np.ndarray) -> np.ndarray:
    return np.round(values, MILLIMETER_DIGITS).astype(np.float32)
