"""What the reproduction leaves behind: pictures, results.json, and a report that stands alone."""

import base64
import html
import json
from dataclasses import asdict

import numpy as np

from boomctl.arrays import Array
from boomctl.files import plain
from boomctl.papers.bai.comparison import CORRECTED, MET, NOT_REPRODUCIBLE, Section
from boomctl.plotting.rotating_beam import Picture, picture_bytes

_CURVE_POINTS = 301
_COLOURS = {MET: "#d8efe2", CORRECTED: "#fff2cc", NOT_REPRODUCIBLE: "#f8d7da"}
_STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; max-width: 62rem; margin: 2rem auto; padding: 0 1rem; color: #222 }
table { border-collapse: collapse; margin: .8rem 0; width: 100%; font-size: 13px }
th, td { border: 1px solid #ccc; padding: .25rem .5rem; text-align: left; vertical-align: top }
td.n { text-align: right; white-space: nowrap; font-variant-numeric: tabular-nums }
img { max-width: 100%; height: auto } figure { margin: 1rem 0 } figcaption { color: #555; font-size: 13px }
"""


def results_json(sections: tuple[Section, ...]) -> str:
    """Every number, statement and curve as JSON; numbers that are not finite become strings.

    Parameters
    ----------
    sections : tuple of Section
    """
    data = {
        "paper": "Bai, Ben-Tzvi, Zhou & Huang 2009, Sensors & Transducers 5, 53-68",
        "summary": summary(sections),
        "sections": [
            {
                "title": section.title,
                "comparisons": [asdict(each) for each in section.comparisons],
                "claims": [asdict(each) for each in section.claims],
                "figures": [_curves(picture) for picture in section.pictures],
            }
            for section in sections
        ],
    }
    return json.dumps(plain(data), indent=1, ensure_ascii=False, allow_nan=False)


def summary(sections: tuple[Section, ...]) -> dict[str, int]:
    """How many numbers and statements are met, met with corrected reading, and not reproducible."""
    verdicts = [each.verdict for section in sections for each in (*section.comparisons, *section.claims)]
    return {verdict: verdicts.count(verdict) for verdict in (MET, CORRECTED, NOT_REPRODUCIBLE)}


def _curves(picture: Picture) -> dict[str, object]:
    return {
        "name": picture.name,
        "caption": picture.caption,
        "panels": [
            {
                "title": panel.title,
                "x": panel.xlabel,
                "y": panel.ylabel,
                "lines": [{"label": line.label, "x": _thin(line.x), "y": _thin(line.y)} for line in panel.lines],
            }
            for panel in picture.panels
        ],
    }


def _thin(values: Array) -> list[float]:
    step = max(1, (len(values) - 1) // (_CURVE_POINTS - 1))
    return [float(f"{value:.6g}") for value in np.asarray(values, dtype=float)[::step]]


def report_html(sections: tuple[Section, ...], images: dict[str, bytes], film: bytes) -> str:
    """The report: tables, statements and pictures in one file.

    Parameters
    ----------
    sections : tuple of Section
    images : dict of str to bytes
        PNG by picture name.
    film : bytes
        GIF.
    """
    counts = "; ".join(f"{count} {verdict}" for verdict, count in summary(sections).items())
    parts = [
        "<!doctype html><html lang=en><meta charset=utf-8><title>Rotating hub-beam: reproduction</title>",
        f"<style>{_STYLE}</style><h1>A rotating beam with a tip mass, reproduced</h1>",
        "<p>Bai, Ben-Tzvi, Zhou and Huang, <i>A study on dynamic stiffening of a rotating beam with a tip mass</i>, "
        "Sensors &amp; Transducers 5 (2009) 53-68: every number and curve beside what correct equations give. "
        f"Numbers and statements: {html.escape(counts)}.</p>",
        "<p>A number is <b>met</b> if ours differs by no more than the tolerance beside it: one unit of the last "
        "printed digit in Table 2, half a unit for the critical speeds, 10 % for what was read off computed curves. "
        "It is <b>met with corrected reading</b> if it is so once a slip named beside it is mended, and <b>not "
        "reproducible</b> otherwise. Frequencies are converged; motions have the paper's five modes. The paper's "
        "curves are not available as data; its statements about them stand in their place.</p>",
    ]
    for section in sections:
        parts.append(f"<h2>{html.escape(section.title)}</h2>")
        parts += [_numbers(section), _statements(section)]
        parts += [_figure(picture.caption, "png", images[picture.name]) for picture in section.pictures]
    parts += ["<h2>A slew</h2>", _figure("Geometrically exact beam, drawn to scale, real time", "gif", film), "</html>"]
    return "\n".join(part for part in parts if part)


def _figure(caption: str, kind: str, image: bytes) -> str:
    data = base64.b64encode(image).decode("ascii")
    text = html.escape(caption)
    return f'<figure><img alt="{text}" src="data:image/{kind};base64,{data}"><figcaption>{text}</figcaption></figure>'


def _numbers(section: Section) -> str:
    if not section.comparisons:
        return ""
    heads = ("where", "what", "published", "ours", "corrected reading", "tolerance", "unit", "verdict", "why")
    rows = [
        (
            (each.where, ""),
            (each.what, ""),
            *((_number(value), "n") for value in (each.published, each.computed, each.reading, each.tolerance)),
            (each.unit, ""),
            (each.verdict, ""),
            (each.why, ""),
        )
        for each in section.comparisons
    ]
    return _table(heads, rows, [each.verdict for each in section.comparisons])


def _statements(section: Section) -> str:
    if not section.claims:
        return ""
    rows = [
        tuple((text, "") for text in (each.where, each.published, each.computed, each.verdict, each.why))
        for each in section.claims
    ]
    heads = ("where", "statement", "ours", "verdict", "why")
    return _table(heads, rows, [each.verdict for each in section.claims])


def _table(heads: tuple[str, ...], rows: list[tuple[tuple[str, str], ...]], verdicts: list[str]) -> str:
    lines = ["<table><tr>" + "".join(f"<th>{head}</th>" for head in heads) + "</tr>"]
    for row, verdict in zip(rows, verdicts, strict=True):
        cells = "".join(
            f"<td{' class=n' if kind else ''}{_shade(text, verdict)}>{html.escape(text)}</td>" for text, kind in row
        )
        lines.append(f"<tr>{cells}</tr>")
    return "".join([*lines, "</table>"])


def _shade(text: str, verdict: str) -> str:
    return f' style="background:{_COLOURS[verdict]}"' if text == verdict and verdict in _COLOURS else ""


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.6g}"


def images_of(sections: tuple[Section, ...], ending: str) -> dict[str, bytes]:
    """Every picture as the bytes of a file, by name.

    Parameters
    ----------
    sections : tuple of Section
    ending : str
        "png" or "svg".
    """
    return {picture.name: picture_bytes(picture, ending) for section in sections for picture in section.pictures}
