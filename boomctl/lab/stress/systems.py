"""Linear systems: norms, singular values, mode tables, reduction; damping, clusters, spreads, scales, kinds of numbers."""

import warnings
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from math import comb, inf, isfinite, sqrt

import mpmath as mp
import numpy as np
from scipy import linalg

from boomctl.analysis.h2 import h2_norm
from boomctl.analysis.model_norm import hinf_norm
from boomctl.analysis.modes import mode_table
from boomctl.analysis.sigma import sigma
from boomctl.arrays import Array
from boomctl.lab.stress.case import SCALES, Case, Seen, relative, rows
from boomctl.lab.stress.plants import mass_on_spring, named, oscillator, repeated_pole
from boomctl.lab.stress.references import DIGITS, state_space_gain
from boomctl.lti.system import Lti
from boomctl.reduction.reduce import reduce
from boomctl.structure.model import SecondOrderModel

_NORMS, _REDUCTION, _MODES = "Norms", "Reduction", "Modes"
# what a certified peak and a certified H2 norm promise, with a tenth for their own rounding
_PEAK, _H2 = 1.1e-5, 1.1e-6
_EPS = float(np.finfo(float).eps)
_EXACT, _SCALING = "relative, exact solution", "relative, the law of scaling"
_DAMPINGS = (0.0, 1e-12, 1e-10, 1e-8, 1e-4, 0.5, 1.0, 1.0 + 1e-8, 1e2, 1e6)  # relative, from none to overcritical
_KINDS = ("float32", "int64", "int8", "Fortran order", "lists", "a read-only view")


def cases() -> Iterator[Case]:
    """Return the cases of linear systems."""
    yield from _damped()
    yield from _poles()
    yield from _scales()
    yield from _reductions()
    what, rates = "two carts on free wheels, a spring between them", (1e-6, 1e-3, 1.0, 1e3, 1e6)
    yield from rows(_MODES, what, _EXACT, _free, rates, amount="{:g} rad/s", promise=1e-9, answered=True)


_norms = partial(rows, _NORMS)


def _damped() -> Iterator[Case]:
    """Return the cases of damping and frequencies."""

    def fair(zeta: float) -> bool:
        return zeta == 0.0 or zeta >= 1e-8

    for what, work, promise in (
        ("peak of one oscillator", _peak, _PEAK),
        ("peak of one mass on a spring", _model_peak, _PEAK),
        ("H2 norm of one oscillator", _energy, _H2),
    ):
        yield from _norms(what, _EXACT, work, _DAMPINGS, amount="ratio {:.10g}", promise=promise, answered=fair)
    yield from rows(
        _MODES,
        "poles of one oscillator",
        _EXACT,
        _damping,
        _DAMPINGS,
        amount="ratio {:.10g}",
        promise=lambda zeta: max(1e-7, 4.0 * _EPS * zeta**2),  # rounding of the fastest pole is so much of the slowest
        answered=lambda zeta: zeta != 1.0,
    )
    omega, words = (1e-6, 1e-3, 1e3, 1e6), "{:g} rad/s"
    for what, work, promise in (
        ("peak of one oscillator, damped by a hundredth", partial(_peak, 0.01), _PEAK),
        ("H2 norm, damped by a hundredth", partial(_energy, 0.01), _H2),
    ):
        yield from _norms(what, _EXACT, work, omega, amount=words, promise=promise, answered=True)


def _poles() -> Iterator[Case]:
    """Return the cases of poles that are repeated, nearly equal, or ill to compute."""
    both = (("peak", _PEAK), ("H2 norm", _H2))
    for norm, promise in both:
        what, work, counts = (
            f"{norm} of 1/(s + 1)^n, one pole repeated",
            partial(_repeated, norm=norm),
            (2, 4, 6, 8, 12),
        )
        yield from _norms(what, _EXACT, work, counts, amount="{} times", promise=promise, answered=True)
    measure = "relative, the largest gain found in sixty digits beside poles"
    what, orders = "peak of an elliptic low-pass in companion form", (4, 8, 12, 16)
    yield from _norms(what, measure, _companion, orders, amount="order {}", promise=_PEAK, answered=True)
    what = "peak of a triangular matrix with large couplings, 8 states"
    yield from _norms(what, measure, _triangular, (1e1, 1e3, 1e5), promise=_PEAK, answered=True)
    for norm, promise in both:
        what, work = f"{norm} of two nearly equal coupled poles", partial(_defective, norm=norm)
        gaps = (1e-2, 1e-5, 1e-8, 1e-11, 1e-14)
        yield from _norms(what, _EXACT, work, gaps, amount="{:g} apart", promise=promise)


