"""An oracle: random machines of rigid bodies and beams, and what they do, in exact rational arithmetic.

Every body has its place ``x, y, theta`` as if it were free, every beam its shift along its axis and the deflections and
slopes of its nodes; joints, cut joints, held and moved points are conditions with multipliers.  Places are decimal fractions
and directions have a rational tangent of half their angle, so that what cancels cancels exactly here and to rounding in the
description that a user gives.
"""

from dataclasses import dataclass, field
from fractions import Fraction
from math import atan2

import numpy as np
from flint import fmpq, fmpq_mat

from boomctl.structure import (
    GROUND,
    Assembly,
    Beam,
    BeamSegment,
    CutJoint,
    FiniteElements,
    Force,
    Joint,
    Output,
    RigidBody,
    SpringDamper,
)

X, Y, TURN = (Fraction(1), Fraction(0)), (Fraction(0), Fraction(1)), "theta"
HALF_TANGENTS = [Fraction(1, 2), Fraction(-1, 3), Fraction(3), Fraction(-2), Fraction(5, 7), Fraction(-11, 37)]


def sideways(d):
    return -d[1], d[0]


def less(a, b):
    """Return the difference of two rows, which are mappings from coordinate to number."""
    return {k: v for k in {**a, **b} if (v := a.get(k, 0) - b.get(k, 0))}


def spoken(d):
    """Return a direction as a description has it."""
    return {X: "x", Y: "y", TURN: TURN}.get(d) or atan2(float(d[1]), float(d[0]))


