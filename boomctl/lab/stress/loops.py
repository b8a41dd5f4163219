"""Control: regulators, estimators, H-infinity designs and margins, against closed forms and laws."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from itertools import combinations, product
from math import acos, degrees, inf, pi, sqrt

import mpmath as mp
import numpy as np
from scipy import linalg

from boomctl.analysis.margins import LoopMargin, margins
from boomctl.analysis.model_norm import hinf_norm
from boomctl.lab.stress.case import SCALES, Case, Seen, rows
from boomctl.lab.stress.plants import named, oscillator, repeated_pole, static
from boomctl.lab.stress.references import DIGITS, state_space_response
from boomctl.lti.system import Lti
from boomctl.simulation.conditioning import conditioning_gains
from boomctl.structure.families import AffineFamily
from boomctl.structure.model import SecondOrderModel
from boomctl.synthesis.hinf.h_infinity import h_infinity
from boomctl.synthesis.lq.h2 import h2
from boomctl.synthesis.lq.kalman import kalman
from boomctl.synthesis.lq.lqg import lqg
from boomctl.synthesis.lq.lqr import lqr
from boomctl.synthesis.plants import channels
from boomctl.synthesis.plants.generalized import generalized_plant
from boomctl.synthesis.plants.partition import close_loop
from boomctl.tuning.parts import makers
from boomctl.tuning.tune import tune

_REGULATORS, _HINF, _TUNED = "LQR and LQG", "H-infinity and H2 designs", "Tuning"
_MARGINS, _WINDUP = "Margins", "Anti-windup"
_RATES = (1e-6, 1e-3, 1.0, 1e3, 1e6)  # rad/s, of a plant
_CLOSED = "relative, closed form"


def cases() -> Iterator[Case]:
    """Return the cases of control."""
    yield from _regulators()
    yield from _designs()
    yield from _margins()
    tried = partial(rows, _TUNED, seconds=60.0)
    what, measure = "tuned, an unstable plant of 2 states", "share by which the norm is above that of one order less"
    yield from tried(what, measure, _grown, (1, 2), amount="order {}", promise=1e-6)
    what, measure = "a budget of force, over a family", "share by which a corner's norm exceeds the worst told"
    yield from tried(what, measure, _budgeted, (1.0, 0.6, 0.4), promise=1e-6)
    tried, zetas = partial(rows, _WINDUP), (1e-2, 1e-4, 1e-6, 1e-8)
    what, measure = "three controls, any of them at their limits", "what is left of a state after 2^50 samples"
    yield from tried(what, measure, _windup, zetas, amount="damping ratio {:g}", promise=1e-6, answered=True)


def _designs() -> Iterator[Case]:
    """Return the cases of H-infinity and H2 designs."""
    tried = partial(rows, _HINF, seconds=60.0)
    measure = "share by which the verified norm misses the loop's own, or lies below the bound or the known optimum"
    work = partial(_hinf, partial(repeated_pole, 1))
    yield from tried("a first-order plant, units of time", measure, work, _RATES, promise=1e-5)
    measure = "share by which the verified norm misses the loop's own or lies below its bound"
    poles, work = (1.0, 1e3, 1e6), partial(_hinf, _unstable)
    yield from tried("an unstable plant", measure, work, poles, amount="pole {:g} rad/s", promise=1e-5)
    zetas, words = (0.0, 1e-8, 1e-4, 1e-1), "damping ratio {:g}"
    yield from tried("an oscillator", measure, partial(_hinf, oscillator), zetas, amount=words, promise=1e-5)
    what = "H2 optimum of an oscillator"
    measure = "relative, two scalar Riccati equations or the regulator's and the filter's"
    yield from rows(_HINF, what, measure, _h2_oscillator, zetas, amount=words, promise=1e-6)
    what = "cheap control, an unstable plant of 5 states, as near to the best as can be had"
    measure = "share by which the loop's gain, of plant and controller in sixty digits, lies outside the bounds"
    yield from tried(what, measure, _cheap, (1.0, 1e-1, 1e-2, 1e-3), amount="costs {:g}", promise=1e-9)


def _margins() -> Iterator[Case]:
    """Return the cases of margins."""
    tried = partial(rows, _MARGINS, measure=_CLOSED, promise=1e-6)
    for what, work in (
        ("phase and delay of an integrator's loop", _integrator),
        ("gain of 1/(s + 1)^3, time scaled", _cubic),
    ):
        yield from tried(what, work=work, over=_RATES, amount="{:g} rad/s", answered=True)
    what = "delay of a loop whose gain at infinite frequency is"
    yield from tried(what, work=_direct, over=(0.5, 1.0, 1.0 + 1e-9, 1.5, 1e6), amount="{:.10g}", answered=True)
    what, zetas, words = "delay of a lightly damped loop", (1e-2, 1e-4, 1e-6, 1e-8), "damping ratio {:g}"
    yield from tried(what, work=_light, over=zetas, amount=words, answered=lambda zeta: zeta >= 1e-6)
    what = "further delay of an integrator sampled once a second"
    yield from tried(what, work=_sampled_delay, over=(1.1, 1.5, 1.9, 1.9999), amount="gain {:g}", answered=True)


def _regulators() -> Iterator[Case]:
    """Return the cases of regulators and filters."""
    tried = partial(rows, _REGULATORS)
    what, weights = "gain of a double integrator", (1e-12, 1e-6, 1.0, 1e6, 1e12)
    yield from tried(what, _CLOSED, _double, weights, amount="R = {:g}", promise=1e-8, answered=True)
    what, zetas, words = "cost of an oscillator", (0.0, 1e-12, 1e-8, 1e-4, 1.0, 1e4), "damping ratio {:g}"
    yield from tried(what, _CLOSED, _oscillator, zetas, amount=words, promise=1e-8, answered=lambda zeta: zeta <= 1.0)
    what, gaps = "an unstable mode that the control hardly moves", (1e-1, 1e-4, 1e-8, 1e-12, 0.0)
    yield from tried(
        what, _CLOSED, _hardly_moved, gaps, amount="by {:g}", promise=1e-6, answered=lambda gap: gap >= 1e-4
    )
    what, measure = "LQG: cost in other units of time", "relative, the law of scaling"
    yield from tried(what, measure, _lqg_units, SCALES, promise=1e-6, answered=True)
    what, spreads = "cost with poles far apart", (1e2, 1e6, 1e10, 1e14)
    yield from tried(what, _CLOSED, _lqr_spread, spreads, amount="-1 and -{:g}", promise=1e-8)
    what, variances = "a sampled filter beside modes that no noise reaches", (1.0, 1e-8, 1e-16)
    yield from tried(what, _CLOSED, _unreached, variances, amount="variance {:g}", promise=1e-8, answered=True)


def _double(weight: float) -> Seen:
    """Gains ``1/sqrt(r)`` and ``sqrt(2) / r^(1/4)``."""
    system = named(np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0], [1.0]]), np.eye(2))
    found = lqr(system.statespace("plant"), np.diag([1.0, 0.0]), weight).gain[0]
    true = np.array([weight**-0.5, sqrt(2.0) * weight**-0.25])
    return Seen(float(np.abs(found / true - 1.0).max()))


def _oscillator(zeta: float) -> Seen:
    """``x'' + 2 z x' + x = u`` with weights 1: of the cost matrix ``p12 = sqrt 2 - 1``, and ``p22`` from a quadratic."""
    found = lqr(oscillator(zeta).statespace("plant"), np.eye(2), 1.0).cost
    p12 = 1.0 / (1.0 + sqrt(2.0))
    rest = 2.0 * p12 + 1.0
    p22 = rest / (2.0 * zeta + sqrt(4.0 * zeta**2 + rest))
    p11 = 2.0 * zeta * p12 + p22 + p12 * p22
    true = np.array([[p11, p12], [p12, p22]])
    return Seen(float(np.abs(found / true - 1.0).max()))


