"""A report as index.md with its files beside it, and as one self-contained index.html."""

from __future__ import annotations

import base64
import html
from collections.abc import Sequence
from pathlib import Path

from .page import Picture, Section, Table

STYLE = """
body { max-width: 70em; margin: 2em auto; padding: 0 1em; font: 16px/1.5 sans-serif; }
table { border-collapse: collapse; margin: 1em 0; font-size: 14px; }
th, td { padding: .25em .7em; border-bottom: 1px solid #ccc; text-align: right; }
th.words, td.words { text-align: left; }
img { max-width: 100%; } pre { background: #f4f4f4; padding: .6em; }
p.caption { color: #444; margin-top: -.5em; }
"""


def markdown(title: str, head: Sequence[str], sections: Sequence[Section]) -> str:
    """The whole report as Markdown; tables link their CSV files."""
    lines = [f"# {title}", "", *(f"- {line}" for line in head), ""]
    short = _short(sections)
    if short:
        lines += ["## In short", "", *(f"- {words} {_link(one)}" for one, words in short), ""]
    for section in sections:
        lines += [f'<a id="{section.key}"></a>', "", f"## {section.title}", ""]
        lines += _otherwise(section, head)
        for part in section.parts:
            lines += [*_markdown_of(part), ""]
        lines += [_again(section), ""]
    return "\n".join(lines)


def _short(sections: Sequence[Section]) -> list[tuple[Section, str]]:
    """What to take from the report, and from which section."""
    return [(section, words) for section in sections for words in section.short]


def _link(section: Section) -> str:
    return f"([{section.title}](#{section.key}))"


def _otherwise(section: Section, head: Sequence[str]) -> list[str]:
    """When and where a section was made, if not as the page's head says."""
    usual = not section.made or section.made == " ".join(head[:2])
    return [] if usual else [section.made, ""]


def _again(section: Section) -> str:
    return f"Again: `throwplan report --only {section.key}` ({section.seconds:.0f} s here)."


def _markdown_of(part: str | Table | Picture) -> list[str]:
    if isinstance(part, Table):
        rows = [[part.shown(cell).replace("|", "\\|") for cell in row] for row in part.rows]
        align = ["---" if words else "---:" for words in _worded(part)]
        lines = ["| " + " | ".join(row) + " |" for row in (part.columns, align, *rows)]
        return [f"**{part.caption}** ([{part.name}.csv]({part.name}.csv))", "", *lines]
    if isinstance(part, Picture):
        link = "" if part.data is None else f" ([{part.data.name}.csv]({part.data.name}.csv))"
        return [f"![{part.caption}]({part.name}.png)", "", f"*{part.caption}*{link}"]
    return [part]


def _worded(table: Table) -> list[bool]:
    """Which columns hold words: they are read from the left."""
    return [
        any(isinstance(row[i], str) for row in table.rows) or i == 0
        for i in range(len(table.columns))
    ]


def page(title: str, head: Sequence[str], sections: Sequence[Section], folder: Path) -> str:
    """The whole report as HTML; pictures, read from `folder`, are inside it."""
    body = [f"<h1>{html.escape(title)}</h1>", "<ul>"]
    body += [f"<li>{_words(line)}</li>" for line in head] + ["</ul>"]
    short = _short(sections)
    if short:
        body += ["<h2>In short</h2>", "<ul>"]
        for section, words in short:
            link = f'(<a href="#{section.key}">{html.escape(section.title)}</a>)'
            body.append(f"<li>{_words(words)} {link}</li>")
        body.append("</ul>")
    for section in sections:
        body.append(f'<h2 id="{section.key}">{html.escape(section.title)}</h2>')
        body += [f"<p>{_words(line)}</p>" for line in _otherwise(section, head) if line]
        body += [_html_of(part, folder) for part in section.parts]
        body.append(f"<p>{_words(_again(section))}</p>")
    text = "\n".join(body)
    return (
        f'<!doctype html><html lang="en"><meta charset="utf-8"><title>{html.escape(title)}</title>'
        f"<style>{STYLE}</style><body>\n{text}\n</body></html>\n"
    )


def _html_of(part: str | Table | Picture, folder: Path) -> str:
    if isinstance(part, Table):
        kinds = ['class="words"' if words else "" for words in _worded(part)]
        head = "".join(
            f"<th {kind}>{html.escape(name)}</th>"
            for kind, name in zip(kinds, part.columns, strict=True)
        )
        rows = "\n".join(
            "<tr>"
            + "".join(
                f"<td {kind}>{html.escape(part.shown(c))}</td>"
                for kind, c in zip(kinds, row, strict=True)
            )
            + "</tr>"
            for row in part.rows
        )
        return f"<p><b>{_words(part.caption)}</b></p><table><tr>{head}</tr>\n{rows}</table>"
    if isinstance(part, Picture):
        data = base64.b64encode((folder / f"{part.name}.png").read_bytes()).decode()
        alt = html.escape(part.caption, quote=True)
        return (
            f'<p><img alt="{alt}" src="data:image/png;base64,{data}"></p>'
            f'<p class="caption">{_words(part.caption)}</p>'
        )
    return f"<p>{_words(part)}</p>"


def _words(text: str) -> str:
    """A paragraph with `code` in backquotes."""
    pieces = html.escape(text, quote=False).split("`")
    return "".join(f"<code>{p}</code>" if i % 2 else p for i, p in enumerate(pieces))
