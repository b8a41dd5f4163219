"""Random structures: well-conditioned matrices, planar machines, stepped beams."""

from dataclasses import dataclass

import numpy as np
from hypothesis import strategies as st

from boomctl.structure import (
    GROUND,
    Assembly,
    Beam,
    BeamSegment,
    FiniteElements,
    Force,
    Output,
    RigidBody,
    SecondOrderModel,
    SpringDamper,
    fixed,
    planar,
    prismatic,
    revolute,
)

__all__ = ["Structure", "matrices", "random_machine", "random_stepped_beam", "seeds", "structures"]

seeds = st.integers(0, 2**32 - 1)


@dataclass(frozen=True, repr=False)
class Structure:
    """A force-driven model, kept as the plain matrices it was made from."""

    M: np.ndarray
    C: np.ndarray
    K: np.ndarray
    B: np.ndarray
    L: np.ndarray

    @property
    def model(self):
        """The model, forces ``f0, f1, ...`` and outputs ``y0, y1, ...``."""
        return SecondOrderModel(
            self.M,
            self.C,
            self.K,
            {f"f{i}": column for i, column in enumerate(self.B.T)},
            {f"y{i}": line for i, line in enumerate(self.L)},
        )


def matrices(rng, n):
    """Return M, C, K: cond(M) up to 16, natural frequencies of 1 to 3 rad/s, every mode damped by at least a tenth."""
    Q, P = (np.linalg.qr(rng.standard_normal((n, n)))[0] for _ in range(2))
    root = Q * rng.uniform(0.5, 2.0, n) @ Q.T
    omega = rng.uniform(1.0, 3.0, n)
    damper = rng.standard_normal((n, 1))
    C = P * (0.2 * omega * rng.uniform(1.0, 2.0, n)) @ P.T + 0.3 * damper @ damper.T / n
    return _even(root @ root), _even(root @ C @ root), _even(root @ (P * omega**2) @ P.T @ root)


def _even(matrix):
    return 0.5 * (matrix + matrix.T)


@st.composite
def structures(draw, least=3, most=8, inputs=3, outputs=2):
    """Return a structure with at least ``inputs + 1`` coordinates."""
    n = draw(st.integers(max(least, inputs + 1), most))
    rng = np.random.default_rng(draw(seeds))
    return Structure(*matrices(rng, n), rng.standard_normal((n, inputs)), rng.standard_normal((outputs, n)))


def random_machine(seed, grounded=True, kinds=("rigid", "beam"), at_nodes=False):
    """Return a random tree of rigid bodies and beams with links, forces and collocated outputs of the same names.

    A machine that is not grounded floats: its first body moves freely and nothing else touches the ground.  Links act
    along the line between their ends, as springs do, or on rotation.  ``at_nodes``: beams are attached to at nodes.
    """
    rng = np.random.default_rng(seed)

    def somewhere(body):
        if not isinstance(body, Beam):
            return body.at(*rng.uniform(-1, 1, 2))
        station = rng.choice(body.discretization.elements) if at_nodes else rng.uniform(0.0, body.length)
        return body.at(float(station))

    chosen = rng.choice(kinds, int(rng.integers(1, 4)))
    parent = GROUND.at(*rng.uniform(-1, 1, 2))
    bodies = [RigidBody("root", parent, planar("x", "y", "theta"), *rng.uniform(1, 3, 2), tuple(rng.uniform(-1, 1, 2)))]
    for i, kind in enumerate(chosen):
        parent = somewhere(bodies[int(rng.integers(len(bodies)))])
        bodies.append(_rigid(rng, f"body{i}", parent) if kind == "rigid" else _beam(rng, f"beam{i}", parent, at_nodes))
    pairs = list(zip(bodies[1:], bodies[:-1], strict=True))
    links = [_link(rng, somewhere(a), somewhere(b)) for a, b in pairs]
    if grounded:
        place = GROUND.at(*rng.uniform(-1, 1, 2))
        links += [SpringDamper(bodies[0].at(*rng.uniform(-1, 1, 2)), place, d, 4.0, 1.0) for d in ("x", "y", "theta")]
    forces, outputs = [], []
    for i, body in enumerate(bodies[-3:]):
        point, direction = somewhere(body), _direction(rng)
        forces.append(Force(f"p{i}", point, direction))
        outputs.append(Output(f"p{i}", point, direction))
    point, reaction = (somewhere(body) for body in pairs[-1])
    forces.append(Force("pair", point, "x", reaction_point=reaction))
    outputs.append(Output("pair", point, "x", relative_to=reaction))
    return Assembly(tuple(bodies), tuple(links), tuple(forces), tuple(outputs))


def _direction(rng):
    return ["x", "y", "theta", float(rng.uniform(-3, 3))][int(rng.integers(4))]


def _link(rng, a, b):
    line = float(np.arctan2(b.y - a.y, b.x - a.x))
    return SpringDamper(a, b, "theta" if rng.uniform() < 0.3 else line, *rng.uniform(0.5, 5.0, 2))


def _rigid(rng, name, parent):
    joint = (fixed(), revolute(), prismatic(float(rng.uniform(-3, 3))))[int(rng.integers(3))]
    mass, inertia, x, y = rng.uniform(0.5, 2.0, 4)
    return RigidBody(name, parent, joint, mass, inertia, (x, y))


def _beam(rng, name, parent, at_nodes):
    joint = (fixed(), revolute(), planar("y", "theta"))[int(rng.integers(3))]
    sections = tuple(BeamSegment(*rng.uniform((0.5, 1.0, 20.0, 0.0), (1.5, 2.0, 40.0, 0.01))) for _ in range(2))
    middle, end = sections[0].length, sections[0].length + sections[1].length
    nodes = [(0.0, middle, end), (0.0, middle / 2, middle, (middle + end) / 2, end)][int(rng.integers(2))]
    angle, station = float(rng.uniform(-3, 3)), float(rng.choice(nodes) if at_nodes else rng.uniform(0.0, end))
    start = (parent.x - station * np.cos(angle), parent.y - station * np.sin(angle))
    return Beam(name, parent, joint, start, sections, FiniteElements(nodes), angle)


def random_stepped_beam(seed, order=None):
    """Return a stepped beam, held in one of three ways, with a knob on its first section and a spring to its last.

    Nodes stand where sections end and where something is attached; elements are cubic unless ``order`` is given.
    """
    rng = np.random.default_rng(seed)
    joint = (fixed(), revolute(), planar("y", "theta"))[int(rng.integers(3))]
    sections = tuple(BeamSegment(*rng.uniform((0.4, 0.5, 0.5), (1.0, 2.0, 4.0))) for _ in range(rng.integers(1, 4)))
    ends = np.cumsum([0.0, *(section.length for section in sections)])
    here, there = float(ends[1] / 2), float(ends[-1] - sections[-1].length / 4)
    mesh = FiniteElements(tuple(sorted({*ends.tolist(), here, there})), order or 3)
    beam = Beam("beam", GROUND.at(0.0), joint, (0.0, 0.0), sections, mesh)
    knob = RigidBody("knob", beam.at(here), fixed(), *rng.uniform(0, 1, 2))
    spring = SpringDamper(beam.at(there), GROUND.at(there), "y", float(rng.uniform(0.0, 20.0)))
    end = beam.at(beam.length)
    return Assembly((beam, knob), (spring,), (Force("tip", end),), (Output("tip", end),))
