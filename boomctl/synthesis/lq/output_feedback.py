"""The observer-based controllers of LQG and H2 synthesis, and their certificate."""

import numpy as np

from boomctl.analysis.h2 import matrices_h2_norm
from boomctl.arrays import Array
from boomctl.exceptions import SynthesisError
from boomctl.lti.modal import sides
from boomctl.lti.system import Lti, rates_of
from boomctl.synthesis.certificate import DesignCertificate
from boomctl.synthesis.lq.riccati import MAX_COST_ERROR, RiccatiSolution
from boomctl.synthesis.plants.full_plant import ReducedPlant, evaluate_on_full_plant
from boomctl.synthesis.plants.partition import GeneralizedPlant


def observer(plant: Lti, F: Array, L: Array) -> Lti:
    """Return ``u = -F z`` with ``z' = A z + B u + L (y - C z - D u)``, from measurements to controls."""
    A, D = plant.A - plant.B @ F - L @ (plant.C - plant.D @ F), np.zeros((len(F), L.shape[1]))
    states = tuple(f"estimate.{name}" for name in plant.state_labels)
    return Lti(A, L, -F, D, plant.output_labels, plant.input_labels, states, plant.dt, plant.scales)


def least_cost(W: Array, R: Array, regulator: RiccatiSolution, estimator: RiccatiSolution) -> float:
    """Return the least cost, the sum of the costs of state feedback and of estimation.

    ``tr(X W) + tr(R F Y F^T)``; Kwakernaak & Sivan (1972), Theorem 5.4.  In discrete time ``R + B^T X B`` replaces ``R``.
    """
    F = regulator.gain
    return float(np.trace(regulator.X @ W) + np.trace(R @ F @ estimator.X @ F.T))


def certify(
    loop: Lti,
    K: Lti,
    least: float,
    regulator: RiccatiSolution,
    estimator: RiccatiSolution,
    *,
    plant: GeneralizedPlant,
    origin: ReducedPlant | None,
    by_states: bool = False,
) -> DesignCertificate:
    """Return a certificate of the H2 norm of a loop, and of the least one by the two Riccati equations.

    If ``origin`` is given, the loop with ``K`` is also evaluated on the full plant, without its norm if states of the
    reduced plant have weights or noise (``by_states``).

    Raises
    ------
    SynthesisError
        If the loop is not stable, or if its norm is not the least one.
    """
    poles = loop.poles
    slowest = float(rates_of(poles, loop.dt).real.max())
    if (sides(poles, loop.dt) >= 0).any():
        raise SynthesisError(f"The closed loop is not stable: a pole has the real part {slowest:.3g} rad/s.")
    norm, lower = matrices_h2_norm(loop), float(np.sqrt(max(least, 0.0)))
    if not abs(norm.value**2 - lower**2) <= MAX_COST_ERROR * max(norm.value, lower) ** 2:
        raise SynthesisError(
            f"The H2 norm of the closed loop is {norm.value:.8g} by {norm.method}, but {lower:.8g} by the Riccati equations."
            " The problem is too ill-conditioned; scale the signals."
        )
    return DesignCertificate(
        norm_bounds=norm,
        spectral_abscissa=slowest,
        fastest_pole=float(np.abs(K.poles).max(initial=0.0)),
        lower_bound=lower,
        lower_bound_source="both Riccati equations",
        stages=(*regulator.stages, *estimator.stages, norm.method),
        summary=f"H2 norm {norm.value:.6g}, {norm.status}; lower bound {lower:.6g} by the Riccati equations; "
        f"slowest pole {slowest:.4g} rad/s; Riccati residuals {regulator.residual:.1e} and {estimator.residual:.1e}",
        full_plant=evaluate_on_full_plant(origin, plant, K, None if by_states else norm),
        regulator_riccati=regulator,
        filter_riccati=estimator,
    )
