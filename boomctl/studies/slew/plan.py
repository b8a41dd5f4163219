"""The slew that ``boomctl slew`` plans: the one asked for, the fastest and the cheapest beside it, errors over meshes."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from boomctl.rotating_beam.assumed_modes import AssumedModesBeam
from boomctl.slew.budget import SlewProgress
from boomctl.slew.nlp.mesh_study import mesh_study
from boomctl.slew.optimal import TIME_LIMIT, optimal_slew
from boomctl.slew.result import SlewResult
from boomctl.studies.slew.design import SlewDesign, SlewEvaluation

STEPS = 7  # what `evaluated_plan` (3) and the report (4) tell of
_SCHEMES = (("shooting", 1), ("collocation", 3), ("radau", 3))
"""Ways to plan whose errors are shown over meshes, and the substeps or collocation points of each."""
_ROOM = 1.1  # duration of the cheapest slew over the least time; with less room its torque is nearly bang-bang


def evaluated_plan(
    h: AssumedModesBeam,
    *,
    angle: float,
    torque_limit: float,
    meshes: tuple[int, ...] | None = None,
    tell: Callable[[str], None] = lambda text: None,
    time_limit: float = TIME_LIMIT,
    progress: Callable[[SlewProgress], object] | None = None,
    **asked: Any,
) -> SlewEvaluation:
    """Plan a slew and judge it beside the fastest, the cheapest and classical ones.

    Parameters
    ----------
    h : AssumedModesBeam
    angle, torque_limit : float
        rad, N m.
    meshes : tuple of int
        Numbers of intervals, ascending, on which the report shows the error of planning; None: three, by the fastest
        bending vibration; () leaves that out.
    tell : callable
        Told in words what comes next.
    time_limit, progress
        Of each slew, as `optimal_slew` has them.
    asked
        Objective, duration and further limits by the names that `optimal_slew` has for them.
    """
    tell("the slew asked for")
    search = {"time_limit": time_limit, "progress": progress}
    slew = optimal_slew(h, angle, torque_limit, **asked, **search)
    tell("slews to compare")
    planned = _beside(h, slew, angle, torque_limit, search)
    evaluation = SlewDesign("slew", "A slew of a flexible beam", h, planned).evaluate()
    tell("errors over meshes")
    roomy = _ROOM * planned["minimum time"].duration
    counts = default_meshes(h, roomy) if meshes is None else meshes
    if not counts:
        return evaluation
    # axial vibrations are too fast for shooting on any of these meshes
    schemes = tuple(scheme for scheme in _SCHEMES if scheme[0] != "shooting" or not h.has_axial_modes)
    return replace(evaluation, meshes=mesh_study(h, angle, torque_limit, roomy, schemes=schemes, intervals=counts))


def _title(slew: SlewResult) -> str:
    """Return what sets a slew apart from others of the same beam."""
    limited = ", with limits" if slew.plan.problem.limits.beside_torque else ""
    return f"{slew.title}{limited}" if slew.objective == "time" else f"{slew.title}, {slew.duration:.3g} s{limited}"


def _beside(
    h: AssumedModesBeam, slew: SlewResult, angle: float, torque_limit: float, search: dict[str, Any]
) -> dict[str, SlewResult]:
    """Return the slew asked for, the fastest one, and the cheapest in a little more than the least time."""
    named = {_title(slew): slew}
    if "minimum time" not in named:
        named["minimum time"] = optimal_slew(h, angle, torque_limit, **search)
    roomy = _ROOM * named["minimum time"].duration
    effort = optimal_slew(h, angle, torque_limit, "effort", roomy, method="shooting", intervals=200, **search)
    named.setdefault(_title(effort), effort)
    return named


def default_meshes(h: AssumedModesBeam, duration: float) -> tuple[int, ...]:
    """Return three meshes, the coarsest with four intervals a period of the fastest bending mode, or what is cheap."""
    bending = AssumedModesBeam(h.parameters, "sfoam", h.modes)
    needed = 4.0 * duration * float(bending.frequencies_hz().max())
    first = 10 * min(max(round(needed / 10.0), 2), 10)
    return (first, 2 * first, 4 * first)