def _hardly_moved(gap: float) -> Seen:
    """``x' = x + g u``: of the cost matrix ``p = (1 + sqrt(1 + g^2)) / g^2``."""
    system = named(np.diag([1.0, -1.0]), np.array([[gap], [1.0]]), np.eye(2))
    found = lqr(system.statespace("plant"), np.diag([1.0, 0.0]), 1.0).cost[0, 0]
    return Seen(abs(found * gap**2 / (1.0 + sqrt(1.0 + gap**2)) - 1.0) if gap else inf)


def _lqr_spread(spread: float) -> Seen:
    """Two modes, each weighted and moved by a control of its own: ``p = q / (a + sqrt(a^2 + q))``."""
    system = named(np.diag([-1.0, -spread]), np.eye(2), np.eye(2))
    found = np.diag(lqr(system.statespace("plant"), np.eye(2), np.eye(2)).cost)
    true = [1.0 / (a + sqrt(a * a + 1.0)) for a in (1.0, spread)]
    return Seen(float(np.abs(found / true - 1.0).max()))


def _lqg_units(scale: float) -> Seen:
    one = oscillator(0.05)
    other = replace(one, A=scale * one.A, B=scale * one.B)
    # in faster time the same noise has less intensity; what drives the states grows with their rate, twice
    costs = [
        lqg(s.statespace("plant"), np.eye(2), 1.0, 0.3 * rate, 0.2 / rate).cost
        for s, rate in ((one, 1.0), (other, scale))
    ]
    return Seen(abs(costs[1] / costs[0] - 1.0))


