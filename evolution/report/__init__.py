"""What people look at: figures, video, and one self-contained HTML page."""

from evolution.report.figures import (
    draw_cloud,
    draw_learning_curve,
    draw_pieces,
    draw_section,
    draw_surface,
    draw_tracks,
)
from evolution.report.page import Page
from evolution.report.video import encode_video

__all__ = [
    "Page",
    "draw_cloud",
    "draw_learning_curve",
    "draw_pieces",
    "draw_section",
    "draw_surface",
    "draw_tracks",
    "encode_video",
]
