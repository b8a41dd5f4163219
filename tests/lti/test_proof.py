"""Stability and norms of systems as stored, against balls: responses by linear solves, poles by eigenvalues, energy exactly.

What a norm's certificate says is held against the same.
"""

from contextlib import nullcontext
from functools import wraps

import control
import numpy as np
import pytest
from flint import acb, acb_mat, arb, ctx, fmpq, fmpq_mat
from scipy import linalg, signal

import boomctl as bc
from boomctl.analysis.norm import matrices_norm
from boomctl.exact_roots import OPERATIONS, UndecidedError
from boomctl.exceptions import CertificateError
from boomctl.lti.proof import Exact
from boomctl.lti.system import ClosedLoop, Lti, of
from tests.exact import Exact as Reference
from tests.hard_systems import unimodular
from tests.profiles import is_hunt, is_quick

SLACK = 1e-12  # relative: what the last digits of a bound may do
SYSTEMS = 240 if is_hunt() else 12 if is_quick() else 96  # drawn at random
RESPONSE_BITS, POLE_BITS = 600, 1500  # of the oracles: far above what the entries of these systems need
SMALL = 8  # states up to which an H2 norm is computed exactly, by a linear equation of that number squared


def random(rng, n):
    A = rng.standard_normal((n, n))
    return A - (np.linalg.eigvals(A).real.max() + rng.choice([1, 1, 1, -1]) * 10.0 ** rng.uniform(-8, 0)) * np.eye(n)


