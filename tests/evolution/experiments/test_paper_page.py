"""The page in a real browser, and the whole reduced run behind it."""

import contextlib
import io
import json
import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import imageio.v2 as imageio
import numpy as np
import pytest
from PIL import Image

from evolution import report
from evolution._src.cli.main import run
from evolution._src.experiments.paper import PaperSizes
from evolution._src.report.figures import encode_png
from symbrion_gym import Course

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
FLAGS = [
    "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-quic",
    "--no-first-run", "--disable-background-networking", "--disable-component-update", "--disable-sync",
]  # fmt: skip
DESKTOP, PHONE = (1280, 900), (390, 844)
MEGABYTE = 1e6
HEADINGS = [
    "From points to arena, in 3-D", "Fig. 3", "Table I and Figs. 4, 5, 6", "Arenas", "Table II", "Table III", "Fig. 7",
    "What differs from the paper", "Time of the experiments",
]  # fmt: skip


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    program = next(filter(None, map(shutil.which, BROWSERS)), None)
    if program is None:
        pytest.skip(f"no browser here; one of {', '.join(BROWSERS)} is needed")
    with api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=program, args=FLAGS)
        yield browser
        browser.close()


@contextlib.contextmanager
def visit(browser: Any, path: Path, size: tuple[int, int]) -> Iterator[Any]:
    """Open a page; afterwards nothing must have been complained about, and nothing fetched."""
    page = browser.new_page(viewport={"width": size[0], "height": size[1]})
    complaints: list[str] = []
    fetched: list[str] = []
    page.on("console", lambda message: complaints.append(message.text) if message.type == "error" else None)
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on("request", lambda request: fetched.append(request.url))
    page.goto(path.resolve().as_uri())
    page.wait_for_timeout(2000)
    yield page
    page.close()
    assert complaints == []
    outside = [url for url in fetched if not url.startswith(("data:", "blob:"))]
    assert outside == [path.resolve().as_uri()]


def look(page: Any) -> np.ndarray:
    """Return the pixels of the scene, `[H, W, 3]`."""
    page.wait_for_timeout(700)
    return np.asarray(Image.open(io.BytesIO(page.locator(".scene").screenshot())).convert("RGB")).astype(int)


@pytest.mark.slow
def test_two_clicks_on_a_scene_write_a_command_and_a_turn_none(browser, tmp_path):
    scene = report.Scene(command="train --start START --goal GOAL")
    scene.add_surface("surface", Course().surface(), "#aabbcc")
    page = report.Page("A scene")
    page.add_scene(scene, "a scene")
    page.write(tmp_path / "page.html")
    with visit(browser, tmp_path / "page.html", DESKTOP) as shown:
        box = shown.locator("#scene-3d").bounding_box()

        def press(x: float, y: float, turn: float = 0.0) -> str:
            x, y = box["x"] + x * box["width"], box["y"] + y * box["height"]
            shown.mouse.move(x - 5, y)
            shown.mouse.move(x, y, steps=4)
            shown.wait_for_timeout(600)
            shown.mouse.down()
            shown.mouse.move(x + turn, y, steps=3)
            shown.mouse.up()
            return shown.locator("#clicked").inner_text()

        first = press(0.3, 0.5)
        start = re.fullmatch(r"From (-\d\.\d\d -?\d\.\d\d) \[m\]\. Click on the goal\.", first)
        assert start, first
        assert press(0.5, 0.6, turn=40.0) == first
        camera = json.dumps(scene.make_view()["camera"])
        shown.evaluate(f"Plotly.relayout('scene-3d', {{'scene.camera': {camera}}})")
        found = re.fullmatch(r"train --start (\S+) (\S+) --goal (\S+) (\S+)", press(0.7, 0.5))
        assert found
        left, right = float(found[1]), float(found[3])  # the course extends 3.3 m to both sides
        assert -2.2 < left < -0.8 < 0.8 < right < 2.2
        assert max(abs(float(found[2])), abs(float(found[4]))) < 1.0, "and 1 m to the others"


@pytest.mark.slow
@pytest.mark.parametrize("has_colors", [False, True])
def test_a_focus_is_in_the_middle_of_the_view_and_a_click_there_tells_it(browser, tmp_path, has_colors):
    mesh = Course().surface().subdivide_to_size(0.1)
    height = mesh.bounds[1, 2]  # of the plateau
    if has_colors:
        mesh.visual.vertex_colors = np.tile(np.uint8([90, 120, 60, 255]), (len(mesh.vertices), 1))
    scene = report.Scene(focus=np.array([[-1.0, 0.3, height], [-0.6, 0.5, height]]), command="START to GOAL")
    scene.add_surface("surface", mesh, "#aabbcc")
    page = report.Page("A scene")
    page.add_scene(scene, "a scene")
    page.write(tmp_path / "page.html")
    for width in (DESKTOP, PHONE):
        with visit(browser, tmp_path / "page.html", width) as shown:
            box = shown.locator("#scene-3d").bounding_box()
            x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
            shown.mouse.move(x - 5, y)
            shown.mouse.move(x, y, steps=4)
            shown.wait_for_timeout(600)
            shown.mouse.click(x, y)
            text = shown.locator("#clicked").inner_text()
        place = [float(word) for word in text.removeprefix("From ").split(" [m]")[0].split()]
        assert place == pytest.approx([-0.8, 0.4], abs=0.25)


