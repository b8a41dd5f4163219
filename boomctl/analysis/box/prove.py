"""Proof of a statement about a loop over a box: that it is stable there, or that its gain stays below a level.

Cells of parameters (:mod:`boomctl.analysis.box.zero_exclusion`) see all frequencies at once, and bear many lightly damped
poles; cells of parameters and frequencies (:mod:`boomctl.analysis.box.response_cells`) bear strongly coupled ones and many
parameters.  Both show that no pole, or no singular value at the level, is on the axis anywhere in them.  A box is connected,
so that the statement holds throughout if it does at one point.  Which way a loop is for shows soon: each tells from a taste
how many cells it would take.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import inf
from typing import Protocol

import numpy as np

from boomctl.analysis.box.response_cells import ROUNDING, Frontier, ResponseCells
from boomctl.analysis.box.zero_exclusion import Cell, CellProof, Terms, about, prove_pencil, value_at
from boomctl.arrays import Array
from boomctl.chebyshev import FEW_PARAMETERS
from boomctl.progress import tell

WORTH = 150  # cells of parameters and frequencies that take as long as one of parameters alone (measured: 100 to 300)
# share of the cells allowed that either way tastes first, the dear ones before the cheap ones (measured)
_TASTES = (0.1, 0.02)
# Parameters up to which cells of parameters and frequencies are tried: what one costs grows with the square of their number,
# and beyond some 16 it is that of a cell of parameters alone.
_MOST_PARAMETERS = 16
_ON = 2.0 / 3.0  # share of what waited that may wait after a taste if the dear ones are to go on at once (measured)
_LITTLE = 1e-2  # share of a part that counts as some progress at least: nothing is told from less (a choice)
_HOPELESS = 2.0  # times as many cheap cells as allowed: it is given up, for an estimate may be off by some (a choice)
# cheap cells that take as long as a dear one, to tell which way ends sooner (measured: 17 to 60, and dear ones are rather
# underestimated: the hardest come last)
_RATE = 100.0
_TURN = 0.25  # share of the cells allowed after which it is told anew which way ends sooner (a choice)
_LOOKED_AT = 16  # cells left over, the hardest, in whose middles the statement is tried (a choice)
# dear cells that the ways share at first, if more are allowed, and times as many whenever they come round again (choices:
# a way that needs few is not kept waiting by the other)
_FIRST, _LATER = 500, 8


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
    needed : float
        About how many cells of parameters and frequencies it would still take; infinite where it was not estimated.
    """

    proved: bool
    dear: int = 0
    cheap: int = 0
    refuted: Array | None = None
    left: Array | None = None
    small: bool = False
    needed: float = inf

    @property
    def method(self) -> str:
        """How many cells of which kind proved it; empty where it is not proved."""
        kinds = ((self.dear, "of parameters"), (self.cheap, "of parameters and frequencies"))
        return " and ".join(f"{count} {kind}" for count, kind in kinds if count) if self.proved else ""


@dataclass(frozen=True)
class _Cover:
    """Cells of parameters that wait, how many were proved and tried, a refuting point met, whether the last is too small."""

    waiting: tuple[Cell, ...]
    proved: int = 0
    tried: int = 0
    refuted: Array | None = None
    small: bool = False

    @property
    def left(self) -> float:
        """Share of the part that waits."""
        return float(sum(np.prod(cell.reach) for cell in self.waiting))

    @property
    def over(self) -> bool:
        """Whether there is nothing to go on with."""
        return not self.waiting or self.small or self.refuted is not None


def prove_box(parts: Sequence[Part], statement: Statement, limit: float) -> BoxProof:
    """Prove a statement over a box.

    Parameters
    ----------
    parts : sequence of Part
        What covers the box.
    statement : Statement
        What is to be proved.
    limit : float
        Most cells of parameters in each part at a level, one at least; of those with frequencies there may be `WORTH` times
        as many.
    """
    result = BoxProof(True)
    for part in parts:
        here = _proved(part, statement, limit)
        result = replace(here, dear=result.dear + here.dear, cheap=result.cheap + here.cheap)
        if not result.proved:
            break
    return result


