"""What people look at: figures are pictures, films are films, the page holds everything itself."""

import io
import re
from pathlib import Path

import imageio.v2 as imageio
import numpy as np
import pytest
import trimesh
from matplotlib.figure import Figure
from PIL import Image

from evolution import report
from evolution._src.report.figures import DPI, compute_width, encode_png
from symbrion_gym._src.arenas.course import Course


def open_picture(figure: Figure) -> np.ndarray:
    """Return the pixels of a figure that must show something."""
    png = report.to_png(figure)
    pixels = np.asarray(Image.open(io.BytesIO(png)).convert("RGB"))
    assert pixels.shape[0] > 60
    assert pixels.shape[1] > 300
    assert (pixels < 200).any(axis=2).sum() > 100  # dark enough to be seen
    return pixels


@pytest.mark.slow
def test_figures_show_something() -> None:
    course = Course()
    surface = course.surface()
    points = np.random.default_rng(0).uniform(-1, 1, (500, 3))
    open_picture(report.draw_cloud(points))
    marked = report.draw_cloud(points, marked=points[:200], bounds=np.array([[-1.0] * 3, [1.0] * 3]))
    red, green, blue = np.moveaxis(open_picture(marked).astype(int), 2, 0)
    assert ((red > 150) & (green < 90) & (blue < 110)).sum() > 50
    open_picture(report.draw_surface(surface))
    open_picture(report.draw_pieces(course.pieces()))
    open_picture(report.draw_section({"truth": surface, "pieces": course.pieces()}, points))
    open_picture(report.draw_learning_curve(np.arange(3), np.arange(3.0), np.zeros(3)))
    body = np.zeros((50, 8, 3)) + np.linspace(0, 1, 8)[:, None]
    open_picture(report.draw_tracks(body, surface))


def test_the_side_view_follows_the_body_in_any_direction() -> None:
    ground = trimesh.Trimesh(
        [[0, 0, 0], [5, 0, 0], [5, 9, 0.9], [0, 9, 0.9]], [[0, 1, 2], [0, 2, 3]], process=False
    )
    way = np.linspace([3.0, 2.0, 0.25], [3.0, 6.0, 0.65], 40)
    axes = report.draw_tracks(np.stack([way, way - [0, 0.1254, 0.0125]], axis=1), ground).axes[0]
    segments = np.concatenate(axes.collections[0].get_segments())
    np.testing.assert_allclose(segments[:, 1], 0.1 * (segments[:, 0] + 2.0 - 0.0627), atol=1e-9)
    assert axes.get_xlim()[0] > -1
    assert axes.get_xlim()[1] == pytest.approx(4.2, abs=0.1)


def test_equal_figures_are_equal_files() -> None:
    first, second = (report.draw_learning_curve(np.arange(3), np.arange(3.0), np.zeros(3)) for _ in range(2))
    assert report.to_png(first) == report.to_png(second)


def test_a_sharp_picture_is_not_shown_larger() -> None:
    pixels = np.zeros((40, 300, 3), np.uint8)
    assert compute_width(encode_png(pixels)) == 300
    assert compute_width(encode_png(pixels, 2 * DPI)) == 150


def test_a_film_holds_its_frames(tmp_path: Path) -> None:
    frames = [np.full((64, 96, 3), value, dtype=np.uint8) for value in np.linspace(0, 255, 10)]
    path = tmp_path / "film.mp4"
    path.write_bytes(report.encode_video(frames, fps=10))
    seen = list(imageio.get_reader(path).iter_data())
    assert len(seen) == 10
    assert seen[0].mean() < 20
    assert seen[-1].mean() > 235
    with pytest.raises(ValueError, match="no frame"):
        report.encode_video([])


def test_the_page_holds_everything_itself(tmp_path: Path) -> None:
    page = report.Page("A <title>", "summary", "footer")
    page.add_section("Section", "text & more")
    for text, good in (("it holds", True), ("in part: < 2 % (--crop)", None), ("it fails", False)):
        page.add_verdict(text, good=good)
    page.add_figure(encode_png(np.zeros((4, 6, 3), np.uint8)), "a caption")
    page.add_video(b"mp4", "a film")
    page.add_table(["arena", "what", "cost"], [["a", "boxes", "1.5"], ["b", "-", "2.5"]], "a table")
    path = tmp_path / "page.html"
    page.write(path)
    html = path.read_text()
    assert "A &lt;title&gt;" in html
    assert "text &amp; more" in html
    assert "in part: &lt; 2 % (<code>--crop</code>)" in html  # no line ends in an option
    assert "<td class=text>boxes</td>" in html  # columns of words stand left
    assert "<td>1.5</td>" in html
    assert not re.findall(r'(?:src|href)="(?!data:)', html)
    assert not re.findall(r"https?://", html)
    assert list(tmp_path.iterdir()) == [path]


def test_a_list_and_a_section(tmp_path: Path) -> None:
    page = report.Page("title")
    page.add_section("Fig. 3: the cloud")
    page.add_list(["one", "two & three"])
    page.write(tmp_path / "page.html")
    html = (tmp_path / "page.html").read_text()
    assert 'id="fig-3-the-cloud"' in html
    assert "<li>two &amp; three</li>" in html


def test_a_surface_in_its_own_colors_is_lit() -> None:
    surface = Course().surface()
    surface.visual = trimesh.visual.ColorVisuals(
        surface, vertex_colors=np.full((len(surface.vertices), 4), 128)
    )
    scene = report.Scene()
    scene.add_surface("surface", surface, "#aabbcc")
    (trace, *_) = scene.layers[0].traces
    assert set(trace["vertexcolor"]) == {"#808080"}
    assert trace["lighting"]["ambient"] < trace["lighting"]["diffuse"]


def test_switches_know_their_traces(tmp_path: Path) -> None:
    scene = report.Scene()
    surface = Course().surface()
    scene.add_points("cloud", np.zeros((50, 3)), limit=10)
    scene.add_surface("surface", surface, "#aabbcc")
    scene.add_pieces("pieces", Course().pieces(), is_shown=False)
    body = np.zeros((50, 8, 3)) + np.linspace(0, 1, 8)[:, None]
    scene.add_path("path", body)
    switches = scene.switches()
    assert [switch["traces"] for switch in switches] == [[0], [1, 2], [3, 4, 5, 6, 7], [8, 9]]
    assert [switch["is_shown"] for switch in switches] == [True, True, False, True]
    assert len(scene.layers[0].traces[0]["x"]) == 10
    page = report.Page("title")
    page.add_scene(scene, "a scene")
    with pytest.raises(ValueError, match="one already"):
        page.add_scene(scene, "another")
    page.write(tmp_path / "page.html")
    html = (tmp_path / "page.html").read_text()
    assert not re.findall(r'<(?:script|link|img)[^>]*(?:src|href)="(?!data:)', html)
    assert 'data-traces="[1, 2]" checked' in html
