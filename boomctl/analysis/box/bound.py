"""A level that no singular value of a loop reaches anywhere in a box: raised where a worse point is met, proved in cells."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from math import inf

import numpy as np

from boomctl.analysis.box.level import DrivenLoops
from boomctl.analysis.box.prove import LOOKED_AT
from boomctl.analysis.box.response_cells import WORTH
from boomctl.analysis.box.robustness import pattern_search
from boomctl.analysis.box.sampled_level import SampledLoops
from boomctl.analysis.box.zero_exclusion import Cell, value_at
from boomctl.analysis.norm import NormCertificate, matrices_norm
from boomctl.arrays import Array
from boomctl.progress import Tell

LARGEST = 1.0  # a tolerance beyond which a bound says nothing (a choice)
LOST = "the loop is unstable there, or undamped"
_LOOSER = (1.0, 10.0, 100.0)  # times the tolerance: levels tried in turn, the next where cells run out (a choice)
_RESPONSES, _PENCIL = "cells of parameters and frequencies", "cells of parameters"
# Ways to a proof at a level, in the order taken, and how many of the cells that are allowed: strongly coupled poles are for
# the response, many lightly damped ones for the pencil, and which a loop is shows soon (shares: choices)
_ROUNDS = ((_RESPONSES, 0.05), (_PENCIL, 0.2), (_RESPONSES, 0.5), (_PENCIL, 1.0), (_RESPONSES, 0.5))
_FIRST = 60_000  # cells that the rounds share at first, if more are allowed (the default of `worst_case`)
_LATER = (
    8  # times as many whenever they come round again (a choice: a way that needs few is not kept waiting by the other)
)
_CHECKED = 8  # points drawn in the box at which a bound is tried again (a choice)
_COMPARED = 3  # points drawn at which the loops that are proved are compared with those closed anew (a choice)
_HARDLY = 1e-3  # damping ratio below which, if little was proved at first, it is given up (a choice)
_FUTILE = 1e-2  # share of the box that is little: it would take a hundred times as many cells (a choice)
_SAME = 1e-6  # relative distance of norms, as far as certified, by two routes that are the same (a choice)


@dataclass(frozen=True)
class Bound:
    """A level below which the norm was proved to lie in all cells, and the worst point met."""

    level: float
    cells: int
    delta: Array
    reason: str = ""


def bounded(
    loops: DrivenLoops | SampledLoops,
    at: Callable[[Array], NormCertificate],
    delta: Array,
    *,
    tolerance: float,
    limit: int,
    tell: Tell,
    least: float = 0.0,
    spent: int = 0,
) -> Bound:
    """Prove a level over the whole box.

    Parameters
    ----------
    loops : DrivenLoops or SampledLoops
        The loops that are proved.
    at : callable
        The norm at a point, from the loop closed anew.
    delta : ndarray
        The worst point found.
    tolerance : float
        How far the level may lie above the worst point, relative.
    limit : int
        Most cells of parameters and frequencies at a level.
    tell : callable
        Is told how far it is.
    least : float
        A norm that is known elsewhere: no lower level is asked for.
    spent : int
        How many of the cells allowed were needed elsewhere.
    """
    hindered = _hindrance(loops, at, delta)
    if hindered:
        return Bound(inf, 0, delta, hindered)
    size, lower, gap, level = len(delta), max(at(delta).lower, least), tolerance, inf

    def seen(gain: float, point: Array) -> float:
        nonlocal delta, lower, level
        if gain > lower * (1.0 + _SAME):
            delta, lower, _ = pattern_search(lambda d: at(d).lower, size, 1.0, point)
            if lower * (1.0 + 0.5 * gap) > level:
                level = lower * (1.0 + gap)
        return level

    responses, needed = loops.responses(size), 0.0
    frontier, waiting = responses.start(), [Cell(np.zeros(size), np.ones(size))]
    counts: dict[str, int] = dict.fromkeys((_RESPONSES, _PENCIL), 0)
    done = 1.0  # share of the box that the pencil has proved
    for looser in _LOOSER:
        gap = min(tolerance * looser, LARGEST)
        level = max(lower, loops.at_infinity) * (1.0 + gap)
        for way, most in _rounds(limit) if isinstance(loops, DrivenLoops) else ((_RESPONSES, limit),):
            if isinstance(loops, SampledLoops):
                frontier, more, needed = responses.prove_if_near(frontier, level, max(1, limit - spent), seen, tell)
                left, middles = len(frontier), list(frontier.middle[-LOOKED_AT:])
            elif way == _RESPONSES:
                frontier, more = responses.prove(frontier, level, max(1, int(most)), seen, tell)
                left, middles = len(frontier), list(frontier.middle[-LOOKED_AT:])
            else:
                waiting, more = _by_pencil(loops, waiting, level, max(1, int(most / WORTH)), at, seen, tell)
                left, middles = len(waiting), [cell.middle for cell in waiting[-LOOKED_AT:]]
                done = 1.0 - sum(float(np.prod(cell.reach)) for cell in waiting)
            counts[way] += more
            if left == 0 and level < inf:
                _checked(at, level, size)
                return Bound(level, counts[way], delta)
            lost, hardly = _poles_at(loops, [delta, *middles])
            if lost is not None:
                return Bound(inf, counts[way], lost, LOST)
            if done < _FUTILE and hardly:
                return Bound(
                    inf, counts[way], delta, f"hardly damped, {hardly}: it would take far more than {limit} cells"
                )
    about = f"about {needed:.0e} cells, more than" if needed > limit else "more than"
    return Bound(inf, max(counts.values()), delta, f"it would take {about} max_cells = {limit} at {level:.5g}")


def bounded_in_parts(
    parts: Sequence[SampledLoops],
    at: Callable[[Array], NormCertificate],
    delta: Array,
    *,
    tolerance: float,
    limit: int,
    tell: Tell,
) -> Bound:
    """Prove a level over a box of which each part has its own loops; as `bounded`."""
    level, cells = 0.0, 0
    for part in parts:

        def here(point: Array, part: SampledLoops = part) -> NormCertificate:
            return at(part.place(point))

        known = at(delta).lower
        start = part.nearest(delta)
        found = bounded(part, here, start, tolerance=tolerance, limit=limit, tell=tell, least=known, spent=cells)
        if here(found.delta).lower > known:
            delta = part.place(found.delta)
        level, cells = max(level, found.level), cells + found.cells
        if found.reason:
            return Bound(inf, cells, delta, found.reason)
    return Bound(level, cells, delta)


def _poles_at(loops: DrivenLoops | SampledLoops, points: list[Array]) -> tuple[Array | None, str]:
    """Return a point at which the loop is not stable, if there is one, and, if it is hardly damped, its least damping."""
    found = [(point, value_at(loops.pencils, point)) for point in points]
    unstable = [point for point, here in found if not here.stable]
    if unstable:
        return unstable[0], ""
    poles = np.concatenate([here.poles for _, here in found])
    pole = complex(poles[np.argmax(np.real(poles) / np.abs(poles))])
    if -pole.real >= _HARDLY * abs(pole):
        return None, ""
    return None, f"a damping ratio of {-pole.real / abs(pole):.2g} at {abs(pole):.4g} rad/s"


def _rounds(limit: int) -> Iterator[tuple[str, float]]:
    """Yield the ways in turn, each with how many cells it may take."""
    allowed = min(limit, _FIRST)
    while True:
        yield from ((way, share * allowed) for way, share in _ROUNDS)
        if allowed == limit:
            return
        allowed = min(_LATER * allowed, limit)


def _by_pencil(
    loops: DrivenLoops,
    waiting: list[Cell],
    level: float,
    limit: int,
    at: Callable[[Array], NormCertificate],
    seen: Callable[[float, Array], float],
    tell: Tell,
) -> tuple[list[Cell], int]:
    """Prove a level by the even pencil; return the cells left and how many were proved."""
    even, tried, proved = loops.even(level), 0, 0
    while waiting and tried < limit and level < inf:
        tried += 1
        tell("cells of the box proved", proved)
        cell = waiting[-1]
        found = loops.prove(even, cell)
        waiting = waiting[:-1]
        if found.proved:
            proved += 1
            continue
        raised = seen(at(cell.middle).lower, cell.middle)
        if level < raised < inf:
            even = loops.even(raised)
        level = raised
        waiting += cell.halves(found.axis)
    return waiting, proved


def _checked(at: Callable[[Array], NormCertificate], level: float, size: int) -> None:
    """Refuse a level that a norm at a point drawn exceeds."""
    drawn = np.random.default_rng(0).uniform(-1.0, 1.0, (_CHECKED, size))
    if max(at(point).lower for point in drawn) > level:
        raise ArithmeticError(f"worst_case: a norm above the level proved, {level:.9g}, at a point drawn")


def _hindrance(loops: DrivenLoops | SampledLoops, at: Callable[[Array], NormCertificate], delta: Array) -> str:
    """Return why there is no bound to be looked for; empty where there may be one."""
    if not all(value_at(loops.pencils, point).stable for point in (delta, np.zeros(len(delta)))):
        return "a pole that does not decay hides from these signals"
    drawn = np.random.default_rng(1).uniform(-1.0, 1.0, (_COMPARED, len(delta)))
    for point in (delta, np.zeros(len(delta)), *drawn):  # the loops that are proved are those whose norms were found
        here, there = at(point), matrices_norm(loops.at(point))
        known = [(x.lower, x.upper if x.certified else x.lower) for x in (here, there)]
        if max(low for low, _ in known) > min(high for _, high in known) * (1.0 + _SAME):
            return f"two routes to the norm differ: {here.lower:.9g} and {there.lower:.9g}"
    return "" if at(delta).lower > 0.0 else "nothing comes through at any point tried"