def _scales() -> Iterator[Case]:
    """Return the cases of scales, spreads, kinds of numbers, and of what hardly shows."""
    for what, work, promise in (
        ("peak of 1/(s + 1) + a/(s + a)", partial(_spread, norm="peak"), _PEAK),
        ("H2 norm of 1/(s + 1) + sqrt(a)/(s + a)", partial(_spread, norm="H2 norm"), _H2),
        ("peak, an unstable pole of +1 beside -a", _unstable, _PEAK),
    ):
        yield from _norms(what, _EXACT, work, (1e2, 1e6, 1e10, 1e14), promise=promise)
    for unit in ("time", "inputs", "states"):
        for norm, promise in (("peak", _PEAK), ("H2 norm", _H2)):
            what, work = f"{norm} in other units of {unit}", partial(_scaled, unit=unit, norm=norm)
            yield from _norms(what, _SCALING, work, SCALES, promise=promise, answered=True)
    what, measure = "peak and H2 norm of numbers of another kind", "relative, the same numbers in double precision"
    yield from _norms(what, measure, _kinds, _KINDS, amount="{}", promise=1e-9, answered=True)
    what, tiny = "peak of a system whose gain is tiny", (1e-90, 1e-150, 1e-300, 1e-306)
    yield from _norms(what, _EXACT, _tiny, tiny, promise=_PEAK, answered=lambda gain: gain > 1e-100)
    yield from _norms("peak of a system whose gain is huge", _EXACT, _tiny, (1e90, 1e150, 1e300), promise=_PEAK)
    for what, kind in (
        ("peak of 1 + k/(s^2 + 1), undamped", "undamped"),
        ("H2 norm of 1/(s + 1) + k/s, an integrator", "H2 norm"),
    ):
        gains, work = (1e-2, 1e-5, 1e-8, 1e-12), partial(_weak, what=kind)
        promise = _PEAK if kind == "undamped" else _H2
        yield from _norms(what, "infinite", work, gains, amount="{:g} beside 1", promise=promise)


def _reductions() -> Iterator[Case]:
    """Return the cases of reduction."""
    tried = partial(rows, _REDUCTION, promise=1e-9)
    measure = "share by which the verified error falls below the largest one found in sixty digits"
    for method in ("balanced", "singular-perturbation", "hankel", "modal"):
        what, work = f"a chain of 6 masses, {method}", partial(_reduced, method)
        yield from tried(what, measure, work, (2, 4, 6, 8), amount="order {}")
    what, gaps = "nearly equal poles in mixed coordinates, balanced to half", (1e-2, 1e-6, 1e-10, 1e-14)
    yield from tried(what, measure, _clustered, gaps, amount="{:g} apart")
    measure = (
        "share by which the verified error, or the bound known before, falls below the largest one in sixty digits"
    )
    for method in ("balanced", "singular-perturbation", "hankel"):
        what, work, radii = (
            f"five discrete modes, {method} to four states",
            partial(_discrete, method),
            (0.5, 0.9, 0.99, 0.9999),
        )
        yield from tried(what, measure, work, radii, amount="radius {:g}")
    what, work = "eight modes that cancel, to three states", partial(_cancelling, "hankel")
    yield from tried(what, measure, work, (1.0, 1e-1, 1e-2), amount="hankel, {:g} apart")
    what, poles = "an unstable pole beside oscillators, modal to five states", (1e-3, 1e-1, 10.0)
    yield from tried(what, measure, _modal, poles, amount="pole {:g} rad/s", answered=True)
    what = "an error asked for, an unstable pole, coordinates of unlike sizes"
    measure = "share by which the verified error exceeds the one asked for, or falls below the true one"
    yield from tried(what, measure, _asked, (1e-1, 1e-4, 1e-8, 1e-12), answered=True)
    what, measure = (
        "a cart with friction keeps its integrator",
        "integrators less than one, or relative error of its residue",
    )
    frictions = (1e-4, 1e-2, 1.0, 1e2, 1e4)
    yield from rows(_REDUCTION, what, measure, _cart, frictions, amount="{:g} N s/m", promise=1e-6)
    yield from rows(_REDUCTION, "verified error in other units of time", _SCALING, _reduced_units, SCALES, promise=1e-4)


