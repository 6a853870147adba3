"""What people look at: figures, pages, films."""

from contextlib import suppress
from pathlib import Path

if Path("matplotlibrc").is_file():  # matplotlib reads that of the working folder unasked; it may start LaTeX
    with suppress(ImportError):
        import matplotlib as mpl

        mpl.rcdefaults()
