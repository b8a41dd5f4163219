"""The hub-beam: modes, speeds, masses at the tip, the neighbourhood of a critical speed, units, motion."""

from collections.abc import Iterator
from functools import partial
from math import pi, sqrt

import numpy as np

from boomctl.lab.stress.case import SCALES, Case, Seen, each_relative, rows
from boomctl.lab.stress.plants import in_other_units
from boomctl.lab.stress.references import clamped_free_frequencies, rotating_frequencies
from boomctl.rotating_beam.factory import hub_beam
from boomctl.rotating_beam.manoeuvres import hold, hub_profile, sine_torque, spin_up
from boomctl.rotating_beam.parameters import HubBeamParameters

_AREA = "Hub-beam"
_EPS = float(np.finfo(float).eps)
_MODELS = ("tlam", "sfoam", "foam")


def cases() -> Iterator[Case]:
    """Return the cases of the hub-beam."""
    yield from _frequencies()
    yield from _units_and_motion()


def _frequencies() -> Iterator[Case]:
    """Return the cases of frequencies."""
    modes = (1, 5, 12, 20, 50, 100, 200)
    what, measure = "frequencies at rest", "relative, cos b cosh b = -1 in sixty digits"
    yield from rows(_AREA, what, measure, _at_rest, modes, amount=_modes, promise=1e-10, answered=lambda n: n <= 20)
    measure = "relative, sixty digits"
    for tip in (0.0, 0.5):
        what, work = f"three modes of SFOAM turning, {tip:g} kg at the tip", partial(_true, tip=tip)
        speeds, words = (0.0, 1.0, 100.0, 1e4), "{:g} rad/s"
        yield from rows(_AREA, what, measure, work, speeds, amount=words, promise=1e-10, answered=True, seconds=40.0)

    def of_heavy(ratio: float) -> float:
        return max(1e-10, 1e2 * _EPS * ratio)  # the first mode is a difference of terms as large as the mass itself

    words, ratios = "tip mass {:g} times the beam's", (1e-6, 1.0, 1e3, 1e6)
    yield from rows(_AREA, "three modes at 1 rad/s", measure, _heavy, ratios, amount=words, promise=of_heavy)
    what, measure = "TLAM's frequency near its critical speed", "relative, sqrt(critical^2 - speed^2)"

    def below(delta: float) -> float:
        return max(1e-10, 20 * _EPS / delta)

    deltas = (1e-1, 1e-3, 1e-6, 1e-9, 1e-12)
    yield from rows(_AREA, what, measure, _near_critical, deltas, amount="{:g} below it", promise=below)
    yield from rows(
        _AREA,
        "TLAM's frequency beyond its critical speed",
        "a refusal",
        _beyond,
        (0.0, 1e-12, 1e-3),
        amount=lambda delta: f"{delta:g} beyond it" if delta else "at it",
        promise=None,
    )


def _units_and_motion() -> Iterator[Case]:
    """Return the cases of units and of motion."""
    for unit in ("length", "force", "time"):
        what, measure = f"frequencies in other units of {unit}", "relative, the law of scaling"
        yield from rows(_AREA, what, measure, partial(_units, unit), SCALES, promise=1e-9)
    for model in _MODELS:
        what, measure = f"{model}: energy without torque", "relative change of energy over ten periods"
        work, words = partial(_energy, model), "started at {:g} rad/s"
        yield from rows(_AREA, what, measure, work, (1e-3, 1.0, 1e2), amount=words, promise=1e-6, seconds=40.0)

    def apart(speed: float) -> float:
        return max(1e-6, 2.0 * (speed / 2.9) ** 2)  # the models' distance: square of speed over first frequency, rad/s

    what, measure, words = "deflection of a slow spin-up", "of the largest, TLAM against FOAM", "to {:g} rad/s"
    yield from rows(_AREA, what, measure, _slow_spin_up, (1e-6, 1e-3, 0.1), amount=words, promise=apart, seconds=60.0)
    what, measure = "a profile whose acceleration is off", "of the largest deflection, the profile itself"
    amounts = (1e-2, 1e-4, 1e-6, 1e-8, 1e-12)
    yield from rows(_AREA, what, measure, _profile_off, amounts, amount="by {:g} of it", promise=1e-8)
    what = "geometrically exact, a spin-up that leaves the tip behind"
    measure = "error of the tip over the one estimated, 24 polynomials"
    few, words = (2, 4, 8, 16), "{} polynomials"
    yield from rows(_AREA, what, measure, _whip, few, amount=words, promise=1.0, answered=True, seconds=60.0)

    def linear(torque: float) -> float:
        return max(1e-5, 1e-4 * torque**2)

    torques, words = (1e-6, 1e-2, 1.0), "{:g} N m"
    what, measure = "SFOAM under a sine of torque", "of the largest, python-control on its linear model"
    yield from rows(
        _AREA, what, measure, _small_torque, torques, amount=words, promise=linear, answered=True, seconds=60.0
    )


def _modes(count: int) -> str:
    return f"{count} mode{'s' if count > 1 else ''}"


