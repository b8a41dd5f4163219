"""Report of Anthonis & Ramon (2003): computed and published tables and figures."""

from collections.abc import Mapping
from functools import partial

from boomctl.boom.parameters import BoomParameters
from boomctl.identification.files.frequency_response import MeasuredFrequencyResponse
from boomctl.lab.papers.anthonis_ramon.figures import figures_chapter
from boomctl.lab.papers.anthonis_ramon.friction import POINTS, friction_chapter
from boomctl.lab.papers.anthonis_ramon.updating import updating_chapter
from boomctl.lab.papers.jobs import Chapter, Jobs
from boomctl.report import Report

_LEAD = (
    "Eigenfrequencies and singular values of the horizontal motion of a 12 m spray boom, from the parameters of Anthonis"
    " & Ramon (2003), J. Sound Vib. 266, 535-552, Table 2. Each number is compared with the published one and with that"
    " of an exact Euler-Bernoulli beam. Parameters were fitted only in the section on updating."
)
_ORDER = ("table and figures", "friction in the cradle", "fitted parameters")


def jobs(parameters: BoomParameters | None = None, measured: MeasuredFrequencyResponse | None = None) -> Jobs:
    """Return the jobs of the reproduction, the longest first; :func:`report` makes a report of their results.

    Parameters are by default those of Table 2; a measured sigma curve is laid over Fig. 3.
    """
    p = BoomParameters() if parameters is None else parameters
    return {
        "friction in the cradle": partial(friction_chapter, p, POINTS),
        "table and figures": partial(figures_chapter, p, measured),
        "fitted parameters": partial(updating_chapter, p),
    }


def report(jobs: Mapping[str, Chapter]) -> Report:
    """Return the report of the jobs' results."""
    chapters = [jobs[name] for name in _ORDER]
    sections = tuple(section for chapter in chapters for section in chapter.sections)
    results = {key: value for chapter in chapters for key, value in chapter.results.items()}
    return Report("The spray boom of Anthonis & Ramon (2003)", (_LEAD,), sections, results)
