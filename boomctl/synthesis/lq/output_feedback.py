"""From a regulator and a filter to a controller: the structure that LQG and H2 share, and what is checked of it.

The H2 norm of the closed loop is computed by both Gramians, solved apart from each other.  They are those of balanced
states, by Bartels and Stewart: with each mode of a plant twice in the loop, once regulated and once estimated, its
eigenvectors are nearly parallel, and modal coordinates would lose the digits.
"""

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from boomctl.arrays import Array
from boomctl.lti.gramians import EXTENDED, refined_gramian
from boomctl.lti.modal import sides
from boomctl.lti.system import Lti, rates_of
from boomctl.synthesis.assumptions import SynthesisError
from boomctl.synthesis.lq.riccati import RiccatiCertificate, RiccatiSolution

_ALIKE = 1e-6  # relative difference of two norms' squares above which their Gramians are solved once more (a choice)
_AGREEMENT = 1e-4  # relative difference of the three H2 norms above which none is vouched for (a choice)


@dataclass(frozen=True)
class QuadraticNorm:
    """An H2 norm, found in two ways.

    Attributes
    ----------
    controllability, observability : float
        By the Gramian of controllability and by that of observability; infinite if not stable or, in continuous time, not
        strictly proper.
    """

    controllability: float
    observability: float

    @property
    def value(self) -> float:
        """The larger of the two."""
        return max(self.controllability, self.observability)

    @property
    def disagreement(self) -> float:
        """Difference of the two, relative."""
        if not np.isfinite(self.value):
            return np.inf
        return abs(self.controllability - self.observability) / max(self.value, float(np.finfo(float).tiny))


@dataclass(frozen=True)
class FeedbackCertificate:
    """What was found about a regulator and a filter in one loop, apart from the solvers.

    Attributes
    ----------
    regulator, filter : RiccatiCertificate
        Of the two Riccati equations.
    separation_error : float
        Largest distance between a pole of the closed loop and its partner among those of regulator and filter,
        relative to its size.
    abscissa : float
        Largest real part of the poles of the closed loop, from its own matrix [rad/s]; in discrete time of their rates.
    norm : QuadraticNorm
        H2 norm of the closed loop, its square the cost, by either Gramian.
    least_norm : float
        The least H2 norm that any controller reaches, from the two Riccati solutions alone.
    """

    regulator: RiccatiCertificate
    filter: RiccatiCertificate
    separation_error: float
    abscissa: float
    norm: QuadraticNorm
    least_norm: float

    def __repr__(self) -> str:
        norms = f"H2 norm {self.norm.value:.6g}, least possible {self.least_norm:.6g}, apart by {self.disagreement:.0e}"
        residuals = f"Riccati residuals {self.regulator.residual:.1e} and {self.filter.residual:.1e}"
        return f"FeedbackCertificate: {norms}\n  slowest pole {self.abscissa:.4g} rad/s; {residuals}"

    @property
    def disagreement(self) -> float:
        """Largest relative difference of the three norms."""
        found = (self.norm.controllability, self.norm.observability, self.least_norm)
        return (max(found) - min(found)) / max(*found, float(np.finfo(float).tiny))


def observer(plant: Lti, F: Array, L: Array) -> Lti:
    """Return ``u = -F z`` with ``z' = A z + B u + L (y - C z - D u)``, from measurements to controls."""
    A = plant.A - plant.B @ F - L @ (plant.C - plant.D @ F)
    states = tuple(f"estimate.{name}" for name in plant.states)
    return Lti(A, L, -F, np.zeros((len(F), L.shape[1])), plant.outputs, plant.inputs, states, plant.dt)


def least_cost(W: Array, R: Array, regulator: RiccatiSolution, estimator: RiccatiSolution) -> float:
    """Return the least cost: of knowing the state, and of having to estimate it.

    ``tr(X W) + tr(R F Y F^T)``; Kwakernaak & Sivan (1972), Theorem 5.4.  In discrete time ``R + B^T X B`` stands for ``R``.
    """
    F = regulator.gain
    return float(np.trace(regulator.X @ W) + np.trace(R @ F @ estimator.X @ F.T))


def certify(loop: Lti, least: float, regulator: RiccatiSolution, estimator: RiccatiSolution) -> FeedbackCertificate:
    """Return what is found about a closed loop.

    Raises
    ------
    SynthesisError
        It is not stable, or its norms disagree.
    """
    poles = loop.poles
    abscissa = float(rates_of(poles, loop.dt).real.max())
    if (sides(poles, loop.dt) >= 0).any():
        raise SynthesisError(f"the closed loop is not stable: a pole with real part {abscissa:.3g} rad/s")
    found = FeedbackCertificate(
        regulator=regulator.certificate,
        filter=estimator.certificate,
        separation_error=_distance(poles, np.concatenate([regulator.poles, estimator.poles])),
        abscissa=abscissa,
        norm=quadratic_norm(loop),
        least_norm=float(np.sqrt(max(least, 0.0))),
    )
    if not found.disagreement <= _AGREEMENT:
        raise SynthesisError(
            f"the H2 norm of the closed loop is not certain: {found.norm.controllability:.8g} and "
            f"{found.norm.observability:.8g} by its Gramians, {found.least_norm:.8g} by the Riccati equations"
        )
    return found


def quadratic_norm(system: Lti) -> QuadraticNorm:
    """Return the H2 norm of a system, by both Gramians; refined ones where these differ, and in discrete time."""
    through = float(np.sum(system.D**2)) if system.dt != 0.0 else np.inf if system.D.any() else 0.0
    if not len(system.A):
        return QuadraticNorm(float(np.sqrt(through)), float(np.sqrt(through)))
    if through == np.inf or (sides(system.poles, system.dt) >= 0).any():
        return QuadraticNorm(np.inf, np.inf)
    s = system.balanced()
    if s.dt != 0.0:
        P, Q = refined_gramian(s.A, s.B, True), refined_gramian(s.A.T, s.C.T, True)
        squares = float(np.sum((s.C @ P) * s.C)), float(np.sum((s.B.T @ Q) * s.B.T))
        return QuadraticNorm(*(float(np.sqrt(max(square, 0.0) + through)) for square in squares))
    P = linalg.solve_continuous_lyapunov(s.A, -s.B @ s.B.T)
    Q = linalg.solve_continuous_lyapunov(s.A.T, -s.C.T @ s.C)
    squares = float(np.trace(s.C @ P @ s.C.T)), float(np.trace(s.B.T @ Q @ s.B))
    if abs(squares[0] - squares[1]) > _ALIKE * max(squares) and len(s.A) <= EXTENDED:
        P, Q = refined_gramian(s.A, s.B), refined_gramian(s.A.T, s.C.T)
        squares = float(np.sum((s.C @ P) * s.C)), float(np.sum((s.B.T @ Q) * s.B.T))
    return QuadraticNorm(*(float(np.sqrt(max(square, 0.0))) for square in squares))


def _distance(found: Array, expected: Array) -> float:
    """Return the largest relative distance between poles, paired so that the sum of distances is least."""
    gaps = np.abs(found[:, None] - expected[None, :]) / np.maximum(np.abs(expected)[None, :], np.finfo(float).tiny)
    nearest = gaps.argmin(axis=1)
    if len(np.unique(nearest)) == len(nearest):  # each its own: no other pairing has a smaller sum
        return float(gaps.min(axis=1).max())
    from scipy import optimize  # long to import; poles that lie apart do not come here

    rows, columns = optimize.linear_sum_assignment(gaps)
    return float(gaps[rows, columns].max())
