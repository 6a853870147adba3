"""What people look at: figures are pictures, films are films, the page holds everything itself."""

import io
import re
from pathlib import Path

import imageio.v2 as imageio
import numpy as np
import pytest
from PIL import Image

from evolution import report
from symbrion_gym.arenas.course import Course


def open_picture(png: bytes) -> np.ndarray:
    """Return the pixels of a PNG that must show something."""
    pixels = np.asarray(Image.open(io.BytesIO(png)).convert("RGB"))
    assert pixels.shape[0] > 60
    assert pixels.shape[1] > 300
    assert (pixels < 200).any(axis=2).sum() > 100  # dark enough to be seen
    return pixels


def test_figures_show_something() -> None:
    course = Course()
    surface = course.surface()
    points = np.random.default_rng(0).uniform(-1, 1, (500, 3))
    open_picture(report.draw_cloud(points))
    open_picture(report.draw_surface(surface, points))
    open_picture(report.draw_pieces(course.pieces()))
    open_picture(report.draw_section({"truth": surface, "pieces": course.pieces()}, points))
    open_picture(report.draw_learning_curve(np.arange(3), np.arange(3.0), np.zeros(3)))
    body = np.zeros((50, 8, 3)) + np.linspace(0, 1, 8)[:, None]
    open_picture(report.draw_tracks(body, surface))


def test_a_film_holds_its_frames(tmp_path: Path) -> None:
    frames = [np.full((64, 96, 3), value, dtype=np.uint8) for value in np.linspace(0, 255, 10)]
    path = tmp_path / "film.mp4"
    path.write_bytes(report.encode_video(frames, fps=10))
    seen = [frame for frame in imageio.get_reader(path)]  # noqa: C416  (its length is unknown)
    assert len(seen) == 10
    assert seen[0].mean() < 20
    assert seen[-1].mean() > 235


def test_a_film_without_frames_is_refused() -> None:
    with pytest.raises(ValueError, match="no frame"):
        report.encode_video([])


def test_the_page_holds_everything_itself(tmp_path: Path) -> None:
    page = report.Page("A <title>", "summary", "footer")
    page.add_section("Section", "text & more")
    page.add_verdict("it holds", good=True)
    page.add_figure(b"png", "a caption")
    page.add_video(b"mp4", "a film")
    page.add_table(["name", "value"], [["x", 1.5]], "a table")
    path = tmp_path / "page.html"
    page.write(path)
    html = path.read_text()
    assert "A &lt;title&gt;" in html
    assert "text &amp; more" in html
    assert not re.findall(r'(?:src|href)="(?!data:)', html)
    assert not re.findall(r"https?://", html)
    assert list(tmp_path.iterdir()) == [path]
