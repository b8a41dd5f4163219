"""Proofs about linear systems whose entries, doubles, are treated as exact.

The response is a quotient of polynomials with rational coefficients, ``G = N/a``; of a discrete system that of its continuous
image ``z = (1 + s)/(1 - s)``.  Each property is then a statement about roots, which ball arithmetic isolates (python-flint),
or about a linear equation, whose solution it encloses:

- stability: no root of ``a`` is to the right of the axis; roots on it are common to ``a(s)`` and ``a(-s)``;
- a norm below a level: no ``s = j omega`` is a root of ``det(level^2 - G(-s)^T G(s))``, whose fractions are cleared by
  Bareiss's elimination, with ``a(s) a(-s)`` in place of one as the first pivot;
- an H2 norm: ``a(s) x(-s) + a(-s) x(s) = sum N_ij(s) N_ij(-s)``; its square is the quotient of the first coefficients of
  ``x`` and ``a`` (Astrom, Jury & Agniel 1970).

Nothing is rounded before the roots are isolated, so that repeated, unobservable and nearly undamped poles need no special
treatment.  A proof holds for the stored numbers; it does not consider perturbations of their last digit.
"""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import chain, pairwise
from math import inf
from typing import TypeVar

import flint
import numpy as np
from flint import acb, acb_mat, acb_poly, arb, arb_mat, fmpq, fmpq_mat, fmpq_poly

from boomctl.exact_roots import (
    BITS,
    UndecidedError,
    Work,
    characteristic_polynomial,
    eigenvalues,
    isolated_roots,
    rational_matrix,
)
from boomctl.lti.bilinear import image_of_omega, omega_of_image
from boomctl.lti.frequency import RAISED
from boomctl.lti.inequality import PRECISION, Inequality, enclosed_gain
from boomctl.lti.rounding import EXACT_STATES, LEVEL, TINY
from boomctl.lti.system import Lti, System, closed, parallel

