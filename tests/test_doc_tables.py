"""The tables of the documentation are complete: environments, extras, arenas, controllers, backends, point files."""

import re
import tomllib
from pathlib import Path

import pytest

from evolution.controllers.controller import CONTROLLERS, make_controller
from evolution.search.evaluation import BACKENDS
from reconstruction.scans.point_files import READABLE
from symbrion_gym.assets import NAMED_ARENAS
from symbrion_gym.contact.kinds import CONTACT_CHOICES
from symbrion_gym.registration import ENVIRONMENTS
from symbrion_gym.tasks.criteria import SuccessCriteria

ROOT = Path(__file__).parents[1]
EXTRAS = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
DEVELOPERS = {"docs", "mutants", "dev"}


def read_table(page: str, head: str) -> list[list[str]]:
    """Return the cells of the table of a page with this title of the first column."""
    _, _, rest = (ROOT / page).read_text().partition(f"\n| {head} |")
    lines = rest.partition("\n\n")[0].splitlines()[2:]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]


def read_names(page: str, head: str) -> set[str]:
    """Return the names in code type of the first column."""
    return {name.strip('"') for row in read_table(page, head) for name in re.findall(r"`([^`]+)`", row[0])}


@pytest.mark.parametrize(
    ("page", "head", "wanted"),
    [
        ("docs/getting-started.md", "id", set(ENVIRONMENTS)),
        ("docs/getting-started.md", "extra", set(EXTRAS) - DEVELOPERS),
        ("README.md", "extra", set(EXTRAS) - DEVELOPERS - {"all"}),
        ("docs/packages/evolution.md", "controller", set(CONTROLLERS)),
        ("docs/packages/symbrion-gym.md", "`kind`", set(CONTACT_CHOICES)),
        ("docs/cluster.md", "`--backend`", set(BACKENDS)),
    ],
)
def test_tables_are_complete(page: str, head: str, wanted: set[str]) -> None:
    assert read_names(page, head) == wanted


def test_controllers_have_the_documented_number_of_genes() -> None:
    for name, genes, _ in read_table("docs/packages/evolution.md", "controller"):
        number = re.match(r"\d+", genes)
        controller = make_controller(name.strip("`"), 8)
        assert len(controller.parameters) == (int(number[0]) if number else 7), name


@pytest.mark.parametrize("name", NAMED_ARENAS)
def test_named_arenas_are_documented(name: str) -> None:
    assert f"`{name}`" in (ROOT / "docs/packages/symbrion-gym.md").read_text()


@pytest.mark.parametrize("ending", sorted(READABLE))
def test_every_kind_of_point_file_is_documented(ending: str) -> None:
    for page in ("docs/own-scan.md", "docs/packages/reconstruction.md"):
        assert ending in (ROOT / page).read_text(), page


def test_criteria_of_success_have_the_documented_numbers() -> None:
    text = " ".join((ROOT / "docs/environment.md").read_text().split())
    criteria = SuccessCriteria()
    low, high = (100 * height for height in criteria.ground_band)
    for words in (
        f"at every control step for {criteria.hold_time:g} s",
        f"a cube of {200 * criteria.corner:g} cm",
        f"z component of its up axis above {criteria.upright:g}",
        f"{low:g} to {high:g} cm above the ground",
        f"at most {100 * criteria.speed_slack:g} cm ahead",
        f"z component of its up axis below {criteria.rolled_over:g}",
    ):
        assert words in text, words


def test_ready_made_arenas_are_documented() -> None:
    folders = {path.parent.name for path in (ROOT / "assets" / "arenas").rglob("arena.json")}
    assert read_names("assets/README.md", "arena") == folders


def test_every_folder_of_the_packages_is_documented() -> None:
    packages = ("reconstruction", "symbrion_gym", "evolution", "benchmarks")
    folders = {
        f"{path.parent.relative_to(ROOT).as_posix()}/"
        for package in packages
        for path in (ROOT / package).rglob("__init__.py")
    }
    assert folders <= read_names("CONTRIBUTING.md", "folder")