@dataclass
class Machine:
    """A machine as it is drawn: its description, and the same in fractions."""

    rng: np.random.Generator
    scale: Fraction
    rounded: bool
    bodies: list = field(default_factory=lambda: [GROUND])
    centers: list = field(default_factory=lambda: [None])  # of a beam: its direction and the places of its nodes
    first: list = field(default_factory=lambda: [None])  # of each body, its first coordinate
    n: int = 0
    inertia: list = field(default_factory=list)  # rows and their weights
    joints: list = field(default_factory=list)
    cuts: list = field(default_factory=list)
    links: list = field(default_factory=list)
    forces: list = field(default_factory=list)
    outputs: list = field(default_factory=list)
    seen: list = field(default_factory=list)  # bodies, place and direction of what is there

    def number(self, x):
        """Return a number in the description, in some machines with an error in its last place."""
        return float(np.nextafter(float(x), self.rng.choice([-np.inf, np.inf]))) if self.rounded and x else float(x)

    def at(self, body, place):
        return self.bodies[body].at_point(self.number(place[0]), self.number(place[1]))

    def row(self, body, place, d):
        """Return what the motion of a place of a body is along a direction, or its turn."""
        if body == 0:
            return {}
        first = self.first[body]
        if isinstance(self.bodies[body], Beam):
            way, nodes = self.centers[body]
            node = first + 1 + 2 * nodes.index(place)
            if d == TURN:
                return {node + 1: Fraction(1)}
            parts = (d[0] * way[0] + d[1] * way[1], d[1] * way[0] - d[0] * way[1])
            return {k: v for k, v in zip((first, node), parts, strict=True) if v}
        if d == TURN:
            return {first + 2: Fraction(1)}
        dx, dy = (place[i] - self.centers[body][i] for i in (0, 1))
        return {k: v for k, v in zip((first, first + 1, first + 2), (*d, dx * d[1] - dy * d[0]), strict=True) if v}

    def between(self, a, b, place, other, d):
        return less(self.row(a, place, d), self.row(b, other, d))

    def place(self, *bodies):
        """Return a place: of a beam a node, and anywhere for others; None if two beams have none in common."""
        nodes = [self.centers[b][1] for b in bodies if isinstance(self.bodies[b], Beam)]
        if nodes:
            common = [place for place in nodes[0] if place in nodes[-1]]
            return common[self.rng.integers(len(common))] if common else None
        return tuple(Fraction(int(k), 10) * self.scale for k in self.rng.integers(-20, 21, 2))

    def direction(self, turning=0.2):
        if self.rng.random() < turning:
            return TURN
        if self.rng.random() < 0.5:
            return X if self.rng.random() < 0.5 else Y
        t = HALF_TANGENTS[self.rng.integers(len(HALF_TANGENTS))]
        return (1 - t * t) / (1 + t * t), 2 * t / (1 + t * t)

    def pair(self):
        """Return two bodies, a place on each, and a direction: new ones, or those of a part that is there, moved along."""
        rng = self.rng
        if self.seen and rng.random() < 0.5:
            a, b, place, d = self.seen[rng.integers(len(self.seen))]
            a, b = (b, a) if a == 0 else (a, b)
            if d == TURN:
                return a, b, self.place(a), self.place(b), d
            return a, b, self.along(a, place, d), self.along(b, place, d), d
        a = int(rng.integers(1, len(self.bodies)))
        b = int(rng.choice([k for k in range(len(self.bodies)) if k != a]))
        one = rng.random() < 0.7 and self.place(a, b)
        return a, b, one or self.place(a), one or self.place(b), self.direction()

    def along(self, body, place, d):
        """Return a place on the line through another one; of a beam that place, if it is a node, or any node."""
        if isinstance(self.bodies[body], Beam):
            return place if place in self.centers[body][1] else self.place(body)
        way = Fraction(int(self.rng.integers(-20, 21)), 10) * self.scale
        return place[0] + way * d[0], place[1] + way * d[1]

    def added_beam(self, name, parent, place, joint, size):
        """Add a beam of a few elements through a place, and return it."""
        rng, way = self.rng, self.direction(0.0)
        steps = [Fraction(int(k), 10) * self.scale for k in rng.integers(1, 9, rng.integers(1, 4))]
        at = int(rng.integers(len(steps) + 1))
        start = sum(steps[:at], Fraction(0))
        stations = [sum(steps[:k], Fraction(0)) for k in range(len(steps) + 1)]
        nodes = [tuple(place[i] + (s - start) * way[i] for i in (0, 1)) for s in stations]
        mass, stiffness, damping = (
            10.0 ** rng.uniform(-1, 1) / size,
            size**3 * 10.0 ** rng.uniform(-1, 3),
            10.0 ** rng.uniform(-4, -2),
        )
        section = BeamSegment(float(stations[-1]), mass, stiffness, damping)
        mesh = FiniteElements(tuple(float(s) for s in stations))
        corner = tuple(float(x) for x in nodes[0])
        beam = Beam(name, self.at(parent, place), joint, corner, (section,), mesh, atan2(float(way[1]), float(way[0])))
        first = self.n
        self.bodies.append(beam)
        self.centers.append((way, nodes))
        self.first.append(first)
        self.n += 1 + 2 * len(nodes)
        self.inertia.append(({first: Fraction(1)}, Fraction(mass) * stations[-1]))
        for k, h in enumerate(steps):
            w, p, v, q = range(first + 1 + 2 * k, first + 5 + 2 * k)
            turn = {p: h / 2, q: -h / 2}
            # curvature is a mean and a slope; the deflection of a cubic in Legendre polynomials of the element
            mean, slope = {p: -1 / h, q: 1 / h}, {w: 6 / h**2, v: -6 / h**2, p: 3 / h, q: 3 / h}
            for row, share in ((mean, h), (slope, h / 3)):
                self.links.append((row, share * Fraction(stiffness), share * Fraction(stiffness) * Fraction(damping)))
            shapes = (
                {w: Fraction(1, 2), v: Fraction(1, 2), p: h / 12, q: -h / 12},
                {w: Fraction(-3, 5), v: Fraction(3, 5), p: -h / 20, q: -h / 20},
                {k: -x / 6 for k, x in turn.items()},
                {w: Fraction(1, 10), v: Fraction(-1, 10), p: h / 20, q: h / 20},
            )
            for degree, row in enumerate(shapes):
                self.inertia.append((row, Fraction(mass) * h / (2 * degree + 1)))
        return beam


