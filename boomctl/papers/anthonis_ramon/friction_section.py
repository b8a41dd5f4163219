"""The report's section on friction in the cradle: what it explains of the measured lower singular value, and what not."""

from collections.abc import Callable
from typing import Any

from boomctl.boom import BoomParameters
from boomctl.papers.anthonis_ramon.friction import BAND_HZ, BoomFriction, friction_study
from boomctl.report import Picture, Section, Table

_POINTS = 26


def studied(p: BoomParameters, tell: Callable[[str], None]) -> BoomFriction:
    """Return the study at the few frequencies that a report shows."""
    return friction_study(p, points=_POINTS, tell=tell)


def friction_numbers(study: BoomFriction) -> dict[str, Any]:
    """Return the study's numbers, for JSON."""
    return {
        "platform_amplitude": study.amplitude,
        "force": study.force,
        "matched_hz": study.matched_hz,
        "lower_over_linear": study.numbers(),
    }


def friction_section(study: BoomFriction, picture: Picture) -> Section:
    """Return text, table and picture."""
    low, high = BAND_HZ
    text = (
        f"Between {low:g} and {high:g} Hz the paper measured a lower singular value below the computed one and put it down"
        " to the cradle, which sticks and slips. Friction acts on the jolt alone; here it is simulated in time with true"
        f" stick-slip (stepped sine, {1e3 * study.amplitude:g} mm at each actuator) and by its describing function. The"
        f" friction force, {study.force:.2f} N, is the one whose equivalent damping is the c_g of Table 2 at the mode"
        f" of {study.matched_hz:.2f} Hz; the paper gives neither force nor amplitude, both are assumptions."
    )
    verdict = (
        "A cradle that sticks in addition to the viscous damping of Table 2 raises the lower singular value, for it carries"
        " the hinge along with the platform. What lowers it, as measured, is friction in place of that damping: a linear fit"
        " takes Coulomb friction for a c_g that is right at one slip speed and too large above, where the equivalent damping"
        " 4 F/(pi w A) has fallen. So stick-slip explains the mismatch if the c_g of Table 2 is itself such a fit, and not if"
        " it is oil. Above 3.5 Hz the lower singular value is that of the yaw, which friction in the cradle does not touch;"
        " there the mismatch ends in the paper as well."
    )
    lines = tuple((name, f"{value:.2f}") for name, value in study.numbers().items())
    caption = f"Lower singular value over the linear one, mean from {low:g} to {high:g} Hz; measured: below 1."
    table = Table(("reading of the friction", "ratio"), lines, caption)
    return Section("Friction in the cradle", (text, verdict), (table,), (picture,))
