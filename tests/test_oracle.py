"""Norms, reduction errors, margins and poles of systems made hard on purpose, against exact arithmetic.

What is certified is true, each time, and so are the bounds of what is not; few of the damped ones are not certified.
"""

import sys
import warnings
from collections import Counter
from math import inf, isfinite

import control
import numpy as np
import pytest
from flint import fmpq

import boomctl as bc
from boomctl.exceptions import ReductionError
from boomctl.lti.modal import side_of_axis, spectral_parts
from boomctl.lti.system import of
from tests.exact import Exact, dyadic, loop_is_stable, loop_of, loop_truth, on_axis
from tests.hard_systems import BEYOND, KINDS, hard
from tests.profiles import is_hunt

ALL = 2000  # systems of the slow tests; of poles and reductions every third
SOME = 300  # of them in the full profile; all for reductions: two refused of so few would be more than SHARE
FEW = range(30)  # of the quick tests, two of each kind
SLACK = 1e-12  # relative: what the last digits of a bound may do
DAMPED = 1e-6  # damping ratio from which on no more than SHARE may be refused or uncertified
INTEGRATING = 1e-14  # share of the fastest pole below which a pole is one at zero that rounding moved
SHARE = 0.02
OUTCOMES = ("certified", "FALSE", "uncertified", "refused", "not asked")
METHODS = ("balanced", "singular-perturbation", "hankel", "modal")
LOOP_DIGITS = 1e-4  # relative, of margins; those certified nowhere
NO_LIMIT = 1e-7  # gains below that, and above its inverse, are none
KEPT = 1e-3  # share of its frequency beside a kept pole, or of the fastest pole for one at zero, not looked at
KEPT_ROUNDING = 1e-8  # of the response, elsewhere: kept states are the system's own to rounding
# share of the fastest pole by which rounding may move a kept pole; nearer to it than KEPT_ROUNDING allows is not looked at
MOVED = 1e2 * float(np.finfo(float).eps)
LOOKED_AT = np.geomspace(1e-3, 1e3, 30)


def is_damped(poles, damping):
    size = [float(abs(p)) for p in poles]
    return damping > DAMPED and min(size, default=1.0) > INTEGRATING * max(size, default=1.0)


def told(certified, holds):
    return "FALSE" if not holds else "certified" if certified else "uncertified"


def hinf_outcome(seed, system, exact):
    low, high, _ = exact.norm()
    found = bc.hinf_norm(system)
    return told(found.certified, found.lower_bound <= high * (1.0 + SLACK) and found.upper_bound * (1.0 + SLACK) >= low)


def h2_outcome(seed, system, exact):
    truth = exact.h2()
    found = bc.h2_norm(system)
    return told(
        found.certified, found.lower_bound <= truth * (1.0 + SLACK) and found.upper_bound * (1.0 + SLACK) >= truth
    )


def squared(exact, omega):
    """Return ``omega^2`` in the units of a transfer matrix, exactly."""
    unit = fmpq(1 << exact.time) if exact.time >= 0 else fmpq(1, 1 << -exact.time)
    return (dyadic(omega) / unit) ** 2


def error_beside_kept(system, exact, error):
    """Return the largest error beyond rounding, away from the poles that are kept, at resonances and between."""
    kept = spectral_parts(of(system).balanced()).retained.poles
    poles = np.array([complex(float(p.real), float(p.imag)) for p in exact.poles_in_rad()])
    width = KEPT * np.where(side_of_axis(kept) == 0, np.maximum(np.abs(kept), KEPT * np.abs(poles).max()), 0.0)
    around = np.abs(poles.imag) + np.array([-1.0, -0.3, 0.0, 0.3, 1.0])[:, None] * np.abs(poles.real)
    omega = np.concatenate([around.ravel(), LOOKED_AT])
    away = np.abs(omega[:, None] - np.abs(kept.imag)) > width
    felt = np.abs(1j * omega[:, None] - kept) * KEPT_ROUNDING <= MOVED * np.abs(poles).max()
    omega = omega[(omega > 0.0) & (away & ~felt).all(axis=1)]
    seen = [(float(error.largest_at(squared(error, w))), float(exact.largest_at(squared(exact, w)))) for w in omega]
    return max(missed - KEPT_ROUNDING * size for missed, size in seen)