def drawn(seed, beams=0.2):
    """Return a random machine, from millimeters to kilometers, held and moved at some of its forces; a share of beams."""
    rng = np.random.default_rng(seed)
    m = Machine(
        rng, Fraction(int(rng.integers(1, 100)), 10) * Fraction(10) ** int(rng.integers(-3, 4)), rng.random() < 0.3
    )
    size = float(m.scale)
    for i in range(1, int(rng.integers(2, 7))):
        parent = int(rng.integers(i)) if rng.random() < 0.6 else 0
        place = m.place(parent)
        slides = [m.direction(0.0)][: rng.integers(2)]
        slides += [sideways(slides[0])] if slides and rng.random() < 0.4 else []
        turns = bool(rng.random() < 0.6) or not slides
        joint = Joint(tuple((f"s{k}", atan2(float(d[1]), float(d[0]))) for k, d in enumerate(slides)), turns)
        if rng.random() < beams:
            m.added_beam(f"b{i}", parent, place, joint, size)
        else:
            center = m.place() if rng.random() < 0.6 else place
            mass, inertia = 10.0 ** rng.uniform(-1, 1), size**2 * 10.0 ** rng.uniform(-2, 0.5)
            at = tuple(m.number(x) for x in center)
            m.bodies.append(RigidBody(f"b{i}", m.at(parent, place), joint, mass, inertia, at))
            m.centers.append(center)
            m.first.append(m.n)
            m.inertia += [({m.n + k: Fraction(1)}, Fraction(x)) for k, x in enumerate((mass, mass, inertia))]
            m.n += 3
        closed = [X, Y] if not slides else [sideways(slides[0])] if len(slides) == 1 else []
        for d in [*closed, *([] if turns else [TURN])]:
            m.joints.append(m.between(i, parent, place, place, d))
            m.seen.append((i, parent, place, d))
    forces, links, outputs, cuts = [], [], [], []
    for k in range(int(rng.integers(1, 5))):
        a, b, place, other, d = m.pair()
        alone = rng.random() < 0.5
        forces.append(Force(f"f{k}", m.at(a, place), spoken(d), None if alone else m.at(b, other)))
        m.forces.append(m.row(a, place, d) if alone else m.between(a, b, place, other, d))
        m.seen.append((a, 0 if alone else b, place, d))
    if len(m.bodies) > 2 and rng.random() < 0.5:
        a, b = rng.choice(np.arange(1, len(m.bodies)), 2, replace=False).tolist()
        place, ways = m.place(a, b), [m.direction() for _ in range(int(rng.integers(1, 3)))]
        if place:
            cuts.append(CutJoint(m.at(a, place), m.at(b, place), tuple(spoken(d) for d in ways)))
            m.cuts = [m.between(a, b, place, place, d) for d in ways]
            m.seen += [(a, b, place, d) for d in ways]
    for _ in range(int(rng.integers(1, 2 * len(m.bodies)))):
        a, b, place, other, d = m.pair()
        unit = size**2 if d == TURN else 1.0
        k, c = unit * 10.0 ** rng.uniform(-1, 3), unit * 10.0 ** rng.uniform(-3, 1)
        k, c = (0.0, c) if rng.random() < 0.2 else (k, 0.0) if rng.random() < 0.2 else (k, c)
        links.append(SpringDamper(m.at(a, place), m.at(b, other), spoken(d), k, c))
        m.links.append((m.between(a, b, place, other, d), Fraction(k), Fraction(c)))
    for k in range(int(rng.integers(1, 4))):
        a, b, place, other, d = m.pair()
        alone = rng.random() < 0.5
        outputs.append(Output(f"y{k}", m.at(a, place), spoken(d), None if alone else m.at(b, other)))
        m.outputs.append(m.row(a, place, d) if alone else m.between(a, b, place, other, d))
    used = rng.random(len(forces)) + 0.1
    held, moved = (np.flatnonzero(chosen).tolist() for chosen in (used < 0.3, (used >= 0.3) & (used < 0.6)))
    return m, Assembly(tuple(m.bodies[1:]), tuple(links), tuple(forces), tuple(outputs), tuple(cuts)), moved, held


