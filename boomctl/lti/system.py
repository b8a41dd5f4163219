"""Linear systems ``x' = A x + B u``, ``y = C x + D u``: one record for all that is done with them.

python-control's types stand at the border only: :func:`of` turns what a user hands in into an :class:`Lti`, with one
check and one message, and :meth:`Lti.statespace` gives a named ``control.StateSpace`` back.
"""

import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import linalg

from boomctl.arrays import Array
from boomctl.checks import names

if TYPE_CHECKING:
    import control

_BATCH = 2**16  # entries of the pencils that are solved at once: what stays in the cache


@dataclass(frozen=True, eq=False)
class Lti:
    """``x' = A x + B u``, ``y = C x + D u``; in discrete time ``x+`` in place of ``x'``.

    Attributes
    ----------
    A, B, C, D : ndarray
        Real, finite, of shapes (n, n), (n, m), (p, n), (p, m).
    inputs, outputs, states : tuple of str
        Names; empty where nobody asks for them.
    dt : float
        Sampling time [s]; 0 in continuous time, ``nan`` in discrete time that does not say.
    """

    A: Array
    B: Array
    C: Array
    D: Array
    inputs: tuple[str, ...] = ()
    outputs: tuple[str, ...] = ()
    states: tuple[str, ...] = ()
    dt: float = 0.0

    def select(self, inputs: str | Sequence[str] | None = None, outputs: str | Sequence[str] | None = None) -> "Lti":
        """Return the system between the signals named, in that order; ``None`` means all.

        Raises
        ------
        ValueError
            A name that is not known or is asked for twice.
        """
        ins, outs = names("input", inputs, self.inputs), names("output", outputs, self.outputs)
        i, o = [self.inputs.index(name) for name in ins], [self.outputs.index(name) for name in outs]
        return replace(self, B=self.B[:, i], C=self.C[o], D=self.D[np.ix_(o, i)], inputs=ins, outputs=outs)

    def balanced(self) -> "Lti":
        """Return the system with states scaled by powers of two, so that rows and columns of ``A`` have like sizes."""
        if not len(self.A):
            return self
        A, (scale, _) = linalg.matrix_balance(self.A, permute=False, separate=True)
        return replace(self, A=A, B=self.B / scale[:, None], C=self.C * scale[None, :])

    def response(self, omega: Array) -> Array:
        """Return the frequency response, shape (outputs, inputs, frequencies)."""
        try:
            resolvent = self._resolvent(omega)
        except np.linalg.LinAlgError:
            # exactly on a pole of a mode that may not show: look beside it
            resolvent = self._resolvent(omega * (1.0 + 1e-9) + 1e-12)
        return np.moveaxis(self.C @ resolvent + self.D, 0, 2)

    def _resolvent(self, omega: Array) -> Array:
        n, B = len(self.A), self.B.astype(complex)
        found = np.empty((len(omega), *B.shape), complex)
        step, places = max(1, _BATCH // max(n, 1) ** 2), np.arange(n)
        for i in range(0, len(omega), step):
            s = 1j * omega[i : i + step]
            pencil = np.tile(-self.A.astype(complex), (len(s), 1, 1))
            pencil[:, places, places] += s[:, None]
            found[i : i + step] = np.linalg.solve(pencil, B)
        return found

    def statespace(self, name: str) -> "control.StateSpace":
        """Return the system as python-control's, with all its names.

        Dots in names of signals, which python-control does not allow, become ``_``.
        """
        from boomctl.lti.python_control import control

        signals = {"inputs": self.inputs, "outputs": self.outputs}
        given = {kind: [label.replace(".", "_") for label in labels] for kind, labels in signals.items() if labels}
        states = list(self.states) or None
        time = {} if self.dt == 0.0 else {"dt": True if np.isnan(self.dt) else self.dt}
        return control.ss(self.A, self.B, self.C, self.D, name=name, states=states, **given, **time)


def is_statespace(system: object) -> bool:
    """Return whether this is a ``control.StateSpace``, without importing python-control to find out."""
    control = sys.modules.get("control")
    return control is not None and isinstance(system, control.StateSpace)


def of(
    system: object,
    what: str = "system",
    expected: str = "SecondOrderModel or StateSpace",
    *,
    discrete: bool = False,
    any_time: bool = False,
) -> Lti:
    """Return the matrices and names of what a user hands in: a ``control.StateSpace``, a structural model, an ``Lti``.

    Parameters
    ----------
    system : StateSpace, SecondOrderModel or Lti
    what : str
        What a message calls it: the parameter's name.
    expected : str
        What a message says was expected.  Anything with a method ``to_statespace`` is taken where "SecondOrderModel" is
        expected.
    discrete : bool, optional
        True: discrete time is expected; by default, or False, continuous time.
    any_time : bool, optional
        True: both will do.

    Raises
    ------
    TypeError
        Another kind of system.
    ValueError
        The wrong kind of time; matrices that are not finite; signals of the same name.
    """
    if isinstance(system, Lti):
        return system
    given: Any = system
    if "SecondOrderModel" in expected and hasattr(system, "to_statespace"):
        given = given.to_statespace()
    if not is_statespace(given):
        raise TypeError(f"{what}: expected {expected}, got {type(system).__name__}")
    continuous = given.isctime()
    if not any_time and continuous == discrete:
        wanted = "a sampling time" if discrete else "continuous time"
        found = "continuous time" if continuous else f"a sampling time of {_seconds(given.dt)}"
        raise ValueError(f"{what}: expected {wanted}, got {found}")
    matrices = [np.asarray(getattr(given, letter), dtype=float) for letter in "ABCD"]
    for letter, matrix in zip("ABCD", matrices, strict=True):
        if not np.isfinite(matrix).all():
            row, column = np.argwhere(~np.isfinite(matrix))[0]
            value = matrix[row, column]
            raise ValueError(f"{what}: expected finite numbers, got {letter}[{row}, {column}] = {value}")
    labels = tuple(given.input_labels), tuple(given.output_labels), tuple(given.state_labels)
    for kind, listed in zip(("input", "output"), labels, strict=False):
        if len(set(listed)) < len(listed):
            twice = next(label for label in listed if listed.count(label) > 1)
            raise ValueError(f"{what}: {kind} {twice!r} is there twice")
    A, B, C, D = matrices
    dt = 0.0 if continuous else float("nan") if given.dt is True else float(given.dt)
    return Lti(A, B, C, D, *labels, dt)


def _seconds(dt: object) -> str:
    return "a length not said" if dt is True else f"{dt:g} s"


def state_matrices(system: "control.StateSpace") -> Lti:
    """Return the matrices of a continuous-time system, states balanced."""
    return of(system, expected="StateSpace").balanced()