def _rate(p: HubBeamParameters) -> float:
    """Return the unit of a clamped beam's frequencies, rad/s."""
    return sqrt(p.bending_stiffness / p.mass_per_length) / p.length**2


def _at_rest(modes: int) -> Seen:
    p = HubBeamParameters()
    found = 2 * pi * hub_beam(p, "sfoam", modes).frequencies_hz()
    return Seen(each_relative(found, _rate(p) * clamped_free_frequencies(modes)))


def _true(speed: float, tip: float) -> Seen:
    p = HubBeamParameters(tip_mass=tip)
    found = 2 * pi * hub_beam(p, "sfoam", 3).frequencies_hz(speed)
    true = rotating_frequencies(
        3,
        speed,
        length=p.length,
        mass=p.mass_per_length,
        stiffness=p.bending_stiffness,
        radius=p.hub_radius,
        tip_mass=p.tip_mass,
    )
    return Seen(each_relative(found, true))


def _heavy(ratio: float) -> Seen:
    p = HubBeamParameters()
    return _true(1.0, ratio * p.mass_per_length * p.length)


def _near_critical(delta: float) -> Seen:
    p = HubBeamParameters()
    critical = _rate(p) * float(clamped_free_frequencies(1)[0])
    speed = critical * (1.0 - delta)
    found = 2 * pi * hub_beam(p, "tlam", 1).frequencies_hz(speed)[0]
    return Seen(abs(found / sqrt((critical - speed) * (critical + speed)) - 1.0))


def _beyond(delta: float) -> Seen:
    p = HubBeamParameters()
    beam = hub_beam(p, "tlam", 1)
    speed = beam.critical_speed() * (1.0 + delta)
    return Seen(float(beam.frequencies_hz(speed)[0]))


# powers of length, force and time in the unit of each parameter
_UNITS = {
    "length": (1, 0, 0),
    "density": (-4, 1, 2),
    "area": (2, 0, 0),
    "youngs_modulus": (-2, 1, 0),
    "second_moment": (4, 0, 0),
    "hub_inertia": (1, 1, 2),
    "hub_radius": (1, 0, 0),
    "tip_mass": (-1, 1, 2),
}


def _units(unit: str, scale: float) -> Seen:
    p = HubBeamParameters(tip_mass=0.1)
    slower = scale if unit == "time" else 1.0
    found = hub_beam(in_other_units(p, _UNITS, unit, scale), "sfoam", 3).frequencies_hz(1.0 / slower) * slower
    return Seen(each_relative(found, hub_beam(p, "sfoam", 3).frequencies_hz(1.0)))


def _energy(model: str, rate: float) -> Seen:
    """The first mode is set moving, the hub held still: its energy stays."""
    beam = hub_beam(HubBeamParameters(), model, 1)
    names = list(beam.state_names)
    state = np.zeros(len(names))
    state[-1] = rate
    run = beam.simulate(hold(), np.linspace(0.0, 20.0, 101), initial=state)
    return Seen(float(np.ptp(run.energy) / np.abs(run.energy).max()))


def _slow_spin_up(speed: float) -> Seen:
    grid = np.linspace(0.0, 40.0, 201)
    runs = [hub_beam(model=m, modes=2).simulate(spin_up(speed, 30.0), grid).tip_displacement for m in ("tlam", "foam")]
    return Seen(float(np.abs(runs[0] - runs[1]).max() / np.abs(runs[1]).max()))


def _profile_off(off: float) -> Seen:
    beam, grid = hub_beam(modes=2), np.linspace(0.0, 20.0, 201)
    exact, other = (
        beam.simulate(
            hub_profile(lambda t: 1.0 - np.cos(t), np.sin, lambda t, z=z: z * np.cos(t)), grid
        ).tip_displacement
        for z in (1.0, 1.0 + off)
    )
    return Seen(float(np.abs(other - exact).max() / np.abs(exact).max()))


def _whip(modes: int) -> Seen:
    grid = np.linspace(0.0, 0.9, 31)
    beams = (hub_beam(model="geometrically-exact", modes=n) for n in (modes, 24))
    few, true = (beam.simulate(spin_up(5.0, 0.7), grid, rtol=1e-4) for beam in beams)
    error = float(np.abs(few.tip_displacement - true.tip_displacement).max())
    return Seen(error / (few.error_estimate + true.error_estimate))


def _small_torque(amplitude: float) -> Seen:
    from boomctl.lti.python_control import control

    beam = hub_beam(modes=1)
    grid = np.linspace(0.0, 20.0, 4001)
    run = beam.simulate(sine_torque(amplitude, 10.0, 10.0), grid)
    torque = np.where(grid <= 10.0, amplitude * np.sin(2 * pi * grid / 10.0), 0.0)
    system = beam.linearize()
    linear = control.forced_response(system, grid, torque)
    true = np.asarray(linear.outputs)[list(system.output_labels).index("tip_displacement")]
    return Seen(float(np.abs(run.tip_displacement - true).max() / np.abs(true).max()))
