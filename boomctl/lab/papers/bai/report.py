"""Bai et al. (2009), reproduced: every table and figure beside what correct equations give."""

from collections.abc import Callable, Mapping
from dataclasses import asdict
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np

from boomctl.arrays import Array
from boomctl.lab.papers.bai import frequencies, spin_up, torque
from boomctl.lab.papers.bai.comparison import CORRECTED, MET, NOT_REPRODUCIBLE, Chart, Part
from boomctl.lab.papers.bai.validity import EXACT, TORQUES, section, tip_errors, tips
from boomctl.lab.papers.jobs import Jobs
from boomctl.report import Report, Section, Table
from boomctl.rotating_beam.exact.beam import GeometricallyExactBeam
from boomctl.rotating_beam.manoeuvres import sine_torque
from boomctl.rotating_beam.parameters import HubBeamParameters

PARTS: dict[str, Callable[[], Part]] = {
    "Table 2": frequencies.table_2,
    "Fig. 3": spin_up.neglected_terms,
    "Fig. 4": spin_up.cfoam_and_foam,
    "Fig. 5": spin_up.foam_and_tlam,
    "Fig. 6": spin_up.mode_by_mode,
    "Table 3, Fig. 7": torque.inertia_torque,
    "Fig. 8": torque.foam_and_sfoam,
    "critical speeds, Fig. 9": frequencies.critical_speeds,
    "Fig. 10": spin_up.tip_mass,
}
"""Parts of the paper in its order, each computed by one function."""

_TOGETHER = (
    ("Table 3, Fig. 7", "Fig. 8"),
    ("Fig. 3", "Fig. 4", "Fig. 5", "Fig. 6", "Fig. 10"),
    ("Table 2", "critical speeds, Fig. 9"),
)
"""Parts that share runs of the beam, and are computed by one process for that; the longest first."""
_MODELS: tuple[str, ...] = ("cfoam", "foam", "tlam", EXACT, "sfoam", "sfoam-consistent")  # the longest first (measured)

_CURVE_POINTS = 301  # of a curve in results.json: enough to draw it again, and a file of one megabyte
_SHADES = {MET: "#d8efe2", CORRECTED: "#fff2cc", NOT_REPRODUCIBLE: "#f8d7da"}
_RULE = (
    "A number is met if ours differs by no more than the tolerance beside it: one unit of the last printed digit in Table "
    "2, half a unit for the critical speeds, 10 % for what was read off computed curves. It is met with corrected reading "
    "if it is so once a slip named beside it is mended, and not reproducible otherwise. Frequencies are converged; motions "
    "have the paper's five modes. The paper's curves are not available as data; its statements about them stand in their "
    "place."
)


def jobs(torques: tuple[float, ...] = TORQUES) -> Jobs:
    """Return the jobs of the reproduction, the longest first; :func:`report` makes a report of their results.

    Torques are amplitudes over which the models are held against the geometrically exact beam, N m: at least two, ascending,
    > 0; otherwise `ValueError`.
    """
    if len(torques) < 2 or torques[0] <= 0.0 or any(b <= a for a, b in pairwise(torques)):
        raise ValueError(f"torques = {torques!r}: expected at least two, ascending and > 0")
    valid = {f"validity of {model}": partial(tips, model, torques) for model in _MODELS}
    parts = {names[0]: partial(_drawn_parts, names) for names in _TOGETHER}
    return valid | parts | {"a slew": _film_section}


def report(torques: tuple[float, ...], found: Mapping[str, Any]) -> Report:
    """Return the report of the results of the jobs for these torques."""
    drawn = {name: part for names in _TOGETHER for name, part in found[names[0]].items()}
    valid = section(np.array(torques), tip_errors({model: found[f"validity of {model}"] for model in _MODELS}))
    parts, sections = zip(*(drawn[name] for name in PARTS), (valid, _section(valid)), strict=True)
    values = results(list(parts))
    counts = "; ".join(f"{count} {verdict}" for verdict, count in values["summary"].items())
    lead = (
        "Bai, Ben-Tzvi, Zhou and Huang, A study on dynamic stiffening of a rotating beam with a tip mass, Sensors & "
        "Transducers 5 (2009) 53-68: every number and curve beside what correct equations give. Numbers and statements: "
        f"{counts}."
    )
    return Report("A rotating beam with a tip mass, reproduced", (lead, _RULE), (*sections, found["a slew"]), values)