def _free(omega: float) -> Seen:
    """Two poles at zero that the one force moves and the other does not, and the elastic pair at ``sqrt 2 omega``."""
    pull = np.array([1.0, -1.0])
    stiffness = omega**2 * np.outer(pull, pull)
    model = SecondOrderModel(
        np.eye(2), 0.0 * stiffness, stiffness, {"push": [1.0, 0.0], "squeeze": pull}, {"place": [1.0, 0.0]}
    )
    first, second, elastic = mode_table(model).rows
    rigid = all(row.pole == 0.0 and row.peaks.tolist() == [[inf, 0.0]] for row in (first, second))
    return Seen(abs(elastic.pole - 1j * sqrt(2.0) * omega) / omega if rigid else inf)


def _of(found: float, true: float, certified: bool, said: str) -> Seen:
    """Compare a norm with the true one; two infinite ones are equal."""
    if not isfinite(true) or not isfinite(found):
        return Seen(0.0 if found == true else inf if certified else 1.0, certified, said)
    return Seen(abs(found / true - 1.0) if true else abs(found), certified, said)


def _peak_of(system: Lti | SecondOrderModel, true: float) -> Seen:
    known = isinstance(system, SecondOrderModel)
    told = sigma(system).certificate if known else hinf_norm(system.statespace("stressed"))
    return _of(told.lower, true, told.certified, "" if told.certified else told.method)


def _h2_of(system: Lti, true: float) -> Seen:
    told = h2_norm(system.statespace("stressed"))
    return _of(told.value, true, told.certified, "" if told.certified else told.method)


def _true_peak(zeta: float) -> float:
    if zeta == 0.0:
        return inf
    return 1.0 / (2.0 * zeta * sqrt(1.0 - zeta**2)) if zeta < sqrt(0.5) else 1.0


def _peak(zeta: float, omega: float = 1.0) -> Seen:
    return _peak_of(oscillator(zeta, omega), _true_peak(zeta))


def _model_peak(zeta: float) -> Seen:
    return _peak_of(mass_on_spring(zeta), _true_peak(zeta))


def _energy(zeta: float, omega: float = 1.0) -> Seen:
    return _h2_of(oscillator(zeta, omega), sqrt(omega) * 0.5 / sqrt(zeta) if zeta else inf)


def _damping(zeta: float) -> Seen:
    found = [row.pole for row in mode_table(mass_on_spring(zeta)).rows]
    with mp.workdps(DIGITS):
        z = mp.mpf(2.0 * zeta) / 2
        root = mp.sqrt(z * z - 1)
        true = [complex(-z + root), complex(-z - root)]
    worst = max(min(abs(p - t) / abs(t) for t in true) for p in found)
    # where two poles meet, half of the digits are those of the data
    return Seen(worst if abs(zeta - 1.0) > 1e-6 else max(0.0, worst - 2.0 * sqrt(_EPS)))


def _repeated(count: int, norm: str) -> Seen:
    system = repeated_pole(count)
    if norm == "peak":
        return _peak_of(system, 1.0)
    return _h2_of(system, sqrt(comb(2 * count - 2, count - 1) / 2.0 ** (2 * count - 1)))


