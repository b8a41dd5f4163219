"""Natural frequencies of the beam at a constant, prescribed hub speed."""

import numpy as np

from boomctl.arrays import Array
from boomctl.rotating_beam.modal.equations import Equations
from boomctl.rotating_beam.modal.integrals import ModalIntegrals


def lowest(mass: Array, stiffness: Array) -> float:
    """Lowest natural frequency of a positive definite pair, rad/s."""
    from scipy.linalg import eigh

    return float(1.0 / np.sqrt(eigh(mass, stiffness, eigvals_only=True)[-1]))


def transverse(integrals: ModalIntegrals, speed: float, *, stiffening: bool) -> Array:
    """Frequencies of ``K2 + w^2 (D - M2)``, or without D, in Hz, ascending.

    Parameters
    ----------
    integrals : ModalIntegrals
    speed : float
        Hub speed w, rad/s, below the critical one.
    stiffening : bool
        Whether D is there.
    """
    from scipy.linalg import eigh

    softening = integrals.M2 - integrals.D if stiffening else integrals.M2
    squares = eigh(integrals.M2, integrals.K2 - speed**2 * softening, eigvals_only=True)
    return 1.0 / (2.0 * np.pi * np.sqrt(squares[::-1]))


def coupled(equations: Equations, speed: float) -> Array:
    """Frequencies of axial and transverse motion with gyroscopic terms about the stretched beam, in Hz, ascending.

    Parameters
    ----------
    equations : Equations
    speed : float
        Hub speed, rad/s, below the critical one.

    Raises
    ------
    ValueError
        If the stretched beam has lost its stiffness.
    """
    q, tangents = steady_rotation(equations, speed)
    n = q.size
    mass, damping, stiffness = (each[0, 1:, 1:] for each in tangents)
    try:
        roots = np.linalg.cholesky(mass), np.linalg.cholesky(0.5 * (stiffness + stiffness.T))
    except np.linalg.LinAlgError:
        raise ValueError(f"hub_speed = {speed:g}: expected a speed at which the beam keeps its stiffness") from None
    to_v = np.linalg.inv(roots[0]).T
    system = np.zeros((2 * n, 2 * n))
    system[:n, n:] = roots[1].T @ to_v
    system[n:, :n] = -system[:n, n:].T
    system[n:, n:] = -(to_v.T @ damping @ to_v)
    values = np.linalg.eigvals(system)
    return np.sort(values.imag[values.imag > 0.0]) / (2.0 * np.pi)


def steady_rotation(equations: Equations, speed: float) -> tuple[Array, tuple[Array, Array, Array]]:
    """Beam coordinates at which the beam is at rest in the hub's frame, and the equations' derivatives there.

    Parameters
    ----------
    equations : Equations
    speed : float
        Hub speed, rad/s.

    Returns
    -------
    q : ndarray, N - 1
        The beam is straight then, so its equations are linear in q.
    tangents : three ndarray, 1 x N x N
        With respect to accelerations, rates and coordinates.
    """
    y, rate, none = (np.zeros((1, equations.size)) for _ in range(3))
    rate[0, 0] = speed
    stiffness = equations.tangents(y, rate, none).stiffness[0, 1:, 1:]
    y[0, 1:] = -np.linalg.solve(stiffness, equations.residual(y, rate, none)[0, 1:])
    return y[0, 1:], equations.tangents(y, rate, none)
