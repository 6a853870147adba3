"""Figures as picture files: PNG cut to what is drawn, SVG with lines as lines and crowds of points as pixels."""

import io

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

DPI = 110
CHART_WIDTH = 7.2
"""Width of a chart [inch]: its text can be read on a phone, too."""
MARGIN = 12


def to_png(figure: Figure) -> bytes:
    """Return the figure as PNG, cut to what is drawn on it."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    pixels = np.asarray(canvas.buffer_rgba())[..., :3]
    rows, columns = (np.flatnonzero((pixels < 250).any(axis=(axis, 2))) for axis in (1, 0))
    cut = pixels[
        max(rows[0] - MARGIN, 0) : rows[-1] + MARGIN, max(columns[0] - MARGIN, 0) : columns[-1] + MARGIN
    ]
    return encode_png(cut)


def encode_png(pixels: np.ndarray) -> bytes:
    """Return `[H, W, 3]` bytes as PNG, in 256 colours where that loses nothing to speak of."""
    buffer = io.BytesIO()
    image = Image.fromarray(np.ascontiguousarray(pixels))
    image.quantize(256, dither=Image.Dither.NONE).save(buffer, format="png", optimize=True)
    return buffer.getvalue()


def to_svg(figure: Figure) -> bytes:
    """Return the figure as SVG; figures drawn alike give equal bytes."""
    buffer = io.BytesIO()
    with mpl.rc_context({"svg.hashsalt": "symbrion"}):
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    return buffer.getvalue()
