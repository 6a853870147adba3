"""Figures as picture files: PNG cut to what is drawn, SVG with lines as lines and crowds of points as pixels."""

import io

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

DPI = 110
"""Of pictures without text; on a screen a page draws one pixel of theirs as one of its own."""
CHART_DPI = 150
CHART_WIDTH = 5.6
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
    return encode_png(cut, figure.dpi)


def encode_png(pixels: np.ndarray, dpi: float = DPI) -> bytes:
    """Return `[H, W, 3]` bytes as PNG that knows its dots per inch, in 256 colours: nothing to speak of is lost."""
    buffer = io.BytesIO()
    image = Image.fromarray(np.ascontiguousarray(pixels))
    image.quantize(256, dither=Image.Dither.NONE).save(buffer, format="png", optimize=True, dpi=(dpi, dpi))
    return buffer.getvalue()


def find_width(png: bytes) -> int:
    """Return the width at which a page shows a picture: a chart has more pixels than that, for sharp text."""
    image = Image.open(io.BytesIO(png))
    return round(image.width * DPI / image.info.get("dpi", (DPI, DPI))[0])


def to_svg(figure: Figure) -> bytes:
    """Return the figure as SVG; figures drawn alike give equal bytes."""
    buffer = io.BytesIO()
    with mpl.rc_context({"svg.hashsalt": "symbrion"}):
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    return buffer.getvalue()