def _unreached(variance: float) -> Seen:
    """Return the covariance of a random walk, measured together with lightly damped modes that rest."""
    modes = [0.999 * np.array([[np.cos(w), np.sin(w)], [-np.sin(w), np.cos(w)]]) for w in (0.3, 0.7, 1.1)]
    A, B = linalg.block_diag(1.0, *modes), np.eye(7)[:, :1]
    plant = named(A, B, np.array([[1.0, 1e6, 0.0, 1.0, 0.0, 1e-6, 0.0]]), dt=1e-5)
    found = kalman(plant.statespace("plant"), {plant.inputs[0]: variance}, 1.0, disturbances=plant.inputs)
    true = 0.5 * (variance + sqrt(variance**2 + 4.0 * variance))
    return Seen(max(float(found.covariance[1:].any()), abs(found.covariance[0, 0] / true - 1.0)))


def _generalized(plant: Lti) -> Lti:
    """Return ``z = (y, u)`` for the disturbance beside the control and the noise of the sensor."""
    B, C = plant.B, plant.C[:1]
    n = len(plant.A)
    B1, C1 = np.hstack([B, np.zeros((n, 1))]), np.vstack([C, np.zeros((1, n))])
    D = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]])
    return named(plant.A, np.hstack([B1, B]), np.vstack([C1, C]), D)


def _hinf(plant: Callable[[float], Lti], value: float) -> Seen:
    """Return the share by which what is claimed is not so: of the loop's own norm, and of the bound below."""
    found = h_infinity(_generalized(plant(value)).statespace("P"), 1, 1)
    own = hinf_norm(found.closed_loop)
    return Seen(max(abs(found.gamma / own.lower - 1.0), found.certificate.lower / found.gamma - 1.0))


def _unstable(pole: float) -> Lti:
    return named(pole * np.eye(1), pole * np.ones((1, 1)), np.ones((1, 1)))


def _h2_oscillator(zeta: float) -> Seen:
    plant = oscillator(zeta)
    P = _generalized(plant)
    A, B, C = plant.A, plant.B, plant.C
    X = linalg.solve_continuous_are(A, B, C.T @ C, np.eye(1))
    Y = linalg.solve_continuous_are(A.T, C.T, B @ B.T, np.eye(1))
    true = np.trace(B.T @ X @ B) + np.trace(B.T @ X @ Y @ X @ B)
    return Seen(abs(h2(P.statespace("P"), 1, 1).norm ** 2 / true - 1.0))


def _margins_with(plant: Lti, gain: float, dt: float = 0.0) -> LoopMargin:
    """Return the margins of the loop of a plant and a gain, sampled where ``dt`` is given."""
    return margins(plant.statespace("plant"), static(-gain, dt).statespace("controller")).loops[0]


def _integrator(omega: float) -> Seen:
    told = _margins_with(named(np.zeros((1, 1)), np.ones((1, 1)), np.ones((1, 1))), omega)
    wrong = [told.phase_deg / 90.0 - 1.0, told.delay * omega / (0.5 * pi) - 1.0, told.phase_omega / omega - 1.0]
    return Seen(max(map(abs, wrong)) if told.gain_high == inf else inf)


def _cubic(omega: float) -> Seen:
    told = _margins_with(repeated_pole(3, omega), 2.0)
    # 2/(1 + x^2)^(3/2) = 1 where x^2 = 4^(1/3) - 1; the phase is then 180 - 3 atan x degrees
    x = sqrt(4.0 ** (1.0 / 3.0) - 1.0)
    phase = 180.0 - 3.0 * degrees(acos(1.0 / sqrt(1.0 + x * x)))
    wrong = [
        told.gain_high / 4.0 - 1.0,
        told.phase_deg / phase - 1.0,
        told.delay * omega * x / np.radians(phase) - 1.0,
        told.gain_high_omega / (omega * sqrt(3.0)) - 1.0,
    ]
    return Seen(max(map(abs, wrong)))


def _direct(gain: float) -> Seen:
    """``g (s + 3)/(s + 1)``: any delay is too much unless the gain at infinite frequency is below one."""
    plant = named(-np.eye(1), np.ones((1, 1)), np.array([[2.0]]), np.ones((1, 1)))
    told = _margins_with(plant, gain)
    if gain >= 1.0:
        return Seen(told.delay)
    # (9 + w^2) g^2 = 1 + w^2
    w = sqrt((9.0 * gain**2 - 1.0) / (1.0 - gain**2))
    phase = pi + np.angle(gain * (3.0 + 1j * w) / (1.0 + 1j * w))
    return Seen(abs(told.delay * w / phase - 1.0))


