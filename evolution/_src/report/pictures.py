"""Figures as image files: PNG cropped to the drawing, SVG with lines as vectors and many points as pixels."""

import io

import matplotlib as mpl
import numpy as np
from jaxtyping import UInt8
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

DPI = 110
"""Resolution of figures without text; a page shows them pixel by pixel."""
CHART_DPI = 150
"""Resolution of charts; higher, so that their text is sharp on screens of high density."""
CHART_WIDTH = 5.6
"""Width of a chart [inch]; its text can be read on a phone, too."""
MARGIN = 12
"""White border around a figure [pixel]."""


def to_png(figure: Figure, is_reduced: bool = True) -> bytes:
    """Return the figure as PNG, cropped to the drawing; `is_reduced`: to 256 colors, too few for color scales."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    pixels = np.asarray(canvas.buffer_rgba())[..., :3]
    rows, columns = (np.flatnonzero((pixels < 250).any(axis=(axis, 2))) for axis in (1, 0))
    cut = pixels[
        max(rows[0] - MARGIN, 0) : rows[-1] + MARGIN, max(columns[0] - MARGIN, 0) : columns[-1] + MARGIN
    ]
    return encode_png(cut, figure.dpi, is_reduced)


def encode_png(pixels: UInt8[np.ndarray, "H W 3"], dpi: float = DPI, is_reduced: bool = True) -> bytes:
    """Return an image as PNG with its resolution; `is_reduced`: to 256 colors, which figures hardly exceed."""
    buffer = io.BytesIO()
    image = Image.fromarray(np.ascontiguousarray(pixels))
    image = image.quantize(256, dither=Image.Dither.NONE) if is_reduced else image
    image.save(buffer, format="png", optimize=True, dpi=(dpi, dpi))
    return buffer.getvalue()


def find_width(png: bytes) -> int:
    """Return the width at which a page shows an image [pixel]; a chart has more pixels, for sharp text."""
    image = Image.open(io.BytesIO(png))
    return round(image.width * DPI / image.info.get("dpi", (DPI, DPI))[0])


def to_svg(figure: Figure) -> bytes:
    """Return the figure as SVG; equal figures give equal bytes."""
    buffer = io.BytesIO()
    with mpl.rc_context({"svg.hashsalt": "symbrion"}):
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    return buffer.getvalue()
