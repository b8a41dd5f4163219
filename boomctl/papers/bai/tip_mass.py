"""Fig. 10 of Bai et al. (2009): TLAM with a tip mass, and what the mass does to the first frequency."""

import numpy as np

from boomctl.papers.bai.comparison import Part, judge
from boomctl.plotting.rotating_beam import COLOURS, Chart, Line, Panel
from boomctl.rotating_beam import HubBeamParameters, SimulationResult, hub_beam, spin_up

TIME = np.linspace(0.0, 60.0, 3001)
MASSES = (0.0, 0.1, 0.5)


def _run(model: str, mass: float) -> SimulationResult:
    return hub_beam(HubBeamParameters(tip_mass=mass), model, 5).simulate(spin_up(2.0, 30.0), TIME)


def tip_mass() -> Part:
    """Fig. 10, at 2 rad/s: above the critical speed of TLAM with 0.5 kg, below that with 0.1 kg or none."""
    tlam, foam = ({mass: _run(model, mass) for mass in MASSES} for model in ("tlam", "foam"))
    left = tlam[0.5].small_deformation_until
    gap = float(np.max(np.abs(tlam[0.0].tip_displacement - foam[0.0].tip_displacement)))
    share = gap / float(np.max(np.abs(foam[0.0].tip_displacement)))
    at_ten = {mass: _first("foam", mass, 10.0) for mass in MASSES}
    claims = (
        judge(
            "Fig. 10",
            "TLAM fails at 2 rad/s with 0.5 kg",
            f"it diverges: |v| exceeds L/10 at {left:.2f} s",
            bool(left < 60.0),
            "the critical speed is 1.936 rad/s",
        ),
        judge(
            "section 4.4",
            "without tip mass TLAM is almost the same as FOAM at 2 rad/s",
            f"largest difference {share:.2g} of the peak",
            share < 0.1,
            "TLAM loses stiffness with the speed squared, 47 % of it at 2 rad/s; FOAM does not",
        ),
        judge(
            "conclusions",
            "the tip mass has a stiffening effect in FOAM",
            "first frequency at 10 rad/s: " + ", ".join(f"{each:.3f}" for each in at_ten.values()) + " rad/s",
            at_ten[0.5] > at_ten[0.0],
            "the mass adds a stiffness term m (r_A + l) S w^2, but it lowers the frequency in FOAM too",
        ),
    )
    return Part("Fig. 10: tip mass", (_fig_10(tlam, foam),), claims=claims)


def _fig_10(tlam: dict[float, SimulationResult], foam: dict[float, SimulationResult]) -> Chart:
    panels = tuple(
        Panel(
            f"({letter}) tip mass {mass:g} kg",
            "time [s]",
            "v(L) [m]",
            (
                Line("TLAM", TIME, tlam[mass].tip_displacement, "-", COLOURS["TLAM"]),
                Line("FOAM", TIME, foam[mass].tip_displacement, "--", COLOURS["FOAM"]),
            ),
            ylim=(-3.0, 1.0) if mass == 0.5 else None,
            legend="lower left",
        )
        for letter, mass in zip("abc", MASSES, strict=True)
    )
    frequencies = Panel("(d) first frequency", "hub speed [rad/s]", "frequency [rad/s]", _frequency_lines())
    return Chart(
        "fig-10",
        "Fig. 10. TLAM and FOAM with a tip mass, spin-up to 2 rad/s in 30 s; first frequency over the hub speed",
        (*panels, frequencies),
        columns=2,
    )


def _frequency_lines() -> tuple[Line, ...]:
    """First frequency of FOAM up to 10 rad/s, and of TLAM up to its critical speed."""
    lines = []
    for model, style in (("foam", "-"), ("tlam", "--")):
        for mass, colour in zip(MASSES, ("#0072b2", "#d55e00", "#009e73"), strict=True):
            end = 10.0 if model == "foam" else 0.999999 * _critical(mass)
            speeds = end * np.sin(np.linspace(0.0, np.pi / 2.0, 61))
            label = f"{model.upper()}, {mass:g} kg"
            lines.append(Line(label, speeds, np.array([_first(model, mass, w) for w in speeds]), style, colour))
    return tuple(lines)


def _first(model: str, mass: float, speed: float) -> float:
    return float(2.0 * np.pi * hub_beam(HubBeamParameters(tip_mass=mass), model, 15).frequencies_hz(float(speed))[0])


def _critical(mass: float) -> float:
    return float(hub_beam(HubBeamParameters(tip_mass=mass), "tlam", 15).critical_speed())
