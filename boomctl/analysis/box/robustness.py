"""Stability and performance of a loop over a whole box of real parameters: a proof, and the worst point found."""

from dataclasses import dataclass
from itertools import product
from math import inf
from typing import TYPE_CHECKING

import numpy as np

from boomctl.analysis.box.loop_pencil import Pencil, closed_pencil
from boomctl.analysis.box.zero_exclusion import Cell, prove_cell
from boomctl.analysis.loops import controller_of, feedback_loop
from boomctl.analysis.norm import NormCertificate, hinf_norm
from boomctl.arrays import Array
from boomctl.checks import known, names, positive, whole
from boomctl.lti.system import Lti, state_matrices
from boomctl.printing import sentence
from boomctl.structure.families import AffineFamily

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    import control

_CELLS = 500
_MARGIN_CELLS = 100
_STEPS = (0.5, 0.25, 0.125, 0.0625)


def _listed(values: dict[str, float]) -> str:
    return ", ".join(f"{name} = {value:.5g}" for name, value in values.items())


@dataclass(frozen=True)
class RobustStability:
    """Whether a loop is stable over a whole box of parameters.

    Attributes
    ----------
    proved : bool
        Stable at every point of the box: no pole touches the imaginary axis in any of the cells that cover it.
    unstable_at : dict or None
        Parameter values at which the loop is unstable, if such were found.
    cells : int
        Cells in which it was proved (or tried).
    abscissa : float
        Largest real part of the poles at the points tried [rad/s]; a lower bound of that over the box.
    worst : dict
        Parameter values at which that is so.
    """

    proved: bool
    unstable_at: dict[str, float] | None
    cells: int
    abscissa: float
    worst: dict[str, float]

    def __repr__(self) -> str:
        return sentence("RobustStability", self.render())

    def render(self) -> str:
        """Return the verdict as text."""
        if self.unstable_at is not None:
            return f"unstable at {_listed(self.unstable_at)} (pole with real part {self.abscissa:.4g} rad/s)"
        verdict = "stable over the whole box, proved" if self.proved else "stable where tried, but not proved,"
        found = f"real parts of poles found up to {self.abscissa:.4g} rad/s, at {_listed(self.worst)}"
        return f"{verdict} in {self.cells} cells; {found}"


@dataclass(frozen=True)
class StructuredMargin:
    """How many times the box may grow about its middle before the loop may become unstable.

    Attributes
    ----------
    stable_up_to : float
        Proved stable over the box enlarged by this factor.
    unstable_at : float
        Unstable at a point of the box enlarged by this factor; ``inf`` if none was found.
    unstable_values : dict or None
        That point.
    """

    stable_up_to: float
    unstable_at: float
    unstable_values: dict[str, float] | None

    @property
    def mu_lower(self) -> float:
        """Lower bound of the structured singular value for these real parameters, 1 being the box itself."""
        return 1.0 / self.unstable_at if self.unstable_at > 0.0 else inf

    @property
    def mu_upper(self) -> float:
        """Upper bound of it."""
        return 1.0 / self.stable_up_to if self.stable_up_to > 0.0 else inf

    def __repr__(self) -> str:
        return sentence("StructuredMargin", self.render())

    def render(self) -> str:
        """Return both bounds as text."""
        proved = f"proved stable over the box enlarged {self.stable_up_to:.4g} times"
        if self.unstable_values is None:
            return f"{proved}; no instability found"
        return f"{proved}; unstable at {self.unstable_at:.4g} times: {_listed(self.unstable_values)}"


@dataclass(frozen=True)
class WorstCase:
    """The largest certified H-infinity norm found over a box of parameters.

    Attributes
    ----------
    norm : NormCertificate
        At the worst point found; infinite where the loop is unstable.
    values : dict
        That point.
    nominal : NormCertificate
        In the middle of the box.
    evaluations : int
        Points tried.
    """

    norm: NormCertificate
    values: dict[str, float]
    nominal: NormCertificate
    evaluations: int

    def __repr__(self) -> str:
        return sentence("WorstCase", self.render())

    def render(self) -> str:
        """Return the worst case found as text."""
        where = f"at {_listed(self.values)} and {self.norm.omega:.4g} rad/s"
        middle = f"in the middle of the box {self.nominal.lower:.5g}"
        return f"H-infinity norm up to {self.norm.lower:.5g} {where}; {middle}; {self.evaluations} points tried"