_MOST_BITS = 2**15  # Limit on the precision of an enclosure [bits]; stored doubles need far less.
_DIGITS = 2.0**-44  # Relative width at which an enclosure is accepted; below the accuracy of any certificate.

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class Exact:
    """``x' = A x + B u``, ``y = C x + D u`` (in discrete time ``x+``) of rational numbers, and the work limit of a proof.

    Attributes
    ----------
    A, B, C, D : fmpq_mat
    dt : float
        Sampling time [s]; 0 in continuous time.
    work : Work
        Limit on the operations of a proof.
    """

    A: fmpq_mat
    B: fmpq_mat
    C: fmpq_mat
    D: fmpq_mat
    dt: float
    work: Work = field(default_factory=lambda: Work(inf))

    @classmethod
    def of(cls, system: System, operations: float = inf, minus: Lti | None = None) -> "Exact":
        """Return a stored system, a closed loop of its subsystems, or the difference from a system of the same signals.

        A property that needs more than ``operations`` is undecided.
        """
        if isinstance(system, Lti):
            M = _rational(system)
        else:
            plant, K = _rational(system.plant), _rational(system.controller)
            p, m = len(plant.C) - K.B.shape[1], plant.B.shape[1] - len(K.C)
            once = np.diag(np.full(len(K.C), fmpq(1))) - K.D @ plant.D[p:, m:]
            M = closed(plant, K, np.array(rational_matrix(once).inv().tolist()).reshape(once.shape))
        if minus is not None:
            M = parallel(M, _rational(minus), -1)
        A, B, C, D = map(rational_matrix, (M.A, M.B, M.C, M.D))
        return cls(A, B, C, D, M.dt, Work(operations))

    def square(self, omega: float) -> float:
        """Return ``omega^2`` of the image at a frequency [rad/s]: it is ``tan(omega dt/2)`` in discrete time."""
        return (omega if self.dt == 0.0 else float(image_of_omega(omega * 0.5 * self.dt, 2.0))) ** 2

    def omega(self, square: float) -> float:
        """Return the frequency [rad/s] of ``omega^2`` of the image."""
        return square**0.5 if self.dt == 0.0 else float(omega_of_image(square**0.5, 2.0)) / (0.5 * self.dt)

    @property
    def is_large(self) -> bool:
        """True if polynomials take too long where an inequality does not decide."""
        return self.A.nrows() > EXACT_STATES

    def inequality(self, peak: float) -> Inequality | None:
        """Return the system in coordinates for inequalities of levels near ``peak``; None if it is not stable in floats."""
        self.work.charge_entries(self.A.nrows(), 1)
        return Inequality.of(self.A, self.B, self.C, self.D, self.dt, peak)

    @property
    def bits(self) -> int:
        """Size of the largest number on which the results depend, in binary digits."""
        exact = "characteristic" in self.__dict__
        return int(self.characteristic.numer().height_bits()) if exact else PRECISION

    @cached_property
    def characteristic(self) -> fmpq_poly:
        """``det(s - A)``, in discrete time of the continuous image: it has lower degree with a pole at ``z = -1``."""
        self.work.charge_entries(self.A.nrows(), 1)
        return self._image(characteristic_polynomial(tuple(self.A.entries())))

    @cached_property
    def whole(self) -> tuple[fmpq_poly, list[list[fmpq_poly]]]:
        """``a``, all poles, and ``N``."""
        p, m, n = self.D.nrows(), self.D.ncols(), self.A.nrows()
        self.work.charge_entries(self.A.nrows(), p * m)
        a, moments, X = characteristic_polynomial(tuple(self.A.entries())), [], self.B
        for _ in range(n):
            moments.append((self.C * X).tolist())
            X = self.A * X
        N = []
        for i in range(p):
            N.append([])
            for j in range(m):
                product = a * fmpq_poly([moment[i][j] for moment in reversed(moments)])
                N[i].append(self._image(fmpq_poly(product.coeffs()[n:]) + self.D[i, j] * a))
        return self._image(a), N

    @cached_property
    def response(self) -> tuple[fmpq_poly, list[list[fmpq_poly]]]:
        """``a`` and ``N`` without the factors common to all entries: poles that show in none are none."""
        a, N = self.whole
        common = a
        for entry in chain(*N):
            common = common.gcd(entry)
        return a / common, [[entry / common for entry in row] for row in N]

    def _image(self, p: fmpq_poly) -> fmpq_poly:
        """Return a polynomial in ``z``, of degree n at most, in ``s``: times ``(1 - s)^n`` at ``z = (1 + s)/(1 - s)``."""
        if self.dt == 0.0:
            return p
        c = p(fmpq_poly([-1, 2])).coeffs()  # in 1/u, u = 1 - s
        return fmpq_poly([fmpq(0)] * (self.A.nrows() + 1 - len(c)) + c[::-1])(fmpq_poly([1, -1]))

    @cached_property
    def sides(self) -> tuple[int, list[complex], list[complex]]:
        """Number of unstable poles; if zero, the poles on the stability boundary, and the poles of the response there."""
        p = self.characteristic
        both = _symmetric(p)
        decided = [root for root, count in self._roots(p / both) for _ in range(count)]
        # A root and its mirror image are both on the axis, or one of them is to the right of it.
        squares = _squares(both)
        right = sum(1 for root in decided if root.real > 0) + squares.degree() - len(self._positive(squares))
        lost = self.A.nrows() - p.degree() if self.dt else 0
        if right or not both.degree() + lost:
            return right, [], []
        a, N = self.response
        infinite = any(entry.degree() > a.degree() for row in N for entry in row)
        return right, self._on_axis(both) + [-1.0 + 0j] * lost, self._on_axis(_symmetric(a)) + [-1.0 + 0j] * infinite

    @property
    def slowest(self) -> complex:
        """The most unstable pole, in discrete time the largest, for messages."""
        return max(eigenvalues(self.A, self.work).tolist(), key=abs if self.dt else lambda pole: pole.real)

    def _on_axis(self, p: fmpq_poly) -> list[complex]:
        """Return the roots of a polynomial that are all on the axis; of a discrete system those on the circle."""
        omega = [float(x) ** 0.5 for x in self._positive(_squares(p))]
        s = [0j] * (p.degree() - 2 * len(omega)) + [side * 1j * w for w in omega for side in (1, -1)]
        return [(1.0 + x) / (1.0 - x) for x in s] if self.dt else s

    def _roots(self, p: fmpq_poly) -> list[tuple[acb, int]]:
        """Return the roots of a polynomial without any on the axis, so accurately that the side of each is certain."""
        return self._enclosed(
            lambda: isolated_roots(p, self.work),
            lambda roots: all(root.real > 0 or root.real < 0 for root, _ in roots),
        )

    def _positive(self, p: fmpq_poly) -> list[arb]:
        """Return the positive roots of a polynomial that has none at zero, in ascending order, as often as they occur."""

        def is_decided(root: acb) -> bool:
            side = root.real if root.imag == 0 else root.imag
            return side > 0 or side < 0

        roots = self._enclosed(
            lambda: isolated_roots(p, self.work), lambda roots: all(is_decided(root) for root, _ in roots)
        )
        real = [root.real for root, count in roots if root.imag == 0 for _ in range(count)]
        return sorted((x for x in real if x > 0), key=float)

    def crossings(self, level: float, inside: float = 1.0) -> tuple[list[arb], bool]:
        """Return the frequencies at which a singular value equals the level, and whether all are below it at one frequency.

        The crossings are ``omega^2`` in ascending order, of the image in discrete time, without zero and infinity.  All
        singular values are below the level if there are none, and if they are so at one frequency, ``omega^2 = inside``,
        where all leading minors are then positive.
        """
        a, N = self.whole  # each minor of G has the denominator a, so that divisions come out even
        hidden = _symmetric(a)
        growing, _, shown = self.sides
        if shown or (growing and hidden.degree()):
            raise UndecidedError
        rows = N if len(N) < len(N[0]) else [list(column) for column in zip(*N, strict=True)]  # the smaller product
        self.work.charge_entries(self.A.nrows(), len(rows) ** 2)
        zero, aa, square = fmpq_poly([0]), a * _flipped(a), fmpq(*level.as_integer_ratio()) ** 2
        left = [[-sum((x * _flipped(y) for x, y in zip(r, q, strict=True)), zero) for q in rows] for r in rows]
        for k in range(len(rows)):
            left[k][k] += square * aa
        minors = [aa]
        for k in range(len(rows)):
            pivot = left[k][k]
            if not pivot:  # a singular value that is the level at all frequencies
                raise UndecidedError
            for i in range(k + 1, len(rows)):
                for j in range(k + 1, len(rows)):
                    left[i][j] = (pivot * left[i][j] - left[i][k] * left[k][j]) / minors[-1]
            minors.append(pivot)
        # Poles on the axis cancel from the response: minors are zero there, with the multiplicity of aa.
        minors = [minor / (hidden * _flipped(hidden)) for minor in minors[1:]]
        crossings, at = self._positive(_squares(minors[-1])), fmpq(*inside.as_integer_ratio())
        return crossings, all(
            fmpq_poly([-x if k % 2 else x for k, x in enumerate(p.coeffs()[::2])])(at) > 0 for p in minors
        )

    def gain(self, square: float) -> arb:
        """Return a gain in one direction at ``omega^2``, which may be infinite, enclosed: the largest to within rounding."""
        a, N = self.response
        n = a.degree()

        def value() -> arb:
            if square == inf:
                return enclosed_gain(acb_mat([[acb(entry[n] / a[n]) for entry in row] for row in N]))
            s = acb(0, 1) * arb(square).sqrt()
            over = acb_poly(a)(s)
            if over.contains(0):
                raise ZeroDivisionError
            return enclosed_gain(acb_mat([[acb_poly(entry)(s) / over for entry in row] for row in N]))

        return self._enclosed(value, _is_narrow)

    def norm(self, square: float, band: tuple[float, float] = (0.0, inf)) -> tuple[float, float, float]:
        """Return bounds on the H-infinity norm of a stable system and ``omega^2`` of the peak, from an estimate of it.

        With ``band``, two values of ``omega^2``, the largest singular value between these.
        """
        a, N = self.response
        n, (low, high) = a.degree(), band
        through = (
            np.array([[float(entry[n] / a[n]) for entry in row] for row in N]) if high == inf else np.zeros((1, 1))
        )
        squares = {low, *(x for x in (square, high) if low <= x <= high and x < inf)}
        peak, at = max(
            (float(np.linalg.norm(through, 2)) * (1.0 - LEVEL), inf), *((below(self.gain(x)), x) for x in squares)
        )
        inside = 0.5 * (low + high) if high < inf else low + 1.0
        for _ in range(RAISED):
            level = max(peak * (1.0 + LEVEL), TINY)
            if not level < inf:  # larger than any float
                raise UndecidedError
            crossings, stays = self.crossings(level, inside)
            reached = [x for x in map(float, crossings) if low < x < high]
            if stays and not reached:
                return peak, level, at
            # The level is reached at these frequencies, or everywhere.
            reached = reached or [inside]
            ends = max(low, 0.25 * reached[0]), min(high, 4.0 * reached[-1])
            between = [(x * y) ** 0.5 for x, y in pairwise([ends[0], *reached, ends[1]])]
            peak, at = max(*((below(self.gain(x)), x) for x in between), (level, reached[0]))
        raise UndecidedError

    def check_norm(self) -> None:
        """Raise `UndecidedError` if a norm needs more operations than remain, before it is computed."""
        p, m = self.D.nrows(), self.D.ncols()
        self.work.check_entries(self.A.nrows(), p * m + min(p, m) ** 2)

    def energy(self) -> arb:
        """Return the square of the H2 norm of a stable system, enclosed; infinite by a feedthrough in continuous time."""
        if self.dt == 0.0 and any(chain(*self.D.tolist())):
            return arb("inf")
        a, N = self.response
        total = sum((entry * _flipped(entry) for row in N for entry in row), fmpq_poly([0]))
        if not total:
            return arb(0)
        if self.dt:  # dz/z on the circle is 2 ds/(1 - s^2) on the axis
            a, total = a * fmpq_poly([1, 1]), 2 * total
        n = a.degree()
        rows = [[(-1) ** i * 2 * a[2 * k - i] if 0 <= 2 * k - i <= n else 0 for i in range(n)] for k in range(n)]
        right = fmpq_mat([[total[2 * k]] for k in range(n)])
        return self._enclosed(lambda: arb_mat(fmpq_mat(rows)).solve(arb_mat(right))[n - 1, 0] / arb(a[n]), _is_narrow)

    def _enclosed(self, attempt: Callable[[], T], accept: Callable[[T], bool]) -> T:
        """Return the result of ``attempt`` at the first precision that is decisive; raise it while operations remain."""
        before, bits = flint.ctx.prec, BITS
        try:
            while bits <= _MOST_BITS:
                self.work.check()
                flint.ctx.prec = bits
                with suppress(ZeroDivisionError):
                    result = attempt()
                    if accept(result):
                        return result
                bits *= 2
        finally:
            flint.ctx.prec = before
        raise UndecidedError


