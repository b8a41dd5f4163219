"""The beam's motion at constant hub speed in closed form, for the models that are then linear."""

import numpy as np

from boomctl.arrays import Array
from boomctl.rotating_beam.modal.equations import BeamSpeedTerms

_WORST_CONDITION = 1e8  # of the eigenvectors: half of the digits are left, as many as the default tolerance asks for
_INTERVAL_DIGITS = 12  # decimals [s] in which equal intervals agree, so that one exponential serves them

# The forms of the motion at constant hub speed, in the order tried
MODES = "modes"  # without damping and gyroscopic terms: every mode turns on its own, whatever its stiffness
EIGENVECTORS = "eigenvectors"  # otherwise: of the first-order form
EXPONENTIALS = "matrix exponentials"  # where these are ill-conditioned: slower, and always exact


def steady_motion(
    terms: BeamSpeedTerms, speed: float, start: tuple[Array, Array], elapsed: Array
) -> tuple[Array, Array, str]:
    """Coordinates and rates of the beam after given times at a constant hub speed, exact but for rounding.

    Parameters
    ----------
    terms : BeamSpeedTerms
    speed : float
        Hub speed, rad/s.
    start : pair of ndarray, n
        Coordinates and rates at the beginning.
    elapsed : ndarray, k
        Times since then, s.

    Returns
    -------
    q, v : ndarray, k x n
    form : str
        The form that was used: `MODES`, `EIGENVECTORS` or `EXPONENTIALS`.
    """
    stiffness = terms.K + speed**2 * terms.K_w
    damping = terms.C + speed * terms.G
    force = speed**2 * terms.f_w
    if np.any(damping) or np.any(force):
        return _general(terms, stiffness, damping, force, start, elapsed)
    return *_modal(terms.M, stiffness, start, elapsed), MODES


def vibration_amplitudes(terms: BeamSpeedTerms, speed: float, tip: Array) -> tuple[Array, Array]:
    """Rows from coordinates and from rates to the amplitudes of the modes at the free end, n x n each.

    Modes are those of ``K + w^2 K_w`` without damping and gyroscopic terms; one without stiffness counts with 1 rad/s.

    Parameters
    ----------
    terms : BeamSpeedTerms
    speed : float
        Hub speed w, rad/s.
    tip : ndarray, n
        Row of the free end's displacement.
    """
    from scipy.linalg import eigh

    squares, shapes = eigh(terms.K + speed**2 * terms.K_w, terms.M)
    rate = np.sqrt(np.where(squares > 0.0, squares, 1.0))
    rows = (tip @ shapes)[:, None] * (shapes.T @ terms.M)
    return rows, rows / rate[:, None]


def _modal(mass: Array, stiffness: Array, start: tuple[Array, Array], elapsed: Array) -> tuple[Array, Array]:
    from scipy.linalg import eigh

    squares, shapes = eigh(stiffness, mass)
    q, v = (shapes.T @ mass @ item for item in start)
    rate = np.sqrt(np.abs(squares))
    phase = np.multiply.outer(elapsed, rate)
    stiff = squares > 0.0
    with np.errstate(over="ignore", invalid="ignore"):
        cosine = np.where(stiff, np.cos(phase), np.cosh(np.where(stiff, 0.0, phase)))
        growing = np.sinh(np.where(stiff, 0.0, phase))
        sine = np.where(stiff, np.sin(phase), growing) / np.where(rate > 0.0, rate, 1.0)
        sine = np.where(rate > 0.0, sine, elapsed[:, None])
        return (q * cosine + v * sine) @ shapes.T, (v * cosine - squares * q * sine) @ shapes.T


def _general(
    terms: BeamSpeedTerms,
    stiffness: Array,
    damping: Array,
    force: Array,
    start: tuple[Array, Array],
    elapsed: Array,
) -> tuple[Array, Array, str]:
    """In coordinates in which mass and stiffness at rest are unity: there undamped motion is a rotation."""
    n = force.size
    mass_root: Array = np.linalg.cholesky(terms.M)
    stiffness_root: Array = np.linalg.cholesky(terms.K)
    to_q, to_v = np.linalg.inv(stiffness_root).T, np.linalg.inv(mass_root).T
    system = np.zeros((2 * n, 2 * n))
    system[:n, n:] = np.matmul(stiffness_root.T, to_v)
    system[n:, :n] = -np.matmul(to_v.T, stiffness @ to_q)
    system[n:, n:] = -np.matmul(to_v.T, damping @ to_v)
    push = np.concatenate([np.zeros(n), to_v.T @ force])
    state = np.concatenate([stiffness_root.T @ start[0], mass_root.T @ start[1]])
    states, form = _linear_flow(system, push, state, elapsed)
    return states[:, :n] @ to_q.T, states[:, n:] @ to_v.T, form


def _linear_flow(system: Array, push: Array, state: Array, elapsed: Array) -> tuple[Array, str]:
    """Solution of ``z' = system z + push`` after given times, k x n, and the form that was used."""
    values, vectors = np.linalg.eig(system)
    if np.linalg.cond(vectors) < _WORST_CONDITION and np.abs(values).min() > 0.0:
        rest = -np.linalg.solve(system, push)
        with np.errstate(over="ignore", invalid="ignore"):
            modes = np.exp(np.multiply.outer(elapsed, values)) * np.linalg.solve(vectors, state - rest)
            return rest + (modes @ vectors.T).real, EIGENVECTORS
    return _by_exponentials(system, push, state, elapsed), EXPONENTIALS


def _by_exponentials(system: Array, push: Array, state: Array, elapsed: Array) -> Array:
    from boomctl.lti.hold import zero_order_hold

    result, before, known = np.empty((elapsed.size, state.size)), 0.0, {}
    for k, now in enumerate(elapsed):
        interval = round(float(now - before), _INTERVAL_DIGITS)
        if interval not in known:
            known[interval] = zero_order_hold(system, push[:, None], interval)
        Phi, gained = known[interval]
        state, before = np.matmul(Phi, state) + gained[:, 0], float(now)
        result[k] = state
    return result
