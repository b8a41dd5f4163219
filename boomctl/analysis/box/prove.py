"""Proof of a statement about a loop over a box: that it is stable there, or that its gain stays below a level.

Cells of parameters (:mod:`boomctl.analysis.box.zero_exclusion`) see all frequencies at once, and bear many lightly damped
poles; cells of parameters and frequencies (:mod:`boomctl.analysis.box.response_cells`) bear strongly coupled ones and many
parameters.  Both show that no pole, or no singular value at the level, is on the axis anywhere in them.  A box is connected,
so that the statement holds throughout if it does at one point.

One rule: a cell of parameters is proved or halved.  At every fifth halving, and before it is given up, it is tried by cells
of parameters and frequencies, as many as take as long as the cells of parameters since.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import inf
from typing import Protocol

import numpy as np

from boomctl.analysis.box.response_cells import ROUNDING, ResponseCells
from boomctl.analysis.box.zero_exclusion import Cell, CellProof, Terms, about, prove_pencil, value_at
from boomctl.arrays import Array
from boomctl.progress import tell

WORTH = 150  # cells of parameters and frequencies that take as long as one of parameters alone (measured: 100 to 300)
# Parameters up to which cells of parameters and frequencies are tried: what one costs grows with the square of their number,
# and beyond some 16 it is that of a cell of parameters alone.
_MOST_PARAMETERS = 16
_HALVINGS = 5  # Of a cell until those of frequencies are tried: one of 32 cells wastes them (measured: 3 to 5).
_SHARE = 4  # times `WORTH` that are tried then: as long as the cells of parameters since take (measured: 1 to 4)


class Part(Protocol):
    """A part of a box and the loop over it, a polynomial of parameters that run from -1 to 1 across the part."""

    @property
    def cell(self) -> Cell:
        """The part."""
        ...

    def prover(self, level: float) -> Callable[[Cell], CellProof]:
        """Return what tries to prove a level in cells of parameters."""
        ...

    def responses(self) -> ResponseCells:
        """Return what proves cells of parameters and frequencies."""
        ...


@dataclass(frozen=True)
class Statement:
    """What is to be proved of a loop at every point of a box.

    Attributes
    ----------
    level : callable
        Returns what no gain may reach; ``inf`` once it is known not to hold.
    met : callable
        Is told the largest gain met and its point, and may raise the level.
    holds : callable
        Whether the loop, closed anew, is stable at a point where a proof failed; may raise the level, too.
    looser : callable
        Raises the level where cells run out; whether it did.
    """

    level: Callable[[], float]
    met: Callable[[float, Array], None]
    holds: Callable[[Array], bool]
    looser: Callable[[], bool]

    @classmethod
    def stable(cls, at: Callable[[Array], bool]) -> "Statement":
        """Return that a loop is stable: nothing drives it, and any level shows that poles stay away from the axis."""
        return cls(lambda: 1.0, lambda gain, point: None, at, lambda: False)


@dataclass(frozen=True)
class StablePart:
    """A part of a box and a loop that nothing drives.

    ``missed`` is by how much entries of its matrices may be off, none where it is exact.
    """

    cell: Cell
    terms: Terms
    missed: Array | None = None

    @classmethod
    def of(cls, terms: Terms, cell: Cell) -> "StablePart":
        """Return the part of a box that is a cell of it."""
        near = about(terms, cell.middle)
        scaled = {power: (float(np.prod(cell.reach[list(power)])), x) for power, x in near.items()}
        return cls(cell, {power: type(x)(share * x.E, share * x.A) for power, (share, x) in scaled.items()})

    def prover(self, level: float) -> Callable[[Cell], CellProof]:
        """Return what tries to prove that no pole touches the axis anywhere in a cell of parameters."""
        missed = with_rounding(self.terms, self.missed)
        return lambda cell: prove_pencil(self.terms, cell, value_at(self.terms, cell.middle).stable, missed)

    def responses(self) -> ResponseCells:
        """Return what proves cells of parameters and frequencies: of a loop that nothing drives and nobody judges."""
        E, A = ({power: getattr(x, letter) for power, x in self.terms.items()} for letter in "EA")
        n = len(E[()])
        none = np.zeros((n, 1))
        missed = None if self.missed is None else (self.missed, none)
        return ResponseCells.of(E, A, {(): none}, none.T, np.zeros((1, 1)), len(self.cell.middle), missed=missed)


def with_rounding(terms: Terms, missed: Array | None) -> Array | None:
    """Return by how much entries of a pencil may be off, rounding of sums included."""
    if missed is None:
        return None
    return missed + ROUNDING * sum((np.abs(x.E) + np.abs(x.A) for x in terms.values()), np.zeros_like(missed))


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
    small : bool
        Whether that is as small as cells get.
    """

    proved: bool
    dear: int = 0
    cheap: int = 0
    refuted: Array | None = None
    left: Array | None = None
    small: bool = False

    @property
    def method(self) -> str:
        """How many cells of which kind proved it; empty where it is not proved."""
        kinds = ((self.dear, "of parameters"), (self.cheap, "of parameters and frequencies"))
        return " and ".join(f"{count} {kind}" for count, kind in kinds if count) if self.proved else ""


def prove_box(parts: Sequence[Part], statement: Statement, limit: float) -> BoxProof:
    """Prove a statement over a box.

    Parameters
    ----------
    parts : sequence of Part
        What covers the box.
    statement : Statement
        What is to be proved.
    limit : float
        Most cells of parameters in each part at a level, one at least; none is smaller than that share of the part.
    """
    result = BoxProof(True)
    for part in parts:
        here = _proved(part, statement, limit)
        result = replace(here, dear=result.dear + here.dear, cheap=result.cheap + here.cheap)
        if not result.proved:
            break
    return result


def _proved(part: Part, statement: Statement, limit: float) -> BoxProof:
    """Prove a part: cells that wait are proved in either way, or halved."""
    size, responses = len(part.cell.middle), None
    most = int(min(_SHARE, limit) * WORTH)

    def met(gain: float, point: Array) -> float:
        statement.met(gain, part.cell.middle + part.cell.reach * point)
        return statement.level()

    waiting, tried, dear, cheap = [Cell(np.zeros(size), np.ones(size))], 0, 0, 0
    level = statement.level()
    prove = part.prover(level)
    while waiting:
        tell("cells of the box proved", dear + cheap)
        cell, tried = waiting.pop(), tried + 1
        result = prove(cell)
        if result.proved:
            dear += 1
            continue
        middle = part.cell.middle + part.cell.reach * cell.middle
        if not statement.holds(middle):
            return BoxProof(False, dear, cheap, middle)
        small = cell.reach.max() < 1.0 / limit
        last = small or tried >= 2.0 * limit  # halves of halves: twice as many are tried as are proved
        if size <= _MOST_PARAMETERS and (last or round(-np.log2(cell.reach.prod())) % _HALVINGS == _HALVINGS - 1):
            responses = responses or part.responses()
            left, count = responses.prove(responses.start(cell), statement.level(), most, met)
            if statement.level() == inf:
                return BoxProof(False, dear, cheap)
            if not len(left):
                cheap += count
                continue
        if not last:
            waiting += cell.halves(result.axis)
        elif statement.looser():
            waiting, tried = [*waiting, cell], 0
        else:
            return BoxProof(False, dear, cheap, None, middle, small)
        if statement.level() > level:
            level = statement.level()
            prove = part.prover(level)
    return BoxProof(True, dear, cheap)
