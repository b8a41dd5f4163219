"""How fast a parameter may change: a Lyapunov function that follows it, shown to fall over every cell of a grid.

Loops that are stable while a parameter stays may be unstable while it changes.  With ``E(p) x' = A(p) x`` and ``V = x^T
E^T P(p) E x`` positive, ``V' = x^T (S0(p) + p' S1(p)) x``, where ``S0 = A^T P E + E^T P A`` and ``S1 = E_p^T P E + E^T
P E_p + E^T P_p E``.  P is found at the corners of the cells, from the loop there, and runs in straight lines between
them in each parameter.  S0 and S1 are then polynomials over a cell.  In Bernstein's basis, whose functions are not
negative and have the sum one, they are averages of their coefficients at every point: where ``S0 + r S1`` of all
coefficients is negative definite for both signs of r, it is so everywhere in the cell, and V falls for every ``|p'| <=
r``.  No point between the corners is left to chance.

Two ways to P at a corner, of which the one that shows more on the first grid is taken:

==========  =========================================================================================================
"modes"     the sum of the squared modal coordinates of the loop there: every mode decays at its own rate
"lyapunov"  ``F^T P + P F = -Q`` of ``F = A E^-1`` with one Q for all, from the modes in the middle of the box: where modes
            cross, and their shapes jump
==========  =========================================================================================================
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache, cached_property
from itertools import pairwise, product
from math import comb
from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg
from scipy.special import binom

from boomctl.analysis.box.loop_pencil import LoopPencil, closed_pencil
from boomctl.analysis.box.loops import BoxLoops, controller_at, without
from boomctl.analysis.box.zero_exclusion import Cell, Terms
from boomctl.arrays import Array, balance
from boomctl.checks import known, positive, whole
from boomctl.lti.controllers.scheduled import ScheduledController
from boomctl.lti.rounding import EPS
from boomctl.lti.system import controller_of
from boomctl.printing import sentence
from boomctl.progress import Listener, computing, tell
from boomctl.structure.families import Family
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    import control

_MODES, _LYAPUNOV = "modes", "lyapunov"
_FIRST_CELLS = 4  # of each stretch of a schedule along the parameter that changes, at first (a choice)
_FIRST_BESIDE = 2  # along every other parameter (a choice)
_MOST_CELLS = 100_000  # that may be asked for: half a minute and 0.6 GB for half a boom (measured)
_CELLS = 4000  # most cells of a grid (a choice of patience: some ten seconds)
_ROUNDING = 16.0 * EPS  # of sums of products of a few matrices, relative to their size
_SMALL = (
    1e-11  # share of A below which a term of its polynomial in a cell is left out and counts as an error (measured)
)
_BELOW = 1.0 - 1e-9  # share of a rate that is stated: less by more than the rounding of eigenvalues
_STEP = 1e-3  # share of a cell over which E is differentiated where the function is tried again (a choice)
_CHECKED = 200  # points drawn at which the function is tried again (a choice)


@dataclass(frozen=True)
class RampBound:
    """How fast a parameter may change while a loop stays stable.

    Attributes
    ----------
    parameter : str
        The one that changes; all others may have any value in the box, but keep it.
    rate : float
        The loop is proved exponentially stable for every course of the parameter within its range that nowhere changes
        faster than this, in its unit per second; 0 where nothing was proved.
    at_most : float
        What the same Lyapunov function could show at best: the least rate at which it ceases to fall at a point tried.
        Faster courses may be stable too.
    cells : int
        Cells of the grid on which it was proved.
    path : str
        How the Lyapunov function was found: "modes" or "lyapunov".
    slack : float
        Certificate, from loops closed anew at points drawn in the box: how much of ``V'`` is left, as a share, at the
        rate proved, least of all points; 1 where nothing is used up.
    unstable_at : dict or None
        Parameter values at which the loop is unstable while they stay, if such were met.
    """

    parameter: str
    rate: float
    at_most: float
    cells: int
    path: str
    slack: float
    unstable_at: dict[str, float] | None = None

    @property
    def proved(self) -> bool:
        """Whether any rate was proved."""
        return self.rate > 0.0

    def __repr__(self) -> str:
        return sentence("RampBound", self.render())

    def render(self) -> str:
        """Return the bound as text.

        Returns
        -------
        str
            A sentence.
        """
        if self.unstable_at is not None:
            where = ", ".join(f"{name} = {value:.5g}" for name, value in self.unstable_at.items())
            return f"unstable at {where}, without any change"
        if not self.proved:
            return f"not proved for any change of {self.parameter} in {self.cells} cells"
        found = f"proved stable while {self.parameter} changes by up to {self.rate:.4g} a second, in {self.cells} cells"
        return f"{found}; this function ({self.path}) could show {self.at_most:.4g} at most"


@one_blas_thread
def ramp_bound(
    family: Family,
    controller: control.StateSpace | ScheduledController,
    parameter: str | None = None,
    *,
    tolerance: float = 0.1,
    max_cells: int = _CELLS,
    progress: Listener | None = None,
) -> RampBound:
    """Return how fast a parameter may change, proved by a Lyapunov function that follows it.

    :func:`boomctl.robust_stability` speaks of parameters that stay where they are; a loop that is stable at every value of
    a parameter may still be unstable while it changes.  Here every course within the box counts whose rate keeps below
    the bound, jumps of the rate included.  The loop is the linear one about the steady state at the present value of the
    parameter: what the change itself forces is a disturbance of it.

    Parameters
    ----------
    family : AffineFamily or PolynomialFamily
        The plants.
    controller : control.StateSpace or ScheduledController
        ``u = K y``, as for :func:`boomctl.robust_stability`, in continuous time.
    parameter : str, optional
        The parameter that changes; by default the one that the controller follows, or the first.  The others stay
        anywhere in the box.
    tolerance : float
        The grid is refined until what is proved comes within this share of what the function could show.
    max_cells : int
        Largest number of cells of a grid, at most 100,000: half a minute and more.
    progress : callable, optional
        Is told a `Progress` at each stage.  Without one, after three seconds a line on a terminal or in a notebook says
        what goes on; `listening` hears whatever runs within it.

    Returns
    -------
    RampBound
        The rate, in the parameter's unit per second, and how it was proved.

    Raises
    ------
    TypeError, ValueError
        As for :func:`boomctl.robust_stability`; an unknown parameter.

    Examples
    --------
    How fast a hub may spin up under a scheduled drive:

    >>> import boomctl as bc
    >>> import control
    >>> family = bc.hub_beam(model="sfoam", modes=1).family(hub_speed=(0.0, 6.0))
    >>> signals = {"inputs": ["hub_speed", "root_moment"], "outputs": "torque"}
    >>> drives = [control.ss([], [], [], [[-gain, -0.5]], **signals) for gain in (20.0, 40.0)]
    >>> bound = bc.analysis.ramp_bound(family, bc.schedule(drives, [0.0, 6.0]))
    >>> bound.proved
    True
    """
    loops, close = BoxLoops.of(family, controller), positive("tolerance", tolerance)
    limit = whole("max_cells", max_cells, most=_MOST_CELLS)
    usual = controller.signal if isinstance(controller, ScheduledController) else family.names[0]
    name = usual if parameter is None else known("parameter", parameter, family.names)
    axis = family.names.index(name)
    unit = 0.5 * float((family.high - family.low)[axis])
    with computing("ramp bound", progress):
        try:
            scene = _Scene.of(loops, axis)
            grid = max((_Grid.of(scene, way, 1) for way in (_MODES, _LYAPUNOV)), key=lambda each: each.at_most)
            best, shown, before, finer = grid, grid.proved(), np.inf, 1
            while True:
                settled = abs(grid.at_most - before) <= close * grid.at_most
                if shown > 0.0 and settled and shown >= (1.0 - close) * grid.at_most:
                    break
                finer, before = 2 * finer, grid.at_most
                if scene.cells(finer) > limit:
                    break
                grid = _Grid.of(scene, grid.way, finer)
                rate = grid.proved()
                if rate >= shown:
                    best, shown = grid, rate
        except _Unstable as found:
            return RampBound(name, 0.0, 0.0, 0, "", 0.0, family.values(found.delta))
        rate = _BELOW * shown
        slack = _slack(family, controller, best, rate) if rate > 0.0 else 0.0
    if slack < 0.0:  # the function does not fall at a point drawn, and proves nothing
        rate = slack = 0.0
    return RampBound(name, rate * unit, max(best.at_most, rate) * unit, len(best.cells), best.way, slack)


class _Unstable(Exception):
    """The loop is unstable at a corner of the grid."""

    def __init__(self, delta: Array) -> None:
        super().__init__()
        self.delta = delta


@dataclass(frozen=True)
class _Scene:
    """The loops, the parameter that changes, and scales in which E is one in the middle of the box and F balanced.

    ``E`` and ``A`` are taken as ``left E right`` and ``left A right``.
    """

    loops: BoxLoops
    axis: int
    left: Array
    right: Array
    weight: Array

    @classmethod
    def of(cls, loops: BoxLoops, axis: int) -> _Scene:
        middle = loops.at(np.zeros(loops.family.size))
        F = np.linalg.solve(middle.E.T, middle.A.T).T
        left = np.diag(1.0 / balance(F)[1])
        scene = cls(loops, axis, left, np.linalg.inv(left @ middle.E), np.zeros_like(F))
        poles, W = scene.modes(np.zeros(loops.family.size))
        return replace(scene, weight=np.real(W.conj().T @ (2.0 * np.abs(poles.real)[:, None] * W)))

    def scaled(self, matrix: Array) -> Array:
        return self.left @ matrix @ self.right

    def modes(self, delta: Array) -> tuple[Array, Array]:
        """Return poles at a point, and the rows that read the modal coordinates off ``E x``."""
        poles, V = np.linalg.eig(self._frozen(delta))
        if not (np.real(poles) < 0.0).all():
            raise _Unstable(delta)
        return poles, np.linalg.inv(V)

    def energy(self, way: str, delta: Array) -> Array:
        """Return P at a point."""
        W = self.modes(delta)[1]
        if way == _MODES:
            return np.real(W.conj().T @ W)
        found = linalg.solve_continuous_lyapunov(self._frozen(delta).T, -self.weight)
        return 0.5 * (found + found.T)

    def edges(self, finer: int) -> tuple[Array, ...]:
        """Return the edges of a grid along each parameter; the corners of the schedule lie on them."""
        found = []
        for k in range(self.loops.family.size):
            inner = [s.high for s in self.loops.stretches if abs(s.high) < 1.0] if k == self.loops.axis else []
            parts = finer * (_FIRST_CELLS if k == self.axis else _FIRST_BESIDE)
            pieces = [np.linspace(low, high, parts + 1)[:-1] for low, high in pairwise([-1.0, *inner, 1.0])]
            found.append(np.concatenate([*pieces, [1.0]]))
        return tuple(found)

    def cells(self, finer: int) -> int:
        """Return how many cells a grid has."""
        return int(np.prod([len(each) - 1 for each in self.edges(finer)]))

    def _frozen(self, delta: Array) -> Array:
        found = self.loops.at(delta)
        return np.linalg.solve(self.scaled(found.E).T, self.scaled(found.A).T).T


@dataclass(frozen=True)
class _Polynomials:
    """E and A, scaled: coefficients, (k, n, n), and powers of the parameters, (k, axes); A is missed by ``left`` at most."""

    powers: Array
    E: Array
    A: Array
    left: float = 0.0

    @classmethod
    def of(cls, scene: _Scene, terms: Terms) -> _Polynomials:
        powers = np.array([[power.count(k) for k in range(scene.loops.family.size)] for power in terms])
        E, A = (np.array([scene.scaled(getattr(x, name)) for x in terms.values()]) for name in "EA")
        return cls(powers, E, A)

    def within(self, low: Array, high: Array) -> _Polynomials:
        """Return the same in places of a cell, from 0 to 1 along each parameter, without what is as small as rounding."""
        powers = np.array(list(product(*(range(int(top) + 1) for top in self.powers.max(axis=0)))))
        shares = np.ones((len(powers), len(self.powers)))
        for k in range(len(low)):
            j, p = powers[:, None, k], self.powers[None, :, k]
            shares *= np.where(j <= p, binom(p, j) * low[k] ** np.maximum(p - j, 0) * (high - low)[k] ** j, 0.0)
        E, A = np.tensordot(shares, self.E, 1), np.tensordot(shares, self.A, 1)
        sizes = np.linalg.norm(A, axis=(1, 2))
        small = ~E.any(axis=(1, 2)) & (sizes <= _SMALL * sizes.max())
        return _Polynomials(powers[~small], E[~small], A[~small], float(sizes[small].sum()))

    def at(self, places: Array, axis: int) -> tuple[Array, Array, Array]:
        """Return E, A and the slope of E along a parameter at places, (places, axes)."""
        shares = np.prod(places[:, None, :] ** self.powers, axis=2)
        less = self.powers - (np.arange(places.shape[1]) == axis)
        slopes = self.powers[:, axis] * np.prod(places[:, None, :] ** np.maximum(less, 0), axis=2)
        return np.tensordot(shares, self.E, 1), np.tensordot(shares, self.A, 1), np.tensordot(slopes, self.E, 1)

    @property
    def degrees(self) -> tuple[int, ...]:
        """Degree of S0 and S1 in each parameter."""
        e, a = (self.powers[X.any(axis=(1, 2))].max(axis=0, initial=0) for X in (self.E, self.A))
        return tuple((np.maximum(e + a, 2 * e) + 1).tolist())


@dataclass(frozen=True)
class _Cell:
    """A cell: its lower and upper corner, P at its corners, (2, ..., 2, n, n), and the loop over places in it."""

    axis: int
    low: Array
    high: Array
    corners: Array
    loop: _Polynomials

    def falling(self, shares: Array) -> tuple[Array, Array]:
        """Return S0 and S1 at places in the cell, (places, axes) from 0 to 1 along each parameter."""
        E, A, slope = self.loop.at(shares, self.axis)
        return self.along(shares, E, A, slope / (self.high - self.low)[self.axis])

    def along(self, shares: Array, E: Array, A: Array, E_p: Array) -> tuple[Array, Array]:
        """Return S0 and S1 of pencils and their slopes at places in the cell."""
        size = len(self.low)
        P, P_p = (np.broadcast_to(self.corners, (len(shares), *self.corners.shape)) for _ in range(2))
        for k in range(size):  # the first axis of what is left, behind the places, is that of parameter k
            t = shares[:, k].reshape(-1, *(1,) * (P.ndim - 2))
            P = (1.0 - t) * P[:, 0] + t * P[:, 1]
            mean = (1.0 - t) * P_p[:, 0] + t * P_p[:, 1]
            P_p = (P_p[:, 1] - P_p[:, 0]) / (self.high - self.low)[k] if k == self.axis else mean
        turned, steeper = E.transpose(0, 2, 1), E_p.transpose(0, 2, 1)
        half, part = A.transpose(0, 2, 1) @ P @ E, steeper @ P @ E
        return half + half.transpose(0, 2, 1), part + part.transpose(0, 2, 1) + turned @ P_p @ E

    def proved(self) -> float:
        """Return a rate up to which V falls all over the cell; 0 where none is proved."""
        places, to_bernstein = _bernstein(self.loop.degrees)
        S0, S1 = self.falling(places)
        try:
            to_one = np.linalg.inv(np.linalg.cholesky(-S0.mean(axis=0)))
        except np.linalg.LinAlgError:
            return 0.0
        S0, S1 = (np.tensordot(to_bernstein, to_one @ S @ to_one.T, 1) for S in (S0, S1))
        E, A, _ = self.loop.at(places, self.axis)
        size_E, size_A, size_P = (float(np.linalg.norm(X, axis=(-2, -1)).max()) for X in (E, A, self.corners))
        rounding = _ROUNDING * len(to_one) * float(np.abs(to_bernstein).sum(axis=1).max()) * size_A
        missed = (rounding + 2.0 * self.loop.left) * size_E * size_P * float(np.linalg.norm(to_one, 2)) ** 2
        return _rate(S0 + missed * np.eye(len(to_one)), S1)


@dataclass(frozen=True)
class _Grid:
    """Cells side by side, and P at their corners."""

    scene: _Scene
    way: str
    cells: tuple[_Cell, ...]

    @classmethod
    def of(cls, scene: _Scene, way: str, finer: int) -> _Grid:
        edges = scene.edges(finer)
        found = np.array([scene.energy(way, np.array(point)) for point in product(*edges)])
        corners = found.reshape(*(len(each) for each in edges), *found.shape[1:])
        cells, loops = [], {id(s.terms): _Polynomials.of(scene, s.terms) for s in scene.loops.stretches}
        for place in product(*(range(len(each) - 1) for each in edges)):
            low, high = (np.array([each[i + j] for each, i in zip(edges, place, strict=True)]) for j in (0, 1))
            mine = corners[tuple(slice(i, i + 2) for i in place)]
            loop = loops[id(scene.loops.terms(Cell(0.5 * (low + high), 0.5 * (high - low))))]
            cells.append(_Cell(scene.axis, low, high, mine, loop.within(low, high)))
        return cls(scene, way, tuple(cells))

    @cached_property
    def at_most(self) -> float:
        """Least rate at which V ceases to fall in the middle of a cell; 0 where it does not fall."""
        return min(_rate(*cell.falling(np.full((1, len(cell.low)), 0.5))) for cell in self.cells)

    def proved(self) -> float:
        """Return a rate up to which V falls in all cells; 0 where none is proved."""
        found = np.inf
        for number, cell in enumerate(self.cells):
            tell("cells of the grid", number)
            found = min(found, cell.proved())
            if found <= 0.0:
                return 0.0
        return found


def _rate(S0: Array, S1: Array) -> float:
    """Return the largest r with all ``S0 + r S1`` and ``S0 - r S1`` negative definite; 0 where an ``S0`` is not."""
    try:
        to_one = np.linalg.inv(np.linalg.cholesky(-S0))
    except np.linalg.LinAlgError:
        return 0.0
    largest = float(np.abs(np.linalg.eigvalsh(to_one @ S1 @ to_one.transpose(0, 2, 1))).max(initial=0.0))
    return 1.0 / largest if largest > 0.0 else np.inf


@cache
def _bernstein(degrees: tuple[int, ...]) -> tuple[Array, Array]:
    """Return places in the unit box, and the matrix from values there to coefficients in Bernstein's basis."""
    places, whole = [], np.ones((1, 1))
    for n in degrees:
        t = 0.5 - 0.5 * np.cos(np.pi * (np.arange(n + 1) + 0.5) / (n + 1))
        basis = np.array([comb(n, k) * t**k * (1.0 - t) ** (n - k) for k in range(n + 1)]).T
        places.append(t)
        whole = np.kron(whole, np.linalg.inv(basis))
    return np.array(list(product(*places))), whole


def _slack(family: Family, controller: control.StateSpace | ScheduledController, grid: _Grid, rate: float) -> float:
    """Return how much of ``V'`` is left at the rate, as a share, least of points drawn; from loops closed anew there."""
    rng, least = np.random.default_rng(0), 1.0

    def closed(delta: Array) -> LoopPencil:
        K = controller_of(controller_at(family, controller, delta))
        whole = closed_pencil(family.at(delta).select(K.outputs, K.inputs), K)
        return without({(): whole}, family.unfelt)[()]

    for _ in range(_CHECKED):
        cell = grid.cells[int(rng.integers(len(grid.cells)))]
        share, step = rng.uniform(_STEP, 1.0 - _STEP, len(cell.low)), np.zeros(len(cell.low))
        step[cell.axis] = _STEP
        before, here, after = (closed(cell.low + (share + k * step) * (cell.high - cell.low)) for k in (-1, 0, 1))
        E_p = (after.E - before.E) / (2.0 * _STEP * (cell.high - cell.low)[cell.axis])
        there = _rate(*cell.along(share[None], *(grid.scene.scaled(X)[None] for X in (here.E, here.A, E_p))))
        least = min(least, 1.0 - rate / there) if there > 0.0 else -np.inf
    return least
