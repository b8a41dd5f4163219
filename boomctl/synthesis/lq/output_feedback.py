"""From a regulator and a filter to a controller: the structure that LQG and H2 share, and what is checked of it."""

import numpy as np

from boomctl.analysis.h2 import matrices_h2_norm
from boomctl.arrays import Array
from boomctl.exceptions import SynthesisError
from boomctl.lti.modal import sides
from boomctl.lti.system import Lti, rates_of
from boomctl.synthesis.certificate import DesignCertificate
from boomctl.synthesis.lq.riccati import LARGEST_COST_ERROR, RiccatiSolution
from boomctl.synthesis.plants.full_plant import ReducedPlant, judged_on_full_plant
from boomctl.synthesis.plants.partition import GeneralizedPlant


def observer(plant: Lti, F: Array, L: Array) -> Lti:
    """Return ``u = -F z`` with ``z' = A z + B u + L (y - C z - D u)``, from measurements to controls."""
    A = plant.A - plant.B @ F - L @ (plant.C - plant.D @ F)
    states = tuple(f"estimate.{name}" for name in plant.state_labels)
    return Lti(
        A,
        L,
        -F,
        np.zeros((len(F), L.shape[1])),
        plant.output_labels,
        plant.input_labels,
        states,
        plant.dt,
        plant.scales,
    )


def least_cost(W: Array, R: Array, regulator: RiccatiSolution, estimator: RiccatiSolution) -> float:
    """Return the least cost: of knowing the state, and of having to estimate it.

    ``tr(X W) + tr(R F Y F^T)``; Kwakernaak & Sivan (1972), Theorem 5.4.  In discrete time ``R + B^T X B`` stands for ``R``.
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
    """Return what vouches for a controller: the H2 norm of its loop, and the least one by the two Riccati equations.

    The loop of ``K`` around ``plant`` is judged on the full plant too, where ``origin`` says that it is a reduced one;
    without its norm where states of the reduced plant are weighed, or driven by noise (``by_states``).

    Raises
    ------
    SynthesisError
        The loop is not stable, or its norm is not the least one.
    """
    poles = loop.poles
    slowest = float(rates_of(poles, loop.dt).real.max())
    if (sides(poles, loop.dt) >= 0).any():
        raise SynthesisError(f"the closed loop is not stable: a pole with real part {slowest:.3g} rad/s")
    norm, lower = matrices_h2_norm(loop), float(np.sqrt(max(least, 0.0)))
    if not abs(norm.value**2 - lower**2) <= LARGEST_COST_ERROR * max(norm.value, lower) ** 2:
        raise SynthesisError(
            f"the H2 norm of the closed loop is not certain: {norm.value:.8g} by {norm.method}, {lower:.8g} by the Riccati "
            "equations"
        )
    known = "verified" if norm.certified else "not certified"
    return DesignCertificate(
        norm_bounds=norm,
        spectral_abscissa=slowest,
        fastest_pole=float(np.abs(K.poles).max(initial=0.0)),
        lower_bound=lower,
        lower_bound_source="both Riccati equations",
        stages=(*regulator.stages, *estimator.stages, norm.method),
        summary=f"H2 norm {norm.value:.6g}, {known}; no controller goes below {lower:.6g}, by the Riccati equations; "
        f"slowest pole {slowest:.4g} rad/s; Riccati residuals {regulator.residual:.1e} and {estimator.residual:.1e}",
        full_plant=judged_on_full_plant(origin, plant, K, None if by_states else norm),
        regulator_riccati=regulator,
        filter_riccati=estimator,
    )