def _is_narrow(x: arb) -> bool:
    return bool(x.rad() <= _DIGITS * x.mid())


def below(x: arb) -> float:
    """Return a double that is not above an enclosed number."""
    return float(np.nextafter(float(x.lower()), -inf))


def _flipped(p: fmpq_poly) -> fmpq_poly:
    """Return ``p(-s)``."""
    return fmpq_poly([-c if k % 2 else c for k, c in enumerate(p.coeffs())])


def _symmetric(p: fmpq_poly) -> fmpq_poly:
    """Return the factor of a polynomial whose roots have mirror images at the imaginary axis, or are on it."""
    return p.gcd(_flipped(p))


def _squares(p: fmpq_poly) -> fmpq_poly:
    """Return an even or odd polynomial in ``omega^2 = -s^2``, without its roots at zero."""
    c = p.coeffs()
    first = next((k for k, x in enumerate(c) if x), 0)
    return fmpq_poly([-x if k % 2 else x for k, x in enumerate(c[first::2])])


def _rational(system: Lti) -> Lti:
    """Return a system whose numbers are rational."""
    A, B, C, D = (
        np.array([*(fmpq(*x.as_integer_ratio()) for x in M.ravel().tolist()), None], dtype=object)[:-1].reshape(M.shape)
        for M in (system.A, system.B, system.C, system.D)
    )
    return replace(system, A=A, B=B, C=C, D=D)