def matrix(rows, n):
    found = fmpq_mat(len(rows), n)
    for i, row in enumerate(rows):
        for k, value in row.items():
            found[i, k] = fmpq(value.numerator, value.denominator)
    return found


def allowed(rows, n):
    """Return the motions that conditions leave, as columns, and how many of the conditions say something."""
    reduced, rank = matrix(rows, n).rref()
    pivots = [next(j for j in range(n) if reduced[i, j] != 0) for i in range(rank)]
    rest = [j for j in range(n) if j not in pivots]
    T = fmpq_mat(n, len(rest))
    for column, j in enumerate(rest):
        T[j, column] = 1
        for i, p in enumerate(pivots):
            T[p, column] = -reduced[i, j]
    return T, rank


def response(m, moved, held, omega):
    """Return the coordinates left, outputs and reactions of all inputs kept, and sizes of what outputs sum; or None.

    None: the joints contradict each other, nothing is left to move, or something is prescribed that cannot be.
    """
    n, pushed = m.n, moved + held
    _, said = allowed(m.joints, n)
    T, all_said = allowed(m.joints + m.cuts, n)
    J = matrix([m.forces[i] for i in pushed], n) * T
    left = T.ncols() - len(pushed)
    if all_said < said + len(m.cuts) or left <= 0 or J.rank() < len(pushed):
        return None
    R, N = (matrix([row for row, *_ in rows], n) * T for rows in (m.links, m.inertia))
    K, C = (R.transpose() * scaled(R, [link[which] for link in m.links]) for which in (1, 2))
    M = N.transpose() * scaled(N, [weight for _, weight in m.inertia])
    F, L = matrix(m.forces, n) * T, matrix(m.outputs, n) * T
    inputs = [i for i in range(len(m.forces)) if i not in held]
    q, size = T.ncols(), T.ncols() + len(pushed)
    values = np.zeros((L.nrows() + len(pushed), len(inputs), len(omega)), complex)
    sizes = np.zeros_like(values, dtype=float)
    for f, w in enumerate(omega):
        s = fmpq(*float(w).as_integer_ratio())
        A, B = fmpq_mat(2 * size, 2 * size), fmpq_mat(2 * size, len(inputs))
        for i in range(q):
            for j in range(q):
                A[i, j] = A[size + i, size + j] = K[i, j] - s * s * M[i, j]
                A[i, size + j], A[size + i, j] = -s * C[i, j], s * C[i, j]
            for k in range(len(pushed)):
                A[i, q + k] = A[size + i, size + q + k] = -J[k, i]
                A[q + k, i] = A[size + q + k, size + i] = J[k, i]
            for c, force in enumerate(inputs):
                B[i, c] = 0 if force in pushed else F[force, i]
        for c, force in enumerate(inputs):
            if force in pushed:
                B[q + pushed.index(force), c] = 1
        found = A.solve(B)
        X = [[complex(real(found[i, c]), real(found[size + i, c])) for c in range(len(inputs))] for i in range(size)]
        read = fmpq_mat(L.nrows(), size)
        for o in range(L.nrows()):
            for j in range(q):
                read[o, j] = L[o, j]
        parts = [fmpq_mat(found.tolist()[at : at + size]) for at in (0, size)]
        re, im = (np.array([[real(x) for x in row] for row in (read * part).tolist()]) for part in parts)
        weights = np.abs([[real(x) for x in row] for row in read.tolist()])
        values[: L.nrows(), :, f], values[L.nrows() :, :, f] = re + 1j * im, X[q:] if pushed else 0.0
        sizes[: L.nrows(), :, f] = weights @ np.abs(X)
    return left, values, sizes


def scaled(rows, weights):
    found = fmpq_mat(rows.nrows(), rows.ncols())
    for i, weight in enumerate(weights):
        for j in range(rows.ncols()):
            found[i, j] = rows[i, j] * fmpq(weight.numerator, weight.denominator)
    return found


def real(x):
    return float(Fraction(int(x.p), int(x.q)))
