"""Proof that a loop is stable over a box: by few, dear cells of parameters, and what they leave by many, cheap ones.

Cells of parameters (:mod:`boomctl.analysis.box.zero_exclusion`) see all frequencies at once, and bear many lightly damped
poles; cells of parameters and frequencies (:mod:`boomctl.analysis.box.response_cells`) bear strongly coupled ones and many
parameters.  Both show that no pole is on the axis anywhere in them.  A box is connected, so that it is stable throughout if
it is at one point.  Which way a loop is for shows soon: each tells from a taste how many cells it would take.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import inf

import numpy as np

from boomctl.analysis.box.response_cells import HOPELESS, ROUNDING, WORTH, Frontier, ResponseCells
from boomctl.analysis.box.zero_exclusion import Cell, CellProof, Terms, about, prove_cell
from boomctl.arrays import Array
from boomctl.progress import Tell

LOOKED_AT = 16  # cells left over, the hardest, in whose middles the poles are looked at (a choice)
# share of the cells allowed that either way tastes first, the dear ones before the cheap ones (measured)
_TASTES = (0.1, 0.02)

_ON = 2.0 / 3.0  # share of what waited that may wait after a taste if the dear ones are to go on at once (measured)
_RATE = 40.0  # cheap cells that take as long as a dear one, to tell which way ends sooner (measured: 17 to 100)


@dataclass(frozen=True)
class Part:
    """A part of a box and the loop over it, a polynomial of parameters that run from -1 to 1 across the part.

    ``missed`` is by how much entries of its matrices may be off, none where it is exact.
    """

    cell: Cell
    terms: Terms
    missed: Array | None = None

    @classmethod
    def of(cls, terms: Terms, cell: Cell) -> "Part":
        """Return the part of a box that is a cell of it."""
        near = about(terms, cell.middle)
        scaled = {power: (float(np.prod(cell.reach[list(power)])), x) for power, x in near.items()}
        return cls(cell, {power: type(x)(share * x.E, share * x.A) for power, (share, x) in scaled.items()})

    def place(self, delta: Array) -> Array:
        """Return where in the box a point of this part is."""
        return self.cell.middle + self.cell.reach * delta

    def prove(self, cell: Cell) -> CellProof:
        """Try to prove a cell of parameters."""
        if self.missed is None:
            return prove_cell(self.terms, cell)
        sizes = sum((np.abs(x.E) + np.abs(x.A) for x in self.terms.values()), np.zeros_like(self.missed))
        return prove_cell(self.terms, cell, self.missed + ROUNDING * sizes)

    def responses(self) -> ResponseCells:
        """Return what proves cells of parameters and frequencies: of a loop that nothing drives and nobody judges."""
        E, A = ({power: getattr(x, letter) for power, x in self.terms.items()} for letter in "EA")
        n = len(E[()])
        none = np.zeros((n, 1))
        missed = None if self.missed is None else (self.missed, none)
        return ResponseCells.of(E, A, {(): none}, none.T, np.zeros((1, 1)), len(self.cell.middle), missed=missed)


@dataclass(frozen=True)
class BoxProof:
    """What is known of a box.

    Attributes
    ----------
    proved : bool
        Whether the loop is stable at every point.
    dear, cheap : int
        Cells proved, of parameters, and of parameters and frequencies.
    unstable : ndarray or None
        A point at which it is not stable, if one was met.
    left : ndarray or None
        The middle of a cell of parameters that resisted.
    small : bool
        Whether that is as small as cells get.
    """

    proved: bool
    dear: int = 0
    cheap: int = 0
    unstable: Array | None = None
    left: Array | None = None
    small: bool = False

    @property
    def path(self) -> str:
        """How many cells of which kind proved it; empty where it is not proved."""
        kinds = ((self.dear, "of parameters"), (self.cheap, "of parameters and frequencies"))
        return " and ".join(f"{count} {kind}" for count, kind in kinds if count) if self.proved else ""


@dataclass(frozen=True)
class _Cover:
    """Cells of parameters that wait, how many were proved and tried, an unstable point met, whether there is no going on."""

    waiting: tuple[Cell, ...]
    proved: int = 0
    tried: int = 0
    unstable: Array | None = None
    over: bool = False

    @property
    def left(self) -> float:
        """Share of the part that waits."""
        return float(sum(np.prod(cell.reach) for cell in self.waiting))


def prove_box(parts: Sequence[Part], stable: Callable[[Array], bool], limit: int, tell: Tell) -> BoxProof:
    """Prove that a loop is stable over a box.

    Parameters
    ----------
    parts : sequence of Part
        What covers the box.
    stable : callable
        Whether the loop, closed anew, is stable at a point of the box.
    limit : int
        Most cells of parameters in each part; of those with frequencies there may be `WORTH` times as many.
    tell : callable
        Is told how many cells are proved.
    """
    found = BoxProof(True)
    for part in parts:
        here = _proved(part, stable, limit, tell)
        found = replace(here, dear=found.dear + here.dear, cheap=found.cheap + here.cheap)
        if not found.proved:
            break
    return found


def prove_by_pencil(parts: Sequence[Part], stable: Callable[[Array], bool], limit: int, tell: Tell) -> BoxProof:
    """Prove it by cells of parameters alone, as `prove_box`."""
    dear = 0
    for part in parts:
        cover = _covered(part, stable, _start(part), limit, inf, tell)
        dear += cover.proved
        if cover.waiting or cover.unstable is not None:
            return BoxProof(False, dear, unstable=cover.unstable)
    return BoxProof(True, dear)


def _start(part: Part) -> _Cover:
    size = len(part.cell.middle)
    return _Cover((Cell(np.zeros(size), np.ones(size)),))


def _covered(
    part: Part, stable: Callable[[Array], bool], cover: _Cover, limit: int, tries: float, tell: Tell
) -> _Cover:
    """Go on with cells of parameters, with so many proved and waiting, or so many tried, at most."""
    waiting, proved, tried = list(cover.waiting), cover.proved, cover.tried
    while waiting and tried < tries:
        tell("cells of the box proved", proved)
        cell, tried = waiting[-1], tried + 1
        found = part.prove(cell)
        if found.proved:
            waiting, proved = waiting[:-1], proved + 1
            continue
        middle = part.place(cell.middle)
        if not found.stable and not stable(middle):
            return _Cover(tuple(waiting), proved, tried, middle)
        if proved + len(waiting) > limit or cell.reach.max() < 1.0 / limit:
            return _Cover(tuple(waiting), proved, tried, over=True)
        waiting = [*waiting[:-1], *cell.halves(found.axis)]
    return _Cover(tuple(waiting), proved, tried)


def _proved(part: Part, stable: Callable[[Array], bool], limit: int, tell: Tell) -> BoxProof:
    """Prove a part: taste both ways, go on with the one that is to end sooner, then with the other."""
    cheap = WORTH * limit
    cover, before = _start(part), inf
    while cover.waiting and cover.unstable is None and not cover.over and cover.left <= _ON * before:
        before = cover.left
        cover = _covered(part, stable, cover, limit, cover.tried + max(1, int(_TASTES[0] * limit)), tell)
    if cover.unstable is not None or not cover.waiting:
        return BoxProof(cover.unstable is None, cover.proved, unstable=cover.unstable)
    dear, cells = cover.proved, part.responses()
    frontier, proved = _responded(cells, cells.start(cover.waiting), max(1, int(_TASTES[1] * cheap)), tell)
    if not len(frontier):
        return BoxProof(True, dear, proved)
    needed = cells.still_needed(frontier, 1.0)
    sooner = needed * (1.0 - cover.left) < _RATE * cover.tried * cover.left
    for way in (0, 1) if sooner else (1, 0):
        if way == 0 and needed <= HOPELESS * cheap:
            frontier, more = _responded(cells, frontier, cheap, tell)
            proved += more
            if not len(frontier):
                return BoxProof(True, dear, proved)
        elif way == 1 and not cover.over:
            cover = _covered(part, stable, cover, limit, inf, tell)
            if cover.unstable is not None or not cover.waiting:
                return BoxProof(cover.unstable is None, cover.proved, unstable=cover.unstable)
    middles = (part.place(middle) for middle in frontier.middle[-LOOKED_AT:])
    unstable = next((middle for middle in middles if not stable(middle)), None)
    last = cover.waiting[-1]
    return BoxProof(False, cover.proved, proved, unstable, part.place(last.middle), last.reach.max() < 1.0 / limit)


def _responded(cells: ResponseCells, frontier: Frontier, limit: int, tell: Tell) -> tuple[Frontier, int]:
    """Go on with cells of parameters and frequencies: nothing drives the loop, and any level shows that poles stay away."""
    return cells.prove(frontier, 1.0, limit, lambda gain, point: 1.0, tell)
