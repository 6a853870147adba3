"""Results for people: figures, video, and self-contained HTML pages."""

from typing import TYPE_CHECKING

from reconstruction.lazy import export_lazily

if TYPE_CHECKING:
    from evolution.report.arena_view import draw_arena
    from evolution.report.error_map import draw_error_map
    from evolution.report.figures import (
        draw_cloud,
        draw_learning_curve,
        draw_pieces,
        draw_section,
        draw_surface,
        draw_tracks,
    )
    from evolution.report.page import Page
    from evolution.report.pictures import to_png, to_svg
    from evolution.report.scene import Scene
    from evolution.report.video import encode_video

__all__ = [
    "Page",
    "Scene",
    "draw_arena",
    "draw_cloud",
    "draw_error_map",
    "draw_learning_curve",
    "draw_pieces",
    "draw_section",
    "draw_surface",
    "draw_tracks",
    "encode_video",
    "to_png",
    "to_svg",
]

__getattr__, __dir__ = export_lazily(__name__)
