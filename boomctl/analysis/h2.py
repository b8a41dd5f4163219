"""Certified H2 norms.

Three ways to one number: the Gramian of controllability, that of observability (both in modal coordinates where there
are any, so that light damping costs no digits), and the sum over pairs of modes
``|G|^2 = -sum_ij (c_i^* c_j)(b_j b_i^*)/(p_j + p_i^*)``.  What the equations of the Gramians leave over bounds the error:
with ``A P + P A^T + B B^T = R`` the square of the norm is ``tr(C P C^T) - tr(R Q)``, exactly.
"""

from dataclasses import dataclass
from math import inf
from typing import TYPE_CHECKING

import numpy as np

from boomctl.analysis.modal_form import modal_form
from boomctl.analysis.norm import unbounded_pole
from boomctl.arrays import Array
from boomctl.lti.gramians import factors
from boomctl.lti.modal import ModalSystem, diagonalized, spectral_parts
from boomctl.lti.system import Lti, of
from boomctl.structure.model import SecondOrderModel

if TYPE_CHECKING:
    import control

_AGREEMENT = 1e-6  # relative distance of bounds and of independent values up to which a norm is certified (a choice)
_EPS = float(np.finfo(float).eps)


@dataclass(frozen=True)
class H2Certificate:
    """An H2 norm between two bounds.

    Attributes
    ----------
    value : float
        The norm; ``inf`` with a feedthrough, an unstable pole, or an undamped mode that shows.
    lower, upper : float
        Bounds from the residual of the Gramian's equation.
    gap : float
        Largest relative difference of the values by the Gramian of controllability, by that of observability and by
        the modes.
    method : str
        How it was obtained, or why it is infinite.
    """

    value: float
    lower: float
    upper: float
    gap: float
    method: str

    def __repr__(self) -> str:
        certified = "certified" if self.certified else f"not certified: {self.lower:.6g} to {self.upper:.6g}"
        return f"H2Certificate: H2 norm {self.value:.6g}, {certified}\n  {self.method}"

    @property
    def certified(self) -> bool:
        """Whether bounds and independent values agree to a millionth, or the norm is known to be infinite."""
        if self.value == inf:
            return True
        return self.gap <= _AGREEMENT and self.upper - self.lower <= _AGREEMENT * self.upper


def h2_norm(system: "SecondOrderModel | control.StateSpace") -> H2Certificate:
    """Return the certified H2 norm: the RMS of the outputs to white noise of unit intensity at every input.

    Raises
    ------
    TypeError, ValueError
        Another kind of system, discrete time, not finite; an output of a structure that needs a derivative of an input.
    """
    given = modal_form(system) if isinstance(system, SecondOrderModel) else of(system)
    if given.D.any():
        o, i = np.unravel_index(int(np.argmax(np.abs(given.D))), given.D.shape)
        return _infinite(f"a feedthrough to {given.outputs[int(o)]!r} from {given.inputs[int(i)]!r}")
    if not len(given.A) or min(given.D.shape) == 0:
        return H2Certificate(0.0, 0.0, 0.0, 0.0, "no response")
    balanced = given.balanced()
    pole = unbounded_pole(balanced.poles, balanced.response)
    if pole is not None and pole.real > 0.0:
        return _infinite(f"an unstable pole at {pole.real:.4g}{pole.imag:+.4g}j rad/s")
    if pole is not None:
        return _infinite(f"a pole on the imaginary axis, at {pole.imag:.6g} rad/s")
    return _finite(spectral_parts(balanced)[0])


def _infinite(why: str) -> H2Certificate:
    return H2Certificate(inf, inf, inf, 0.0, why)


def _finite(system: Lti) -> H2Certificate:
    """Return the norm of a stable system without feedthrough."""
    if not len(system.A):
        return H2Certificate(0.0, 0.0, 0.0, 0.0, "no mode that shows")
    modal = diagonalized(system)
    used = system if modal is None else modal.blocks
    F, H = factors(used, None)
    by_control, by_observation = float(np.linalg.norm(used.C @ F)), float(np.linalg.norm(used.B.T @ H))
    values = [by_control, by_observation] + ([] if modal is None else [_by_modes(modal)])
    largest = max(values)
    gap = (largest - min(values)) / largest if largest > 0.0 else 0.0
    A, B, P, Q = used.A, used.B, F @ F.T, H @ H.T
    AP, BB = A @ P, B @ B.T
    rounding = 2.0 * len(A) * _EPS * (2.0 * (np.abs(A) @ np.abs(P)) + np.abs(BB))
    left_over = np.abs(AP + AP.T + BB) + rounding + rounding.T  # |R|, and what rounding may have hidden of it
    margin = float(np.sum(left_over * np.abs(Q)))  # |tr(R Q)| is not larger
    square = by_control**2
    return H2Certificate(
        by_control,
        float(np.sqrt(max(square - margin, 0.0))),
        float(np.sqrt(square + margin)),
        gap,
        "two Gramians" if modal is None else "two Gramians and the modes",
    )


def _by_modes(modal: ModalSystem) -> float:
    """Return the norm as a sum over pairs of modes."""
    p = modal.poles
    acting: Array = modal.B @ modal.B.conj().T
    reading: Array = modal.C.conj().T @ modal.C
    square = -np.sum(reading.T * acting / (p[:, None] + p.conj()[None, :]))
    return float(np.sqrt(max(float(square.real), 0.0)))
