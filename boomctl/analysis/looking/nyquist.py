"""The Nyquist curve of a loop, its encirclements of -1 counted along it, and the critical disk.

With ``L`` the loop's response under negative feedback, ``det(I + L)`` is the product of ``s - p`` over the closed loop's
poles over that of the open one.  Its winding about zero, poles of the open loop on the axis left to the left, is by how many
the closed loop's poles on the right are fewer (Nyquist 1932).  The number that it says is compared with the eigenvalues of
the closed loop: two ways that share nothing but the matrices.

A sampled loop is looked at through the bilinear map, by which the unit circle is the imaginary axis.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

from boomctl.analysis.looking.given import looked_at, matrices
from boomctl.analysis.loops import joined, sign_advice
from boomctl.analysis.margins import DiskMargin, grid_of_loop, single_disk
from boomctl.analysis.nyquist import followed
from boomctl.arrays import Array
from boomctl.checks import no_signals, nonnegative
from boomctl.lti.bilinear import continuous_image, image_of_poles, omega_of_image
from boomctl.lti.frequency import Triangular, smooth_curve, triangular
from boomctl.lti.modal import boundary_poles, side_of_axis
from boomctl.lti.system import Lti, controller_of, of, well_posed_inverse
from boomctl.printing import count, listed
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    import control

    from boomctl.structure.model import SecondOrderModel

_FAR = 1e4  # how far beyond the fastest pole the curve is followed: what is left turns by less than a thousandth each
_DETOUR = 0.1  # of the distance from a pole on the axis to the next one, the radius of the way round it (a choice)
_TOGETHER = 1e-3  # of the distance from poles on the axis to all others, up to which they have one way round
_ON_ARC = 9  # points on an arc to begin with, along which the pole itself is divided out
_WHOLE = 1e-2  # distance from a whole number of windings that is rounding and what is left beyond the end (a choice)
_STATIC = 1.0  # [rad/s], where a loop without dynamics is asked: its response is the same everywhere
_LIMIT = 200_000  # frequencies that one way may take: as many as of a loop around an exact boom


@dataclass(frozen=True)
class NyquistResult:
    """A loop's Nyquist curve, and what it says of stability.

    Attributes
    ----------
    omega : (n,) ndarray
        Angular frequencies [rad/s].
    curve : (n,) complex ndarray
        The loop's response ``L`` under negative feedback; of several signals ``det(I + L) - 1``, which is as near to -1.
    signals : tuple of str
        Where the loop is opened, all at once.
    encirclements : int
        How often the whole curve, negative frequencies included, winds around -1, counter-clockwise.
    open_loop_unstable_poles, closed_loop_unstable_poles : int
        Unstable poles of the open and of the closed loop: the second is the first less the encirclements, and the
        eigenvalues of the closed loop agree.
    disk_margin : DiskMargin or None
        The disk margin at this signal; None of several signals (see :func:`boomctl.margins`) and of an unstable loop.
    """

    omega: Array
    curve: Array = field(repr=False)
    signals: tuple[str, ...]
    encirclements: int
    open_loop_unstable_poles: int
    closed_loop_unstable_poles: int
    disk_margin: DiskMargin | None
    _advice: str = field(default="", repr=False, compare=False)

    def __repr__(self) -> str:
        turns = (
            f"{self.encirclements} encirclements of -1, {count(self.open_loop_unstable_poles, 'unstable pole')} of "
            "the open loop"
        )
        verdict = (
            "stable" if self.stable else f"{count(self.closed_loop_unstable_poles, 'unstable pole')} of the closed loop"
        )
        disk = "" if self.disk_margin is None else f"; disk margin {self.disk_margin.alpha:.4g}"
        advice = f"\n  {self._advice}" if self._advice else ""
        return f"NyquistResult: opened at {listed(self.signals, 60)}\n  {turns}: {verdict}{disk}{advice}"

    @property
    def stable(self) -> bool:
        """Whether the closed loop is stable."""
        return self.closed_loop_unstable_poles == 0

    @property
    def response(self) -> control.FrequencyResponseData:
        """The curve as python-control's frequency response."""
        from boomctl.lti.python_control import control

        return control.frd(self.curve[None, None, :], self.omega, name="loop")

    def plot(self, ax: Any = None, **style: Any) -> Any:
        """Draw the curve around -1, with the critical disk that it does not enter.

        Parameters
        ----------
        ax : matplotlib Axes, optional
            Where to draw; by default a new figure of pyplot.
        **style
            Of the curve, as matplotlib's lines take it.

        Returns
        -------
        matplotlib.axes.Axes
            Those drawn on.
        """
        return import_module("boomctl.plotting.looking").plot_nyquist(self, ax, **style)


