"""The page in a real browser, and the whole reduced run behind it."""

import contextlib
import io
import json
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
def test_a_focus_is_in_the_middle_of_the_view(browser, tmp_path):
    mesh = Course().surface()
    height = mesh.bounds[1, 2]  # of the plateau
    body = np.array([[[-0.9, 0.4, height]], [[-0.7, 0.4, height]]])
    scene = report.Scene(focus=np.array([[-1.0, 0.3, height], [-0.6, 0.5, height]]))
    scene.add_surface("surface", mesh, "#aabbcc")
    scene.add_path("body", body)
    page = report.Page("A scene")
    page.add_scene(scene, "a scene")
    page.write(tmp_path / "page.html")
    for width in (DESKTOP, PHONE):
        with visit(browser, tmp_path / "page.html", width) as shown:
            seen = look(shown)
        rows, columns = np.nonzero(seen[..., 0] - seen[..., 2] > 60)  # the body alone is red
        middle = np.array(seen.shape[:2]) / 2
        assert np.abs(np.array([rows.mean(), columns.mean()]) - middle).max() < 0.1 * middle.max()


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