def reduce_outcome(seed, system, exact):
    if any(on_axis(p, exact.den) for p in exact.poles):
        return "not asked"
    method = METHODS[seed // len(KINDS) % len(METHODS)]
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", bc.exceptions.LowerOrderWarning)
            found = bc.reduce(system, system.nstates // 2, method)
    except ReductionError:
        return "refused"
    except ValueError as refusal:
        if not any(word in str(refusal) for word in ("defective", "are equal", "are kept", "too close")):
            raise
        return "not asked"  # there is no such reduction
    error = exact - Exact.of(found.system)
    truth = error_beside_kept(system, exact, error) if found.retained_order else error.norm()[0]
    return told(True, truth <= found.error_norm * (1.0 + SLACK) + sys.float_info.min)


def loop_for(seed, system):
    """Return a plant of one signal, and a controller that makes its loop stable; None without."""
    rng = np.random.default_rng(seed)
    B, C, D = system.B[:, :1], system.C[:1], system.D[:1, :1]
    P = control.ss(system.A, B, C, D, inputs=["u"], outputs=["y"])
    exact = Exact.of(P)
    size = np.array([float(abs(p)) for p in exact.poles_in_rad()])
    at = rng.choice(size[size > 1e-13 * size.max()]) * 10 ** rng.uniform(-0.3, 0.3) if size.max() > 0.0 else 1.0
    gain = float(exact.largest_at(squared(exact, at)))
    for k in rng.permutation(20):
        goal = (1e-4, 0.01, 0.03, 0.1, 0.3, 0.8, 2.0, 6.0, 30.0, 1000.0)[k // 2]
        g = (-1.0) ** k * 2.0 ** np.round(np.log2(goal / gain)) if 0.0 < gain < inf else (-1.0) ** k * goal
        names = {"inputs": ["y"], "outputs": ["u"]}
        K = (
            control.ss(-2.0, 1.0, g * rng.integers(-3, 3) / 4, g, **names)
            if seed % 2
            else control.ss([], [], [], g, **names)
        )
        num, den, time = loop_of(exact, Exact.of(K))
        if loop_is_stable(num, den):
            return P, K, (num, den, time)
    return None


def near(one, other):
    if one == other or max(one, other) < NO_LIMIT or min(one, other) > 1.0 / NO_LIMIT:
        return True
    return isfinite(one) and isfinite(other) and abs(one - other) <= LOOP_DIGITS * min(abs(one), abs(other))


def margins_outcome(seed, system, exact):
    made = loop_for(seed, system)
    if made is None:
        return "not asked"
    P, K, loop = made
    truth = loop_truth(*loop)
    closed = Exact(loop[1] - loop[0], ((loop[1],),), 0, loop[2])
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)
            found = bc.margins(P, K)["u"]
    except ValueError as refusal:
        if "is not stable" not in str(refusal):
            raise
        return "refused" if is_damped(closed.poles, closed.damping) else "not asked"
    pairs = [(found.gain_margin[1], truth.gain_high), (found.phase_margin_deg, truth.phase_margin_deg)]
    pairs += [(found.delay_margin, truth.delay_margin)]
    poles = exact.poles_in_rad()
    if all(abs(p.real) > MOVED * max(abs(q) for q in poles) for p in poles):
        low = found.gain_margin[0]  # else rounding tells on which side of the axis a pole lies
        if abs(low - truth.gain_low) > LOOP_DIGITS / 10.0:  # its errors are absolute near zero
            pairs += [(low, truth.gain_low)]
    holds = all(near(ours, true) for ours, true in pairs)
    digits = found.rounding_error <= LOOP_DIGITS / 10.0
    if found.disk_margin.certified:
        holds &= abs(found.disk_margin.alpha - truth.alpha) <= 3e-5 * truth.alpha
    holds |= not digits and not found.disk_margin.certified
    return told(digits and found.disk_margin.certified, holds)


def poles_outcome(seed, system, exact):
    """Of what a table of modes says, no pole is further from one of the system than rounding explains (Bauer & Fike)."""
    A = of(system).balanced().A
    bound = 10.0 * len(A) * np.finfo(float).eps * np.linalg.norm(A) * np.linalg.cond(np.linalg.eig(A)[1])
    try:
        found = np.array([row.pole for row in bc.mode_table(system).rows])
    except ValueError:  # no eigenvectors of their own
        return "not asked"
    truth = np.array([complex(float(p.real), float(p.imag)) for p in exact.poles_in_rad()])
    return told(True, bool((np.abs(found[:, None] - truth).min(axis=1) <= bound).all()))


QUANTITIES = {
    "hinf": hinf_outcome,
    "h2": h2_outcome,
    "reduce": reduce_outcome,
    "margins": margins_outcome,
    "poles": poles_outcome,
}


def outcomes(quantity, seeds):
    """Return how often each outcome came, by kind and for all that are damped, and the seeds of what is false."""
    count, false = Counter(), []
    for seed in seeds:
        kind, system = hard(seed)
        exact = Exact.of(system)
        outcome = QUANTITIES[quantity](seed, system, exact)
        count[kind, outcome] += 1
        if kind not in BEYOND and is_damped(exact.poles, exact.damping):
            count["damped", outcome] += 1
        if outcome == "FALSE":
            false.append(seed)
    return count, false


def table(quantity, count):
    lines = [f"{quantity:18s}" + "".join(f"{outcome:>13s}" for outcome in OUTCOMES)]
    for kind in [*KINDS, "damped"]:
        lines.append(f"{kind:18s}" + "".join(f"{count[kind, outcome]:13d}" for outcome in OUTCOMES))
    return "\n".join(lines)


def share_not_told(count):
    asked = sum(count["damped", outcome] for outcome in OUTCOMES[:-1])
    return (count["damped", "uncertified"] + count["damped", "refused"]) / asked


@pytest.mark.parametrize("quantity", QUANTITIES)
def test_what_is_certified_of_a_few_hard_systems_is_true(quantity):
    few = FEW if quantity in ("hinf", "h2", "poles") else FEW[: len(KINDS)]
    assert outcomes(quantity, few)[1] == []


@pytest.mark.parametrize("seed", [119, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (569, 712, 1078))])
def test_disk_margin_changed_by_rounding_uncertified(seed):
    _, system = hard(seed)
    assert margins_outcome(seed, system, Exact.of(system)) == "uncertified"


@pytest.mark.slow
@pytest.mark.parametrize("quantity", QUANTITIES)
def test_what_is_certified_of_all_hard_systems_is_true(quantity):
    seeds = range(ALL if is_hunt() or quantity == "reduce" else SOME)
    if quantity in ("poles", "reduce"):
        seeds = [seed for seed in seeds if seed // len(KINDS) % 3 == 0]  # so many of each kind
    count, false = outcomes(quantity, seeds)
    print(f"\n{table(quantity, count)}")
    assert false == []
    assert share_not_told(count) < SHARE, table(quantity, count)