def _companion(order: int) -> Seen:
    from scipy import signal

    with warnings.catch_warnings():  # scipy says that such coefficients are badly conditioned: so they are
        warnings.simplefilter("ignore")
        A, B, C, D = signal.tf2ss(*signal.ellip(order, 0.5, 60.0, 1.0, analog=True))
    return _peak_beside_poles(Lti(A, B, C, D))


def _triangular(coupling: float) -> Seen:
    n = 8
    A = np.triu(np.full((n, n), coupling), 1) - np.diag(np.arange(1.0, n + 1))
    return _peak_beside_poles(named(A, np.eye(n)[:, -1:], np.eye(n)[:1]))


def _peak_beside_poles(system: Lti) -> Seen:
    """Return how far the largest gain found, at the peak told, beside poles and between, lies from the norm told."""
    told = hinf_norm(system.statespace("stressed"))
    sizes = np.unique(np.abs(linalg.eigvals(system.A)))
    omega = np.concatenate([[0.0, told.omega], np.geomspace(0.1 * sizes[0], 2.0 * sizes[-1], 100), sizes])
    true = state_space_gain(system.A, system.B, system.C, system.D, (1j * omega).tolist())
    return _of(told.lower, true, told.certified, "" if told.certified else told.method)


def _defective(gap: float, norm: str) -> Seen:
    """``1/((s + 1)(s + 1 + gap))`` after an orthogonal change of states."""
    c, s = np.cos(0.7), np.sin(0.7)
    Q = np.array([[c, -s], [s, c]])
    A = Q @ np.array([[-1.0, 1.0], [0.0, -1.0 - gap]]) @ Q.T
    system = named(A, Q @ np.array([[0.0], [1.0]]), np.array([[1.0, 0.0]]) @ Q.T)
    b = 1.0 + gap
    return _peak_of(system, 1.0 / b) if norm == "peak" else _h2_of(system, sqrt(1.0 / (2.0 * b * (1.0 + b))))


def _spread(spread: float, norm: str) -> Seen:
    gain = spread if norm == "peak" else sqrt(spread)
    system = named(np.diag([-1.0, -spread]), np.ones((2, 1)), np.array([[1.0, gain]]))
    if norm == "peak":
        return _peak_of(system, 2.0)
    return _h2_of(system, sqrt(0.5 + 0.5 + 2.0 * gain / (1.0 + spread)))


def _unstable(spread: float) -> Seen:
    system = named(np.diag([1.0, -spread]), np.ones((2, 1)), np.array([[1.0, spread]]))
    return _peak_of(system, inf)


def _some() -> Lti:
    """Return damped oscillators over two decades, coordinates mixed by an orthogonal matrix, two inputs and outputs."""
    rng = np.random.default_rng(3)
    omega, zeta = np.geomspace(0.1, 10.0, 5), 10.0 ** rng.uniform(-3.0, -1.0, 5)
    blocks = [w * np.array([[-z, 1.0], [-1.0, -z]]) for w, z in zip(omega, zeta, strict=True)]
    A = linalg.block_diag(*blocks)
    Q = np.linalg.qr(rng.standard_normal(A.shape))[0]
    B, C = rng.standard_normal((len(A), 2)), rng.standard_normal((2, len(A)))
    return named(Q @ A @ Q.T, Q @ B, C @ Q.T)


def _scaled(scale: float, unit: str, norm: str) -> Seen:
    system, factor = _some(), 1.0
    if unit == "time":
        other = replace(system, A=scale * system.A, B=scale * system.B)
        factor = 1.0 if norm == "peak" else sqrt(scale)
    elif unit == "inputs":
        other, factor = replace(system, B=scale * system.B), scale
    else:
        sizes = np.geomspace(1.0, scale, len(system.A))
        other = replace(
            system,
            A=system.A * sizes[:, None] / sizes[None, :],
            B=system.B * sizes[:, None],
            C=system.C / sizes[None, :],
        )
    if norm == "peak":
        return _peak_of(other, factor * hinf_norm(system.statespace("plain")).lower)
    return _h2_of(other, factor * h2_norm(system.statespace("plain")).value)


