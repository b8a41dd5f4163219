"""Mode tables (frequency, damping, participation of inputs and outputs), and poles and transmission zeros.

The contribution of a mode to the response from input ``i`` to output ``o`` has a peak of ``|c_o| |b_i|/|Re p|``.  The
participation of a signal in a mode is this peak relative to the largest modal peak between the same two signals: it is
independent of units, coordinates and the order of signals.  An undamped mode that contributes has participation 1.  In
discrete time a mode ``z`` has a peak of ``|c_o| |b_i|/(1 - |z|)``; its frequency and damping are those of the rate
``log(z)/dt``, which in continuous time has the same values at the samples.  Rigid bodies and integrators are undamped modes
at zero; several of them have a common participation, because equal poles cannot be distinguished.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from importlib import import_module
from itertools import repeat
from typing import TYPE_CHECKING, Any

import numpy as np

from boomctl.analysis.sigma import matrices
from boomctl.arrays import Array
from boomctl.lti.modal import diagonalized, sides, transmission_zeros, without_integrators
from boomctl.lti.rounding import DEPENDENT, TINY
from boomctl.lti.system import Lti, of, rates_of
from boomctl.printing import DataFrame, between, count, data_frame, table_html
from boomctl.structure.model import SecondOrderModel
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    import control

    from boomctl.structure.model import SecondOrderModel


_WIDE = 20  # Width of a pole z in a table, in characters.
_CAPTION = "signal columns: modal peak in % of the highest mode, maximum over the other signals"


@dataclass(frozen=True, eq=False)
class Mode:
    """Mode: a pair of complex poles, or a real pole.

    Attributes
    ----------
    pole : complex
        Pole [rad/s], of a pair the one with positive imaginary part; in discrete time the rate ``log(z)/dt``, ``-inf`` for
        ``z = 0``.
    input_participation, output_participation : (m,) and (p,) ndarray
        From 0 to 1: modal peak relative to the largest finite modal peak between an input and any output (an output and any
        input).
    modal_peaks : (p, m) ndarray
        ``|c_o| |b_i|/|Re p|`` in units of output over input, in discrete time ``|c_o| |b_i|/|1 - |z||``; ``inf`` for an
        undamped mode that contributes.
    z : complex or None
        Pole in discrete time; None in continuous time.
    """

    pole: complex
    input_participation: Array
    output_participation: Array
    modal_peaks: Array
    z: complex | None = None

    def __repr__(self) -> str:
        z = "" if self.z is None else f", z = {_z(self.z)}"
        return (
            f"Mode: {self.omega:.6g} rad/s, {self.frequency_hz:.4g} Hz, damping {100.0 * self.damping_ratio:.4g} %{z}"
        )

    @property
    def omega(self) -> float:
        """Natural frequency ``|p|`` [rad/s]."""
        return abs(self.pole)

    @property
    def frequency_hz(self) -> float:
        """Damped frequency ``Im p/2 pi`` [Hz]."""
        return self.pole.imag / (2.0 * np.pi)

    @property
    def damping_ratio(self) -> float:
        """Damping ratio ``-Re p/|p|``; negative for an unstable mode, 0 at the origin, 1 for ``z = 0``."""
        if np.isinf(self.pole.real):
            return 1.0
        return -self.pole.real / abs(self.pole) if self.pole else 0.0


@dataclass(frozen=True)
class ModeTable:
    """Table of modes in ascending natural frequency.

    Attributes
    ----------
    input_labels, output_labels : tuple of str
        Names of the signals, in the order of the participations.
    rows : tuple of Mode
        Modes in ascending natural frequency.  Rigid-body modes, at 0 rad/s, have a participation of one if they contribute,
        and are not the highest mode for other modes.
    """

    input_labels: tuple[str, ...]
    output_labels: tuple[str, ...]
    rows: tuple[Mode, ...]

    def __str__(self) -> str:
        return self.to_string()

    def __repr__(self) -> str:
        lines = [f"ModeTable: {len(self.rows)} modes between {between(self.input_labels, self.output_labels)}"]
        lines += [f"  {row!r}".replace("Mode: ", "") for row in self.rows[: 4 if len(self.rows) == 4 else 3]]
        more = len(self.rows) + 1 - len(lines)
        return "\n".join([*lines, f"  ... {more} more: print(table)"] if more else lines)

    def _cells(self) -> list[list[str]]:
        """Return the modes as text: [rad/s], [Hz], damping [%], ``z`` of a discrete system, participations [%]."""
        result = []
        for r in self.rows:
            z = [] if r.z is None else [_z(r.z)]
            signals = [f"{100.0 * value:.1f}" for value in (*r.input_participation, *r.output_participation)]
            result.append([f"{r.omega:.6g}", f"{r.frequency_hz:.4g}", f"{100.0 * r.damping_ratio:.4g}", *z, *signals])
        return result

    def _repr_html_(self) -> str:
        signals = (f"{name} [%]" for name in (*self.input_labels, *self.output_labels))
        return table_html(f"Modes; {_CAPTION}", [*self._heads, *signals], self._cells())

    def to_string(self, count: int | None = None) -> str:
        """Return the modes as text, participations in percent.

        Parameters
        ----------
        count : int, optional
            Number of modes, from the slowest. If None, all modes.

        Returns
        -------
        str
            Caption, column heads, and one line for each mode.
        """
        heads, names = self._heads, (*self.input_labels, *self.output_labels)
        wide = [*(13, 7, 11, _WIDE)[: len(heads)], *(max(len(name), 6) for name in names)]
        lines = [[*heads, *names], *self._cells()[:count]]
        rows = ("".join(f"  {cell:>{w}}" for cell, w in zip(x, wide, strict=True)) for x in lines)
        return "\n".join([_CAPTION, *rows])

    def to_pandas(self) -> DataFrame:
        """Return the modes as a data frame of pandas.

        Returns
        -------
        pandas.DataFrame
            One row for each mode, numbered from 1; frequency, damping, and participations from 0 to 1.
        """
        heads = ["omega", "frequency_hz", "damping_ratio", "z"][: len(self._heads)]
        rows = [[*(getattr(r, n) for n in heads), *r.input_participation, *r.output_participation] for r in self.rows]
        numbers = range(1, len(rows) + 1)
        return data_frame(rows, "mode", index=numbers, columns=[*heads, *self.input_labels, *self.output_labels])

    def plot(self, ax: Any = None, **style: Any) -> Any:
        """Draw the damping of each mode over its frequency.

        Parameters
        ----------
        ax : matplotlib Axes, optional
            Axes to draw on. If None, a new figure is created.
        **style
            Marker properties, passed to `matplotlib.axes.Axes.plot`.

        Returns
        -------
        matplotlib.axes.Axes
            The axes.
        """
        return import_module("boomctl.plotting.looking").plot_mode_table(self, ax, **style)

    @property
    def _heads(self) -> list[str]:
        discrete = any(row.z is not None for row in self.rows)
        return ["omega [rad/s]", "[Hz]", "damping [%]", "z"][: 4 if discrete else 3]


def _z(z: complex) -> str:
    return f"{z.real:.6g}" if z.imag == 0.0 else f"{z.real:.6g}{z.imag:+.6g}j"


@one_blas_thread
def mode_table(system: SecondOrderModel | control.StateSpace | control.TransferFunction) -> ModeTable:
    """Return the modes of a system with their input and output participation.

    For a discrete system, frequency and damping are those of the rate ``log(z)/dt`` of a pole ``z``; the table shows both.

    Parameters
    ----------
    system : SecondOrderModel, control.StateSpace or control.TransferFunction
        System to evaluate.

    Returns
    -------
    ModeTable
        One row for each mode, in ascending natural frequency: pole, frequency, damping, and participations.

    Raises
    ------
    TypeError, ValueError
        If `system` has an unsupported type, an unspecified sampling time or an entry that is not finite, or if it has
        defective poles other than integrators (equal poles in a chain, critical damping).

    Examples
    --------
    >>> import boomctl as bc
    >>> table = bc.mode_table(bc.spray_boom())
    >>> [(round(mode.frequency_hz, 3), round(mode.damping_ratio, 4)) for mode in table.rows[:2]]
    [(0.245, 0.0014), (0.587, 0.0214)]
    """
    plain = system._modal_form if isinstance(system, SecondOrderModel) else of(system, sampled=True)
    chain, rest = _rigid(plain.balanced())
    modal = diagonalized(rest)
    if modal is None:
        raise ValueError("system: it has defective poles (a Jordan block, as of critical damping)")
    chosen = np.flatnonzero(modal.poles.imag >= 0.0)
    dt, rates = plain.dt, rates_of(modal.poles, plain.dt)
    chosen = chosen[np.argsort(np.abs(rates[chosen]), kind="stable")]
    residues = np.abs(modal.C[:, chosen]).T[:, :, None] * np.abs(modal.B[chosen])[:, None, :]
    poles, undamped = modal.poles[chosen], (sides(modal.poles, dt) == 0)[chosen, None, None]
    decay = np.abs(poles.real) if dt == 0.0 else np.abs(1.0 - np.abs(poles))
    shown = residues > DEPENDENT * residues.max(axis=0, initial=TINY)
    peaks = np.where(undamped, np.where(shown, np.inf, 0.0), residues / np.where(undamped, 1.0, decay[:, None, None]))
    largest = np.where(undamped, 0.0, peaks).max(axis=0, initial=0.0)
    count = len(chain)  # Rigid-body modes are the first rows.
    peaks = np.concatenate([np.tile(np.where(chain.any(axis=0), np.inf, 0.0), (count, 1, 1)), peaks])
    with np.errstate(invalid="ignore", divide="ignore"):
        fractions = np.where(np.isinf(peaks), 1.0, np.where(largest > 0.0, peaks / largest, 0.0))
    inputs, outputs = (fractions.max(axis=axis, initial=0.0) for axis in (1, 2))
    rates, poles = np.concatenate([np.zeros(count), rates[chosen]]), np.concatenate([np.ones(count), poles])
    rows = zip(map(complex, rates), inputs, outputs, peaks, map(complex, poles) if dt else repeat(None), strict=False)
    return ModeTable(plain.input_labels, plain.output_labels, tuple(Mode(*row) for row in rows))


def _rigid(system: Lti) -> tuple[Array, Lti]:
    """Return rigid bodies and integrators, if several poles are at zero, and the rest of a balanced system.

    Their poles are equal, so that a chain of them has a common participation.  The first value is a mask of the signals to
    which it contributes, for each power of time.
    """
    parts = without_integrators(system)
    B, C = parts.retained.B, parts.retained.C
    if len(B) < 2:
        return np.zeros((0, len(C), B.shape[1]), dtype=bool), system
    N = np.triu(parts.retained.A, 1)
    lengths = np.linalg.norm(system.C, axis=1)[:, None] * np.linalg.norm(system.B, axis=0)
    powers = [np.linalg.matrix_power(N, k) for k in range(len(N))]
    shown = [np.abs(C @ power @ B) > DEPENDENT * np.linalg.norm(N) ** k * lengths for k, power in enumerate(powers)]
    return np.array(shown), parts.rest


@dataclass(frozen=True, eq=False)
class PoleZeroResult:
    """Poles and transmission zeros.

    Attributes
    ----------
    poles, zeros : complex ndarray
        In ascending order of modulus [rad/s]; ``z`` in discrete time.
    input_labels, output_labels : tuple of str
        Signals of the zeros.
    dt : float
        Sampling time [s]; 0 for continuous time.
    """

    poles: Array = field(repr=False)
    zeros: Array = field(repr=False)
    input_labels: tuple[str, ...]
    output_labels: tuple[str, ...]
    dt: float = 0.0

    def __repr__(self) -> str:
        side = sides(self.poles, self.dt)
        some = [f"{int((side > 0).sum())} unstable"] if (side > 0).any() else []
        some += [f"{int((side == 0).sum())} undamped or integrating"] if (side == 0).any() else []
        numbers = f"{count(len(self.poles), 'pole')}, {count(len(self.zeros), 'zero')}"
        slowest = self.poles[np.argmax(self.poles.real if not self.dt else np.abs(self.poles))] if len(side) else None
        last = "" if slowest is None else f"; slowest pole {complex(slowest.real, abs(slowest.imag)):.6g}"
        kinds = f" ({', '.join(some)})" if some else ""
        return f"PoleZeroResult: {between(self.input_labels, self.output_labels)}\n  {numbers}{kinds}{last}"

    @property
    def response(self) -> Any:
        """Poles and zeros as python-control's ``PoleZeroData``."""
        from control.pzmap import PoleZeroData

        return PoleZeroData(self.poles, self.zeros, dt=self.dt or 0, sysname="system")

    def plot(self, ax: Any = None, **style: Any) -> Any:
        """Draw poles as crosses and zeros as circles, for the lowest modes, over lines of equal damping.

        Parameters
        ----------
        ax : matplotlib Axes, optional
            Axes to draw on. If None, a new figure is created.
        **style
            Marker properties, passed to `matplotlib.axes.Axes.plot`.

        Returns
        -------
        matplotlib.axes.Axes
            The axes.
        """
        return import_module("boomctl.plotting.looking").plot_pole_zero(self, ax, **style)


