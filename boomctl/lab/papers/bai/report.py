"""Report of Bai et al. (2009): published tables and figures, and those of corrected equations."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, astuple
from functools import partial
from typing import Any

import numpy as np

from boomctl.arrays import Array
from boomctl.lab.papers.bai import frequencies, spin_up, torque
from boomctl.lab.papers.bai.comparison import CORRECTED, MET, MODELS, NOT_REPRODUCIBLE, Comparison, Part
from boomctl.lab.papers.bai.validity import TORQUES, section, tip_errors, tips
from boomctl.lab.papers.jobs import Jobs
from boomctl.maneuvers import sine_torque
from boomctl.report import Report, Section, Table
from boomctl.rotating_beam.exact.beam import GeometricallyExactBeam
from boomctl.rotating_beam.parameters import HubBeamParameters

_DRAWN = {
    "Table 3, Figs. 7 and 8": (torque.inertia_torque, torque.foam_and_sfoam),
    "Figs. 3 to 6 and 10": (
        spin_up.neglected_terms,
        spin_up.cfoam_and_foam,
        spin_up.foam_and_tlam,
        spin_up.mode_by_mode,
        spin_up.tip_mass,
    ),
    "Table 2, Fig. 9": (frequencies.table_2, frequencies.critical_speeds),
}
"""Parts of the paper that share runs of the beam; the longest first."""
_MODELS = ("CFOAM", "FOAM", "TLAM", "exact", "SFOAM", "SFOAM, consistent")  # in order of run time, the longest first

_CURVE_POINTS = 301  # of a curve in results.json: enough to draw it again, and a file of one megabyte
_SHADES = {MET: "#d8efe2", CORRECTED: "#fff2cc", NOT_REPRODUCIBLE: "#f8d7da"}
_RULE = (
    "A number is met if the difference is within the tolerance: one unit of the last printed digit in Table 2, half a unit "
    "for the critical speeds, 10 % for values that were read off curves. It is met with corrected reading if this "
    "holds after the correction of the named misprint, and not reproducible otherwise. Frequencies are converged; "
    "motions have the five modes of the paper. The curves of the paper are not available as data; its statements about "
    "them are compared instead."
)


def jobs(torques: tuple[float, ...] = TORQUES) -> Jobs:
    """Return the jobs of the reproduction, the longest first; :func:`report` makes a report of their results.

    Torques are amplitudes [N m] over which the models are held against the geometrically exact beam, ascending.
    """
    valid = {f"validity of {label}": partial(tips, MODELS[label], torques) for label in _MODELS}
    return valid | {name: partial(_drawn, name) for name in _DRAWN} | {"a slew": _film}


def report(jobs: Mapping[str, Any], torques: tuple[float, ...] = TORQUES) -> Report:
    """Return the report of the results of the jobs for these torques."""
    free, (*spun_up, fig_10), (table_2, fig_9) = (jobs[name] for name in _DRAWN)
    valid = section(np.array(torques), tip_errors({label: jobs[f"validity of {label}"] for label in _MODELS}))
    parts, sections = zip(table_2, *spun_up, *free, fig_9, fig_10, (valid, _section(valid)), strict=True)
    values = results(parts)
    counts = "; ".join(f"{count} {verdict}" for verdict, count in values["summary"].items())
    lead = (
        "Bai, Ben-Tzvi, Zhou and Huang, A study on dynamic stiffening of a rotating beam with a tip mass, Sensors & "
        "Transducers 5 (2009) 53-68: published numbers and curves, and those of corrected equations. Numbers and statements: "
        f"{counts}."
    )
    return Report("A rotating beam with a tip mass, reproduced", (lead, _RULE), (*sections, jobs["a slew"]), values)


def _drawn(name: str) -> list[tuple[Part, Section]]:
    """Compute and draw parts of the paper."""
    return [(part, _section(part)) for part in (make() for make in _DRAWN[name])]


def _film() -> Section:
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
        tables.append(Table(heads, tuple(map(_line, part.comparisons)), align="llrrrrl", shades=_SHADES))
    if part.claims:
        heads = ("where", "statement", "ours", "verdict", "why")
        tables.append(Table(heads, tuple(map(astuple, part.claims)), align="l", shades=_SHADES))
    pictures = (picture(part.name, draw_chart(part), part.caption),) if part.panels else ()
    return Section(part.title, (), tuple(tables), pictures)


def _line(comparison: Comparison) -> tuple[str, ...]:
    numbers = (comparison.published, comparison.computed, comparison.reading, comparison.tolerance)
    texts = ("" if value is None else f"{value:.6g}" for value in numbers)
    return (comparison.where, comparison.what, *texts, comparison.unit, comparison.verdict, comparison.why)


def results(parts: Sequence[Part]) -> dict[str, Any]:
    """Return every number, statement and curve, and how many of them are met, as results.json holds them."""
    verdicts = [item.verdict for part in parts for item in (*part.comparisons, *part.claims)]
    return {
        "paper": "Bai, Ben-Tzvi, Zhou & Huang 2009, Sensors & Transducers 5, 53-68",
        "summary": {verdict: verdicts.count(verdict) for verdict in (MET, CORRECTED, NOT_REPRODUCIBLE)},
        "sections": [
            {
                "title": part.title,
                "comparisons": [asdict(item) for item in part.comparisons],
                "claims": [asdict(item) for item in part.claims],
                "figures": [_curves(part)] if part.panels else [],
            }
            for part in parts
        ],
    }


def _curves(part: Part) -> dict[str, object]:
    panels = [
        {
            "title": panel.title,
            "x": panel.xlabel,
            "y": panel.ylabel,
            "lines": [{"label": line.label, "x": _thin(line.x), "y": _thin(line.y)} for line in panel.lines],
        }
        for panel in part.panels
    ]
    return {"name": part.name, "caption": part.caption, "panels": panels}


def _thin(values: Array) -> list[float]:
    step = max(1, (len(values) - 1) // (_CURVE_POINTS - 1))
    return [float(f"{value:.6g}") for value in np.asarray(values, dtype=float)[::step]]