def _kinds(kind: str) -> Seen:
    """A system of small whole numbers, which every kind holds exactly."""
    from boomctl.lti.python_control import control

    A = np.array([[0.0, 1.0, 0.0], [-2.0, -1.0, 1.0], [0.0, 0.0, -3.0]])
    B, C, D = np.array([[0.0], [1.0], [2.0]]), np.array([[1.0, 0.0, 0.0]]), np.zeros((1, 1))
    plain = control.ss(A, B, C, D)
    true = np.array([hinf_norm(plain).lower, h2_norm(plain).value])

    def made(x: Array) -> object:
        if kind == "Fortran order":
            return np.asfortranarray(x)
        if kind == "lists":
            return x.astype(int).tolist()
        if kind == "a read-only view":
            seen = np.repeat(x, 2, axis=1)[:, ::2]
            seen.flags.writeable = False
            return seen
        return x.astype(kind)

    other = control.ss(*(made(x) for x in (A, B, C, D)))
    matrices = [[1.0, 0.0], [0.0, 1.0]], [[1.0, 0.0], [0.0, 1.0]], [[2.0, -1.0], [-1.0, 2.0]]
    ports = {"f": [1.0, 0.0]}, {"y": [0.0, 1.0]}
    model = SecondOrderModel(*(made(np.array(x)) for x in matrices), *ports)  # type: ignore[arg-type]
    asked = relative(sigma(model).peak, sigma(SecondOrderModel(*matrices, *ports)).peak)
    return Seen(max(relative([hinf_norm(other).lower, h2_norm(other).value], true), asked))


def _tiny(gain: float) -> Seen:
    system = named(-np.eye(1), np.ones((1, 1)), gain * np.ones((1, 1)))
    return _peak_of(system, gain)


def _weak(gain: float, what: str) -> Seen:
    if what == "undamped":
        one = Lti(
            np.array([[0.0, 1.0], [-1.0, 0.0]]), np.array([[0.0], [gain]]), np.array([[1.0, 0.0]]), np.ones((1, 1))
        )
        return _peak_of(one, inf)
    return _h2_of(named(np.diag([0.0, -1.0]), np.ones((2, 1)), np.array([[gain, 1.0]])), inf)


def _chain() -> Lti:
    """Return a chain of masses and springs, damped a little, from a force at one end to the motion of the other."""
    count = 6
    K = 2.0 * np.eye(count) - np.diag(np.ones(count - 1), 1) - np.diag(np.ones(count - 1), -1)
    A = np.block([[np.zeros((count, count)), np.eye(count)], [-K, -0.02 * K - 0.01 * np.eye(count)]])
    B, C = np.zeros((2 * count, 1)), np.zeros((1, 2 * count))
    B[count], C[0, count - 1] = 1.0, 1.0
    return named(A, B, C)


def _largest_difference(full: Lti, reduced: Lti) -> float:
    """Return the largest difference of two systems at and beside all their resonances: below the true norm."""
    rates: Array = np.concatenate([full.rates, reduced.rates])
    rates = np.asarray(rates[np.isfinite(rates)])
    omega = np.append((np.abs(rates.imag) + np.abs(rates.real) * np.array([[-0.5], [0.0], [0.5]])).ravel(), 0.0)
    A = linalg.block_diag(full.A, reduced.A)
    B, C = np.vstack([full.B, reduced.B]), np.hstack([full.C, -reduced.C])
    return state_space_gain(A, B, C, full.D - reduced.D, full.boundary(omega).tolist())


def _fallen_short(system: Lti, order: int, method: str, asked: float | None = None) -> Seen:
    """Return the share by which the verified error, or the bound known before, falls below the true one.

    With an error asked for, the share by which the verified one exceeds it.
    """
    from boomctl.lti.system import of

    full = system.statespace("full")
    told = reduce(full, error=asked, method=method) if asked is not None else reduce(full, order=order, method=method)
    true, said = _largest_difference(system, of(told.system, sampled=True)), told.measured_error
    if asked is None:
        said = min(said, told.error_bound)
    over = 0.0 if asked is None else said / asked - 1.0
    return Seen(max(0.0, over, 1.0 - said / true if true > 0.0 else 0.0))


