"""Results for people: figures, video, and self-contained HTML pages."""

from typing import TYPE_CHECKING

from reconstruction._src.base.lazy import export_lazily

if TYPE_CHECKING:
    from evolution._src.report.arena_view import draw_arena
    from evolution._src.report.figures import (
        draw_cloud,
        draw_learning_curve,
        draw_pieces,
        draw_section,
        draw_surface,
        draw_tracks,
        to_png,
    )
    from evolution._src.report.page import Page
    from evolution._src.report.scene import Scene
    from evolution._src.report.video import encode_video

__all__ = [
    "Page",
    "Scene",
    "draw_arena",
    "draw_cloud",
    "draw_learning_curve",
    "draw_pieces",
    "draw_section",
    "draw_surface",
    "draw_tracks",
    "encode_video",
    "to_png",
]

__getattr__, __dir__ = export_lazily(__name__)
