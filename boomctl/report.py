"""Self-contained reports: results.json, figures, and one HTML file with all tables and figures."""

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from math import isfinite
from pathlib import Path
from typing import Any

from boomctl.files import json_text, prepared_folder, write_all
from boomctl.lti.rounding import ALIKE
from boomctl.printing import compact

_MIME = {"svg": "image/svg+xml", "png": "image/png", "gif": "image/gif"}
_STYLE = """
body{font:15px/1.5 system-ui,sans-serif;max-width:62rem;margin:2rem auto;padding:0 1rem;color:#1b1b1b}
h1{font-size:1.6rem;margin-bottom:.2rem}h2{font-size:1.15rem;margin-top:2.2rem;border-bottom:1px solid #ccc}
table{display:block;overflow-x:auto;
border-collapse:collapse;margin:.8rem 0;font-variant-numeric:tabular-nums;font-size:.87rem}
th,td{padding:.22rem .6rem;text-align:right;vertical-align:top;border-bottom:1px solid #e4e4e4}th{background:#f3f5f7}
.l{text-align:left}td.l:first-child{min-width:8rem}img{max-width:100%;height:auto}
figcaption,.note{color:#444;font-size:.9rem}figure{margin:1rem 0}
iframe{width:100%;height:92vh;border:1px solid #ccc}
"""


@dataclass(frozen=True)
class Table:
    """A table: column heads, lines of text, a caption.

    Attributes
    ----------
    heads, lines, caption
        A line of one cell is a heading of those below it, across all columns.
    align : str
        One letter a column, "l" for words and "r" for numbers; the last letter holds for all columns that follow.
    shades : mapping of str to str
        Colors behind cells, by the text of the cell.
    """

    heads: tuple[str, ...]
    lines: tuple[tuple[str, ...], ...]
    caption: str = ""
    align: str = "lr"
    shades: Mapping[str, str] = field(default_factory=dict)

    __repr__ = compact


@dataclass(frozen=True)
class Picture:
    """A picture: name of its files, caption, and their content by ending ("svg", "png", "gif"); the first one is shown."""

    name: str
    caption: str
    files: Mapping[str, bytes]

    __repr__ = compact


@dataclass(frozen=True)
class Section:
    """A heading, paragraphs, tables and pictures, in that order."""

    title: str
    text: tuple[str, ...] = ()
    tables: tuple[Table, ...] = ()
    pictures: tuple[Picture, ...] = ()

    __repr__ = compact


@dataclass(frozen=True)
class Report:
    """A report: text, tables and pictures, and what was computed.

    Attributes
    ----------
    title : str
        Its title.
    lead : tuple of str
        Paragraphs that lead in.
    sections : tuple of Section
        Texts, tables and pictures.
    results : mapping
        What ``results.json`` holds.
    files : mapping of str to bytes or str
        Further files by name.
    """

    title: str
    lead: tuple[str, ...]
    sections: tuple[Section, ...]
    results: Mapping[str, Any]
    files: Mapping[str, bytes | str] = field(default_factory=dict)

    __repr__ = compact

    @property
    def html(self) -> str:
        """The report as one HTML document that refers to nothing outside itself."""
        parts = [f"<h1>{escape(self.title)}</h1>", *(f"<p>{escape(text)}</p>" for text in self.lead)]
        return _document(self.title, "\n".join([*parts, *map(_section, self.sections)]))

    def write(self, folder: str | Path) -> tuple[Path, ...]:
        """Write all pictures, ``results.json`` and ``report.html`` into a folder, which is made if need be.

        Parameters
        ----------
        folder : str or Path
            Where to; it is made if need be.

        Returns
        -------
        tuple of Path
            The files; all are written, or none.

        Raises
        ------
        OSError
            The folder cannot be written to.
        """
        target = prepared_folder(folder)
        files: dict[Path, bytes | str] = {
            target / f"{picture.name}.{ending}": content
            for section in self.sections
            for picture in section.pictures
            for ending, content in picture.files.items()
        }
        files |= {target / name: content for name, content in self.files.items()}
        files |= {target / "results.json": json_text(self.results), target / "report.html": self.html}
        write_all(files)
        return tuple(files)


def bound_reports(title: str, reports: Sequence[tuple[str, str]]) -> str:
    """Return several reports (heading, HTML document) in one document that refers to nothing outside itself."""
    frame = "<h2>{0}</h2><iframe title='{0}' srcdoc='{1}'></iframe>"
    parts = (frame.format(escape(head), escape(html)) for head, html in reports)
    return _document(title, "\n".join([f"<h1>{escape(title)}</h1>", *parts]))


def _document(title: str, body: str) -> str:
    return (
        f"<!doctype html>\n<html lang='en'><head><meta charset='utf-8'><title>{escape(title)}</title>"
        f"<meta name='viewport' content='width=device-width'><style>{_STYLE}</style></head><body>\n"
        f"{body}\n</body></html>\n"
    )


def _section(section: Section) -> str:
    text = (f"<p>{escape(words)}</p>" for words in section.text)
    return "\n".join(
        [f"<h2>{escape(section.title)}</h2>", *text, *map(_table, section.tables), *map(_figure, section.pictures)]
    )


def _table(table: Table) -> str:
    columns = table.align.ljust(len(table.heads), table.align[-1])[: len(table.heads)]

    def row(tag: str, cells: tuple[str, ...]) -> str:
        result = ""
        for side, cell in zip(columns, cells, strict=True):
            shade = f" style='background:{table.shades[cell]}'" if cell in table.shades else ""
            result += f"<{tag}{' class=l' if side == 'l' else ''}{shade}>{escape(cell)}</{tag}>"
        return result

    def heading(line: tuple[str, ...]) -> str:
        return f"<th class=l colspan={len(columns)}>{escape(line[0])}</th>"

    lines = "\n".join(
        f"<tr>{heading(line) if len(line) == 1 < len(columns) else row('td', line)}</tr>" for line in table.lines
    )
    caption = f"<p class='note'>{escape(table.caption)}</p>" if table.caption else ""
    return f"<table><thead><tr>{row('th', table.heads)}</tr></thead><tbody>\n{lines}\n</tbody></table>{caption}"


def _figure(picture: Picture) -> str:
    ending, content = next(iter(picture.files.items()))
    data, caption = base64.b64encode(content).decode("ascii"), escape(picture.caption)
    source = f"data:{_MIME[ending]};base64,{data}"
    return f"<figure><img alt='{caption}' src='{source}'><figcaption>{caption}</figcaption></figure>"


def number(value: float, digits: int = 3) -> str:
    """Return a number with few digits, small and large ones with a power of ten; what is rounding is said to be so."""
    if not isfinite(value):
        return str(value)
    if abs(value) < ALIKE:
        return f"less than {power(ALIKE, 1)}"
    if 1e-3 <= abs(value) < 1e4:
        return f"{value:#.{digits}g}".rstrip(".").replace("-", "−")
    return power(value, digits)


def power(value: float, digits: int) -> str:
    """Return a number times a power of ten, "2.1·10⁻³"."""
    mantissa, exponent = f"{value:.{digits - 1}e}".replace("-", "−").split("e")
    raised = str(int(exponent.replace("−", "-"))).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
    return f"10{raised}" if mantissa == "1" else f"{mantissa}·10{raised}"
