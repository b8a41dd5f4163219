"""The least further delay, of one control or one reading, that makes a sampled loop around a continuous plant unstable.

A delay is whole samples and a part of one.  The loop opened at the signal is ``z^-W h(z, t)``: ``W`` whole samples turn it,
and the part ``t`` of one changes the gains of a few signals.  With the loop as it is closed, all poles of ``h`` and of the
sensitivity ``N`` lie within the unit circle, and the loop with a further delay is unstable from where
``N(z) = z^-W h(z, t)`` at some ``z`` on it.

That is sought, and excluded, over cells of frequency and of ``t``.  In a cell, logarithms of ``h`` and ``N`` are linear but
for remainders that are bounded from the distances of the poles: their real parts are equal only at places that no
whole samples change, and their angles there name the next ``W`` that may be one.  What is linear then contracts a cell to
where a solution may be, or to nothing.  The cells of least delay go first, so that no solution has less
delay than the first small cell. The delay is that of the solution next to it, by Newton's method: with repeated poles,
rounding may let cells of slightly less delay pass.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from math import inf, nan

import numpy as np
from numpy.polynomial import chebyshev
from scipy import linalg

from boomctl.analysis.loops import signals_of
from boomctl.arrays import Array, balance
from boomctl.chebyshev import known_along, series
from boomctl.lti.hold import zero_order_hold
from boomctl.lti.modal import sides, split
from boomctl.lti.rounding import EPS, SUMMED, TERMS
from boomctl.lti.sampled import Held, sampled_plant, whole_samples
from boomctl.lti.system import Lti, lower_lft

_DEGREE = 500  # of the polynomials at most: a plant that turns by as many radians a sample
_SMALL = 0.7  # poles below its square, and perhaps below it, are taken by their pulse response (a choice)
_PARALLEL = 1e4  # one over the cosine of a pole and its mirror: beyond, it may be one of several (a choice)
_TOGETHER = 0.1  # share of its decay a sample within which others are taken together with a pole (a choice)
_ORDERS = 500  # of a place of several poles at most: they have gone after 200
_CELLS = 32  # of frequency, at first (a choice)
_BATCH = 256  # cells at once, those of least delay (a choice)
_WORK = 5e6  # functions in cells that are evaluated, at most: a second or two (a choice of patience)
_PASS = 2000.0  # of them take as long as what every pass over cells costs (measured)
_ANGLE = 0.05  # range of angles of a cell above which it is halved where it had no solution (0.5 is slow far out)
_FOUND = 1e-6  # half width of a cell, relative, at which a solution is found: its middle, by Newton, is far better
_NEWTON = 8  # steps from a cell to the solution next to it
_APART = 1e-3  # relative distance of a solution from the cell that it belongs to, at most: rounding of repeated poles
_LONGEST = 1e6  # samples of delay, beyond which none is looked for (a choice)
_JUMPS = 300.0  # samples of delay up to which jumps of a feedthrough are looked at: milliseconds each (a choice)
_AFTER = 1e-6  # of a sample, beside a jump: far above rounding, which must not say on which side of it a delay is
_TURN = 2.0 * np.pi


@dataclass(frozen=True)
class FurtherDelay:
    """A sampled loop and the signal, a control or a measurement, that is delayed further.

    Attributes
    ----------
    plant, controller : Lti
        The plant in continuous time between the controller's signals, in their order.
    delay : float
        That of all controls [s].
    acting : bool
        Whether a control is delayed, or a measurement.
    index : int
        Which one.
    """

    plant: Lti
    controller: Lti
    delay: float
    acting: bool
    index: int

    @classmethod
    def of(cls, plant: Lti, controller: Lti, delay: float, signal: str) -> "FurtherDelay":
        """Return the loop of a plant and a controller, found by name, delayed at a signal."""
        between, acting = (
            signals_of(controller, plant.inputs, plant.outputs, scales=plant.scales),
            signal in controller.outputs,
        )
        index = (controller.outputs if acting else controller.inputs).index(signal)
        return cls(plant.between(*between).balanced(), controller, delay, acting, index)

    def sampled(self, further: float) -> Lti:
        """Return the plant from sample to sample with a further delay [s] at the signal."""
        delays, readings = [self.delay] * len(self.controller.C), [0.0] * self.controller.B.shape[1]
        (delays if self.acting else readings)[self.index] += further
        return sampled_plant(self.plant, range(len(delays)), self.controller.dt, delays, readings)

    def least(self) -> tuple[float, float, float]:
        """Return the least delay [s], its frequency [rad/s], and the delay up to which stability is proved [s].

        The delay is ``inf`` without a limit, and NaN if it is not known; the frequency is NaN in both cases.
        """
        dt, found, omega = self.controller.dt, inf, nan
        start, known, value = self.delay / dt if self.acting else 0.0, True, inf
        try:
            curves = self._curves()
        except ValueError:  # poles that do not separate, or a plant far faster than the samples
            return nan, nan, 0.0
        for curve in curves:
            last = found
            found, omega, known = curve.least(start, (found, omega, known))
            if not known:
                value, omega = nan, nan
            elif found < last:
                value, omega = curve.solution(start, found, omega)
        if not self.plant.D.any():
            return value * dt, omega / dt, min(found, value) * dt
        # where an output has a feedthrough from a control, the loop jumps as that control passes the sample; a gain that is
        # one nowhere is so whatever the whole samples, and shows at once on which side of one it is
        last = min(found, _JUMPS) if found < inf else 2.0
        for place in np.arange(1.0, last + 2.0) - whole_samples(self.delay, dt)[1] / dt:
            if 0.0 < place < last:
                poles = lower_lft(self.sampled((place + _AFTER) * dt), self.controller).balanced().poles
                if (sides(poles, dt) >= 0).any():
                    jump = float(place) * dt
                    return jump, float(abs(np.angle(poles[np.argmax(np.abs(poles))]))) / dt, jump
        if last < found < inf:
            return nan, nan, last * dt
        return value * dt, omega / dt, min(found, value) * dt

    def _curves(self) -> list["_Curve"]:
        """Return the loop over the parts of a sample between which it changes smoothly."""
        P, K, dt, n = self.plant, self.controller, self.controller.dt, len(self.plant.A)
        base, none = self.sampled(0.0), np.zeros(len(K.A))
        A, late = lower_lft(base, K).A, whole_samples(self.delay, dt)
        if self.acting:
            i, breaks = self.index, np.array([0.0, late[1] / dt, 1.0])
            B, D, read = P.B[:, [i]], P.D[:, i], np.hstack([K.D[i] @ base.C, K.C[i]])
            full = np.concatenate([base.B @ K.D @ D, K.B @ D]) + np.pad(
                zero_order_hold(P.A, B, dt)[1][:, 0], (0, len(A) - n)
            )
            ends = A, read, np.append(base.B[:, i], none)

            def moving(part: float) -> Array:
                new = zero_order_hold(P.A, B, (1.0 - part) * dt)[1][:, 0]
                return np.append(A[:, :n] @ new + full - np.pad(new, (0, len(A) - n)), read[:n] @ new + K.D[i] @ D)
        else:
            j, breaks = self.index, np.array([0.0, 1.0 - late[1] / dt, 1.0])
            held = Held.of(P, range(len(K.C)), [late] * len(K.C))
            ends = A.T, np.concatenate([base.B @ K.D[:, j], K.B[:, j]]), np.append(base.C[j], none)

            def moving(part: float) -> Array:
                rows, given = (each[j] for each in held.answers((1.0 - part) * dt))
                return np.concatenate([rows + given @ K.D @ base.C, given @ K.C, [given @ K.D[:, j]]])

        functions = _Functions.of(*ends)
        return [_Curve.of(functions, moving, *part) for part in pairwise(np.unique(breaks))]


@dataclass(frozen=True)
class _Functions:
    """Functions of ``z`` that responses are sums of, ``1/(z - p)^m``, and their shares.

    ``shares`` has a column for each state driven, the last for a direct path; ``sensitivity`` is ``N``.  ``doubt`` is how far
    rounding may have moved the poles.
    """

    poles: Array
    orders: Array
    shares: Array
    sensitivity: Array
    doubt: Array

    @classmethod
    def of(cls, A: Array, read: Array, added: Array) -> "_Functions":
        """Return those of ``read (z - A)^-1``; poles near zero, which may be Jordan blocks, by their pulse response."""
        A, scale = balance(A)
        whole = Lti(A, np.diag(1.0 / scale), (read * scale)[None], np.zeros((1, len(A))), dt=1.0)
        ends = np.sort(np.append(np.clip(np.abs(whole.poles), _SMALL**2, _SMALL), [_SMALL**2, _SMALL]))
        gap = int(np.argmax(np.diff(ends)))
        near, far, _ = split(whole, np.abs(whole.poles) < ends[gap : gap + 2].mean())
        pulses = [(0.0, m + 1.0, 0.0, term) for m, term in enumerate(_terms(near.A, near.C[0], near.B, 0.0))]
        poles, orders, doubt, shares = zip((0.0, 0.0, 0.0, np.zeros(len(A))), *pulses, *_fractions(far), strict=True)
        direct = np.eye(len(shares), 1)
        own = (np.array(shares) @ added)[:, None] + direct
        return cls(np.array(poles), np.array(orders), np.hstack([shares, direct]), own, np.array(doubt))

    def at(self, omega: Array, half: Array) -> tuple[Array, Array, Array]:
        """Return values and slopes over frequency, and bounds of values, slopes and curvatures in cells."""
        z, m = np.exp(1j * omega)[:, None], self.orders
        x = z - self.poles
        near = 1.0 / np.maximum(np.abs(x) - half[:, None], 1.0 - np.abs(self.poles))
        value, bound = 1.0 / x, near.copy()
        slope = -1j * z * value
        others = m != 1.0  # a pole of its own needs no powers
        value[:, others], bound[:, others] = x[:, others] ** -m[others], near[:, others] ** m[others]
        steep = m * bound * near
        return value, m * slope * value, np.array([bound, steep, steep * (1.0 + (m + 1.0) * near)])


def _terms(N: Array, row: Array, acts: Array, place: complex) -> list[Array]:
    """Return ``row N^(m-1) acts``, the shares of ``1/(z - p)^m``, until they are rounding.

    Raises
    ------
    ValueError
        That takes too many.
    """
    terms, size = [], float(np.linalg.norm(row))
    while np.linalg.norm(row) > EPS * size * (1.0 - abs(place)) ** len(terms):
        if len(terms) >= _ORDERS:
            raise ValueError("poles that are nearly parallel lie too far apart")
        terms.append(row @ acts)
        row = row @ N
    return terms


def _fractions(system: Lti) -> list[tuple[complex, float, float, Array]]:
    """Return poles and orders of ``1/(z - p)^m``, how far rounding may have moved the poles, and their shares.

    Poles that lie so near to each other that their eigenvectors are nearly parallel share one place ``p``: with ``T`` their
    part of a Schur form, ``(z - T)^-1`` is the sum of ``(T - p)^(m-1)/(z - p)^m``.

    Raises
    ------
    ValueError
        Such poles lie too far apart for that.
    """
    A = system.A
    poles, V = linalg.eig(A) if len(A) else (np.zeros(0, complex), A)
    W, unit = np.linalg.inv(V), EPS * float(np.linalg.norm(A))
    angle = np.linalg.norm(W, axis=1) * np.linalg.norm(V, axis=0)
    waiting = angle > _PARALLEL
    alone = np.flatnonzero(~waiting)
    found = [(poles[i], 1.0, unit * angle[i], (system.C @ V[:, i]) * (W[i] @ system.B)) for i in alone]
    while waiting.any():
        first = complex(poles[np.flatnonzero(waiting)[0]])
        reach = _TOGETHER * max(1.0 - abs(first), EPS)
        these = waiting & (np.abs(poles - first) <= reach)
        T, Z, count = linalg.schur(A, output="complex", sort=lambda p, at=first, far=reach: abs(p - at) <= far)  # type: ignore[misc]
        if count != these.sum():
            raise ValueError("poles that are nearly parallel do not separate from others")
        waiting &= ~these
        X = linalg.solve_sylvester(T[:count, :count], -T[count:, count:], -T[:count, count:])
        left, right = Z.conj().T[:count] - X @ Z.conj().T[count:], Z[:, :count]
        place = np.trace(T[:count, :count]) / count
        doubt = unit * float(np.linalg.norm(left) * np.linalg.norm(right))
        terms = _terms(T[:count, :count] - place * np.eye(count), (system.C @ right)[0], left @ system.B, place)
        found += [(place, m + 1.0, doubt, term) for m, term in enumerate(terms)]
    return found


@dataclass(frozen=True)
class _Curve:
    """The loop over a range of parts of a sample: ``series`` holds the Chebyshev coefficients of each function's share."""

    functions: _Functions
    middle: float
    reach: float
    series: Array

    @classmethod
    def of(cls, functions: _Functions, moving: Callable[[float], Array], low: float, high: float) -> "_Curve":
        """Return that between two parts; ``moving`` is what is driven, or read, at a part."""
        middle, reach = 0.5 * (low + high), 0.5 * (high - low)

        def at(places: Array) -> dict[str, Array]:
            return {"": np.array([moving(middle + reach * place) for place in places]) @ functions.shares.T}

        values = known_along(at, lambda found: {"": SUMMED * np.abs(found[""]).max()}, _DEGREE)[""]
        if len(values) > _DEGREE:
            raise ValueError("the plant is too fast for a polynomial over a sample")
        return cls(functions, middle, reach, series(values).T)

    def _logarithm(self, known: tuple[Array, Array, Array], cells: Array, shares: Array) -> tuple[Array, ...]:
        """Return a response in cells, the slopes of its logarithm, how far that is from linear, and what changes it.

        The last are shares of it by which frequency alone, the part of a sample alone, and all together change it at most.
        """
        (f, slope, bounds), (_, half, part, wide) = known, cells.T[:4]
        degrees = np.arange(shares.shape[1])
        T = chebyshev.chebvander((part - self.middle) / self.reach, len(degrees) - 1)
        r, dr = T @ shares.T, T @ (chebyshev.chebder(np.eye(len(degrees) + 1)[:, :-1]) @ shares.T) / self.reach
        growth = np.array(
            [degrees**0.0, degrees**2 / self.reach, degrees**2 * (degrees**2 - 1.0) / 3.0 / self.reach**2]
        )
        R = growth @ np.abs(shares).T  # of the shares and their derivatives, at most
        unit = SUMMED + EPS * (TERMS + len(R.T) + len(degrees))  # of rounding, and of what the series leave out
        rounding = bounds[0] @ (unit * (R[0] + R[0].max())) + bounds[1] @ (TERMS * self.functions.doubt * R[0])
        value, over, along = ((a * b).sum(axis=1) for a, b in ((f, r), (slope, r), (f, dr)))
        bent = 0.5 * half**2 * (bounds[2] @ R[0]), 0.5 * wide**2 * (bounds[0] @ R[2])
        rest = bent[0] + bent[1] + half * wide * (bounds[1] @ R[1]) + rounding
        size = np.abs(value)
        alone = half * np.abs(over), wide * np.abs(along)
        changes = np.array([alone[0] + bent[0], alone[1] + bent[1], alone[0] + alone[1] + rest])
        share = changes[2] / size
        far = np.where(share < 1.0, rest / size + 0.5 * share**2 / (1.0 - share), inf)
        return value, over / value, along / value, far, changes

    def _tried(self, cells: Array) -> tuple[Array, Array]:
        """Return what is left of cells, and places to which solutions in cells are confined.

        Rows are frequency and part of a sample, each with half a width, whole samples, and whether no others are meant.
        """
        known = self.functions.at(*cells.T[:2])
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            (Q, *q, far, more), (N, *n, off, less) = (
                self._logarithm(known, cells, shares) for shares in (self.series, self.functions.sensitivity)
            )
            apart = np.abs(np.abs(Q) - np.abs(N)) > more[2] + less[2]
            G: Array = np.log(Q / N)
            over: Array = q[0] - n[0]
            along: Array = q[1] - n[1]
            rem = far + off + TERMS * EPS * cells[:, 4]
            omega, half, part, wide, W, only = cells.T
            apart |= np.abs(G.real) > half * np.abs(over.real) + wide * np.abs(along.real) + rem
            turn = over.imag - W
            angle = np.remainder(G.imag - W * omega + np.pi, _TURN) - np.pi
            total, spread = (half * np.abs(x) + wide * np.abs(along.imag) + rem for x in (turn, over.imag))
            inverse = np.array([[along.imag, -along.real], [-turn, over.real]]) / (
                over.real * along.imag - along.real * turn
            )
            moved, give = -(inverse * np.array([G.real, angle])).sum(axis=1), rem * np.abs(inverse).sum(axis=1)
            reach = np.array([half, wide])
            low, high = np.maximum(moved - give, -reach), np.minimum(moved + give, reach)
            none = (np.abs(angle) > total) | (total + np.abs(angle) < _TURN) & (low > high).any(axis=0)
            small = ~none & (total + np.abs(angle) < _TURN) & ((high - low).prod(axis=0) < reach.prod(axis=0))
            # the next whole samples whose turn is among the angles of the cell
            ahead = np.ceil((W * (omega - half) - G.imag - spread) / _TURN) * _TURN
            later = np.maximum(W + 1.0, np.ceil((ahead + G.imag - spread) / (omega + half)))
            sizes = more / np.abs(Q) + less / np.abs(N)
            axis = np.where(sizes[1] > sizes[0] + half * W, 2, 0)
        done = none | small
        middle, width = 0.5 * (low + high), 0.5 * (high - low)
        found = np.column_stack([omega + middle[0], width[0], part + middle[1], width[1], W, only**0.0])
        rest = np.column_stack([cells[:, :4], np.where(done, later, W), only])
        kept = ~apart & ~(done & (only > 0.0))
        cut = kept & (~done | (total > np.where(np.abs(angle) > total, _ANGLE, np.minimum(omega, _ANGLE))))
        halves = []
        for sign in (-1.0, 1.0):
            piece, rows = rest[cut], np.arange(cut.sum())
            piece[rows, axis[cut] + 1] *= 0.5
            piece[rows, axis[cut]] += sign * piece[rows, axis[cut] + 1]
            halves.append(piece)
        return np.concatenate([rest[kept & ~cut], *halves]), found[small & ~apart]

    def least(self, start: float, best: tuple[float, float, bool]) -> tuple[float, float, bool]:
        """Return the least delay further than a start, its angle, and whether it is known; the best known, if none is less.

        All in samples.
        """
        step, work = 0.5 * np.pi / _CELLS, 0.0
        cells = np.tile([step, step, self.middle, self.reach, np.floor(start) + 1.0, 0.0], (_CELLS, 1))
        cells[:, 0] *= 2.0 * np.arange(_CELLS) + 1.0
        while True:
            before = cells[:, 4] - 1.0 + cells[:, 2] + cells[:, 3] < start
            cells[before, 4] += 1.0
            delay = np.maximum(cells[:, 4] - 1.0 + cells[:, 2] - cells[:, 3] - start, 0.0)
            kept = ~(before & (cells[:, 5] > 0.0)) & (delay < min(best[0], _LONGEST))
            cells, delay = cells[kept], delay[kept]
            if not len(cells):
                return best
            if work > _WORK:
                return float(delay.min()), nan, False
            cells = cells[np.argsort(delay, kind="stable")]
            work += _PASS + len(cells) + len(cells[:_BATCH]) * len(self.series)
            rest, found = self._tried(cells[:_BATCH])
            delay = found[:, 4] - 1.0 + found[:, 2] - start
            narrow = (found[:, 1] <= _FOUND) & (found[:, 3] <= _FOUND * np.maximum(delay, _FOUND))
            here = [
                (float(x), float(y), True) for x, y in zip(delay[narrow], found[narrow, 0], strict=True) if x >= 0.0
            ]
            best = min([best, *here])
            cells = np.concatenate([cells[_BATCH:], rest, found[~narrow]])

    def solution(self, start: float, bound: float, omega: float) -> tuple[float, float]:
        """Return the delay further than a start and the angle at a solution next to a cell, by Newton's method.

        Rounding may let cells of less delay pass for solutions. Both are NaN if there is no solution near them.
        """
        whole = np.round(bound + start + 1.0 - self.middle)
        place, change = np.array([omega, bound + start + 1.0 - whole]), np.full(2, inf)
        for _ in range(_NEWTON):
            cell = np.array([[place[0], 0.0, place[1], 0.0, whole, 1.0]])
            known = self.functions.at(*cell.T[:2])
            (Q, *q), (N, *n) = (self._logarithm(known, cell, x)[:3] for x in (self.series, self.functions.sensitivity))
            over, along, G = (q[0] - n[0])[0] - 1j * whole, (q[1] - n[1])[0], np.log(Q / N)[0] - 1j * whole * place[0]
            gap = np.array([G.real, np.remainder(G.imag + np.pi, _TURN) - np.pi])
            slopes = np.array([[over.real, along.real], [over.imag, along.imag]])
            change = np.linalg.lstsq(slopes, -gap)[0]
            place = place + change
        delay = whole - 1.0 + place[1] - start
        near = abs(delay - bound) <= _APART * max(bound, _FOUND) and np.abs(change).max() <= _FOUND
        return (float(delay), float(place[0])) if near else (nan, nan)
