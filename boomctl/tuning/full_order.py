"""Lower bound on the norm for controllers of any order, for plants that violate assumptions of the Riccati equations.

The equations require noise on every measurement and a weight on every control.  A measurement without noise may be replaced
by ``(d/dt + a)`` times itself, which has the noise of its rate: a controller of the one is, with ``1/(s + a)`` in front, a
controller of the other, with the same loop.  If no rate of a measurement is disturbed, because there are fewer disturbances
than measurements, the controller may measure the disturbances: this is state feedback (Doyle, Glover, Khargonekar & Francis
1989), a bound for all controllers.  Controls are measurements of the dual plant.  If a zero is on the imaginary axis, plant
and controller are evaluated slightly to the right of it, at ``s + e`` in place of ``s``: stability is preserved, and by the
maximum principle no norm grows.
"""

import numpy as np
from scipy import linalg

from boomctl.arrays import Array
from boomctl.exceptions import SynthesisError
from boomctl.lti.rounding import ALIKE
from boomctl.lti.system import Lti
from boomctl.progress import Deadline, OutOfTimeError
from boomctl.synthesis.hinf.bounds import lowest_level
from boomctl.synthesis.plants.partition import GeneralizedPlant, normalized

_TOLERANCE = 1e-4  # relative tolerance of the lowest level
_SHIFTS = (0.0, 1e-6, 1e-4)  # shifts of the axis over the fastest pole: the bound is lower by about this order
_FAILED = (SynthesisError, np.linalg.LinAlgError, ValueError)  # errors if the equations have no solution


def full_order_bound(plant: GeneralizedPlant, deadline: Deadline) -> tuple[float, str]:
    """Compute a lower bound on the norm for stabilizing controllers of any order.

    Parameters
    ----------
    plant : GeneralizedPlant
        Continuous-time plant.
    deadline : Deadline
        Time limit.

    Returns
    -------
    lower : float
        Lower bound on the norm.
    notes : str
        Replacements of measurements without noise and controls without weight, and shift of the axis.

    Raises
    ------
    SynthesisError
        If no bound is proved.
    """
    reason = ""
    for shift in _SHIFTS:
        try:
            measured, replaced = _noisy(_shifted(plant, shift))
            weighed, moved = _noisy(measured.dual)
            bounds, _ = lowest_level(normalized(weighed.dual), _TOLERANCE, deadline)
        except OutOfTimeError as over:
            raise SynthesisError(f"the time ran out while {over}") from None
        except _FAILED as error:
            reason = reason or " ".join(str(error).split())
            continue
        notes = {"measurements": replaced, "controls": moved, "axis": "shifted to the right" if shift else ""}
        return bounds.lower, "; ".join(f"{name}: {text}" for name, text in notes.items() if text)
    raise SynthesisError(reason)


def _shifted(plant: GeneralizedPlant, fraction: float) -> GeneralizedPlant:
    """Return the plant on a shifted axis and without ``D22``, which a controller can compensate."""
    old, rate = plant.system, _fastest(plant.A)
    through = old.D.copy()
    through[plant.nz :, plant.nw :] = 0.0
    A = plant.A - fraction * rate * np.eye(len(plant.A))
    system = Lti(A, old.B, old.C, through, old.input_labels, state_labels=old.state_labels)
    return GeneralizedPlant(system, plant.nmeas, plant.ncon)


def _fastest(A: Array) -> float:
    """Return the largest magnitude of the poles [rad/s]; 1 without nonzero poles."""
    return float(np.abs(np.linalg.eigvals(A)).max(initial=0.0)) or 1.0


def _noisy(plant: GeneralizedPlant) -> tuple[GeneralizedPlant, str]:
    """Return a plant whose ``D21`` has full row rank and whose optimal norm is no larger, and a note on its measurements."""
    A, B1, C, D = plant.A, plant.B1, plant.C2, plant.D21
    rate = _fastest(A)
    # singular values of D21 below rounding error count as zero
    floor = ALIKE * max(np.linalg.norm(D), np.linalg.norm(C) * np.linalg.norm(B1) / rate)
    for turn in range(len(A) + 1):
        left, values, _ = np.linalg.svd(D)
        bare = np.concatenate([values, np.zeros(len(D) - len(values))]) <= floor
        if not bare.any():
            return _measured(plant, C, D), "rates in place of some without noise" if turn else ""
        C, D = left.T @ C, left.T @ D
        C[bare], D[bare] = C[bare] @ A / rate + C[bare], C[bare] @ B1 / rate
    gain = _disturbance_feedback(A, B1)
    return _measured(plant, gain, np.eye(plant.nw)), "the disturbances, which are fewer"


def _disturbance_feedback(A: Array, B1: Array) -> Array:
    """Return ``F`` with ``A - B1 F`` stable: from ``w + F x`` a controller can estimate ``w`` and, asymptotically, ``x``.

    Raises
    ------
    SynthesisError
        If an unstable mode is uncontrollable from the disturbances.
    """
    said = "the disturbances, fewer than the measurements, leave an unstable or undamped mode unmoved"
    try:
        gain = B1.T @ linalg.solve_continuous_are(A, B1, np.eye(len(A)), np.eye(B1.shape[1]))
    except (np.linalg.LinAlgError, ValueError) as error:
        raise SynthesisError(said) from error
    if np.linalg.eigvals(A - B1 @ gain).real.max(initial=-1.0) >= 0.0:
        raise SynthesisError(said)
    return gain


def _measured(plant: GeneralizedPlant, C: Array, D: Array) -> GeneralizedPlant:
    """Return the plant with other measurements."""
    old = plant.system
    through = np.vstack([old.D[: plant.nz], np.hstack([D, np.zeros((len(D), plant.ncon))])])
    system = Lti(plant.A, old.B, np.vstack([plant.C1, C]), through, old.input_labels, state_labels=old.state_labels)
    return GeneralizedPlant(system, nmeas=len(C), ncon=plant.ncon)