def light(rng, n):
    k = max(1, n // 2)
    omega, zeta = 10.0 ** rng.uniform(-1, 3, k), 10.0 ** rng.uniform(-5, -1, k)
    if rng.random() < 0.3:  # modes that nearly coincide
        omega = omega[0] * (1.0 + 10.0 ** rng.uniform(-12, -1, k))
    A = linalg.block_diag(*([[0.0, 1.0], [-(w**2), -2.0 * z * w]] for w, z in zip(omega, zeta, strict=True)))
    T = rng.standard_normal(A.shape)
    return T @ A @ np.linalg.inv(T)


def repeated(rng, n):
    n = min(n, 12)
    A = -(10.0 ** rng.uniform(-2, 2)) * np.eye(n) + np.diag(np.full(n - 1, 10.0 ** rng.uniform(-1, 1)), 1)
    T = np.round(4.0 * rng.standard_normal((n, n)))
    return A if rng.random() < 0.5 or abs(np.linalg.det(T)) < 0.5 else T @ A @ np.linalg.inv(T)


def alike(rng, n):
    k = max(1, n // 3)
    part = rng.standard_normal((k, k))
    part -= (np.linalg.eigvals(part).real.max() + 10.0 ** rng.uniform(-4, 0)) * np.eye(k)
    return linalg.block_diag(part, part, part)  # each pole of several signals, and poles of none


def companion(rng, n):
    k = min(n, 15) // 2
    pair = 10.0 ** rng.uniform(-1, 1, k) * np.exp(1j * (0.5 * np.pi + 10.0 ** rng.uniform(-5, -0.1, k)))
    return linalg.companion(np.poly([*pair, *pair.conj(), -1.0]).real)


def non_normal(rng, n):
    n = min(n, 15)
    couplings = rng.standard_normal((n, n)) * 10.0 ** rng.uniform(0, 3)
    return np.triu(couplings, 1) - np.diag(10.0 ** rng.uniform(-2, 2, n))


def in_steps(rng, n):
    A = rng.standard_normal((n, n))
    edge = 1.0 - rng.choice([1, 1, 1, -1]) * 10.0 ** rng.uniform(-8, -0.3)
    return A * edge / np.abs(np.linalg.eigvals(A)).max()


def light_steps(rng, n):
    A = light(rng, n)
    return linalg.expm(0.3 * A / np.abs(np.linalg.eigvals(A)).max())


def band_pass(rng):
    """Return a filter in companion form, often a narrow one."""
    analog, low, width = bool(rng.random() < 0.5), 10.0 ** rng.uniform(-3, -0.5), 10.0 ** rng.uniform(-3, -1)
    edges, kind = ([low, low * (1.0 + width)], "band") if rng.random() < 0.6 else (low, "low")
    order = int(rng.integers(2, 9 if kind == "band" else 17))
    name, given = [("butter", ()), ("ellip", (0.7, 55.0)), ("cheby1", (1.3,))][rng.integers(3)]
    return control.ss(
        *signal.tf2ss(*getattr(signal, name)(order, *given, edges, btype=kind, analog=analog)), 0 if analog else 1.0
    )


KINDS = {
    kind.__name__: (kind, dt)
    for kind, dt in [
        (random, 0), (light, 0), (repeated, 0), (alike, 0), (companion, 0), (non_normal, 0), (in_steps, 0.01),
        (light_steps, 0.5),
    ]
}  # fmt: skip


def drawn(seed):
    """Return a system that is hard: nearly undamped, repeated, non-normal, in companion form, or not stable."""
    rng = np.random.default_rng([seed, 8])
    kind = [*KINDS, "filter"][seed % (len(KINDS) + 1)]
    if kind == "filter":
        return band_pass(rng)
    make, dt = KINDS[kind]
    A = make(rng, int(rng.integers(2, 13)))
    m, p = rng.integers(1, 4, 2)
    D = rng.standard_normal((p, m)) * (rng.random() < 0.4)
    return control.ss(A, rng.standard_normal((len(A), m)), rng.standard_normal((p, len(A))), D, dt)


def balls(matrix):
    return acb_mat([[acb(float(x)) for x in row] for row in np.asarray(matrix)])


def response(system, omega):
    """Return a response by a linear solve in balls; None at a pole."""
    turn = acb(0, 1) * arb(float(omega))
    s = turn if system.isctime() else (turn * arb(float(system.dt))).exp()
    if not system.nstates:
        return balls(system.D)
    A, B, C, D = (balls(getattr(system, letter)) for letter in "ABCD")
    try:
        return C * (s * identity(A.ncols()) - A).solve(B) + D
    except ZeroDivisionError:
        return None


def identity(n):
    return acb_mat([[acb(int(i == j)) for j in range(n)] for i in range(n)])


def with_many_digits(function):
    @wraps(function)
    def run(*given):
        before, ctx.prec = ctx.prec, RESPONSE_BITS
        try:
            return function(*given)
        finally:
            ctx.prec = before

    return run


def size(G):
    return float(np.linalg.norm([[complex(x) for x in row] for row in G.tolist()], 2))


@with_many_digits
def largest_gain(system, omega):
    """Return the largest singular value at a frequency; None at a pole."""
    G = response(system, omega)
    return None if G is None else size(G)


@with_many_digits
def gain_of_loop(P, K, omega):
    """Return the largest singular value of a plant closed by a controller, from the responses of both."""
    G, k, (m, p) = response(P, omega), response(K, omega), (P.ninputs - K.noutputs, P.noutputs - K.ninputs)
    G11, G12, G21, G22 = (
        acb_mat([[G[i, j] for j in range(*columns)] for i in range(*rows)])
        for rows in ((0, p), (p, P.noutputs))
        for columns in ((0, m), (m, P.ninputs))
    )
    return size(G11 + G12 * k * (identity(K.ninputs) - G22 * k).solve(G21))


def decays(system):
    """Return whether all poles decay, by enclosed eigenvalues; None where these do not tell."""
    before, ctx.prec = ctx.prec, POLE_BITS
    try:
        poles = balls(system.A).eig(multiple=True, nonstop=True)
        beyond = [p.real if system.isctime() else abs(p) - 1 for p in poles]
        if any(x > 0 for x in beyond):
            return False
        return True if all(x < 0 for x in beyond) else None
    finally:
        ctx.prec = before


def energy(system):
    """Return the H2 norm of a discrete system by its Gramian's linear equation, ``A P A^T - P = -B B^T``, in fractions."""
    A, B, C, D = (
        fmpq_mat([[fmpq(*float(x).as_integer_ratio()) for x in row] for row in np.asarray(getattr(system, letter))])
        for letter in "ABCD"
    )
    n = range(A.nrows())
    rows = [[A[i, k] * A[j, m] - int((i, j) == (k, m)) for k in n for m in n] for i in n for j in n]
    P = fmpq_mat(rows).solve(fmpq_mat([[-x] for x in (B * B.transpose()).entries()])).entries()
    whole = C * fmpq_mat(len(n), len(n), P) * C.transpose() + D * D.transpose()
    square = sum((whole[i, i] for i in range(whole.nrows())), fmpq(0))
    return float(arb(square.p) / arb(square.q)) ** 0.5


def places(system, peak):
    """Return frequencies at which a response is large."""
    poles = np.linalg.eigvals(system.A)
    rates = poles if system.isctime() else np.log(poles[poles != 0.0]) / system.dt
    return [*np.abs(rates.imag)[:5], *([peak] if np.isfinite(peak) else [])]


@pytest.mark.parametrize("seed", range(SYSTEMS))
def test_proofs_hold_for_stored_numbers(seed):
    system = drawn(seed)
    norm, truth = bc.hinf_norm(system), decays(system)
    growing, on_axis, _ = Exact.of(of(system, sampled=True)).sides
    if truth is not None:
        assert truth == (not growing and not on_axis)
    assert bc.prove(norm).proved
    if norm.lower_bound == np.inf:
        assert truth is not True
        return
    if norm.certified:
        assert truth is not False
        gains = [gain for omega in places(system, norm.peak_omega) if (gain := largest_gain(system, omega)) is not None]
        assert max(gains, default=0.0) <= norm.upper_bound * (1.0 + SLACK)
        if np.isfinite(norm.peak_omega) and len(gains):
            assert gains[-1] >= norm.lower_bound * (1.0 - SLACK)


@pytest.mark.parametrize("seed", range(SYSTEMS))
def test_h2_norms_hold_for_the_numbers_that_are_stored(seed):
    system = drawn(seed)
    if system.isctime():
        system = control.ss(system.A, system.B, system.C, 0.0 * system.D)
    if system.nstates > SMALL or decays(system) is not True:
        pytest.skip("not stable, or too large for the oracle")
    found, truth = bc.h2_norm(system), Reference.of(system).h2() if system.isctime() else energy(system)
    assert float(Exact.of(of(system, sampled=True)).energy().sqrt()) == pytest.approx(truth, rel=1e-12)
    assert found.lower_bound <= truth * (1.0 + SLACK)
    assert found.upper_bound >= truth * (1.0 - SLACK)
    if found.certified:
        assert found.value == pytest.approx(truth, rel=1e-6)


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("shown", [True, False])
def test_poles_exactly_on_the_axis_are_told_exactly(seed, shown):
    rng = np.random.default_rng(seed)
    w, many = int(rng.integers(0, 4)), int(rng.integers(1, 3))
    block = np.array([[0.0, w], [-w, 0.0]]) if w else np.zeros((1, 1))
    A = linalg.block_diag(*[block] * many, -np.eye(2))
    n, k = len(A), len(block) * many
    B, C = rng.integers(1, 4, (n, 1)).astype(float), rng.integers(1, 4, (1, n)).astype(float)
    if not shown:
        C[:, :k] = 0.0
    T, back = unimodular(rng, n)  # by integers, so that nothing is rounded
    system = control.ss(T @ A @ back, T @ B, C @ back, 0.0)
    growing, on_axis, seen = Exact.of(of(system)).sides
    assert growing == 0
    assert len(on_axis) == k
    assert bool(seen) == shown
    assert (bc.hinf_norm(system).lower_bound == np.inf) == (bc.h2_norm(system).value == np.inf) == shown
    assert bc.prove(bc.hinf_norm(system)).proved


@pytest.mark.parametrize("seed", range(5))
def test_a_wrong_certificate_is_refuted(seed):
    system = drawn(9 * seed + 2)  # repeated poles: stable, whatever happens
    norm = bc.hinf_norm(system)
    for wrong in (
        {"upper_bound": norm.lower_bound * 0.99, "lower_bound": 0.0},
        {"lower_bound": norm.upper_bound * 1.01, "upper_bound": norm.upper_bound * 1.02},
    ):
        with pytest.raises(CertificateError):
            bc.prove(type(norm)(**{"peak_omega": norm.peak_omega, "method": "", **wrong, "_given": of(system)}))
    with pytest.raises(CertificateError):
        bc.prove(type(norm)(np.inf, np.inf, 0.0, "", _given=of(system)))


@pytest.mark.parametrize("elements", [2, 6])
def test_structure_peak_proved_by_state_space(elements):
    yaw = bc.split_symmetric(bc.spray_boom(elements=elements))[1]
    found = bc.sigma(yaw)
    assert bc.prove(found).proved
    assert bc.prove(bc.sigma(yaw.to_statespace("actuator_anti", "tip_anti"))).proved
    assert bc.prove(bc.reduce(yaw.select(["actuator_anti"], ["tip_anti"]), order=6)).proved


def cheap(seed):
    """Return a plant, stable or not, whose effort and noise cost little: its best controllers have poles far away."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 8))
    A = rng.standard_normal((n, n)) * 10.0 ** rng.uniform(-1, 2)
    A -= np.linalg.eigvals(A).real.max() * rng.uniform(0.0, 1.3) * np.eye(n)
    B, C = (np.hstack([rng.standard_normal((n, 2)), np.zeros((n, 1)), rng.standard_normal((n, 1))]) for _ in range(2))
    D = np.zeros((4, 4))
    D[2, 3], D[3, 2] = 10.0 ** rng.uniform(-3, 0, 2)
    return control.ss(A, B, C.T, D)


@pytest.mark.parametrize("seed", range(SYSTEMS // 2))
def test_design_certified_for_returned_controller(seed):
    """Matrices of a loop are rounded; with huge gains that shows in the sixth digit of its norm and before."""
    P, tight = cheap(seed), {"rtol": 1e-9, "fastest_pole": 1e10} if seed % 2 else {}
    try:
        found = bc.h_infinity(P, 1, 1, **tight)
    except bc.exceptions.SynthesisError:
        return
    assert bc.prove(found).proved
    norm = found.certificate.norm_bounds
    gains = [
        gain_of_loop(P, found.controller, w)
        for w in (norm.peak_omega, *np.abs(found.closed_loop.poles().imag))
        if w < np.inf
    ]
    assert max(gains) <= norm.upper_bound * (1.0 + SLACK)
    if norm.peak_omega < np.inf:
        assert gains[0] >= norm.lower_bound * (1.0 - SLACK)


@pytest.mark.parametrize("seed", range(8))
def test_bounds_of_loop_hold_where_terms_cancel(seed):
    """Feedthroughs that almost close an algebraic loop, or a huge gain that the plant's own matrix takes back."""
    rng = np.random.default_rng(seed)
    A, B, C, D = (rng.standard_normal(shape) for shape in ((4, 4), (4, 2), (2, 4), (2, 2)))
    A -= (np.linalg.eigvals(A).real.max() + 0.2) * np.eye(4)
    D, gain = (D, (1.0 - 10.0 ** rng.uniform(-9, -3)) / D[1, 1]) if seed % 2 else (0.0 * D, 10.0 ** rng.uniform(6, 11))
    P = control.ss(A - gain / (1.0 - gain * D[1, 1]) * np.outer(B[:, 1], C[1]), B, C, D)
    K = control.ss([], [], [], gain)
    found = matrices_norm(ClosedLoop(of(P), of(K)))
    gains = [gain_of_loop(P, K, w) for w in (found.peak_omega, 0.0, *np.abs(np.linalg.eigvals(A))) if w < np.inf]
    assert max(gains) <= found.upper_bound * (1.0 + SLACK)
    if found.peak_omega < np.inf:
        assert gains[0] >= found.lower_bound * (1.0 - SLACK)


@pytest.mark.parametrize(("n", "decided"), [(40, True), (120, False)])
def test_norm_beyond_limit_undecided_at_once(n, decided, monkeypatch):
    def unwanted(entries):
        raise AssertionError("expected no arithmetic")

    monkeypatch.setattr("boomctl.lti.proof.characteristic_polynomial", unwanted)
    exact = Exact.of(Lti(-np.eye(n), np.ones((n, 1)), np.ones((1, n)), np.zeros((1, 1))), OPERATIONS)
    with nullcontext() if decided else pytest.raises(UndecidedError):
        exact.check_norm()


def test_proof_ends_at_limit_of_operations():
    system = drawn(3)
    exact = Exact.of(of(system))
    exact.norm(1.0)
    with pytest.raises(UndecidedError):
        Exact.of(of(system), 0.1 * exact.work.spent).norm(1.0)
    assert Exact.of(of(system), 1.01 * exact.work.spent).norm(1.0) == exact.norm(1.0)
    proof = bc.prove(bc.hinf_norm(system), max_operations=1.0)
    assert proof.proved is None
    assert "not decided within the limit" in proof.claim


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    ("kind", "states"), [("light", 14), ("random", 45), ("light", 40), ("in_steps", 50), ("light_steps", 30)]
)
def test_proof_of_large_system_stays_within_limit(kind, states, seed):
    rng = np.random.default_rng(seed)
    make, dt = KINDS[kind]
    A = make(rng, states)
    system = control.ss(A, rng.standard_normal((len(A), 2)), rng.standard_normal((2, len(A))), 0.0, dt)
    exact = Exact.of(of(system, sampled=True), OPERATIONS)
    growing, on_axis, _ = exact.sides
    assert decays(system) in (None, not (growing or on_axis))
    if not growing:
        low, high, _ = exact.norm(1.0)
        assert 0.0 < low <= high <= low * (1.0 + 2e-6)


def ill_conditioned(seed):
    """Return a system whose eigenvalues rounding of LAPACK moves across the axis, in coordinates that mix large integers."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(6, 9))
    A = np.diag(-(10.0 ** rng.uniform(-1.5, 1.0, n))) + np.triu(rng.standard_normal((n, n)), 1)
    lower, upper = (np.tril(rng.integers(-20, 21, (n, n)), -1), np.triu(rng.integers(-20, 21, (n, n)), 1))
    T = (lower + np.eye(n)) @ (upper + np.eye(n))
    A = np.round((T @ A @ np.linalg.inv(T)) * 2.0**12) / 2.0**12
    return control.ss(A, rng.standard_normal((n, 1)), rng.standard_normal((1, n)), 0.0)


@pytest.mark.parametrize(
    "seed", [40, 52, 208, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (220, 234, 280, 302, 532))]
)
def test_poles_of_stable_ill_conditioned_matrix_are_stable(seed):
    system = ill_conditioned(seed)
    assert decays(system)
    assert (of(system).poles.real < 0.0).all()
    assert "unstable" not in repr(bc.pzmap(system)) + repr(bc.bode(system))
    assert bc.hinf_norm(system).lower_bound < np.inf
    try:
        assert "unstable" not in repr(bc.step(system))
    except ArithmeticError as error:
        assert "rounding" in str(error)  # noqa: PT017