@dataclass(frozen=True)
class _Pencils:
    centre: Pencil
    slopes: tuple[Pencil, ...]

    def at(self, delta: Array) -> Pencil:
        E = self.centre.E + np.tensordot(delta, np.array([s.E for s in self.slopes]), 1)
        A = self.centre.A + np.tensordot(delta, np.array([s.A for s in self.slopes]), 1)
        return Pencil(E, A)


def _pencils(family: AffineFamily, controller: "control.StateSpace") -> _Pencils:
    if not isinstance(family, AffineFamily):
        raise TypeError(f"family: expected AffineFamily, got {type(family).__name__}")
    K, model = controller_of(controller), family.centre
    for label in K.input_labels:
        known("plant output (it is an input of the controller)", label, model.outputs)
    for label in K.output_labels:
        known("plant input (it is an output of the controller)", label, model.inputs)
    matrices: Lti = state_matrices(K)

    def at(delta: Array) -> Pencil:
        return closed_pencil(family.at(delta).select(K.output_labels, K.input_labels), matrices)

    centre = at(np.zeros(family.size))
    ends = [at(unit) for unit in np.eye(family.size)]
    return _Pencils(centre, tuple(Pencil(end.E - centre.E, end.A - centre.A) for end in ends))


def robust_stability(
    family: AffineFamily, controller: "control.StateSpace", max_cells: int = _CELLS
) -> RobustStability:
    """Prove that a loop ``u = K y`` is stable over a whole box of parameters, or find where it is not.

    The box is halved until in each cell no pole can touch the imaginary axis (:mod:`boomctl.analysis.box.zero_exclusion`).

    Parameters
    ----------
    family : AffineFamily
        Its controls are forces.
    controller : control.StateSpace
        Its inputs are outputs of the family, its outputs inputs of it.
    max_cells : int
        After so many neither is claimed.

    Raises
    ------
    TypeError, ValueError
        Other kinds of system; names that do not meet; controls that impose motion.
    """
    limit = whole("max_cells", max_cells)
    pencils = _pencils(family, controller)
    return _searched(family, pencils, 1.0, limit)


def _searched(family: AffineFamily, pencils: _Pencils, factor: float, limit: int) -> RobustStability:
    delta, abscissa = _most_unstable(pencils, factor)
    if abscissa >= 0.0:
        return RobustStability(False, family.values(delta), 0, abscissa, family.values(delta))
    proved, cells, bad = _covered(pencils, factor, limit)
    if bad is not None:
        value = pencils.at(bad).abscissa
        return RobustStability(False, family.values(bad), cells, value, family.values(bad))
    return RobustStability(proved, None, cells, abscissa, family.values(delta))


def _covered(pencils: _Pencils, factor: float, limit: int) -> tuple[bool, int, Array | None]:
    """Return whether the box is covered by proved cells, their number, and an unstable point if one was met."""
    size = len(pencils.slopes)
    waiting, cells = [Cell(np.zeros(size), np.full(size, factor))], 0
    while waiting:
        cell = waiting.pop()
        found = prove_cell(pencils.centre, pencils.slopes, cell)
        if found.abscissa >= 0.0:
            return False, cells, cell.middle
        if found.proved:
            cells += 1
        elif cells + len(waiting) >= limit or cell.reach.max() < factor / limit:
            return False, cells, None
        else:
            waiting += cell.halves(found.axis)
    return True, cells, None


def _most_unstable(pencils: _Pencils, factor: float) -> tuple[Array, float]:
    """Return the point of the box with the largest real part of a pole, by corners, faces and a pattern search."""
    return _pattern_search(lambda delta: pencils.at(delta).abscissa, len(pencils.slopes), factor)[:2]


