"""Anthonis & Ramon (2003), reproduced: tables and pictures beside what was published."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from boomctl.analysis.measured import MeasuredCurve
from boomctl.boom.parameters import BoomParameters
from boomctl.lab.papers.anthonis_ramon.figures import BoomReproduction, compute
from boomctl.lab.papers.anthonis_ramon.friction import FULL_POINTS, POINTS, friction_section, friction_study
from boomctl.lab.papers.anthonis_ramon.updating import updating_results, updating_section, updating_study
from boomctl.lab.papers.jobs import Jobs
from boomctl.report import Report, Section, Table

_LEAD = (
    "Eigenfrequencies and singular values of the horizontal motion of a 12 m spray boom, from the parameters of Anthonis"
    " & Ramon (2003), J. Sound Vib. 266, 535-552, Table 2. Each number stands beside the published one and beside that"
    " of an exact Euler-Bernoulli beam. Nothing was fitted but in the section that says so."
)
_TABLE_1 = (
    "Damped frequencies, Im(lambda)/2 pi, platform held by its actuators. The finite element and the Hermitian column are"
    " met. Hermitian mass: the paper does not say how it divides the boom in 6; nodes at hinge and springs, equal elements"
    " in between, are taken here."
)
_GEOMETRICAL = (
    "Geometrical mass allocation: half of each element is a point mass at either of its ends, 16 elements outside and 4"
    " between the springs, what the boom has beyond its tube at the hinge. This meets the first three values within 0.5 %"
    " and the fifth within 1 %. The fourth, 2.9316 Hz, is not reproducible: no division of 20 elements, neither with point"
    " masses nor with the mass of linear interpolation, comes near it while the others stay; it lies above the exact"
    " 2.7833 Hz, where point masses put every other value below the exact one. The table of readings below shows what was"
    " tried."
)
_FIGURE_3 = (
    "Singular values from the two platform actuators to the two tips. Two certified peaks are marked: no singular value"
    " at any frequency exceeds them. The measured curve of the paper is not available in numbers; its eigenfrequencies"
    " are marked."
)
_CONVERGENCE = (
    "Relative error of the first five damped frequencies. Equal elements have hinge or springs inside elements, which"
    " costs an order and makes the error depend on where they fall; with nodes there the error falls with the fourth"
    " order. The discrete elements of the paper keep 4 elements between the springs, so that their error ends where these"
    " are too long. High-order elements have nodes at hinge and springs."
)


@dataclass(frozen=True)
class Chapter:
    """Sections of the report, and what they put into ``results.json``."""

    sections: tuple[Section, ...]
    results: dict[str, Any]


def jobs(parameters: BoomParameters | None = None, measured: MeasuredCurve | None = None, full: bool = False) -> Jobs:
    """Return the jobs of the reproduction, the longest first; :func:`report` makes a report of their results.

    Parameters are by default those of Table 2; a measured sigma curve is laid over Fig. 3; ``full`` takes more frequencies
    for the simulated sines.
    """
    p = BoomParameters() if parameters is None else parameters
    return {
        "friction in the cradle": partial(friction_chapter, p, FULL_POINTS if full else POINTS),
        "table and figures": partial(figures_chapter, p, measured),
        "fitted parameters": partial(updating_chapter, p),
    }


def report(found: Mapping[str, Chapter]) -> Report:
    """Return the report of the jobs' results."""
    friction, figures, updating = (
        found[name] for name in ("friction in the cradle", "table and figures", "fitted parameters")
    )
    sections = (*figures.sections, *friction.sections, *updating.sections)
    results = {**figures.results, **friction.results, **updating.results}
    return Report("The spray boom of Anthonis & Ramon (2003)", (_LEAD,), sections, results)


def friction_chapter(p: BoomParameters, points: int) -> Chapter:
    """Compute and draw what friction in the cradle does, with simulated sines at so many frequencies."""
    from boomctl.plotting.boom import draw_friction
    from boomctl.plotting.canvas import picture

    study = friction_study(p, points=points)
    sines = picture(
        "boom_friction",
        draw_friction(study),
        "Singular values of jolt and yaw. Lines: describing function; circles: stepped sine on the nonlinear model, at"
        f" {points} frequencies (boomctl reproduce --full takes {FULL_POINTS}).",
    )
    numbers = {
        "platform_amplitude": study.amplitude,
        "force": study.force,
        "matched_hz": study.matched_hz,
        "lower_over_linear": study.numbers(),
    }
    return Chapter((friction_section(study, sines),), {"friction": numbers})


