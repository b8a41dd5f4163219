"""Table 2 and the critical speeds of Bai et al. (2009), and Fig. 9."""

import math

import numpy as np

from boomctl.lab.papers.bai.comparison import Comparison, Panel, Part, check_statement, compare, lines
from boomctl.rotating_beam.assumed_modes import AssumedModesBeam
from boomctl.rotating_beam.factory import hub_beam
from boomctl.rotating_beam.parameters import HubBeamParameters
from boomctl.rotating_beam.published import CRITICAL_SPEEDS, FREQUENCIES_HZ

TWO_PI_OF_THE_PAPER = 6.28  # what makes all fifteen printed frequencies agree with computed ones
LAST_DIGIT = 1.0e-4
"""One unit of the last digit of Table 2, Hz."""

_SHAPES = 40  # clamped-free shapes converge slowly with a tip mass
_WHERE = {"mass at the clamp, or none": 0.0, "0.1 kg at the tip": 0.1, "0.5 kg at the tip": 0.5}


def table_2() -> Part:
    """Return the frequencies of the beam alone, with the factor 2 pi/6.28 that all fifteen printed ones carry."""
    slip = 2.0 * math.pi / TWO_PI_OF_THE_PAPER
    comparisons = []
    for (model, speed), values in FREQUENCIES_HZ.items():
        beams = (hub_beam(HubBeamParameters(), model, modes) for modes in (_SHAPES, 5))
        computed, few = (beam.eigenfrequencies_hz(speed) for beam in beams)
        row = f"{model.upper()}, {speed:g} rad/s" if speed else "natural frequency"
        for k, (printed, ours, ours_of_five) in enumerate(zip(values, computed, few, strict=False), 1):
            what, why, slipped = f"{row}, mode {k}", "rad/s divided by 6.28, not 2 pi", float(ours_of_five) * slip
            result = compare("Table 2", what, "Hz", printed, float(ours), why, tolerance=LAST_DIGIT, slipped=slipped)
            comparisons.append(result)
    return Part("Table 2: frequencies (printed under the caption of Table 3)", comparisons=tuple(comparisons))


def critical_speeds() -> Part:
    """Critical speeds of TLAM, and the smallest eigenvalue of its stiffness over speed, mass and place (Fig. 9)."""
    computed = {mass: _critical(mass, None) for mass in CRITICAL_SPEEDS}
    comparisons = tuple(_critical_speed(mass, printed, computed[mass]) for mass, printed in CRITICAL_SPEEDS.items())
    speeds, positions = np.linspace(0.0, 3.5, 141), np.linspace(0.0, 8.0, 41)
    by_speed = {label: np.array([_smallest_eigenvalue(mass, w) for w in speeds]) for label, mass in _WHERE.items()}
    by_position = {f"{m} kg": np.array([_critical(m, float(position)) for position in positions]) for m in (0.1, 0.5)}
    left = Panel(
        "(a) smallest eigenvalue of K22",
        "eigenvalue [N/m]",
        lines(speeds, by_speed),
        "hub speed [rad/s]",
        ylim=(-15.0, 15.0),
        levels=((0.0, ""),),
    )
    right = Panel("(b) critical speed", "hub speed [rad/s]", lines(positions, by_position), "place of the mass l [m]")
    caption = (
        "Fig. 9. TLAM: smallest eigenvalue of its stiffness K22 over the hub speed, and the speed at which it "
        "vanishes over the place of the mass"
    )
    at_hub = _critical(0.5, 0.0)
    falling = all(bool(np.all(np.diff(y) < 1e-9)) for y in by_position.values())
    claim = check_statement(
        "Fig. 9",
        "the mass at the clamp changes nothing; towards the tip, and the heavier it is, the lower the critical speed",
        f"{at_hub:.4f} rad/s with 0.5 kg at the clamp; falling all along the beam",
        abs(at_hub - computed[0.0]) < 1e-6 and falling,
        "the eigenvalue's scale depends on that of the mode shapes; its zero does not",
    )
    title = "Critical speeds of TLAM and Fig. 9 (section 4.4)"
    return Part(title, "fig-09", caption, (left, right), comparisons, (claim,))


def _critical_speed(mass: float, printed: float, computed: float) -> Comparison:
    why = "" if mass < 0.5 else "converged: fewer modes than ours only raise it; perhaps 1.91 for 1.94"
    what = f"critical speed of TLAM, tip mass {mass} kg"
    return compare("section 4.4", what, "rad/s", printed, computed, why, tolerance=0.005)


def _critical(mass: float, position: float | None) -> float:
    p = HubBeamParameters(tip_mass=mass, tip_mass_position=position)
    return float(hub_beam(p, "tlam", _SHAPES).divergence_speed())


def _smallest_eigenvalue(mass: float, speed: float) -> float:
    """Of ``K2 - w^2 M2`` with the five modes of the paper, N/m."""
    integrals = AssumedModesBeam(HubBeamParameters(tip_mass=mass), "tlam", 5)._integrals
    return float(np.linalg.eigvalsh(integrals.K2 - speed**2 * integrals.M2)[0])