def _light(zeta: float) -> Seen:
    """``1/(s^2 + 2 z s + 1)`` fed back with gain 1: its gain is one at ``w^2 = 2 - 4 z^2`` and at rest."""
    told = _margins_with(oscillator(zeta), 1.0)
    w = sqrt(2.0 - 4.0 * zeta**2)
    left = np.arctan2(2.0 * zeta * w, w * w - 1.0)  # pi less the phase's lag there
    return Seen(abs(told.delay * w / left - 1.0))


def _sampled_delay(gain: float) -> Seen:
    """``z^2 - (1 - g (1 - d)) z + g d``, with a delay of ``d < 1`` samples: its roots leave the circle where ``g d = 1``."""
    told = _margins_with(named(np.zeros((1, 1)), np.ones((1, 1)), np.ones((1, 1))), gain, dt=1.0)
    return Seen(abs(told.delay * gain - 1.0))


def _unstable_plant(order: int, cost: float) -> Lti:
    """Return a generalised plant of random numbers: two disturbances and a noise, two signals and an effort."""
    rng = np.random.default_rng(order)
    A = rng.standard_normal((order, order))
    B, C = (
        np.hstack([rng.standard_normal((order, 2)), np.zeros((order, 1)), rng.standard_normal((order, 1))])
        for _ in "BC"
    )
    D = np.zeros((4, 4))
    D[2, 3] = D[3, 2] = cost
    return named(A, B, C.T, D)


def _cheap(cost: float) -> Seen:
    P = _unstable_plant(5, cost)
    found = h_infinity(P.statespace("P"), 1, 1, tolerance=1e-9, fastest_pole=1e10)
    K, norm = found.controller, found.certificate.norm
    with mp.workdps(DIGITS):
        G, k = (state_space_response(s.A, s.B, s.C, s.D, 1j * norm.omega) for s in (P, K))
        loop = G[:3, :3] + G[:3, 3] * k * G[3, :3] / (1 - G[3, 3] * k[0, 0])
        gain = float(np.linalg.norm(np.array(loop.tolist(), dtype=complex), 2))
    return Seen(max(norm.lower / gain - 1.0, gain / norm.upper - 1.0, 0.0), norm.certified)


def _grown(order: int) -> Seen:
    P = _unstable_plant(2, 1.0).statespace("P")
    less, more = (
        tune(P, 1, 1, makers.state_space(n) if n else makers.gain(), starts=2).gamma for n in (order - 1, order)
    )
    return Seen(max(more / less - 1.0, 0.0))


def _budgeted(budget: float) -> Seen:
    def weighed(model: SecondOrderModel) -> object:
        return generalized_plant(
            model,
            disturbances={"f": 1.0},
            noises={"x": 0.1},
            performance={"x": 1.0},
            effort={"f": 1.0},
            measurements="x",
            controls="f",
        )

    box = AffineFamily.through(
        {"k": (1.0, 6.0), "c": (0.1, 1.0)},
        lambda v: SecondOrderModel([[1.0]], [[v["c"]]], [[v["k"]]], {"f": [1.0]}, {"x": [1.0]}),
    )
    counted = [channels.objective("w_f", "z_x"), channels.budget("w_f", "z_f", budget)]
    found = tune(weighed, 1, 1, makers.pid(integral=False, high=50.0), channels=counted, family=box, starts=2)
    worst = max(
        hinf_norm(close_loop(weighed(box.at(np.array(d))), found.controller)["z_x", "w_f"]).lower
        for d in product((-1.0, 1.0), repeat=2)
    )
    assert found.certificate.worst is not None
    return Seen(max(worst / found.certificate.worst.value - 1.0, 0.0))


def _windup(zeta: float) -> Seen:
    """Four modes that three controls all show, as a controller sampled ten times in a period of the fastest."""
    rng, A = np.random.default_rng(0), np.zeros((8, 8))
    for k, w in enumerate((0.03, 0.1, 0.3, 0.6)):
        A[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = linalg.expm(np.array([[0.0, w], [-w, -2.0 * zeta * w]]))
    K = named(A, rng.standard_normal((8, 2)), rng.standard_normal((3, 8)))
    gains, proved = conditioning_gains((K,), np.ones(3, dtype=bool))
    left = 0.0
    for S in (list(S) for count in (1, 2, 3) for S in combinations(range(3), count)):
        X = A - gains[0][:, S] @ K.C[S]
        for _ in range(50):
            X = X @ X
        left = max(left, float(np.abs(X).max()))
    return Seen(left, certified=proved)