@one_blas_thread
def pzmap(
    system: SecondOrderModel | control.StateSpace | control.TransferFunction | Any,
    inputs: str | Sequence[str] | None = None,
    outputs: str | Sequence[str] | None = None,
) -> PoleZeroResult:
    """Return the poles and the transmission zeros of a system.

    The name is python-control's short name of ``pole_zero_map``.

    Parameters
    ----------
    system : SecondOrderModel, control.StateSpace or TransferFunction, or a result
        System to evaluate.  For a design (``lqr``, ``lqg``, ``h2``, ``h_infinity``) the closed loop, for a reduction the
        reduced system.
    inputs, outputs : str or sequence of str, optional
        Signals.  If None, all signals; for a boom model, platform actuators and tips.

    Returns
    -------
    PoleZeroResult
        Poles and zeros; ``.plot()`` draws them, ``.response`` is python-control's.

    Raises
    ------
    TypeError, ValueError
        If `system` has an unsupported type or a signal is unknown.

    Examples
    --------
    >>> import boomctl as bc
    >>> jolt, yaw = bc.split_symmetric(bc.spray_boom())
    >>> found = bc.pzmap(yaw, "suspension_anti", "stroke_anti")  # collocated: zeros between the poles
    >>> abs(found.poles[found.poles.imag > 0][:2]).round(2), abs(found.zeros[found.zeros.imag > 0][:1]).round(2)
    (array([ 1.54, 17.51]), array([4.66]))
    """
    result = matrices(system, inputs, outputs)
    poles, zeros = _ascending(result.poles), _ascending(transmission_zeros(result))
    return PoleZeroResult(poles, zeros, result.input_labels, result.output_labels, result.dt)


def _ascending(values: Array) -> Array:
    return values[np.lexsort((values.imag, np.abs(values)))]