def _in_other_coordinates(A: Array, seed: int, dt: float = 0.0) -> Lti:
    rng, n = np.random.default_rng(seed), len(A)
    T = rng.standard_normal((n, n))
    B, C = rng.standard_normal((n, 2)), rng.standard_normal((2, n))
    return named(T @ A @ np.linalg.inv(T), T @ B, C, dt=dt)


def _pairs(poles: Array) -> Array:
    return linalg.block_diag(*([[p.real, p.imag], [-p.imag, p.real]] for p in poles))


def _discrete(method: str, radius: float) -> Seen:
    return _fallen_short(
        _in_other_coordinates(_pairs(radius * np.exp(1j * np.linspace(0.2, 2.8, 5))), 7, 0.1), 4, method
    )


def _asked(share: float) -> Seen:
    """An unstable pole beside damped ones, in coordinates of unlike sizes."""
    A = linalg.block_diag([[0.5]], _pairs(np.linspace(1.0, 6.0, 4) * (-0.02 + 1j)))
    system, sizes = _in_other_coordinates(A, 8), np.geomspace(1.0, 1e8, len(A))
    other = replace(system, A=system.A * sizes[:, None] / sizes, B=system.B * sizes[:, None], C=system.C / sizes)
    return _fallen_short(other, 0, "balanced", share)


def _cancelling(method: str, gap: float) -> Seen:
    """Modes that lie so near to each other that their residues are huge and cancel."""
    A = np.triu(np.full((8, 8), 1.0), 1) - np.diag(1.0 + gap * np.arange(8.0))
    return _fallen_short(named(A, np.eye(8)[:, -1:], np.eye(8)[:1]), 3, method)


def _modal(pole: float) -> Seen:
    """An unstable pole beside oscillators, in coordinates of random numbers."""
    A = linalg.block_diag([[pole]], _pairs(np.linspace(1.0, 9.0, 4) * (-0.01 + 1j)))
    return _fallen_short(_in_other_coordinates(A, 9), 5, "modal")


def _reduced(method: str, order: int) -> Seen:
    return _fallen_short(_chain(), order, method)


def _clustered(gap: float) -> Seen:
    rng = np.random.default_rng(5)
    A = np.diag(-1.0 - gap * np.arange(6)) + np.diag(np.full(5, 0.3), 1)
    T = np.linalg.qr(rng.standard_normal(A.shape))[0] * 10.0 ** rng.uniform(-2.0, 2.0, 6)
    back = np.linalg.inv(T)
    B, C = rng.standard_normal((6, 1)), rng.standard_normal((1, 6))
    return _fallen_short(named(T @ A @ back, T @ B, C @ back), 3, "balanced")


def _cart(viscous: float) -> Seen:
    """Two masses, joined by spring and damper, friction on the first: position is the integral of what the force leaves."""
    from boomctl.lti.system import of

    c = viscous
    K = np.array([[1.0, -1.0], [-1.0, 1.0]])
    C = np.array([[c + 0.1, -0.1], [-0.1, 0.1]])
    A = np.block([[np.zeros((2, 2)), np.eye(2)], [-K, -C]])
    system = named(A, np.array([[0.0], [0.0], [1.0], [0.0]]), np.array([[0.0, 1.0, 0.0, 0.0]]))
    told = of(reduce(system.statespace("cart"), order=3).system)
    slow = 1e-7 * min(c, 1.0)
    G = complex(told.response(np.array([slow]))[0, 0, 0])
    # s G(s) at rest is one over the friction
    return Seen(abs(1j * slow * G * c - 1.0))


def _reduced_units(scale: float) -> Seen:
    system = _some()
    true = reduce(system.statespace("plain"), order=6).measured_error
    other = replace(system, A=scale * system.A, B=scale * system.B)
    return Seen(abs(reduce(other.statespace("scaled"), order=6).measured_error / true - 1.0))
