"""Motion in time: forced responses, sampled loops, slews; and what is refused at every door."""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from math import pi, sqrt

import mpmath as mp
import numpy as np

from boomctl.arrays import Array
from boomctl.lab.stress.case import SCALES, Case, Seen, relative, rows
from boomctl.lab.stress.plants import mass_on_spring, named, oscillator, repeated_pole, static
from boomctl.lab.stress.references import DIGITS
from boomctl.rotating_beam.factory import hub_beam
from boomctl.simulation.forced_response import forced_response
from boomctl.simulation.loop import simulate_loop
from boomctl.slew.optimal import optimal_slew

_FORCED, _LOOP, _SLEW = "Forced responses", "Sampled loops", "Slews"
_EPS = float(np.finfo(float).eps)
_RATES = (1e-6, 1e-3, 1.0, 1e3, 1e6)  # rad/s, of an oscillator
_DIGITS = "of the largest, sixty digits"


def cases() -> Iterator[Case]:
    """Return the cases of motion."""
    yield from _forced()
    yield from _loops()
    yield from _slews()


def _forced() -> Iterator[Case]:
    """Return the cases of forced responses."""
    tried = partial(rows, _FORCED, measure=_DIGITS)
    what, work = "an oscillator pushed by a ramp, a hundred periods", partial(_ramp, zeta=0.01)
    yield from tried(what, work=work, over=_RATES, amount="{:g} rad/s", promise=1e-9, answered=True)

    def of_fastest(zeta: float) -> float:
        return max(1e-9, 4.0 * _EPS * zeta**2)  # rounding of the fastest pole is as large as so much of the slowest

    for what, work in (
        ("an oscillator of 1 rad/s pushed by a ramp", partial(_ramp, 1.0)),
        ("a mass on a spring pushed by a ramp", partial(_ramp, 1.0, model=True)),
    ):
        ratios, words = (0.0, 1e-12, 1e-6, 1.0, 1e2, 1e6), "damping ratio {:g}"
        yield from tried(
            what, work=work, over=ratios, amount=words, promise=of_fastest, answered=lambda zeta: zeta <= 1.0
        )
    what = "1/(s + 1)^n, one pole repeated, a step"
    yield from tried(what, work=_repeated, over=(2, 4, 8), amount="{} times", promise=1e-9, answered=True)
    what, spreads = "poles -1 and -a, a step", (1e3, 1e6, 1e10, 1e14)
    yield from tried(what, work=_spread, over=spreads, amount="a = {:g}", promise=1e-9, answered=True)


def _loops() -> Iterator[Case]:
    """Return the cases of sampled loops."""
    tried, work = partial(rows, _LOOP), partial(_open_loop, zeta=0.01)
    what = "the same without a controller"
    yield from tried(what, _DIGITS, work, _RATES, amount="{:g} rad/s", promise=1e-9, answered=True)
    what, measure = "an integrator under a sampled gain", "relative, the recursion of the sampled loop"
    counts = (10, 1_000, 100_000)
    yield from tried(what, measure, _sampled, counts, amount="{:,} samples", promise=1e-9, answered=True)
    what, measure = "an integrator under a delayed gain", "of the largest, the recursion of the delayed loop"
    delays = (0.0, 1e-9, 0.3, 1.0, 1.7)
    yield from tried(what, measure, _delayed, delays, amount="{:g} samples late", promise=1e-8, answered=True)


def _slews() -> Iterator[Case]:
    """Return the cases of slews."""
    tried = partial(rows, _SLEW)
    for unit in ("time", "torque", "angle"):
        what, work = f"least time of a double integrator, other units of {unit}", partial(_rigid, unit)
        measure = "relative, 2 sqrt(angle/torque)"
        yield from tried(what, measure, work, SCALES, promise=1e-6, answered=lambda scale: 1e-7 < scale < 1e7)
    yield from tried(
        "least time of two masses and a spring",
        "the law of scaling, published 4.218",
        _two_masses,
        (1e-2, 1.0, 1e2),
        amount=lambda frequency: f"spring's unit of time {1 / frequency:g} s",
        promise=2e-4,
        answered=True,
    )
    what, measure = "least time of SFOAM, one mode", "angle missed in the replay [rad]"
    tips = (1e-3, 0.1, 1.0)
    yield from tried(what, measure, _beam_slew, tips, amount="tip mass {:g} kg", promise=1e-5, seconds=60.0)
    measure = "share by which it is shorter than that of the rigid body or its end is missed"
    limits = (1e-3, 1e-1, 1e1)
    yield from tried(what, measure, _weak_slew, limits, amount="{:g} N m", promise=1e-5, seconds=60.0)


def _ramp_answer(omega: float, zeta: float, times: Array) -> Array:
    """Return ``y`` of ``y'' + 2 z w y' + w^2 y = w^2 (w t)``, from rest, matrices as they stand in double precision."""
    with mp.workdps(DIGITS):
        damping = mp.mpf(2.0 * zeta * omega) / mp.mpf(omega)
        z = damping / 2
        root = mp.sqrt(mp.mpc(z * z - 1))
        values = []
        for t in times:
            x = mp.mpf(omega) * mp.mpf(float(t))
            if abs(root) < mp.mpf(10) ** -20:
                free = mp.exp(-z * x) * (damping + (damping * z - 1) * x)
            else:
                slow, fast = -z + root, -z - root
                # y = x - 2z + a e^(slow x) + b e^(fast x), y(0) = y'(0) = 0
                a = (-1 - damping * fast) / (slow - fast)
                b = damping - a
                free = a * mp.exp(slow * x) + b * mp.exp(fast * x)
            values.append(float(mp.re(x - damping + free)))
        return np.array(values)


