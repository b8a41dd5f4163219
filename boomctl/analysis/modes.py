"""Mode tables: frequency, damping, and which actuator and which sensor sees a mode.

What a mode contributes to the response from input ``i`` to output ``o`` peaks, seen by itself, at ``|c_o| |b_i|/|Re p|``.
A signal's share in a mode is that contribution against the largest of all modes between the same two signals: it depends
neither on units, nor on the coordinates, nor on how signals are ordered.  An undamped mode has
share 1 where it shows at all.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from boomctl.arrays import Array
from boomctl.lti.modal import diagonalized, side_of_axis
from boomctl.lti.system import of
from boomctl.printing import between, table_html
from boomctl.structure.model import SecondOrderModel
from boomctl.structure.response.modal_form import modal_form

if TYPE_CHECKING:
    import control

# share of the largest residue between two signals up to which an undamped mode does not show (a choice)
_HIDDEN = 1e-10


@dataclass(frozen=True)
class ModeRow:
    """One mode: a pair of complex poles, or a real pole.

    Attributes
    ----------
    pole : complex
        The pole, of a pair that of non-negative imaginary part [rad/s].
    input_shares, output_shares : (m,) and (p,) ndarray
        From 0 to 1: how much of the largest modal peak between an input and any output (an output and any input) this
        mode makes.
    peaks : (p, m) ndarray
        ``|c_o| |b_i|/|Re p|`` in units of output over input; ``inf`` for an undamped mode that shows.
    """

    pole: complex
    input_shares: Array
    output_shares: Array
    peaks: Array

    def __repr__(self) -> str:
        return f"ModeRow: {self.omega:.6g} rad/s, {self.frequency_hz:.4g} Hz, damping {100.0 * self.damping:.4g} %"

    @property
    def omega(self) -> float:
        """Natural frequency ``|p|`` [rad/s]."""
        return abs(self.pole)

    @property
    def frequency_hz(self) -> float:
        """Damped frequency ``Im p/2 pi`` [Hz]."""
        return self.pole.imag / (2.0 * np.pi)

    @property
    def damping(self) -> float:
        """Damping ratio ``-Re p/|p|``; negative for an unstable mode, 0 at the origin."""
        return -self.pole.real / abs(self.pole) if self.pole else 0.0


@dataclass(frozen=True)
class ModeTable:
    """Modes in ascending natural frequency, and the signals they were asked for.

    Attributes
    ----------
    inputs, outputs : tuple of str
        Names of the signals, in the order of the shares.
    rows : tuple of ModeRow
        The modes, in ascending natural frequency.
    """

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    rows: tuple[ModeRow, ...]

    def __str__(self) -> str:
        return self.render()

    def __repr__(self) -> str:
        lines = [f"ModeTable: {len(self.rows)} modes between {between(self.inputs, self.outputs)}"]
        lines += [f"  {row!r}".replace("ModeRow: ", "") for row in self.rows[: 4 if len(self.rows) == 4 else 3]]
        more = len(self.rows) + 1 - len(lines)
        return "\n".join([*lines, f"  ... {more} more: print(table)"] if more else lines)

    def _repr_html_(self) -> str:
        heads = ("omega [rad/s]", "[Hz]", "damping [%]", *(f"{name} [%]" for name in (*self.inputs, *self.outputs)))
        rows = []
        for row in self.rows:
            shares = [f"{100.0 * share:.1f}" for share in (*row.input_shares, *row.output_shares)]
            rows.append([f"{row.omega:.6g}", f"{row.frequency_hz:.4g}", f"{100.0 * row.damping:.4g}", *shares])
        return table_html("Modes, and the share of each in the largest peak of a signal", heads, rows)

    def render(self, count: int | None = None) -> str:
        """Return the modes as text, shares in per cent.

        Parameters
        ----------
        count : int, optional
            How many modes, from the slowest; by default all.

        Returns
        -------
        str
            A table, one line for each mode.
        """
        wide = [max(len(name), 6) for name in (*self.inputs, *self.outputs)]
        heads = [f"{name:>{w}}" for name, w in zip((*self.inputs, *self.outputs), wide, strict=True)]
        lines = ["  omega [rad/s]   [Hz]  damping [%]  " + "  ".join(heads)]
        for row in self.rows[:count]:
            shares = [*row.input_shares, *row.output_shares]
            cells = [f"{100.0 * share:{w}.1f}" for share, w in zip(shares, wide, strict=True)]
            start = f"{row.omega:15.6g}{row.frequency_hz:7.4g}{100.0 * row.damping:13.4g}"
            lines.append(start + "  " + "  ".join(cells))
        return "\n".join(lines)


def mode_table(system: "SecondOrderModel | control.StateSpace") -> ModeTable:
    """Return the modes of a system, and how well each input moves and each output shows them.

    Parameters
    ----------
    system : SecondOrderModel or control.StateSpace
        The system.

    Returns
    -------
    ModeTable
        One row for each mode, in ascending natural frequency: pole, frequency, damping, and shares of inputs and outputs.

    Raises
    ------
    TypeError, ValueError
        Another kind of system, discrete time, not finite; poles without eigenvectors of their own (a rigid body that
        no support holds, equal poles in a chain).

    Examples
    --------
    >>> import boomctl as bc
    >>> table = bc.mode_table(bc.spray_boom())
    >>> [(round(mode.frequency_hz, 3), round(mode.damping, 4)) for mode in table.rows[:2]]
    [(0.245, 0.0014), (0.587, 0.0214)]
    """
    given = modal_form(system.structure, system.ports) if isinstance(system, SecondOrderModel) else of(system)
    modal = diagonalized(given.balanced())
    if modal is None:
        raise ValueError(
            "system: it has poles without eigenvectors of their own (a free rigid body, a chain of equals)"
        )
    chosen = np.flatnonzero(modal.poles.imag >= 0.0)
    chosen = chosen[np.argsort(np.abs(modal.poles[chosen]), kind="stable")]
    residues = np.abs(modal.C[:, chosen]).T[:, :, None] * np.abs(modal.B[chosen])[:, None, :]
    poles, undamped = modal.poles[chosen], (side_of_axis(modal.poles) == 0)[chosen, None, None]
    peaks = residues / np.where(undamped, 1.0, np.abs(poles.real)[:, None, None])
    shown = residues > _HIDDEN * residues.max(axis=0, initial=np.finfo(float).tiny)
    peaks = np.where(undamped, np.where(shown, np.inf, 0.0), peaks)
    return ModeTable(given.inputs, given.outputs, _rows(poles, peaks))


def _rows(poles: Array, peaks: Array) -> tuple[ModeRow, ...]:
    largest = peaks.max(axis=0, initial=0.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        shares = np.where(np.isinf(peaks), 1.0, np.where(largest > 0.0, peaks / largest, 0.0))
    return tuple(
        ModeRow(complex(pole), share.max(axis=0, initial=0.0), share.max(axis=1, initial=0.0), peak)
        for pole, share, peak in zip(poles, shares, peaks, strict=True)
    )