def count_changed(before: np.ndarray, after: np.ndarray) -> int:
    """Return how many pixels differ to the eye."""
    return int((np.abs(before - after).max(axis=2) > 20).sum())


def check_scene(page: Any) -> None:
    """Every switch must show and hide something, and dragging must turn the scene."""
    seen = look(page)
    background = seen[2, 2]
    assert (np.abs(seen - background).max(axis=2) > 20).mean() > 0.05  # the canvas is not empty
    for index in range(page.locator(".switches input").count()):
        switch = page.locator(".switches input").nth(index)
        was = switch.is_checked()
        switch.click()
        assert switch.is_checked() is not was
        changed = look(page)
        assert count_changed(seen, changed) > 100, f"switch {index} shows nothing"
        switch.click()
        assert count_changed(seen, look(page)) < 100
    box = page.locator(".scene").bounding_box()
    middle = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(*middle)
    page.mouse.down()
    page.mouse.move(middle[0] + 120, middle[1] + 20, steps=6)
    page.mouse.up()
    assert count_changed(seen, look(page)) > 1000  # it turns


@pytest.mark.slow
def test_wide_tables_and_pictures_scroll_on_a_phone(browser: Any, tmp_path: Path) -> None:
    page = report.Page("A page with a title that is longer than a phone is wide")
    page.add_table([f"column {i}" for i in range(14)], [[f"{10**i:,}" for i in range(14)]], "a table")
    page.add_figure(encode_png(np.zeros((90, 1500, 3), np.uint8)), "a wide picture")
    page.write(tmp_path / "page.html")
    with visit(browser, tmp_path / "page.html", PHONE) as visited:
        assert visited.evaluate("document.documentElement.scrollWidth") == PHONE[0]
        widths = visited.evaluate("[...document.querySelectorAll('.scroll')].map(part => part.scrollWidth)")
        assert len(widths) == 2
        assert min(widths) > PHONE[0]


@pytest.fixture(scope="module")
def paper(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a run that is reduced further than by `--quick`."""
    folder = tmp_path_factory.mktemp("paper")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("evolution._src.experiments.paper.QUICK", PaperSizes((2200,), (13860,), 1, 2, 1, 20))
        assert run(["paper", "--quick", "--quiet", "--out", str(folder)]) == 0
    return folder


@pytest.mark.long
@pytest.mark.filterwarnings("ignore:os.fork:RuntimeWarning")  # imageio's reader is a process of its own
def test_everything_is_kept_as_files(paper: Path) -> None:
    results = json.loads((paper / "results.json").read_text())
    assert set(results) == {"cloud", "networks", "arenas", "evolution", "physics", "laser", "films"}
    assert all("mujoco" in result["machine"] for result in results.values())
    pictures = {path.stem for path in (paper / "figures").glob("*.png")}
    assert pictures == {path.stem for path in (paper / "figures").glob("*.svg")}
    wanted = ("fig3a_raw", "fig3b_cloud", "fig4_gsrm_2200", "fig5_gg_13860", "fig6_gsrm", "fig7_champion")
    assert set(wanted) <= pictures
    for path in (paper / "films").glob("*.mp4"):
        assert imageio.get_reader(path).get_meta_data()["codec"] == "h264"
    assert not list(paper.rglob("*.part*"))


@pytest.mark.long
def test_the_claims_can_be_read_off(paper: Path) -> None:
    experiments = json.loads((paper / "results.json").read_text())
    laser = experiments["laser"]["figures"]["ratios"]
    assert laser["tree"]["gg"]["low"] < laser["brute force"]["gg"]["low"] / 10
    pieces = {row["arena"]: row["pieces"] for row in experiments["arenas"]["figures"]}
    assert pieces["prisms"] > 100 * pieces["gg"]
    assert min(row["contacts"] for row in experiments["physics"]["figures"]["rows"]) > 1
    steps = experiments["cloud"]["figures"]["steps"]
    assert steps[-1]["mean"] < steps[0]["mean"]


@pytest.mark.long
def test_a_second_call_does_nothing_twice(paper: Path, capsys: pytest.CaptureFixture[str]) -> None:
    kept = {path: path.stat().st_mtime_ns for path in (paper / "experiments").iterdir()}
    page = (paper / "report.html").read_bytes()
    assert run(["paper", "--quick", "--json", "--out", str(paper)]) == 0
    assert kept == {path: path.stat().st_mtime_ns for path in (paper / "experiments").iterdir()}
    assert len((paper / "report.html").read_bytes()) == len(page)
    assert json.loads(capsys.readouterr().out)["laser_ratio"]["ratio"] > 0
    assert run(["paper", "--out", str(paper)]) == 1
    assert "describes other options" in capsys.readouterr().err


@pytest.mark.long
@pytest.mark.parametrize("size", [DESKTOP, PHONE], ids=["desktop", "phone"])
def test_the_page_in_a_browser(browser: Any, paper: Path, size: tuple[int, int]) -> None:
    path = paper / "report.html"
    assert path.stat().st_size < 15 * MEGABYTE
    with visit(browser, path, size) as page:
        assert page.evaluate("document.documentElement.scrollWidth") == size[0]
        broken = "[...document.images].filter(image => !image.naturalWidth).length"
        assert page.evaluate(broken) == 0
        headings = page.locator("h2").all_inner_texts()
        assert [heading.partition(":")[0] for heading in headings] == HEADINGS
        check_scene(page)