def _proved(part: Part, statement: Statement, limit: float) -> BoxProof:
    """Prove a part: taste both ways, go on with the one that is to end sooner, told anew at each turn; shares grow."""
    size = len(part.cell.middle)
    few = size <= _MOST_PARAMETERS
    dear_taste = _TASTES[0] * (1.0 if few else (FEW_PARAMETERS / size) ** 2)
    cells, frontier, cheap = part.responses(), None, 0
    cover, allowed = _Cover((Cell(np.zeros(size), np.ones(size)),)), min(limit, _FIRST)
    while True:
        # Dear ones tried, cheap ones: of many parameters these cost as much, and there would be far more of them.
        most = max(1, int(2 * allowed)), max(1, int(WORTH * allowed)) if few else 0
        start, began, before = cover.tried, cover.left, inf
        cover = replace(cover, small=False)
        while not cover.over and cover.left <= _ON * before and cover.tried - start < most[0]:
            before = cover.left
            cover = _covered(part, statement, cover, allowed, max(1, int(dear_taste * allowed)))
        if cover.refuted is not None or not cover.waiting:
            return BoxProof(not cover.waiting, cover.proved, cheap, cover.refuted)
        frontier = cells.start(cover.waiting) if frontier is None else frontier
        if few:
            frontier, more = _responded(part, statement, cells, frontier, max(1, int(_TASTES[1] * most[1])))
            cheap += more
        tried = cover.tried - start
        to_go = tried * cover.left / max(began - cover.left, _LITTLE)
        needed = (cells.still_needed(frontier, statement.level()) if few else inf) if len(frontier) else 0.0
        dear_left = 0 if cover.small or cover.left > began * (1.0 - _LITTLE) else most[0] - tried
        cheap_left = 0 if needed > _HOPELESS * most[1] else most[1]
        while len(frontier) and statement.level() < inf and (dear_left > 0 or cheap_left > 0):
            if cheap_left > 0 and (dear_left <= 0 or needed < _RATE * to_go):
                turn = min(cheap_left, max(1, int(_TURN * most[1])))
                frontier, more = _responded(part, statement, cells, frontier, turn)
                cheap, cheap_left = cheap + more, cheap_left - turn
                needed = cells.still_needed(frontier, statement.level()) if len(frontier) and cheap_left > 0 else needed
                cheap_left = 0 if needed > _HOPELESS * most[1] else cheap_left
                continue
            turn, before = min(dear_left, max(1, int(_TURN * most[0]))), cover.left
            cover = _covered(part, statement, cover, allowed, turn)
            if cover.refuted is not None or not cover.waiting:
                return BoxProof(not cover.waiting, cover.proved, cheap, cover.refuted)
            dear_left = 0 if cover.small else dear_left - turn
            to_go = turn * cover.left / max(before - cover.left, _LITTLE)
        if statement.level() == inf:
            return BoxProof(False, cover.proved, cheap)
        if not len(frontier):
            return BoxProof(True, cover.proved, cheap)
        middles = (part.cell.middle + part.cell.reach * middle for middle in frontier.middle[-_LOOKED_AT:])
        refuted = next((middle for middle in middles if not statement.holds(middle)), None)
        if refuted is not None or (allowed == limit and not statement.looser()):
            last = cover.waiting[-1]
            left = part.cell.middle + part.cell.reach * last.middle
            return BoxProof(False, cover.proved, cheap, refuted, left, cover.small, needed)
        allowed = min(limit, _FIRST if allowed == limit else _LATER * allowed)


def _covered(part: Part, statement: Statement, cover: _Cover, allowed: float, tries: int) -> _Cover:
    """Try so many more cells of parameters, none of them below the share of the part that one in so many would have."""
    waiting, proved, tried, level = list(cover.waiting), cover.proved, 0, statement.level()
    prove = part.prover(level)
    while waiting and tried < tries and level < inf:
        tell("cells of the box proved", proved)
        cell, tried = waiting[-1], tried + 1
        result = prove(cell)
        if result.proved:
            waiting, proved = waiting[:-1], proved + 1
            continue
        middle = part.cell.middle + part.cell.reach * cell.middle
        if not statement.holds(middle):
            return _Cover(tuple(waiting), proved, cover.tried + tried, middle)
        if statement.level() > level:
            level = statement.level()
            prove = part.prover(level)
        if cell.reach.max() < 1.0 / allowed:
            return _Cover(tuple(waiting), proved, cover.tried + tried, small=True)
        waiting = [*waiting[:-1], *cell.halves(result.axis)]
    return _Cover(tuple(waiting), proved, cover.tried + tried)


def _responded(
    part: Part, statement: Statement, cells: ResponseCells, frontier: Frontier, limit: int
) -> tuple[Frontier, int]:
    """Go on with cells of parameters and frequencies."""

    def met(gain: float, point: Array) -> float:
        statement.met(gain, part.cell.middle + part.cell.reach * point)
        return statement.level()

    return cells.prove(frontier, statement.level(), limit, met)