def _drawn_parts(names: tuple[str, ...]) -> dict[str, tuple[Part, Section]]:
    """Compute and draw parts of the paper."""
    parts = {name: PARTS[name]() for name in names}
    return {name: (part, _section(part)) for name, part in parts.items()}


def _film_section() -> Section:
    """Film a slew of the exact beam by one period of a sine torque of 200 N m, and the vibration left after it."""
    from boomctl.plotting.canvas import film
    from boomctl.plotting.slew import animate_slew

    beam = GeometricallyExactBeam(HubBeamParameters(), 6)
    time = np.arange(141) / 10.0
    motion = beam.simulate(sine_torque(200.0, 10.0, 10.0), time, rtol=1e-6)
    shown = animate_slew(beam, {"exact": motion}, title="slew, 200 N m", time_step=0.1)
    return Section("A slew", pictures=(film("slew", shown, "Geometrically exact beam, drawn to scale, real time"),))


def _section(part: Part) -> Section:
    from boomctl.plotting.canvas import picture
    from boomctl.plotting.rotating_beam import draw_chart

    tables = []
    if part.comparisons:
        heads = ("where", "what", "published", "ours", "corrected reading", "tolerance", "unit", "verdict", "why")
        rows = tuple(
            (
                each.where,
                each.what,
                *("" if value is None else f"{value:.6g}" for value in numbers),
                each.unit,
                each.verdict,
                each.why,
            )
            for each in part.comparisons
            for numbers in ((each.published, each.computed, each.reading, each.tolerance),)
        )
        tables.append(Table(heads, rows, align="llrrrrl", shades=_SHADES))
    if part.claims:
        heads = ("where", "statement", "ours", "verdict", "why")
        rows = tuple((each.where, each.published, each.computed, each.verdict, each.why) for each in part.claims)
        tables.append(Table(heads, rows, align="l", shades=_SHADES))
    pictures = tuple(picture(chart.name, draw_chart(chart), chart.caption) for chart in part.charts)
    return Section(part.title, (), tuple(tables), pictures)


def results(parts: list[Part]) -> dict[str, Any]:
    """Return every number, statement and curve, and how many of them are met, as results.json holds them."""
    verdicts = [each.verdict for part in parts for each in (*part.comparisons, *part.claims)]
    return {
        "paper": "Bai, Ben-Tzvi, Zhou & Huang 2009, Sensors & Transducers 5, 53-68",
        "summary": {verdict: verdicts.count(verdict) for verdict in (MET, CORRECTED, NOT_REPRODUCIBLE)},
        "sections": [
            {
                "title": part.title,
                "comparisons": [asdict(each) for each in part.comparisons],
                "claims": [asdict(each) for each in part.claims],
                "figures": [_curves(chart) for chart in part.charts],
            }
            for part in parts
        ],
    }


def _curves(chart: Chart) -> dict[str, object]:
    return {
        "name": chart.name,
        "caption": chart.caption,
        "panels": [
            {
                "title": panel.title,
                "x": panel.xlabel,
                "y": panel.ylabel,
                "lines": [{"label": line.label, "x": _thin(line.x), "y": _thin(line.y)} for line in panel.lines],
            }
            for panel in chart.panels
        ],
    }


def _thin(values: Array) -> list[float]:
    step = max(1, (len(values) - 1) // (_CURVE_POINTS - 1))
    return [float(f"{value:.6g}") for value in np.asarray(values, dtype=float)[::step]]
