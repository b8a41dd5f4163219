"""Anti-windup stays bounded where one control is limited, and where all are: against exact arithmetic, and in runs."""

import warnings

import control as ct
import numpy as np
import pytest
from flint import fmpq, fmpq_mat
from hypothesis import given

import boomctl as bc
from boomctl.exceptions import WindupWarning
from boomctl.lti.system import Lti
from boomctl.simulation.conditioning import bounded, conditioning_gains, positive_definite
from boomctl.simulation.time_varying import TimeVaryingController
from tests.profiles import examples
from tests.simulation.cases import conditioning_gain
from tests.strategies import seeds

_TS = 0.01


def _random_controller(rng, own=None):
    """Return A, B, C, D of a stable controller: any, lightly damped, or slow; or with a largest pole of a given size."""
    m, p, pairs = (int(rng.integers(1, most)) for most in (5, 4, 4))
    if rng.random() < 0.4:
        n, A = 2 * pairs, np.zeros((2 * pairs, 2 * pairs))
        for i in range(pairs):
            angle, size = 10.0 ** rng.uniform(-2.0, 0.4), 1.0 - 10.0 ** rng.uniform(-4.0, -1.0)
            turn = [[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]]
            A[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = size * np.array(turn)
        T = rng.standard_normal((n, n))
        A = T @ A @ np.linalg.inv(T)
    else:
        n = int(rng.integers(1, 9))
        A = rng.standard_normal((n, n))
        A *= rng.uniform(0.3, 0.999) / np.abs(np.linalg.eigvals(A)).max()
    if own is not None:
        A *= own / np.abs(np.linalg.eigvals(A)).max()
    D = rng.standard_normal((m, p)) * (rng.random() < 0.5)
    return A, rng.standard_normal((n, p)), rng.standard_normal((m, n)), D


def _exact(M):
    return fmpq_mat(*M.shape, [fmpq(*float(x).as_integer_ratio()) for x in M.ravel()])


def _within_unit_circle(M):
    """Return whether all eigenvalues are: enclosures of the roots of the characteristic polynomial decide."""
    return all(abs(root) < 1 for root, _ in M.charpoly().numer().complex_roots())


def _sets(m):
    return [*([i] for i in range(m)), list(range(m))]


@given(seed=seeds)
@examples(300)
def test_anti_windup_stable_with_each_limit_and_all(seed):
    A, B, C, D = _random_controller(np.random.default_rng(seed))
    L = conditioning_gain(A, B, C, D)
    assert L.any() or len(C) > 1  # what is stable with one limit may not be with another one: then there is no gain
    A, C, L = _exact(A), _exact(C), _exact(L)
    n, m = C.ncols(), C.nrows()
    for S in _sets(m):
        chosen = fmpq_mat(m, m, [int(i == j and i in S) for i in range(m) for j in range(m)])
        assert _within_unit_circle(A - L * chosen * C), (n, S)


@given(seed=seeds)
@examples(100)
def test_anti_windup_unstable_controller_bounded(seed):
    rng = np.random.default_rng(seed)
    A, B, C, D = _random_controller(rng, own=rng.choice([1.0, 1.02]))
    L = conditioning_gain(A, B, C, D)
    assert L.any()
    assert _within_unit_circle(_exact(A) - _exact(L) * _exact(C))


@given(seed=seeds)
@examples(200)
def test_what_is_called_positive_definite_is(seed):
    """Matrices whose least eigenvalue is of the size of rounding, exactly decided; and hardly larger ones are made out."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 7))
    Q, _ = np.linalg.qr(rng.standard_normal((n, n)))
    least = float(rng.choice([-1.0, 1.0])) * 10.0 ** rng.uniform(-17.0, -10.0)
    scale = 10.0 ** rng.uniform(-6.0, 6.0, n)
    M = (Q * np.concatenate([[least], rng.uniform(0.5, 2.0, n - 1)])) @ Q.T * np.outer(scale, scale)
    M = 0.5 * (M + M.T)
    doubt = 10.0 ** rng.uniform(-18.0, -12.0) * np.abs(M)
    told = positive_definite(M, doubt)
    signs = np.ones((n, n)) if rng.random() < 0.5 else np.sign(rng.standard_normal((n, n)))
    beside = _exact(M) + fmpq(999, 1000) * _exact(doubt * np.where(np.tri(n), signs, signs.T))
    # a symmetric matrix is positive definite if the signs of its characteristic polynomial alternate
    true = all(coefficient * (-1) ** (n - k) > 0 for k, coefficient in enumerate(beside.charpoly().coeffs()))
    assert true or not told
    if least > 1e-10 / n and n == 1:
        assert told


@given(seed=seeds)
@examples(60)
def test_anti_windup_scheduled_controller_bounded(seed):
    """Values of the signal drawn at each sample, one control or all at their limits: the state does not grow."""
    rng = np.random.default_rng(seed)
    first = _random_controller(rng)
    m, p = first[3].shape
    names = tuple(f"y{i}" for i in range(p)), tuple(f"u{i}" for i in range(m))
    laws = []
    for _ in range(3):
        A, *others = (X * (1.0 + 0.1 * rng.uniform(-1.0, 1.0, X.shape)) for X in first)
        laws.append(Lti(A * min(1.0, 0.999 / np.abs(np.linalg.eigvals(A)).max()), *others, *names))
    gains, proved = conditioning_gains(laws, np.ones(m, dtype=bool))
    assert proved or not gains.any()
    for K, L in zip(laws, gains, strict=True):
        for S in _sets(m):
            assert np.abs(np.linalg.eigvals(K.A - L[:, S] @ K.C[S])).max() < 1.0
    if not bounded(laws, np.zeros_like(gains), [()]):
        return  # by itself it is not proved to bear any change either
    stacks = np.array([K.A for K in laws]), np.array([K.C for K in laws]), np.array(gains)
    for S in _sets(m):
        x, length = rng.standard_normal(len(first[0])), 0.0
        for _ in range(400):
            k, share = int(rng.integers(2)), float(rng.random())
            A, C, L = ((1.0 - share) * X[k] + share * X[k + 1] for X in stacks)
            x = (A - L[:, S] @ C[S]) @ x
            length += np.log(np.linalg.norm(x) or 1e-300)
            x /= np.linalg.norm(x) or 1.0
        assert length < np.log(1e6)  # the condition of a Lyapunov matrix at most; growth by 4 % a sample exceeds it


def _loop(K, **limits):
    names = K.output_labels if hasattr(K, "output_labels") else K.outputs
    inputs = K.input_labels if hasattr(K, "input_labels") else K.inputs
    gains = np.zeros((len(inputs), len(names) + 1))
    gains[:, -1] = 1.0
    plant = ct.ss([], [], [], gains, inputs=[*names, "w"], outputs=list(inputs))
    time = _TS * np.arange(800)
    return bc.simulate_loop(plant, K, time, {"w": np.sin(3.0 * time)}, sample_time=_TS, **limits)


def _diverging():
    """Return a stable controller and gains that are stable with both controls, unstable with the first alone."""
    A, C = np.array([[0.9, 0.5], [0.0, 0.9]]), np.eye(2)
    L = np.array([[0.0, 0.5], [-0.4, 0.85]])
    assert np.abs(np.linalg.eigvals(A - L @ C)).max() < 1.0 < np.abs(np.linalg.eigvals(A - L[:, :1] @ C[:1])).max()
    return A, np.ones((2, 1)), C, np.zeros((2, 1)), L


def test_anti_windup_time_varying_unbounded_warns():
    *matrices, L = (X[None] for X in _diverging())
    good = np.array([[[0.2, 0.0], [0.0, 0.2]]])
    K, sound, plain = (
        TimeVaryingController(*matrices, ["y"], ["u0", "u1"], dt=_TS, anti_windup_gain=gain) for gain in (L, good, None)
    )
    limits = {"control_limit": {"u0": 0.5}}
    with pytest.warns(WindupWarning, match=r"where limits are met by u0, .* is not corrected"):
        found = _loop(K, **limits)
    np.testing.assert_array_equal(found.commanded["u0"], _loop(plain, **limits, anti_windup=False).commanded["u0"])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        corrected = _loop(sound, **limits)
    assert np.abs(corrected.commanded["u0"] - found.commanded["u0"]).max() > 0.01


def test_anti_windup_many_rate_limits_warns():
    K = ct.ss(0.9 * np.eye(3), np.ones((3, 1)), np.eye(3), 0.0, _TS, inputs=["y"], outputs=["u0", "u1", "u2"])
    with pytest.warns(WindupWarning, match="u0, u1, u2"):
        _loop(K, rate_limit=1.0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        _loop(K, rate_limit=1.0, control_limit=5.0)
        _loop(K, rate_limit={"u0": 1.0, "u2": 1.0})
        _loop(K)


def test_an_integrator_whose_control_has_no_limit_is_left_alone():
    """Two controllers side by side, one with limits: it is corrected as if it were alone, nothing is refused."""
    A, B, C, D = np.eye(2), np.diag([0.1, 0.2]), np.diag([1.0, -2.0]), np.diag([1.0, 0.5])
    names = {"inputs": ["y0", "y1"], "outputs": ["u0", "u1"]}
    one = conditioning_gain(*(X[:1, :1] for X in (A, B, C, D)))
    laws = (Lti(A, B, C, D, tuple(names["inputs"]), tuple(names["outputs"])),)
    gains, proved = conditioning_gains(laws, np.array([True, False]))
    assert proved
    np.testing.assert_allclose(gains[0], [[one[0, 0], 0.0], [0.0, 0.0]], atol=1e-6)
    _loop(ct.ss(A, B, C, D, _TS, **names), control_limit={"u0": 0.5})
