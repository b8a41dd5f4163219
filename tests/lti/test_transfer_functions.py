"""Transfer functions handed in: the system is that of their polynomials, or it is refused."""

from itertools import chain, product

import control
import numpy as np
import pytest
from flint import acb, acb_poly, arb, ctx

import boomctl as bc
from boomctl.lti.system import of
from tests.profiles import is_quick

PATTERNS = ("lower triangular", "zero row and column", "sparse", "common denominator", "common factor", "integrator")


def random_polynomial(rng, dt, degree):
    """Return a polynomial whose roots decay, some of them lightly damped."""
    p = np.array([1.0])
    while len(p) <= degree:
        w, z = np.exp(rng.uniform(-2.0, 3.0)), np.exp(rng.uniform(np.log(1e-3), 0.0))
        pair = [1.0, 2.0 * z * w, w * w]
        if dt:
            w, z = rng.uniform(-0.9, 0.95), rng.uniform(0.1, 3.0)
            pair = [1.0, -2.0 * abs(w) * np.cos(z), w * w]
        p = np.polymul(p, pair if len(p) < degree and rng.random() < 0.6 else [1.0, -w if dt else w])
    return p


def sparse_table(seed):
    """Return a transfer matrix with zero entries, in continuous or discrete time, in units of up to 24 decades."""
    rng = np.random.default_rng(seed)
    dt, pattern, scaled = ((0.0, 0.1)[seed % 2], PATTERNS[seed // 2 % len(PATTERNS)], seed // 12 % 2)
    p, m = rng.integers(2, 4, 2)
    nonzero = rng.random((p, m)) < 0.6
    if pattern in ("lower triangular", "common denominator"):
        nonzero = np.tril(np.ones((p, m), bool))
    if pattern == "zero row and column":
        nonzero = np.outer(np.arange(p) != rng.integers(p), np.arange(m) != rng.integers(m))
    sizes = np.outer(10.0 ** rng.uniform(-6.0, 6.0, p), 10.0 ** rng.uniform(-6.0, 6.0, m)) ** scaled
    common = [1.0, -1.0 if dt else 0.0] if pattern == "integrator" else random_polynomial(rng, dt, rng.integers(1, 3))
    num, den = [[[[1.0]] * m for _ in range(p)] for _ in range(2)]
    for i, j in product(range(p), range(m)):
        den[i][j] = random_polynomial(rng, dt, rng.integers(1, 4))
        if pattern == "common denominator":
            den[i][j] = common
        elif pattern in ("common factor", "integrator") and rng.random() < 0.7:
            den[i][j] = np.polymul(common, random_polynomial(rng, dt, 1))
        num[i][j] = rng.standard_normal(rng.integers(1, len(den[i][j]) + 1)) * sizes[i, j] * nonzero[i, j]
    return control.tf(num, den, dt)


def exact_response(G, omega):
    """Return the response of the polynomials, in ball arithmetic of 400 bits."""
    ctx.prec = 400
    points = [acb(0, float(w)) if G.isctime() else (acb(0, float(w)) * arb(float(G.dt))).exp() for w in omega]
    entries = [
        (acb_poly(n[::-1].tolist()), acb_poly(d[::-1].tolist()))
        for n, d in zip(chain(*G.num), chain(*G.den), strict=True)
    ]
    values = [[complex(n(s) / d(s)) for s in points] for n, d in entries]
    return np.array(values).reshape(G.noutputs, G.ninputs, -1)


def test_sparse_transfer_matrix_keeps_response():
    omega, refused = np.geomspace(0.05, 30.0, 9), []
    seeds = range(0, 300, 5 if is_quick() else 1)
    for seed in seeds:
        G = sparse_table(seed)
        try:
            system = of(G, sampled=True)
        except ValueError:
            refused.append(PATTERNS[seed // 2 % len(PATTERNS)])
            continue
        assert (list(system.input_labels), list(system.output_labels), system.dt) == (
            G.input_labels,
            G.output_labels,
            G.dt,
        )
        exact = exact_response(G, omega)
        error, sizes = np.abs(system.response(omega) - exact).max(axis=2), np.abs(exact).max(axis=2)
        assert (error <= 1e-6 * sizes + 1e-8 * sizes.max()).all()
        states = sum(
            len(d) - 1 for rows in zip(G.num, G.den, strict=True) for n, d in zip(*rows, strict=True) if any(n)
        )
        if len(system.A) == states:  # no entries are mixed
            assert (error <= 1e-12 * sizes).all()
    assert len(refused) <= 0.01 * len(seeds)
    assert set(refused) <= {"common factor", "integrator"}


def test_all_who_analyze_take_transfer_functions():
    G = control.tf([2.0], [1.0, 0.4, 4.0], inputs="force", outputs="place")
    K = control.tf([-1.0, 0.0], [0.01, 1.0], inputs="place", outputs="force")
    assert bc.hinf_norm(G).lower_bound == pytest.approx(2.0 / (2.0 * 0.1 * 4.0 * np.sqrt(1.0 - 0.01)), rel=1e-6)
    assert bc.mode_table(G).rows[0].damping_ratio == pytest.approx(0.1)
    loop = bc.feedback_loop(G, K, "force")
    poles = np.roots(np.polyadd(np.polymul([1.0, 0.4, 4.0], [0.01, 1.0]), [2.0, 0.0]))
    assert np.sort_complex(loop.poles()) == pytest.approx(np.sort_complex(poles))
    assert bc.margins(G, K)["force"].gain_margin[1] == np.inf
    shared = control.tf([[[1.0], [1.0]], [[1.0], [2.0]]], [[[1.0, 0.0]] * 2] * 2)
    assert len(of(shared).A) == 2  # as many integrators as the response has, not one an entry


def test_what_has_no_realization_is_refused():
    modes = np.array([1.0])  # six decades of hardly damped modes: what each does is below the digits of the others
    for w in np.geomspace(1e-3, 1e3, 12):
        modes = np.polymul(modes, [1.0, 2e-3 * w, w * w])
    num, one = np.random.default_rng(1).standard_normal(24), [1.0]
    for G in (control.tf(num, modes), control.tf([[one, [0.0]], [num, one]], [[[1.0, 1.0], one], [modes, [1.0, 2.0]]])):
        with pytest.raises(ValueError, match=r"too few digits.*expected a StateSpace"):
            bc.hinf_norm(G)


def test_hardly_damped_modes_keep_their_digits():
    """A companion form, balanced, where a staircase form is off by the whole response."""
    modes, peaks = np.array([1.0]), np.geomspace(1.0, 1e5, 8)
    for w in peaks:
        modes = np.polymul(modes, [1.0, 2e-3 * w, w * w])
    system = of(control.tf([modes[-1]], modes))
    omega = np.outer(peaks, [0.9, 0.9999, 1.0001, 1.1]).ravel()
    exact = np.prod([w * w / (w * w - omega**2 + 2e-3j * w * omega) for w in peaks], axis=0)
    assert system.response(omega)[0, 0] == pytest.approx(exact, rel=1e-8)


def test_poles_that_a_zero_cancels_stay_those_of_the_entry():
    cancelled = control.tf([1.0, -1.0], [1.0, 1.0, -2.0])  # (s - 1)/((s - 1)(s + 2))
    assert np.sort(of(cancelled).poles.real) == pytest.approx([-2.0, 1.0])


def test_frequency_data_accepted_or_raises():
    omega = np.geomspace(0.1, 10.0, 50)
    lag = control.tf([1.0], [1.0, 0.1, 1.0], inputs="u", outputs="y")
    data = control.frequency_response(lag, omega)
    data = control.frd(data.frdata, omega, inputs="u", outputs="y")
    found = bc.hinf_norm(data)
    assert found.lower_bound == pytest.approx(bc.sigma(data).peak, rel=1e-12)
    assert found.lower_bound == pytest.approx(np.abs(data.frdata).max())
    assert (found.upper_bound, found.certified) == (np.inf, False)
    spring = control.ss([], [], [], [[-1.0]], inputs="y", outputs="u")
    for refuse in (lambda: bc.margins(data, spring), lambda: bc.h2_norm(data), lambda: bc.reduce(data, order=1)):
        with pytest.raises(TypeError, match=r"FrequencyResponseData, which does not tell its poles: boomctl.fit"):
            refuse()
