"""Response of a linear system to sampled inputs that run straight from sample to sample: exact, without small steps."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike
from scipy import linalg

from boomctl.arrays import Array
from boomctl.checks import finite_array, positive

if TYPE_CHECKING:
    import control


def linear_hold(A: Array, B: Array, step: float) -> tuple[Array, Array, Array]:
    """Return ``Phi, G, H`` of ``x[k+1] = Phi x[k] + G u[k] + H (u[k+1] - u[k])``, exact for inputs linear in between.

    They are the upper rows of the exponential of ``[[A, B, 0], [0, 0, I/step], [0, 0, 0]] step``.
    """
    n, m = B.shape
    generator = np.zeros((n + 2 * m, n + 2 * m))
    generator[:n, :n], generator[:n, n : n + m] = step * A, step * B
    generator[n : n + m, n + m :] = np.eye(m)
    upper = linalg.expm(generator)[:n]
    return upper[:, :n], upper[:, n : n + m], upper[:, n + m :]


def linear_hold_response(
    system: "control.StateSpace", inputs: ArrayLike, step: float, initial: ArrayLike | None = None
) -> Array:
    """Return the outputs of a continuous system at the samples of its inputs, which run straight between them.

    Parameters
    ----------
    system : StateSpace
        Continuous; ``m`` inputs, ``p`` outputs.
    inputs : (m, N) array_like
    step : float
        Time between samples [s].
    initial : (n,) array_like, optional
        State at the first sample; by default zero.

    Returns
    -------
    (p, N) ndarray
        Exact but for rounding.

    Raises
    ------
    TypeError, ValueError
        Shapes that do not fit, values that are not finite, a step not above zero, a discrete system, another kind of
        system; an unstable one whose outputs grow beyond all numbers.

    Notes
    -----
    The samples are cut into about ``sqrt(N)`` runs that are stepped through side by side from a zero state; what each
    run inherits is added afterwards.  Nothing is diagonalised, so that defective systems are served as well.
    """
    from boomctl.lti.python_control import control

    if not isinstance(system, control.StateSpace):
        raise TypeError(f"system: expected control.StateSpace, got {type(system).__name__}")
    if not system.isctime():
        raise ValueError(f"system: expected a continuous system, got one with a sampling time of {system.dt} s")
    u = finite_array("inputs", inputs, ndim=2)
    h = positive("step", step)
    if u.shape[0] != system.ninputs or not u.shape[1]:
        raise ValueError(f"inputs: expected {system.ninputs} rows and at least one column, got shape {u.shape}")
    A, B, C, D = (finite_array(f"{name} of the system", getattr(system, name), ndim=2) for name in "ABCD")
    start = np.zeros(len(A)) if initial is None else finite_array("initial", initial, ndim=1)
    if len(start) != len(A):
        raise ValueError(f"initial: expected {len(A)} values, got {len(start)}")
    if not len(A):
        return D @ u
    with np.errstate(over="ignore", invalid="ignore"):
        Phi, G, H = linear_hold(A, B, h)
        states = recursion(Phi, G @ u[:, :-1] + H @ np.diff(u), start)
        found = C @ states + D @ u
    if not np.isfinite(found).all():
        raise ValueError(
            f"system: its outputs grow beyond all numbers within {u.shape[1]} samples, {h:g} s apart; it is unstable, "
            "or step is too long for its numbers"
        )
    return found


def recursion(Phi: Array, forcing: Array, start: Array) -> Array:
    """Return ``x[0] .. x[N]`` (columns) of ``x[k+1] = Phi x[k] + forcing[:, k]``."""
    n, count = forcing.shape
    length = max(int(np.sqrt(count)), 1)
    runs = -(-count // length)
    padded = np.zeros((n, runs * length))
    padded[:, :count] = forcing
    pushed = np.ascontiguousarray(padded.reshape(n, runs, length).transpose(2, 0, 1))
    inherited = np.empty((n, runs))
    for k in range(1, length):
        pushed[k] += Phi @ pushed[k - 1]
    power = np.linalg.matrix_power(Phi, length)
    state = start
    for j in range(runs):
        inherited[:, j] = state
        state = power @ state + pushed[-1][:, j]
    for k in range(length):
        inherited = Phi @ inherited
        pushed[k] += inherited
    states = np.empty((n, count + 1))
    states[:, 0] = start
    states[:, 1:] = pushed.transpose(1, 2, 0).reshape(n, -1)[:, :count]
    return states
