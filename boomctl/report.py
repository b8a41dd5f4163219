"""A report that stands alone: one HTML file with its tables and pictures in it."""

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

_ROUNDING = 1e-9  # what reports call "less than": nothing in them is measured or computed finer

_STYLE = """
body{font:15px/1.5 system-ui,sans-serif;max-width:62rem;margin:2rem auto;padding:0 1rem;color:#1b1b1b}
h1{font-size:1.6rem;margin-bottom:.2rem}h2{font-size:1.15rem;margin-top:2.2rem;border-bottom:1px solid #ccc}
table{display:block;overflow-x:auto;
border-collapse:collapse;margin:.8rem 0;font-variant-numeric:tabular-nums;font-size:.87rem}
th,td{padding:.22rem .6rem;text-align:right;border-bottom:1px solid #e4e4e4}th{background:#f3f5f7}
th:first-child,td:first-child,table.prose th,table.prose td{text-align:left}img{max-width:100%;height:auto}
figcaption,.note{color:#444;font-size:.9rem}figure{margin:1rem 0}
"""


@dataclass(frozen=True)
class Table:
    """A table: column heads, lines of text, a caption; ``prose`` sets words, not numbers, to the left."""

    heads: tuple[str, ...]
    lines: tuple[tuple[str, ...], ...]
    caption: str = ""
    prose: bool = False


@dataclass(frozen=True)
class Picture:
    """A picture: its file's content, kind (``"svg"``, ``"png"`` or ``"gif"``) and caption."""

    content: bytes
    kind: str
    caption: str


@dataclass(frozen=True)
class Section:
    """A heading, paragraphs, tables and pictures, in that order."""

    title: str
    text: tuple[str, ...] = ()
    tables: tuple[Table, ...] = ()
    pictures: tuple[Picture, ...] = ()


def html_report(title: str, lead: str, sections: Sequence[Section]) -> str:
    """Return the report as one HTML document that refers to nothing outside itself."""
    body = "\n".join(_section(section) for section in sections)
    return (
        f"<!doctype html>\n<html lang='en'><head><meta charset='utf-8'><title>{escape(title)}</title>"
        f"<meta name='viewport' content='width=device-width'><style>{_STYLE}</style></head><body>"
        f"<h1>{escape(title)}</h1><p>{escape(lead)}</p>\n{body}\n</body></html>\n"
    )


def bound_reports(title: str, reports: Sequence[tuple[str, str]]) -> str:
    """Return several reports (heading, HTML document) in one document that refers to nothing outside itself."""
    frame = "iframe{width:100%;height:92vh;border:1px solid #ccc}"
    parts = [
        f"<h2>{escape(head)}</h2><iframe title='{escape(head)}' srcdoc='{escape(html)}'></iframe>"
        for head, html in reports
    ]
    body = "\n".join(parts)
    return (
        f"<!doctype html>\n<html lang='en'><head><meta charset='utf-8'><title>{escape(title)}</title>"
        f"<style>{_STYLE}{frame}</style></head><body><h1>{escape(title)}</h1>\n{body}\n</body></html>\n"
    )


def _section(section: Section) -> str:
    parts = [f"<h2>{escape(section.title)}</h2>"]
    parts += [f"<p>{escape(text)}</p>" for text in section.text]
    parts += [_table(table) for table in section.tables]
    parts += [_picture(picture) for picture in section.pictures]
    return "\n".join(parts)


def _table(table: Table) -> str:
    heads = "".join(f"<th>{escape(head)}</th>" for head in table.heads)
    lines = "\n".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in line) + "</tr>" for line in table.lines)
    caption = f"<p class='note'>{escape(table.caption)}</p>" if table.caption else ""
    kind = " class='prose'" if table.prose else ""
    return f"<table{kind}><thead><tr>{heads}</tr></thead><tbody>\n{lines}\n</tbody></table>{caption}"


def _picture(picture: Picture) -> str:
    mime = {"svg": "image/svg+xml", "png": "image/png", "gif": "image/gif"}[picture.kind]
    data = base64.b64encode(picture.content).decode("ascii")
    caption = escape(picture.caption)
    return f"<figure><img alt='{caption}' src='data:{mime};base64,{data}'><figcaption>{caption}</figcaption></figure>"


def number(value: float, digits: int = 3) -> str:
    """Return a number with few digits, small and large ones with a power of ten; what is rounding is said to be so."""
    if abs(value) < _ROUNDING:
        return f"less than {power(_ROUNDING, 1)}"
    if 1e-3 <= abs(value) < 1e4:
        return f"{value:#.{digits}g}".rstrip(".").replace("-", "−")
    return power(value, digits)


def power(value: float, digits: int) -> str:
    """Return a number times a power of ten, "2.1·10⁻³"."""
    mantissa, exponent = f"{value:.{digits - 1}e}".replace("-", "−").split("e")
    raised = str(int(exponent.replace("−", "-"))).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
    return f"10{raised}" if mantissa == "1" else f"{mantissa}·10{raised}"
