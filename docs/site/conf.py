"""Sphinx's configuration of the site, which `make site` builds from pages, notebooks, docstrings.

The repository is the source folder, so that a link leads to the same page here and on GitHub.
"""

import inspect
import json
import pydoc
import re
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import throwplan as tp
import ziamath
from docutils import nodes
from packaging.version import Version
from sphinx.application import Sphinx
from sphinx.writers.html5 import HTML5Translator
from throwplan import robots
from throwplan.cli.keys import scene_keys
from throwplan.problems.section import Section

project = "throwplan"
release = version = tp.__version__
root_doc = "docs/index"
include_patterns = ["README.md", "CHANGELOG.md", "docs/**.md", "examples/*.ipynb"]
exclude_patterns = [".*", "build", "out", "tests"]
extensions = ["myst_nb", "sphinx.ext.autodoc"]

html_theme = "furo"
html_title = "throwplan"
html_favicon = "icon.svg"
html_copy_source = False
html_static_path = ["style.css"]
html_css_files = ["style.css"]
templates_path = ["."]
html_sidebars = {
    "**": [
        "sidebar/brand.html",
        "versions.html",
        "sidebar/search.html",
        "sidebar/scroll-start.html",
        "sidebar/navigation.html",
        "sidebar/scroll-end.html",
    ]
}

# Notebooks show the outputs that they have.
nb_execution_mode = "off"
nb_mime_priority_overrides = [("html", "image/gif", 0)]
myst_enable_extensions = ["dollarmath", "html_image"]
myst_fence_as_directive = ["math"]
myst_heading_anchors = 4

html_math_renderer = "svg"
ziamath.config.math.color = "currentColor"
ziamath.config.svg2 = False
#: Font size [px] of equations: STIX is smaller than the text's font.
MATH_SIZE = 17

# The page of all keys is made with the site.
Path(__file__).parents[1].joinpath("keys.md").write_text(scene_keys(), encoding="utf-8")

default_role = "py:obj"
smartquotes = False
autodoc_member_order = "bysource"
autodoc_typehints_format = "short"
python_maximum_signature_line_length = 80

#: Classes of which users make objects. Other objects are results: no constructor is shown.
CONSTRUCTED = (Section, tp.Planner, tp.State, robots.Response)


def write_math(writer: HTML5Translator, node: nodes.math | nodes.math_block) -> None:
    """An equation as a drawing, for which a page needs neither scripts nor fonts."""
    text, is_block = node.astext(), isinstance(node, nodes.math_block)
    equation = ziamath.Latex(text, size=MATH_SIZE, inline=not is_block)
    drawing = equation.svgxml()
    style = f"vertical-align: {equation.getyofst():.2f}px"
    drawing.attrib |= {"role": "img", "aria-label": text, "style": style}
    svg = ET.tostring(drawing, encoding="unicode")
    writer.body.append(f'<div class="math">{svg}</div>' if is_block else svg)
    raise nodes.SkipNode


def add_navigation(app: Sphinx, page: str, source: list[str]) -> None:
    """The front page's lists of links are the table of contents."""
    if page == root_doc:
        keys = "`throwplan scenes --keys`"
        source[0] = source[0].replace(f"- {keys}", f"- [Every key](keys.md): {keys},")
        for title, links in re.findall(r"^## (.*)\n\n((?:[- ].*\n)+)", source[0], flags=re.M):
            entries = re.findall(r"^- \[(.*?)\]\((.*?)\)", links, flags=re.M)
            lines = [f"{name} <{target}>" for name, target in entries]
            lines = ["", "```{toctree}", ":hidden:", f":caption: {title}", *lines, "```", ""]
            source[0] += "\n".join(lines)


def add_docstrings(app: Sphinx, page: str, source: list[str]) -> None:
    """A paragraph of names on the page of Python becomes their docstrings."""
    if page == "docs/python":
        source[0] = re.sub(r"^(?:`[\w.]+`,?\s)+", _directives, source[0], flags=re.M)


def _directives(names: re.Match[str]) -> str:
    """Autodoc's directives for names in backticks."""
    lines = ["```{eval-rst}"]
    for name in re.findall(r"[\w.]+", names[0].replace(",", "")):
        value, kind = pydoc.locate(f"throwplan.{name}"), "function"
        if inspect.isclass(value):
            kind = "exception" if issubclass(value, Exception) else "class"
        lines.append(f".. auto{kind}:: throwplan.{name}")
        if kind == "class" and (value is tp.Scene or not issubclass(value, Section)):
            lines.append("   :members:")
    return "\n".join([*lines, "```", ""])


def format_docstring(
    app: Sphinx, what: str, name: str, value: Any, options: Any, lines: list[str]
) -> None:
    """Prose as reStructuredText: parameters in bold, a section's fields as a list."""
    text = re.sub(r"\[([\w ]+)\]\(\S+\)", r"\1", "\n".join(lines))
    if what == "class" and issubclass(value, Section):
        text = re.sub(r"\n +", " ", text)
        text = re.sub(r"(?<=\n\n)(?:\w+: .*\n)+(?=\n|\Z)", _items, text + "\n")
    if what in {"class", "function", "method"}:
        known = "|".join(inspect.signature(value).parameters)
        before, after = r"(\A|\n\n|\n- |[.,;]\s)", r"(?=(?:\s\[[^]]*\]|\s\([^)]*\))?:\s)"
        text = re.sub(rf"{before}({known}){after}", "\\1\0\\2\0", text)
    parts = re.split("(``?[^`]+``?)", text)
    parts[::2] = [re.sub(r"([\\*|_])", r"\\\1", part).replace("\0", "**") for part in parts[::2]]
    lines[:] = "".join(parts).splitlines()


def _items(lines: re.Match[str]) -> str:
    """Lines as a list."""
    return re.sub("^(?=.)", "- ", lines[0], flags=re.M)


def write_signature(
    app: Sphinx, what: str, name: str, value: Any, options: Any, signature: str, returned: str
) -> tuple[str, str]:
    """The signature of a class is shown where users need it; defaults that are made are dots."""
    if what == "class" and not issubclass(value, CONSTRUCTED):
        return "", ""
    return signature and signature.replace("<factory>", "..."), returned


def write_versions(app: Sphinx, error: Exception | None) -> None:
    """The list of the versions beside this one, and the way from their folder to the newest."""
    site = Path(app.outdir).parent
    names = sorted((path.parent.name for path in site.glob("*/objects.inv")), key=Version)[::-1]
    if names:
        script = f"for (const name of {json.dumps(names)}) addVersion(name);\n"
        (site / "versions.js").write_text(script, encoding="utf-8")
        page = f'<meta http-equiv="refresh" content="0; url={names[0]}/{root_doc}.html">\n'
        (site / "index.html").write_text(page, encoding="utf-8")


def setup(app: Sphinx) -> None:
    """Sphinx calls this."""
    app.add_html_math_renderer("svg", (write_math, None), (write_math, None))
    app.connect("source-read", add_navigation)
    app.connect("source-read", add_docstrings)
    app.connect("autodoc-process-docstring", format_docstring)
    app.connect("autodoc-process-signature", write_signature)
    app.connect("build-finished", write_versions)