def updating_chapter(p: BoomParameters) -> Chapter:
    """Fit parameters to the measured row of Table 1, and draw the one that explains it."""
    from boomctl.plotting.canvas import new_figure, picture

    study = updating_study(p)
    figure = new_figure()
    study.lever.plot(ax=figure.add_subplot())
    drawn = picture(
        "boom_updating", figure, "Measured frequencies, those of Table 2, and those of the fitted distance."
    )
    return Chapter((updating_section(study, drawn),), {"updating": updating_results(study)})


def figures_chapter(p: BoomParameters, measured: MeasuredCurve | None) -> Chapter:
    """Compute and draw Table 1, Fig. 3, convergence and modes."""
    from boomctl.plotting.boom import draw_convergence, draw_figure_3, draw_modes
    from boomctl.plotting.canvas import picture

    result = compute(p)
    figure_3 = picture(
        "boom_figure_3",
        draw_figure_3(result.sigma, result.measured_hz, result.deviation, measured),
        "Singular values over frequency, and their distance from exact.",
    )
    convergence = picture("boom_convergence", draw_convergence(result.convergence), "Error over mesh size.")
    modes = picture(
        "boom_modes",
        draw_modes(result.modes, p),
        "First five modes, platform held. Shapes undamped; frequencies and damping ratios of the damped system.",
    )
    sections = (
        Section("Table 1: eigenfrequencies", (_TABLE_1, _GEOMETRICAL), (_table_1(result), _readings(result))),
        Section("Fig. 3: singular values", (_FIGURE_3,), (_peaks(result),), (figure_3,)),
        Section("Convergence", (_CONVERGENCE,), (), (convergence,)),
        Section("Modes", (), (), (modes,)),
    )
    return Chapter(sections, _results(result))


def _peaks(result: BoomReproduction) -> Table:
    lines = tuple(
        (
            name,
            f"{curve.peak:.4f}",
            f"{curve.peak_omega / (2 * np.pi):.6f}",
            "yes" if curve.certified else "on its grid",
            f"{curve.certificate.upper:.4f}" if curve.certified else "-",
        )
        for name, curve in result.sigma.items()
    )
    heads = ("curve", "peak [m/m]", "at [Hz]", "certified", "upper bound")
    return Table(heads, lines, "Largest singular value, platform actuators to tips.")


def _table_1(result: BoomReproduction) -> Table:
    heads = ["", "measured"]
    for method in result.methods:
        heads += [f"{method.name}: published", "here", "diff. %"]
    lines = []
    for k in range(len(result.exact_hz)):
        line = [f"{k + 1}", f"{result.measured_hz[k]:g}"]
        for method in result.methods:
            line += [
                f"{method.published_hz[k]:.4f}",
                f"{method.computed_hz[k]:.4f}",
                f"{method.difference_percent[k]:+.3f}",
            ]
        lines.append((*line, f"{result.exact_hz[k]:.5f}", f"{result.exact_undamped_hz[k]:.5f}"))
    return Table((*heads, "exact beam", "exact, undamped"), tuple(lines), "Table 1 [Hz].")


def _readings(result: BoomReproduction) -> Table:
    published = result.methods[-1].published_hz
    lines = [("published", "", *(f"{value:.4f}" for value in published))]
    for item in result.readings:
        mass = "point masses" if item.mass == "lumped" else "linear interpolation"
        lines.append((mass, f"{20 - item.inner} + {item.inner}", *(f"{value:.4f}" for value in item.computed_hz)))
    heads = ("mass", "elements outside + between springs", "1", "2", "3", "4", "5")
    return Table(heads, tuple(lines), "Readings of the geometrical column, 20 elements [Hz].")


def _results(result: BoomReproduction) -> dict[str, Any]:
    columns = ("published_hz", "computed_hz", "difference_percent")
    methods = {method.name: {key: getattr(method, key) for key in columns} for method in result.methods}
    return {
        "table_1": {
            "measured_hz": result.measured_hz,
            "exact_hz": result.exact_hz,
            "exact_undamped_hz": result.exact_undamped_hz,
            "methods": methods,
            "readings_of_geometrical_mass": [
                {"mass": item.mass, "elements_between_springs": item.inner, "computed_hz": item.computed_hz}
                for item in result.readings
            ],
        },
        "figure_3": {
            name: {
                "freq_hz": curve.omega / (2 * np.pi),
                "sigma": curve.sigma,
                "peak": curve.peak,
                "peak_hz": curve.peak_omega / (2 * np.pi),
                "certified": curve.certified,
                "upper_bound": curve.certificate.upper,
            }
            for name, curve in result.sigma.items()
        },
        "convergence": {
            item.name: {item.of: item.sizes, "unknowns": item.unknowns, "relative_error": item.error}
            for item in result.convergence
        },
    }