@one_blas_thread
def nyquist(
    system: SecondOrderModel | control.StateSpace | control.TransferFunction | Any,
    controller: control.StateSpace | control.TransferFunction | Any | None = None,
    *,
    inputs: str | Sequence[str] | None = None,
    outputs: str | Sequence[str] | None = None,
    delay: float = 0.0,
) -> NyquistResult:
    """Return the Nyquist curve of a loop, and its encirclements of -1.

    It has the short name that python-control gives to its ``nyquist_plot``.

    Parameters
    ----------
    system : SecondOrderModel, control.StateSpace or TransferFunction
        Without a controller: the loop's gain ``L`` under negative feedback, as python-control takes it, with as many outputs
        as inputs.  With one: the plant, signals named.
    controller : control.StateSpace, TransferFunction, or a design, optional
        ``u = K y``, signals found by name, as for :func:`boomctl.margins`: then ``L = -K G``.  A discrete one makes the
        sampled loop.
    inputs, outputs : str or sequence of str, optional
        Signals of the system that the loop goes through; by default all, of a boom's loop gain platform actuators and tips.
    delay : float, optional
        Time between a sample and the moment its control acts [s]; only with a discrete controller.

    Returns
    -------
    NyquistResult
        Frequencies, curve, encirclements and unstable poles; ``.plot()`` draws it with the critical disk.

    Raises
    ------
    TypeError, ValueError
        Other kinds of system; not as many outputs as inputs; names that do not meet; a loop that is not well-posed; a pole
        at ``z = -1``.
    ArithmeticError
        A pole of the closed loop on the imaginary axis (the unit circle), or so close to it that encirclements cannot be
        told.

    Examples
    --------
    >>> import boomctl as bc
    >>> import control
    >>> motor = control.ss([[0.0, 1.0], [0.0, -1.0]], [[0.0], [1.0]], [[0.5, 0.0]], 0.0)
    >>> found = bc.nyquist(motor)
    >>> found.stable, round(found.disk_margin.phase_margin_deg, 1)
    (True, 60.0)
    """
    no_signals("controller", controller, "a controller")
    negative = str
    if controller is None:
        if nonnegative("delay", delay):
            raise ValueError(f"delay = {delay!r}: expected 0 without a controller")
        opened, S, signals = _of_gain(matrices(system, inputs, outputs))
    else:
        P = of(looked_at(system), "plant", sampled=True).select(inputs, outputs)
        K = controller_of(controller, sampled=True, scales=P.scales)
        opened, S, signals = _of_loop(P, K, delay)
        negative = partial(sign_advice, P, K, delay)
    images = image, gain = continuous_image(S), continuous_image(opened)
    grid = np.union1d(*(grid_of_loop(item) for item in images))
    loop = _Difference(triangular(image), triangular(gain))
    turns, unstable = _windings(loop, opened, image.poles, grid)
    closed = unstable - turns
    told = side_of_axis(image.poles)
    if (told == 0).any() or closed != int((told > 0).sum()):
        raise ArithmeticError(
            f"encirclements cannot be told: they say {closed} unstable poles, the eigenvalues of the closed loop"
            f" {int((told > 0).sum())}, and {int((told == 0).sum())} on the boundary of stability"
        )
    grid = grid[grid > 0.0] if len(grid) > 1 else np.array([_STATIC])
    omega, curve = smooth_curve(lambda w: loop.determinant(1j * w) - 1.0, grid)
    disk = single_disk(S) if len(signals) == 1 and not closed else None
    return NyquistResult(
        omega=omega_of_image(omega, S.dt),
        curve=curve,
        signals=signals,
        encirclements=turns,
        open_loop_unstable_poles=unstable,
        closed_loop_unstable_poles=closed,
        disk_margin=disk,
        _advice=negative() if closed else "",
    )


def _of_gain(L: Lti) -> tuple[Lti, Lti, tuple[str, ...]]:
    """Return a loop's gain, its sensitivity ``(I + L)^-1``, and its signals."""
    if L.D.shape[0] != L.D.shape[1]:
        raise ValueError(
            f"system: expected as many outputs as inputs, got {len(L.output_labels)} and {len(L.input_labels)}"
        )
    R = well_posed_inverse(np.eye(len(L.D)) + L.D)
    return L, replace(L, A=L.A - L.B @ R @ L.C, B=L.B @ R, C=-R @ L.C, D=R).balanced(), L.output_labels


