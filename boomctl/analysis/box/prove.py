"""Proof of a statement about a loop over a box: the loop is stable, or its gain is below a level.

Cells of parameters (:mod:`boomctl.analysis.box.zero_exclusion`) cover all frequencies and are suited to many lightly damped
poles; cells of parameters and frequencies (:mod:`boomctl.analysis.box.response_cells`) are suited to strongly coupled poles
and many parameters.  Both show that no pole, or no singular value at the level, is on the axis anywhere in them.  A box is
connected, so that the statement holds throughout if it holds at one point.

A cell of parameters is proved or halved.  At every fifth halving, and before the proof stops, the cell is divided into cells
of parameters and frequencies, about as many as take as long as the cells of parameters since the last such division.  If 32
cells of parameters have not proved a part of the box, it is divided as a whole.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import inf

import numpy as np

from boomctl.analysis.box.level import LoopPart
from boomctl.analysis.box.polynomials import Cell
from boomctl.analysis.box.response_cells import ResponseCells
from boomctl.arrays import Array
from boomctl.progress import tell

COST_RATIO = 150  # Run time of a cell of parameters, relative to one of parameters and frequencies.
# Largest number of parameters for cells of parameters and frequencies.  Their run time grows with the square of this number;
# beyond about 16 it is that of a cell of parameters alone.
_MOST_PARAMETERS = 16
_HALVINGS = 5  # Halvings of a cell between two trials with cells of parameters and frequencies.
_TRIAL = 4  # Budget of such a trial, in units of `COST_RATIO` cells of parameters and frequencies.
_BEFORE_WHOLE = 32  # Cells of parameters before the trial of a whole part.
_WHOLE = 0.5  # Budget of the trial of a whole part, as a fraction of the limit, over the number of parameters.


@dataclass
class Statement:
    """Statement about a loop at every point of a box: here stability, which a gain below any level implies.

    Attributes
    ----------
    stable : callable
        Returns whether the loop, closed independently of the proof, is stable at a point.
    level : float
        Upper limit of the gain; ``inf`` once the statement is known not to hold.
    """

    stable: Callable[[Array], bool]
    level: float = 1.0

    def met(self, gain: float, point: Array) -> None:
        """Register the largest gain of a batch and its point, which may raise the level."""

    def holds(self, point: Array) -> bool:
        """Return whether the loop is stable at a point where a proof failed; may also raise the level."""
        return self.stable(point)

    def looser(self) -> bool:
        """Raise the level when the cell budget is exhausted; return whether it was raised."""
        return False


@dataclass(frozen=True)
class BoxProof:
    """Result of a proof over a box.

    Attributes
    ----------
    proved : bool
        True if the statement holds at every point.
    parameter_cells, frequency_cells : int
        Numbers of cells proved, of parameters, and of parameters and frequencies.
    refuted : ndarray or None
        A point at which the loop is not stable, or None.
    left : ndarray or None
        Midpoint of a cell of parameters that was not proved, or None.
    """

    proved: bool
    parameter_cells: int = 0
    frequency_cells: int = 0
    refuted: Array | None = None
    left: Array | None = None

    @property
    def method(self) -> str:
        """Numbers of cells of each kind that proved the statement; empty if it is not proved."""
        kinds = ((self.parameter_cells, "of parameters"), (self.frequency_cells, "of parameters and frequencies"))
        return " and ".join(f"{count} {kind}" for count, kind in kinds if count) if self.proved else ""


def prove_box(parts: Sequence[LoopPart], statement: Statement, limit: float) -> BoxProof:
    """Prove a statement over a box.

    Parameters
    ----------
    parts : sequence of LoopPart
        Parts that cover the box.
    statement : Statement
        The statement to prove.
    limit : float
        Largest number of cells of parameters in each part at a level, at least one; cells narrower than the part divided by
        ``limit`` are not halved.
    """
    parameter_cells, frequency_cells = 0, 0
    for part in parts:
        result = _prove_part(part, statement, limit)
        parameter_cells += result.parameter_cells
        frequency_cells += result.frequency_cells
        if not result.proved:
            return replace(result, parameter_cells=parameter_cells, frequency_cells=frequency_cells)
    return BoxProof(True, parameter_cells, frequency_cells)


def _prove_part(part: LoopPart, statement: Statement, limit: float) -> BoxProof:
    """Prove a statement over a part of a box."""
    size, parameter_cells, frequency_cells = len(part.cell.middle), 0, 0
    waiting, visited, level, divided = [Cell.whole(size)], 0, statement.level, False
    prove, responses = part.prover(level), None

    def met(gain: float, point: Array) -> float:
        statement.met(gain, part.cell.point(point))
        return statement.level

    while waiting:
        tell("cells of the box proved", parameter_cells + frequency_cells)
        cell, visited = waiting.pop(), visited + 1
        axis = prove(cell)
        if axis is None:
            parameter_cells += 1
            continue
        middle = part.cell.point(cell.middle)
        if not statement.holds(middle):
            return BoxProof(False, parameter_cells, frequency_cells, middle)
        # Bisection: about twice as many cells are visited as are proved.
        last = cell.reach.max() < 1.0 / limit or visited >= 2.0 * limit
        whole = visited >= _BEFORE_WHOLE and not (divided or last)
        if whole or last or round(-np.log2(cell.reach.prod())) % _HALVINGS == _HALVINGS - 1:
            budget, divided = (_WHOLE * limit / size, True) if whole else (min(_TRIAL, limit), divided)
            most = int(budget * COST_RATIO) * (size <= _MOST_PARAMETERS)
            responses = responses or ResponseCells.of(part)
            count = responses.prove(Cell.whole(size) if whole else cell, statement.level, most, met)
            if statement.level == inf:
                return BoxProof(False, parameter_cells, frequency_cells)
            if count is not None and whole:
                return BoxProof(True, 0, count)
            if count is not None:
                frequency_cells += count
                continue
        if not last:
            waiting += cell.halves(axis)
        elif statement.looser():
            waiting, visited = [*waiting, cell], 0
        else:
            return BoxProof(False, parameter_cells, frequency_cells, None, middle)
        if statement.level > level:
            level = statement.level
            prove = part.prover(level)
    return BoxProof(True, parameter_cells, frequency_cells)
