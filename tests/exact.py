"""An oracle: norms, poles, margins and reduction errors of the doubles given, in exact integer arithmetic.

Every double is an integer times a power of two.  With time in units of such a power, ``A`` is a matrix of integers,
its characteristic polynomial has integer coefficients, and so has everything else: the transfer matrix ``N/D``, the
polynomials in ``x = omega^2`` whose real roots are where a singular value equals a level, and where a loop is real or of
size one.  Roots are isolated by FLINT, with proof.  Nothing is rounded before the last line of each function.

Singular values of two rows or columns at most: they are the roots of ``den g^4 - trace g^2 + minors = 0`` in ``g``.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations, pairwise
from math import inf

import numpy as np
from flint import arb, ctx, fmpq, fmpz_mat, fmpz_poly

BITS = 200  # of what is returned by roots and square roots: 60 digits
ABOVE = 1e-10  # how far above the largest value found a level is proved not to be reached, relative
ROUNDS = 60  # of raising a level; each rises to a higher peak, and four or five do
MOST_BITS = 1 << 20  # of intermediate results, where fewer lose all digits
S = fmpz_poly([0, 1])


def integers(matrix):
    """Return a matrix of doubles as integers, and the power of two they are to be multiplied by."""
    parts = [[x.as_integer_ratio() for x in row] for row in np.atleast_2d(np.asarray(matrix, dtype=float)).tolist()]
    down = max([d.bit_length() - 1 for row in parts for _, d in row], default=0)
    return [[n << (down - d.bit_length() + 1) for n, d in row] for row in parts], -down


def in_x(even):
    """Return ``e(s)``, an even polynomial, as a polynomial in ``x``, ``s^2 = -x``."""
    return fmpz_poly([(-c if k % 2 else c) for k, c in enumerate(even.coeffs()[::2])])


def mirrored(p):
    return p(-S)


def size(p):
    """Return ``|p(i omega)|^2`` as a polynomial in ``x = omega^2``."""
    return in_x(p * mirrored(p))


def roots(p):
    """Return the roots of a polynomial, each as often as it occurs; real ones have the imaginary part zero."""
    with_bits(BITS)
    return [r for r, count in p.complex_roots() for _ in range(int(count))] if p.degree() > 0 else []


def with_bits(bits):
    ctx.prec = bits


def dyadic(x):
    """Return a double, or the middle of a ball, as an exact fraction."""
    if isinstance(x, arb):
        man, exponent = x.mid().man_exp()
        man, exponent = int(man), int(exponent)
        return fmpq(man << exponent, 1) if exponent >= 0 else fmpq(man, 1 << -exponent)
    n, d = float(x).as_integer_ratio()
    return fmpq(n, d)


def positive_real(p):
    """Return the positive real roots of a polynomial."""
    return [r.real for r in roots(p) if r.imag.is_zero() and r.real > 0]


def ball(q):
    return arb(q.p) / arb(q.q) if isinstance(q, fmpq) else arb(q)


@dataclass(frozen=True)
class Exact:
    """A transfer matrix ``N(s)/(D(s) 2^shift)``, ``s`` in units of ``2^time`` rad/s; ``D`` has all poles, hidden ones too."""

    den: fmpz_poly
    num: tuple[tuple[fmpz_poly, ...], ...]
    shift: int
    time: int

    @classmethod
    def of(cls, system):
        """Return what the matrices of a state-space system say."""
        A, B, C, D = (np.asarray(x, dtype=float) for x in (system.A, system.B, system.C, system.D))
        n = len(A)
        (b, shift_b), (c, shift_c), (d, shift_d) = integers(B), integers(C), integers(D)
        if not n:
            return cls(fmpz_poly([1]), tuple(tuple(fmpz_poly([x]) for x in row) for row in d), -shift_d, 0)
        a, time = integers(A)
        den, Ai, columns = fmpz_mat(a).charpoly(), fmpz_mat(a), fmpz_mat(b)
        markov = []
        for _ in range(n):
            markov.append((fmpz_mat(c) * columns).tolist())
            columns = Ai * columns
        # C (sI - A)^-1 B = 2^(b + c - time) N(t)/D(t), and D on the same scale
        low = min(shift_b + shift_c - time, shift_d)
        up, up_d = shift_b + shift_c - time - low, shift_d - low
        num = []
        for i in range(D.shape[0]):
            row = []
            for j in range(D.shape[1]):
                h = fmpz_poly([markov[k][i][j] for k in range(n - 1, -1, -1)])  # sum of h_k t^(n-1-k)
                proper = fmpz_poly((den * h).coeffs()[n:])  # the polynomial part of D(t) sum of h_k t^-k-1
                row.append(proper * (1 << up) + den * (d[i][j] << up_d))
            num.append(tuple(row))
        return cls(den, tuple(num), -low, time)

    def __sub__(self, other):
        time = min(self.time, other.time)
        one, two = self.in_units(time), other.in_units(time)
        shift = max(one.shift, two.shift)
        up, down = 1 << (shift - one.shift), 1 << (shift - two.shift)
        num = tuple(
            tuple(p * two.den * up - q * one.den * down for p, q in zip(r, s, strict=True))
            for r, s in zip(one.num, two.num, strict=True)
        )
        return Exact(one.den * two.den, num, shift, time)

    def in_units(self, time):
        """Return the same with ``s`` in finer units."""
        n, step = self.den.degree(), self.time - time
        # p(s/2^step) 2^(n step), of numerators and denominator alike

        def finer(p):
            return fmpz_poly([c << (step * (n - k)) if step else c for k, c in enumerate(map(int, p.coeffs()))])

        return Exact(finer(self.den), tuple(tuple(map(finer, row)) for row in self.num), self.shift, time)

    @cached_property
    def poles(self):
        """Poles in the units of ``s``."""
        return roots(self.den)

    @property
    def unit(self):
        return arb(2) ** self.time

    def poles_in_rad(self):
        return [p * self.unit for p in self.poles]

    @property
    def stable(self):
        return all(p.real < 0 for p in self.poles)

    @property
    def unstable(self):
        """Whether a pole is to the right of the axis, one that no signal shows included."""
        return any(not p.real.is_zero() and p.real > 0 for p in self.poles if not on_axis(p, self.den))

    @property
    def damping(self):
        """Least ``-Re p/|p|`` of all poles; negative with an unstable one, 0 with one at zero or on the axis."""
        least = arb(1)
        for p in self.poles:
            here = arb(0) if on_axis(p, self.den) else -p.real / abs(p)
            least = here if here < least else least
        return float(least)

    @cached_property
    def squares(self):
        """``den, trace, minors``, without common factors: polynomials in ``x`` whose signs are those of squares."""
        p, rows, columns = self.num, range(len(self.num)), range(len(self.num[0]))
        if min(len(rows), len(columns)) > 2:
            raise ValueError("two rows or columns at most")
        den = size(self.den)
        trace = sum((size(entry) for row in p for entry in row), fmpz_poly([0]))
        minors = fmpz_poly([0])
        for i, j in combinations(rows, 2):
            for k, m in combinations(columns, 2):
                minor = p[i][k] * p[j][m] - p[i][m] * p[j][k]
                quotient, rest = divmod(minor, self.den)
                assert not rest
                minors += size(quotient)
        common = den.gcd(trace).gcd(minors)
        if den.leading_coefficient() * common.leading_coefficient() < 0:
            common = -common
        return den // common, trace // common, minors // common

    def largest_at(self, x):
        """Return the largest singular value at ``x = omega^2``, a fraction or ``inf``."""
        if x == inf:
            top = self.squares[0].degree()
            den, trace, minors = (fmpq(p[top]) for p in self.squares)
        else:
            den, trace, minors = (p(x) for p in self.squares)
        if den == 0:
            return arb("inf")
        with_bits(BITS)
        half, product = trace / den / 2, minors / den
        inside = half * half - product
        square = ball(half) + (ball(inside).sqrt() if inside > 0 else 0)
        return square.sqrt() * arb(2) ** (-self.shift)

    def peak(self):
        """Return the largest singular value on the axis between two bounds, and where: doubles, ``inf`` if unbounded."""
        den, trace, minors = self.squares
        if not trace:
            return 0.0, 0.0, 0.0
        if den[0] == 0:
            return inf, inf, 0.0
        with_bits(BITS)
        found = positive_real(den)
        if found:
            return inf, inf, float(found[0].sqrt() * self.unit)
        at = [fmpq(0), inf, *(dyadic(p.imag) ** 2 for p in self.poles), *(dyadic(abs(p)) ** 2 for p in self.poles)]
        best, where = arb(-1), at[0]
        for x in at:
            value = self.largest_at(x)
            if value > best:
                best, where = value, x
        for _ in range(ROUNDS):
            level = dyadic(float_up(best * (1 + arb(ABOVE)) * arb(2) ** self.shift))  # of N/D alone
            g = level * level
            # times the square of the denominator of g: integers
            test = den * (g.p * g.p) - trace * (g.p * g.q) + minors * (g.q * g.q)
            crossings = sorted(positive_real(test), key=float)
            if not crossings and test[0] > 0:
                where = inf if where == inf else float(arb(ball(where)).sqrt() * self.unit)
                return float(best), float(ball(level) * arb(2) ** (-self.shift)), where
            ends = [fmpq(0), *(dyadic(x.sqrt()) for x in crossings)]
            tried = [((a + b) / 2) ** 2 for a, b in pairwise(ends)] + [e * e for e in ends]
            values = [self.largest_at(x) for x in tried]
            top = max(range(len(tried)), key=lambda k: values[k].mid())
            if not values[top] > best:
                raise ArithmeticError("a level is crossed where no value is above it")
            best, where = values[top], tried[top]
        raise ArithmeticError("the level was raised too often")

    def norm(self):
        """Return two bounds of the H-infinity norm, and where it is attained; ``inf`` if unstable."""
        return (inf, inf, float("nan")) if self.unstable else self.peak()

    def h2(self):
        """Return the H2 norm, ``inf`` if unstable or with a feedthrough or a pole on the axis that shows."""
        n = self.den.degree()
        if self.unstable or any(p.degree() >= n and p for row in self.num for p in row):
            return inf
        common = self.den
        for row in self.num:
            for p in row:
                common = common.gcd(p)
        den = self.den // common
        num = [p // common for row in self.num for p in row if p]
        if any(on_axis(p, den) for p in roots(den)):
            return inf
        bits = BITS
        while bits < MOST_BITS:
            with_bits(bits)
            square = sum((line_integral(den, p) for p in num), arb(0))
            if square.is_finite() and (square.rel_accuracy_bits() > BITS // 2 or square.is_zero()):
                return float((square * self.unit).sqrt() * arb(2) ** (-self.shift))
            bits *= 2
        raise ArithmeticError("no digits left")


def float_up(x):
    return float(x.upper()) if isinstance(x, arb) else x


def on_axis(root, p):
    """Return whether a root of a polynomial lies on the imaginary axis, by proof: it is one of its mirror image too."""
    if root.real.is_zero():
        return True
    if not root.real.contains(0):
        return False
    common = p.gcd(mirrored(p))  # symmetric about the axis, and of real polynomials also about the origin
    return any(r.overlaps(root) and r.real.contains(0) for r in roots(common))


def line_integral(den, num):
    """Return the integral of ``|num/den|^2`` along the axis over 2 pi, by the reduction of Astrom and Jury."""
    n = den.degree()
    a = [arb(c) for c in reversed(den.coeffs())]
    b = [arb(0)] * (n - 1 - num.degree()) + [arb(c) for c in reversed(num.coeffs())]  # b[i - 1] is that of s^(k-i)
    total = arb(0)
    for k in range(n, 0, -1):
        alpha, beta = a[0] / a[1], b[0] / a[1]
        total += beta * beta / (2 * alpha)
        padded = [*a, arb(0)]
        b = [b[i] if i % 2 else b[i] - beta * padded[i + 1] for i in range(1, k)]
        a = [padded[i + 1] if i % 2 == 0 else padded[i + 1] - alpha * padded[i + 2] for i in range(k)]
    return total


@dataclass(frozen=True)
class LoopTruth:
    """Margins of a loop ``L`` closed with positive feedback; the words are those of ``boomctl.LoopMargin``."""

    gain_low: float
    gain_high: float
    phase_margin_deg: float
    delay_margin: float
    alpha: float


def loop_of(*parts):
    """Return the product of transfer functions of one signal, without a shift: ``N/D`` of integers, and its time."""
    time = min(part.time for part in parts)
    num, den = fmpz_poly([1]), fmpz_poly([1])
    for part in (part.in_units(time) for part in parts):
        num, den = num * part.num[0][0], den * part.den
        num, den = (num, den * (1 << part.shift)) if part.shift >= 0 else (num * (1 << -part.shift), den)
    return num, den, time


def loop_is_stable(num, den):
    return all(p.real < 0 for p in roots(den - num))


def loop_truth(num, den, time):
    """Return the margins of ``L = num/den``, whose loop is stable."""
    crossed = num * mirrored(den)  # L |den|^2
    real = in_x(fmpz_poly([0 if k % 2 else c for k, c in enumerate(crossed.coeffs())]))
    odd = in_x(fmpz_poly(crossed.coeffs()[1:])(S) if crossed.degree() > 0 else fmpz_poly([0]))  # Im L |den|^2/omega
    size_n, size_d = size(num), size(den)
    low, high, phase, delay = 0.0, inf, inf, inf
    static = float_ratio(num[0], den[0]) if den[0] else None
    top = max(den.degree(), num.degree())
    fast = float_ratio(num[top], den[top])
    found = [x for x in (static, fast) if x is not None]
    finite = odd // odd.gcd(size_d) if odd else odd  # not at poles of the loop on the axis
    found += [float(L) for (L,) in at_roots(finite, lambda x: (real(x) / size_d(x),))]
    for value in found:
        if value > 0.0:
            factor = 1.0 / value
            low, high = (max(low, factor), high) if factor < 1.0 else (low, min(high, factor))
    angles = at_roots(size_n - size_d, lambda x: (arb.atan2(x.sqrt() * odd(x), real(x)), x.sqrt()))
    for angle, omega in angles:
        phase = min(phase, abs(float(angle)))
        late = float(angle) % (2.0 * np.pi) / float(omega * arb(2) ** time)
        delay = min(delay, late)
    if static is not None and num[0] ** 2 == den[0] ** 2:
        phase = min(phase, 0.0 if static > 0.0 else np.pi)
    if num[top] ** 2 == den[top] ** 2:
        phase = min(phase, 0.0 if fast > 0.0 else np.pi)
    if abs(fast) >= 1.0:
        delay = 0.0
    norm = Exact(den - num, ((den + num,),), 0, time).peak()[0]
    return LoopTruth(low, high, float(np.degrees(phase)), delay, 2.0 / max(norm, 1.0))


def float_ratio(n, d):
    with_bits(BITS)
    return float(arb(n) / arb(d))


def at_roots(p, values):
    """Return values at the positive real roots of a polynomial, all to 30 digits at least, or to 60 places if zero."""
    bits = 2 * BITS
    while bits < MOST_BITS and p.degree() > 0:
        with_bits(bits)
        found = [values(r.real) for r, _ in p.complex_roots() if r.imag.is_zero() and r.real > 0]
        if all(x.rel_accuracy_bits() > BITS // 2 or abs(x) < arb(2) ** -BITS for value in found for x in value):
            return found
        bits *= 2
    if p.degree() > 0:
        raise ArithmeticError("no digits left")
    return []