def _of_loop(P: Lti, K: Lti, delay: float) -> tuple[Lti, Lti, tuple[str, ...]]:
    """Return the open loop, the sensitivity at the controls, and these, of ``u = K y``."""
    loop = joined(P, K, delay)
    opened = joined(P, replace(K, C=0.0 * K.C, D=0.0 * K.D), delay)  # states of the plant, then of the controller
    first, m, measured = len(loop.disturbances), len(loop.controls), len(opened.outputs) + len(loop.controls)
    G = opened.system.between(range(first, first + m), range(measured, measured + len(loop.measurements)))
    C = K.D @ G.C
    C[:, C.shape[1] - K.C.shape[1] :] += K.C
    L = replace(G, C=-C, D=-K.D @ G.D, output_labels=loop.controls)
    return L.balanced(), loop.sensitivity.between(range(m), range(m)), loop.controls


@dataclass(frozen=True)
class _Difference:
    """``I + L`` of a loop, by its sensitivity ``S`` near poles of the closed loop and by ``L`` near those of the open one."""

    S: Triangular
    L: Triangular

    def determinant(self, s: Array) -> Array:
        """Return ``det(I + L)``; infinite at a pole of ``L``.

        Raises
        ------
        ArithmeticError
            A pole of the closed loop lies there.
        """
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            values = self.S.at(s).transpose(2, 0, 1)
            if not np.isfinite(values).all():
                raise ArithmeticError(
                    "encirclements cannot be told: the closed loop has a pole on the boundary of stability"
                )
            result = 1.0 / np.linalg.det(values)
            large = np.isfinite(result) & (np.abs(result) > 1.0)
            direct = np.linalg.det(np.eye(len(self.L.D)) + self.L.at(s[large]).transpose(2, 0, 1))
            result[large] = np.where(np.isfinite(direct), direct, result[large])
        return result


def _windings(loop: _Difference, opened: Lti, theirs: Array, grid: Array) -> tuple[int, int]:
    """Return how often ``det(I + L)`` winds around zero, counter-clockwise, over the whole axis, and poles on its right.

    Poles of the open loop on the axis are passed on their right.  One of multiplicity ``k`` turns the determinant by ``-k``
    half turns there, all else by what remains.
    """
    if not len(theirs):
        return 0, 0
    side, points = boundary_poles(opened)
    ours = image_of_poles(points, opened.dt)
    ours[side == 0] = 1j * ours[side == 0].imag
    on_axis, rest = np.sort(ours[side == 0].imag), np.concatenate([ours[side != 0], theirs])
    end, begin, turned = _FAR * max(float(np.abs(np.concatenate([on_axis, rest])).max()), _STATIC), 0.0, 0.0
    gaps = np.abs(rest[:, None] - 1j * on_axis).min(axis=0, initial=end)
    apart = np.flatnonzero(np.diff(on_axis) > _TOGETHER * np.minimum(gaps[1:], gaps[:-1])) + 1
    for group in np.split(on_axis, apart) if len(on_axis) else ():
        if group[-1] < 0.0:
            continue
        center, multiplicity = 0.0 if group[0] <= 0.0 else float(group.mean()), len(group)
        others = np.concatenate([rest, 1j * np.setdiff1d(on_axis, group)])
        radius = _DETOUR * float(np.abs(others - 1j * center).min(initial=end))
        if center > 0.0:
            turned += _turned(lambda w: loop.determinant(1j * w), _between(grid, begin, center - radius))
        angles = np.linspace(0.0 if center == 0.0 else -0.5 * np.pi, 0.5 * np.pi, _ON_ARC)
        turned += _turned(
            lambda t, c=center, r=radius, k=multiplicity: (
                loop.determinant(1j * c + r * np.exp(1j * t)) * np.exp(1j * k * t)
            ),
            angles,
        ) - multiplicity * (angles[-1] - angles[0])
        begin = center + radius
    turned += _turned(lambda w: loop.determinant(1j * w), _between(grid, begin, end))
    at_end = loop.determinant(np.array([1j * end]))[0]
    turned += float(np.angle(1.0 / np.linalg.det(loop.S.D) / at_end))
    windings = turned / np.pi
    turns = round(windings)
    if abs(windings - turns) > _WHOLE:
        raise ArithmeticError(f"the loop winds {windings:.4f} times about -1, not a whole number of times")
    return turns, int((side > 0).sum())


def _between(grid: Array, low: float, high: float) -> Array:
    """Return the frequencies of a grid between two, and these."""
    return np.concatenate([[low], grid[(grid > low) & (grid < high)], [high]])


def _turned(determinant: Callable[[Array], Array], t: Array) -> float:
    """Return by how much the determinant turns along a part of the way, by a parameter that ascends [rad]."""
    _, values = followed(lambda t: determinant(t)[:, None, None], t, _LIMIT)
    determinants = values[:, 0, 0]
    return float(np.angle(determinants[1:] / determinants[:-1]).sum())
