"""Fails if the site has a warning, a dead link, a page or a docstring too few."""

from __future__ import annotations

import dataclasses
import inspect
import re
import subprocess
import sys
from functools import cache
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest
import throwplan as tp

pytest.importorskip("sphinx", reason="needs the extra docs")
bs4 = pytest.importorskip("bs4", reason="needs the extra docs")
pytestmark = pytest.mark.slow

ROOT = Path(__file__).parent.parent.parent
#: Versions whose sites are there, the newest first; the first is built here.
VERSIONS = (tp.__version__, "0.0.10", "0.0.9")


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site of this version beside what tells that of others."""
    folder = tmp_path_factory.mktemp("site")
    for version in VERSIONS[1:]:
        (folder / version / "docs").mkdir(parents=True)
        (folder / version / "docs" / "index.html").touch()
        (folder / version / "objects.inv").touch()
    command = [sys.executable, "-m", "sphinx", "--fail-on-warning", "--quiet"]
    command += ["-c", str(ROOT / "docs/site"), "-d", str(folder / "doctrees")]
    command += [str(ROOT), str(folder / VERSIONS[0])]
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return folder


def pages(site: Path) -> list[Path]:
    """The pages of the newest version."""
    return sorted((site / VERSIONS[0]).rglob("*.html"))


@cache
def parsed(path: Path) -> bs4.BeautifulSoup:
    return bs4.BeautifulSoup(path.read_bytes(), "html.parser")


@cache
def anchors(path: Path) -> set[str]:
    return {tag["id"] for tag in parsed(path).find_all(id=True)}


def test_links_lead_somewhere_and_nothing_is_loaded_from_elsewhere(site: Path) -> None:
    found = 0
    for page in pages(site):
        for tag in parsed(page).find_all(lambda tag: tag.get("href") or tag.get("src")):
            link = tag.get("href") or tag["src"]
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                # A link that a reader follows; all that the page itself needs is here.
                assert tag.name == "a" and parts.scheme == "https", (page, link)
                continue
            target = (page.parent / unquote(parts.path)).resolve() if parts.path else page
            assert target.is_file(), (page, link)
            if parts.fragment:
                assert unquote(parts.fragment) in anchors(target), (page, link)
            found += 1
    assert found > 2000
    for sheet in site.rglob("*.css"):
        assert not re.search(r"(url\(|@import)\s*[\"']?(https?:)?//", sheet.read_text("utf-8"))


def test_the_pages_are_those_of_the_repository(site: Path) -> None:
    sources = [ROOT / "README.md", ROOT / "CHANGELOG.md", *(ROOT / "docs").rglob("*.md")]
    sources += (ROOT / "examples").glob("*.ipynb")
    names = {str(path.relative_to(ROOT).with_suffix(".html")) for path in sources}
    built = {str(path.relative_to(site / VERSIONS[0])) for path in pages(site)}
    assert built - names == {"genindex.html", "search.html"} and names <= built
    # Films and pictures of the front page, a notebook, the report.
    for name, picture in {
        "docs/index": "cup.gif",
        "examples/02_bin": ".gif",
        "docs/performance": "models.png",
    }.items():
        page = parsed(site / VERSIONS[0] / f"{name}.html")
        assert page.select(f'img[src$="{picture}"]'), name


def test_the_reference_has_the_docstrings_of_every_name(site: Path) -> None:
    page = parsed(site / VERSIONS[0] / "docs/python.html")
    for name in tp.__all__:
        value, title = getattr(tp, name), page.find(id=f"throwplan.{name}")
        words = title.find_next_sibling("dd").get_text(" ")
        if name == "Target":
            assert "Pose" in words
            continue
        first = re.findall(r"\w+", inspect.getdoc(value).splitlines()[0])
        assert re.findall(r"\w+", words)[: len(first)] == first, name
        if dataclasses.is_dataclass(value):
            bold = {tag.get_text() for tag in title.find_next_sibling("dd").select("li strong")}
            fields = [f for f in dataclasses.fields(value) if f.name in value.__annotations__]
            assert {f.name for f in fields if "meaning" in f.metadata} <= bold, name
    methods = {name for name in vars(tp.Planner) if not name.startswith("_")}
    assert {f"throwplan.Planner.{name}" for name in methods} <= anchors(
        site / VERSIONS[0] / "docs/python.html"
    )


def test_equations_are_drawn(site: Path) -> None:
    text = (ROOT / "docs/how-it-works.md").read_text(encoding="utf-8")
    page = parsed(site / VERSIONS[0] / "docs/how-it-works.html")
    blocks = page.select("div.math svg[aria-label]")
    assert len(blocks) == text.count("```math") > 5
    assert all(len(svg.find_all("path")) > 5 for svg in blocks)
    assert len(page.select("svg[role=img]")) > 80
    assert "$" not in page.find("article").get_text()