def _pattern_search(value: "Callable[[Array], float]", size: int, factor: float) -> tuple[Array, float, int]:
    """Return where in the box ``value`` is largest among its lattice and the points a pattern search visits."""
    lattice = [factor * np.array(point) for point in product((0.0, -1.0, 1.0), repeat=size)]
    values = [value(point) for point in lattice]
    best, tried = int(np.argmax(values)), len(lattice)
    at, top = lattice[best], values[best]
    for step in _STEPS:
        moved = top < inf
        while moved:
            moved = False
            for axis, sign in product(range(size), (-1.0, 1.0)):
                point = at.copy()
                point[axis] = np.clip(point[axis] + sign * step * factor, -factor, factor)
                if (point == at).all():
                    continue
                tried += 1
                found = value(point)
                if found > top * (1.0 + 1e-9 * np.sign(top)):
                    at, top, moved = point, found, found < inf
    return at, top, tried


def structured_margin(
    family: AffineFamily,
    controller: "control.StateSpace",
    largest: float = 4.0,
    tolerance: float = 0.05,
    max_cells: int = _MARGIN_CELLS,
) -> StructuredMargin:
    """Return how many times the box may grow about its middle before the loop ``u = K y`` becomes unstable.

    Bisected: from above by unstable points found, from below by proof.

    Parameters
    ----------
    family, controller, max_cells
        As of :func:`robust_stability`.
    largest : float
        The box is not enlarged beyond this factor; what then has no known instability has ``unstable_at = inf``.
    tolerance : float
        Wanted relative distance of the two bounds.
    """
    top, close, limit = positive("largest", largest), positive("tolerance", tolerance), whole("max_cells", max_cells)
    pencils = _pencils(family, controller)
    if pencils.centre.abscissa >= 0.0:
        return StructuredMargin(0.0, 0.0, family.values(np.zeros(family.size)))
    bad, where = _unstable_factor(pencils, top, close)
    good, ceiling = 0.0, min(bad, top)
    tried = ceiling * (1.0 - 0.5 * close) if bad < inf else ceiling
    for _ in range(12):
        proved, _, point = _covered(pencils, tried, limit)
        if point is not None:
            bad, where = float(np.abs(point).max()), point
        good, ceiling = (tried, ceiling) if proved else (good, tried)
        if good >= ceiling * (1.0 - close):
            break
        tried = 0.5 * (good + ceiling)
    return StructuredMargin(good, bad, None if where is None else family.values(where))


def _unstable_factor(pencils: _Pencils, top: float, close: float) -> tuple[float, Array | None]:
    """Return the smallest factor found at which a point of the box is unstable."""
    at, abscissa = _most_unstable(pencils, top)
    if abscissa < 0.0:
        return inf, None
    good, bad, where = 0.0, float(np.abs(at).max()), at
    while bad - good > 0.1 * close * bad:
        middle = 0.5 * (good + bad)
        at, abscissa = _most_unstable(pencils, middle)
        along = where * middle / np.abs(where).max()
        if abscissa < 0.0 <= pencils.at(along).abscissa:
            at, abscissa = along, 0.0
        if abscissa >= 0.0:
            bad, where = min(middle, float(np.abs(at).max())), at
        else:
            good = middle
    return bad, where


def worst_case(
    family: AffineFamily,
    controller: "control.StateSpace",
    inputs: "str | Sequence[str] | None" = None,
    outputs: "str | Sequence[str] | None" = None,
) -> WorstCase:
    """Return the largest H-infinity norm of the loop ``u = K y`` found over a box of parameters, certified where found.

    A search over the box's lattice and a pattern search from its worst point: a lower bound of the worst case.

    Parameters
    ----------
    family, controller
        As of :func:`robust_stability`.
    inputs, outputs : str or sequence of str, optional
        Between which signals of the closed loop (:func:`boomctl.feedback_loop`); by default from all disturbances to
        all outputs of the family.
    """
    _pencils(family, controller)

    def at(delta: Array) -> NormCertificate:
        loop = feedback_loop(family.at(delta), controller)
        ins = names("input", inputs, loop.input_labels)
        outs = names("output", family.centre.outputs if outputs is None else outputs, loop.output_labels)
        return hinf_norm(loop[list(outs), list(ins)])

    delta, _, tried = _pattern_search(lambda point: at(point).lower, family.size, 1.0)
    return WorstCase(at(delta), family.values(delta), at(np.zeros(family.size)), tried)