def _times(omega: float) -> Array:
    """Return instants of a hundred periods."""
    return np.linspace(0.0, 200.0 * pi / omega, 501)


def _ramp(omega: float, zeta: float, model: bool = False) -> Seen:
    times, plant = _times(omega), mass_on_spring(zeta) if model else oscillator(zeta, omega).statespace("plant")
    found = forced_response(plant, {"u0": omega * times}, times)["y0"]
    return Seen(relative(found, _ramp_answer(omega, zeta, times)))


def _open_loop(omega: float, zeta: float) -> Seen:
    times = _times(omega)
    plant = oscillator(zeta, omega).statespace("plant")
    run = simulate_loop(plant, None, {"u0": omega * times}, times, sample_time=float(times[1]))
    return Seen(relative(run["y0"], _ramp_answer(omega, zeta, times)))


def _repeated(count: int) -> Seen:
    """The step response is ``1 - e^-t sum_k t^k / k!``."""
    times = np.linspace(0.0, 30.0, 301)
    plant = repeated_pole(count).statespace("plant")
    found = forced_response(plant, {"u0": np.ones_like(times)}, times)["y0"]
    with mp.workdps(DIGITS):
        true = [
            float(1 - mp.exp(-mp.mpf(float(t))) * sum(mp.mpf(float(t)) ** k / mp.factorial(k) for k in range(count)))
            for t in times
        ]
    return Seen(relative(found, true))


def _spread(spread: float) -> Seen:
    times = np.linspace(0.0, 10.0, 101)
    plant = named(np.diag([-1.0, -spread]), np.array([[1.0], [spread]]), np.eye(2)).statespace("plant")
    run = forced_response(plant, {"u0": np.ones_like(times)}, times)
    true = [-np.expm1(-times), -np.expm1(-spread * times)]
    return Seen(relative([run["y0"], run["y1"]], true))


def _held_gain(h: float, k: float, count: int, delay: float = 0.0) -> Array:
    """Return ``x`` of ``x' = u + w``, ``u = -k x`` held for a sample of ``h`` and so many samples late, ``w = 1``."""
    times, K = h * np.arange(count + 1), static(-k).statespace("controller")
    plant = named(np.zeros((1, 1)), np.ones((1, 2)), np.ones((1, 1))).statespace("plant")
    return simulate_loop(plant, K, {"u1": np.ones_like(times)}, times, sample_time=h, delay=delay * h)["y0"]


def _sampled(count: int) -> Seen:
    """Without a delay ``x`` goes to ``1/k`` by factors ``1 - k h``."""
    h, k = 0.1, 0.5
    true = -np.expm1(np.arange(count + 1) * np.log1p(-k * h)) / k
    return Seen(relative(_held_gain(h, k, count), true))


def _delayed(delay: float) -> Seen:
    h, k, count = 0.1, 0.5, 200
    whole, part = int(delay), delay - int(delay)
    x = [0.0]
    for n in range(count):
        older = [-k * x[n - late] if n >= late else 0.0 for late in (whole + 1, whole)]
        x.append(x[-1] + h * (1.0 + part * older[0] + (1.0 - part) * older[1]))
    return Seen(relative(_held_gain(h, k, count, delay), x))


def _rigid(unit: str, scale: float) -> Seen:
    rate = scale if unit == "time" else 1.0
    gain, angle = rate**2, 1.0
    limit = scale if unit == "torque" else 1.0
    angle = scale if unit == "angle" else 1.0
    plant = named(np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0], [gain]]), np.array([[1.0, 0.0]]))
    found = optimal_slew(plant.statespace("plant"), angle, limit)
    return Seen(abs(found.duration / (2.0 * sqrt(angle / (gain * limit))) - 1.0))


def _two_masses(frequency: float) -> Seen:
    """Both masses one, the spring ``frequency^2``, and the force that makes it the published problem in other units."""
    f = frequency
    A = np.array([[0.0, 0, 1, 0], [0, 0, 0, 1], [-f * f, f * f, 0, 0], [f * f, -f * f, 0, 0]])
    plant = named(A, np.array([[0.0], [0.0], [f * f], [0.0]]), np.array([[1.0, 0.0, 0.0, 0.0]]))
    found = optimal_slew(plant.statespace("plant"), 1.0, 1.0)
    switches = np.asarray(found.history.switches) * f
    published = np.array([1.003, 2.109, 3.215])
    missed = float(np.abs(switches - published).max()) if len(switches) == 3 else float("inf")
    return Seen(max(abs(found.duration * f / 4.218 - 1.0), 0.2 * missed))


def _beam_slew(tip: float) -> Seen:
    found = optimal_slew(hub_beam(replace(hub_beam(modes=1).parameters, tip_mass=tip), modes=1), 0.6, 200.0)
    return Seen(float(found.end_error))


def _weak_slew(limit: float) -> Seen:
    beam = hub_beam(modes=1)
    found = optimal_slew(beam, 0.6, limit)
    p = beam.parameters
    m, a, b = p.mass_per_length, p.hub_radius, p.hub_radius + p.length
    rigid = 2.0 * sqrt(0.6 * (p.hub_inertia + m * (b**3 - a**3) / 3.0) / limit)
    return Seen(max(float(found.end_error), 1.0 - found.duration / rigid))
