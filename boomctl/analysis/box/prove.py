"""Proof of a statement about a loop over a box: that it is stable there, or that its gain stays below a level.

Cells of parameters (:mod:`boomctl.analysis.box.zero_exclusion`) see all frequencies at once, and bear many lightly damped
poles; cells of parameters and frequencies (:mod:`boomctl.analysis.box.response_cells`) bear strongly coupled ones and many
parameters.  Both show that no pole, or no singular value at the level, is on the axis anywhere in them.  A box is connected,
so that the statement holds throughout if it does at one point.

One rule: a cell of parameters is proved or halved.  At every fifth halving, and before it is given up, it is tried by cells
of parameters and frequencies, as many as take as long as the cells of parameters since.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from math import inf

import numpy as np

from boomctl.analysis.box.level import LoopPart
from boomctl.analysis.box.polynomials import Cell
from boomctl.analysis.box.response_cells import ResponseCells
from boomctl.arrays import Array
from boomctl.progress import tell

WORTH = 150  # cells of parameters and frequencies that take as long as one of parameters alone (measured: 100 to 300)
# Parameters up to which cells of parameters and frequencies are tried: what one costs grows with the square of their number,
# and beyond some 16 it is that of a cell of parameters alone.
_MOST_PARAMETERS = 16
_HALVINGS = 5  # Of a cell until those of frequencies are tried: one of 32 cells wastes them (measured: 3 to 5).
_SHARE = 4  # times `WORTH` that are tried then: as long as the cells of parameters since take (measured: 1 to 4)


@dataclass
class Statement:
    """What is to be proved of a loop at every point of a box: here that it is stable, which a gain below any level shows.

    Attributes
    ----------
    stable : callable
        Whether the loop, closed anew, is stable at a point.
    level : float
        What no gain may reach; ``inf`` once the statement is known not to hold.
    """

    stable: Callable[[Array], bool]
    level: float = 1.0

    def met(self, gain: float, point: Array) -> None:
        """Take note of the largest gain met and its point, which may raise the level."""

    def holds(self, point: Array) -> bool:
        """Return whether the loop is stable at a point where a proof failed; may raise the level, too."""
        return self.stable(point)

    def looser(self) -> bool:
        """Raise the level where cells run out; return whether it did."""
        return False


@dataclass(frozen=True)
class BoxProof:
    """What is known of a box.

    Attributes
    ----------
    proved : bool
        Whether the statement holds at every point.
    dear, cheap : int
        Cells proved, of parameters, and of parameters and frequencies.
    refuted : ndarray or None
        A point at which the loop is not stable, if one was met.
    left : ndarray or None
        The middle of a cell of parameters that resisted.
    """

    proved: bool
    dear: int = 0
    cheap: int = 0
    refuted: Array | None = None
    left: Array | None = None

    @property
    def method(self) -> str:
        """How many cells of which kind proved it; empty where it is not proved."""
        kinds = ((self.dear, "of parameters"), (self.cheap, "of parameters and frequencies"))
        return " and ".join(f"{count} {kind}" for count, kind in kinds if count) if self.proved else ""


def prove_box(parts: Sequence[LoopPart], statement: Statement, limit: float) -> BoxProof:
    """Prove a statement over a box.

    Parameters
    ----------
    parts : sequence of LoopPart
        What covers the box.
    statement : Statement
        What is to be proved.
    limit : float
        Most cells of parameters in each part at a level, one at least; none is smaller than that share of the part.
    """
    dear, cheap = 0, 0

    def met(part: LoopPart, gain: float, point: Array) -> float:
        statement.met(gain, part.cell.point(point))
        return statement.level

    for part in parts:
        waiting, tried, level = [Cell.whole(len(part.cell.middle))], 0, statement.level
        prove, responses = part.prover(level), None
        while waiting:
            tell("cells of the box proved", dear + cheap)
            cell, tried = waiting.pop(), tried + 1
            axis = prove(cell)
            if axis is None:
                dear += 1
                continue
            middle = part.cell.point(cell.middle)
            if not statement.holds(middle):
                return BoxProof(False, dear, cheap, middle)
            # halves of halves: twice as many are tried as are proved
            last = cell.reach.max() < 1.0 / limit or tried >= 2.0 * limit
            if last or round(-np.log2(cell.reach.prod())) % _HALVINGS == _HALVINGS - 1:
                most = int(min(_SHARE, limit) * WORTH) * (len(middle) <= _MOST_PARAMETERS)
                responses = responses or ResponseCells.of(part)
                count = responses.prove(cell, statement.level, most, partial(met, part))
                if statement.level == inf:
                    return BoxProof(False, dear, cheap)
                if count is not None:
                    cheap += count
                    continue
            if not last:
                waiting += cell.halves(axis)
            elif statement.looser():
                waiting, tried = [*waiting, cell], 0
            else:
                return BoxProof(False, dear, cheap, None, middle)
            if statement.level > level:
                level = statement.level
                prove = part.prover(level)
    return BoxProof(True, dear, cheap)
