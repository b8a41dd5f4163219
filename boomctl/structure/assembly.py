"""Assembly: description of a machine, and its equations of motion.

The geometry of the parts determines the kinematics of a machine: its :class:`Mechanism`, the free coordinates and the rows
over them.  Masses and stiffnesses are the weights of these rows.  Machines that differ only in weights share one mechanism,
which is computed once.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import lru_cache
from itertools import pairwise
from math import hypot

import numpy as np
from scipy import linalg

from boomctl.arrays import Array, combined
from boomctl.checks import instance, sequence, warn_user
from boomctl.lti.rounding import ALIKE, CANCELLED
from boomctl.printing import count, listed, signals
from boomctl.structure.beams.elements import DiscreteElements, FiniteElements, distinct, element_nodes
from boomctl.structure.beams.exact import ExactLayout, ExactModel
from boomctl.structure.beams.mesh import BeamMesh
from boomctl.structure.elimination import eliminate
from boomctl.structure.kinematics import Kinematics, Row, attachments, kinematics
from boomctl.structure.layout import CACHE_SIZE, Layout, Weights
from boomctl.structure.matrices import Structure
from boomctl.structure.model import SecondOrderModel
from boomctl.structure.outline import Line, Outline
from boomctl.structure.parts import Beam, CutJoint, Force, Ground, Output, Point, RigidBody, SpringDamper
from boomctl.structure.ports import Ports
from boomctl.threads import one_blas_thread
from boomctl.units import motion_unit

_DRAWN = 10  # Number of plotted points per element.
_POINTS = (60, 600)  # Limits on the number of plotted points per beam.
_DIVISION = 0.41421356  # Fraction of its length at which a free beam is divided: sqrt 2 - 1, no node of a low mode.


@dataclass(frozen=True)
class Assembly:
    """A planar, linear flexible multibody system: a tree of bodies, their connections, forces and outputs.

    Parameters
    ----------
    bodies : tuple of RigidBody and Beam
        Each after its parent.
    springs : tuple of SpringDamper
        Springs and dampers between any two points.
    forces : tuple of Force
        The inputs: forces and torques.
    outputs : tuple of Output
        The outputs: measured motions.
    cut_joints : tuple of CutJoint
        Joints that close kinematic chains.

    Raises
    ------
    TypeError, ValueError
        If a part has another type, if two bodies, forces or outputs have the same name, or if a body is before its parent.

    Examples
    --------
    >>> import boomctl as bc
    >>> s = bc.structure
    >>> cart = s.RigidBody("cart", s.GROUND.at(0.0), s.prismatic(0.0), mass=2.0)
    >>> spring = s.SpringDamper(cart.at(0.0), s.GROUND.at(0.0), "x", stiffness=50.0)
    >>> force, place = s.Force("push", cart.at(0.0), "x"), s.Output("place", cart.at(0.0), "x")
    >>> s.Assembly((cart,), (spring,), (force,), (place,)).assemble().eigenfrequencies_hz(1).round(4)
    array([0.7958])
    """

    bodies: tuple[RigidBody | Beam, ...]
    springs: tuple[SpringDamper, ...] = ()
    forces: tuple[Force, ...] = ()
    outputs: tuple[Output, ...] = ()
    cut_joints: tuple[CutJoint, ...] = ()

    def __post_init__(self) -> None:
        kinds = (RigidBody, Beam), SpringDamper, Force, Output, CutJoint
        for field_, kind in zip(fields(self), kinds, strict=True):
            parts = sequence(field_.name, getattr(self, field_.name), "parts")
            object.__setattr__(self, field_.name, parts)
            for part in parts:
                instance(field_.name, part, kind)
        for what, items in (("body", self.bodies), ("force", self.forces), ("output", self.outputs)):
            names = [item.name for item in items]
            if len(set(names)) < len(names):
                twice = next(name for name in names if names.count(name) > 1)
                raise ValueError(f"two of the assembly's {what} names are {twice!r}")
        bodies, points = [body.name for body in self.bodies], [point.body.name for point in self.points()]
        for index, name in enumerate(points):
            if name != Ground.name and name not in bodies[:index]:
                user = f"body {bodies[index]!r}" if index < len(bodies) else "a link, force, output or cut joint"
                known = f"expected one listed before: {sorted([Ground.name, *bodies[:index]])}"
                raise ValueError(f"{user} refers to body {name!r}; {known}")

    def __repr__(self) -> str:
        joints = f", {count(len(self.cut_joints), 'cut joint')}" if self.cut_joints else ""
        ports = signals([force.name for force in self.forces], [output.name for output in self.outputs])
        bodies = listed([body.name for body in self.bodies], 50)
        return f"Assembly: {bodies}; {count(len(self.springs), 'link')}{joints}\n{ports}"

    def points(self) -> list[Point]:
        """Return all points of attachment.

        Returns
        -------
        list of Point
            Joints of the bodies first, then ends of links, cut joints, forces and outputs; a point may occur twice.
        """
        pairs = [(body.parent, None) for body in self.bodies]
        pairs += [(link.a, link.b) for link in (*self.springs, *self.cut_joints)]
        pairs += [(force.point, force.reaction_point) for force in self.forces]
        pairs += [(output.point, output.relative_to) for output in self.outputs]
        return [point for pair in pairs for point in pair if point is not None]

    @one_blas_thread
    def assemble(self) -> SecondOrderModel:
        """Return the equations of motion, forces as inputs.

        Returns
        -------
        SecondOrderModel
            ``M, C, K`` with named coordinates; its inputs are the forces, its outputs the outputs, by their names.

        Raises
        ------
        ValueError
            The joints contradict each other, or a coordinate without mass is acted upon.

        Warns
        -----
        BoomctlWarning
            If the joints leave no motion of a point in the direction of a force, a link or an output.
        """
        mechanism = _mechanism(self, exact=False)
        layout, ports, weights = mechanism.rows.rigid, mechanism.rows.ports, self._weights(mechanism.meshes)
        structure = Structure(layout, weights, Outline(self))
        massless = np.flatnonzero(~layout.N[weights.m > 0.0].any(axis=0))
        if len(massless):
            T, retained = _condensation(structure, ports, massless)
            layout, ports = layout.congruent(T, tuple(layout.coordinates[i] for i in retained)), ports.restricted(T)
            structure = Structure(layout, weights, Outline(self, (T,)))
        return SecondOrderModel.of(structure, ports)

    def lines(self) -> tuple[Line, ...]:
        """Return the positions of the bodies, and their motion with the free coordinates.

        Returns
        -------
        tuple of Line
            A beam has points along its elements, a rigid body its points of attachment.
        """
        points = self.points()
        motion, T, _ = _moving(self, exact=False)
        result = []
        for body in self.bodies:
            if isinstance(body, Beam):
                elements = len(motion.meshes[body.name].nodes) - 1
                stations = np.linspace(0.0, body.length, int(np.clip(_DRAWN * elements, *_POINTS)) + 1)
                shown = [body.at(float(s)) for s in stations]
            else:
                own = [body.parent, *(point for point in points if point.body.name == body.name)]
                center = {body.center_of_mass} if body.center_of_mass else set()
                shown = [body.at(x, y) for x, y in sorted({(point.x, point.y) for point in own} | center)]
            frames = [motion.motion(point) for point in shown]
            x, y = (motion.matrix(rows) @ T for rows in ([frame.x for frame in frames], [frame.y for frame in frames]))
            positions = np.array([(frame.x0, frame.y0) for frame in frames])
            result.append(Line(body.name, isinstance(body, Beam), positions, x, y))
        return tuple(result)

    @one_blas_thread
    def to_exact(self) -> ExactModel:
        """Return the structure with exact beams, which need no elements; forces are its inputs.

        Returns
        -------
        ExactModel
            Frequency responses and eigenfrequencies from the beams' differential equations; the beams' discretizations
            are not used.
        """
        mechanism = _mechanism(self, exact=True)
        segments = tuple(
            replace(body.segments[index], length=float(length))
            for body, mesh, lengths in zip(self._beams(), mechanism.meshes, mechanism.lengths, strict=True)
            for index, length in zip(mesh.section, lengths, strict=True)
        )
        return ExactModel(mechanism.rows, self._weights(()), segments)

    def _beams(self) -> list[Beam]:
        return [body for body in self.bodies if isinstance(body, Beam)]

    def _weights(self, meshes: Sequence[BeamMesh]) -> Weights:
        """Return the weights of bodies, of axial motions of beams, and of links, followed by those of meshes."""
        moving: list[float] = []
        for body in self.bodies:
            if isinstance(body, RigidBody):
                moving += [body.mass, body.mass, body.inertia]
            else:
                moving.append(sum(section.length * section.mass_per_length for section in body.segments))
        c, k = [link.damping for link in self.springs], [link.stiffness for link in self.springs]
        parts = [[np.array(item, dtype=float)] for item in (moving, c, k)]
        for beam, mesh in zip(self._beams(), meshes, strict=False):
            sections = [(s.mass_per_length, s.bending_stiffness, s.stiffness_damping) for s in beam.segments]
            mass, stiffness, damping = np.array(sections, dtype=float).T[:, mesh.section]
            parts[0].append(mesh.inertia.weights(mass))
            parts[1].append(mesh.strain.weights(stiffness * damping))
            parts[2].append(mesh.strain.weights(stiffness))
        return Weights(*(np.concatenate(part) for part in parts))


@dataclass(frozen=True, eq=False)
class Mechanism:
    """Kinematics of a machine over its free coordinates, independent of its masses and stiffnesses.

    Attributes
    ----------
    meshes : tuple of BeamMesh
        Meshes of its beams, in their order.
    rows : ExactLayout
        Rows and signals.  ``N``: centers of the bodies and beams along their axes; ``R``: elongations of the links.  Below
        them, unless the beams are exact, deflections and strains of the beams; of exact beams the ends of segments, ``S``.
    lengths : tuple of ndarray
        Lengths of the segments of exact beams [m].
    idle : tuple of str
        Descriptions of links, forces and outputs without motion along their direction.
    """

    meshes: tuple[BeamMesh, ...]
    rows: ExactLayout
    lengths: tuple[Array, ...]
    idle: tuple[str, ...]


def _mechanism(assembly: Assembly, exact: bool) -> Mechanism:
    """Return the mechanism of a machine, its beams discretized or exact; warn of links, forces and outputs without motion."""
    known = all(type(beam.discretization) in (FiniteElements, DiscreteElements) for beam in assembly._beams())
    find = _find_mechanism if known else _find_mechanism.__wrapped__
    result = find(_Geometry(_where(assembly), exact, assembly))
    if result.idle:
        warn_user(
            f"No motion for {', '.join(result.idle)}: the joints constrain the point in that direction. Check the direction."
        )
    return result


@dataclass(frozen=True)
class _Geometry:
    """Cache key: the geometry of a machine, which is equal for machines with the same kinematics."""

    where: tuple[Hashable, ...]
    exact: bool
    assembly: Assembly = field(compare=False)


def _where(assembly: Assembly) -> tuple[Hashable, ...]:
    """Return all data on which the rows depend."""

    def at(point: Point | None) -> Hashable:
        return None if point is None else (point.body.name, point.x, point.y)

    def joint(body: RigidBody | Beam) -> Hashable:
        return tuple(body.joint.translations), body.joint.rotation

    def of(body: RigidBody | Beam) -> Hashable:
        if isinstance(body, RigidBody):
            return body.name, at(body.parent), joint(body), body.center_of_mass and tuple(body.center_of_mass)
        lengths = tuple(section.length for section in body.segments)
        return body.name, at(body.parent), joint(body), body._origin, body.angle, body.discretization, lengths

    return (
        tuple(of(body) for body in assembly.bodies),
        tuple((at(link.a), at(link.b), link.direction) for link in assembly.springs),
        tuple((f.name, at(f.point), f.direction, at(f.reaction_point)) for f in assembly.forces),
        tuple(
            (o.name, at(o.point), o.direction, at(o.relative_to), o.derivative, o.bandwidth_hz)
            for o in assembly.outputs
        ),
        tuple((at(cut.a), at(cut.b), tuple(cut.directions)) for cut in assembly.cut_joints),
    )


@lru_cache(maxsize=CACHE_SIZE)
def _find_mechanism(key: _Geometry) -> Mechanism:
    assembly, exact = key.assembly, key.exact
    beams = assembly._beams()
    motion, T, names = _moving(assembly, exact)
    index, meshes = motion.index, tuple(motion.meshes.values())
    first = [index[f"{beam.name}.{mesh.names[0]}"] for beam, mesh in zip(beams, meshes, strict=True)]

    def rows(lines: list[Row]) -> Array:
        return combined(motion.matrix(lines), T)

    bodies: list[Row] = []
    for body in assembly.bodies:
        if isinstance(body, RigidBody):
            center = motion.motion(body.at(*(body.center_of_mass or (body.parent.x, body.parent.y))))
            bodies += [center.x, center.y, center.theta]
        else:
            bodies.append(motion.frames[body.name].along(body.angle))
    N, R = rows(bodies), rows([motion.relative(link.a, link.b, link.direction) for link in assembly.springs])
    links, S, lengths = R, np.zeros((0, len(names))), ()
    if exact and meshes:
        lengths = tuple(
            _segment_lengths(beam, mesh.nodes, assembly.points()) for beam, mesh in zip(beams, meshes, strict=True)
        )
        S = np.vstack([_segment_ends(size, T[at:]) for at, size in zip(first, lengths, strict=True)])
    elif not exact:
        deflections = [mesh.inertia.matrix(at, len(index)) @ T for at, mesh in zip(first, meshes, strict=True)]
        strains = [combined(mesh.strain.matrix(at, len(index)), T) for at, mesh in zip(first, meshes, strict=True)]
        N, R = np.vstack([N, *deflections]), np.vstack([R, *strains])
    layout, ports = Layout(names, N, R), _ports(assembly, motion, rows)
    described = [f"the link of {x.a.body.name!r} and {x.b.body.name!r} along {x.direction!r}" for x in assembly.springs]
    described += [f"force {force.name!r} along {force.direction!r}" for force in assembly.forces]
    described += [f"output {output.name!r} along {output.direction!r}" for output in assembly.outputs]
    largest = [np.abs(x).max(axis=axis, initial=0.0) for x, axis in ((links, 1), (ports.B[0], 0), (ports.L, (0, 2)))]
    idle = [text for text, size in zip(described, np.concatenate(largest), strict=True) if size <= CANCELLED]
    return Mechanism(meshes, ExactLayout.of(layout, S, ports), lengths, tuple(idle))


def _moving(assembly: Assembly, exact: bool) -> tuple[Kinematics, Array, tuple[str, ...]]:
    """Return the kinematics of a machine, how all coordinates follow from the free ones, and the names of these."""
    points, meshes = assembly.points(), {}
    for beam in assembly._beams():
        stations = attachments(beam, points)
        meshes[beam.name] = _segment_mesh(beam, stations) if exact else beam.discretization.mesh(beam, stations)
    motion = kinematics(assembly.bodies, meshes, assembly.cut_joints, len(assembly.forces))
    coordinates = tuple(motion.index)
    if not motion.held:
        return motion, np.eye(len(coordinates)), coordinates
    labels, held = zip(*motion.held, strict=True)
    choice = eliminate(motion.matrix(held).T, labels, motion.weights)
    return motion, choice.T_q, tuple(coordinates[i] for i in choice.independent)


def _segment_ends(lengths: Array, T: Array) -> Array:
    """Return the lines ``w1, l phi1, w2, l phi2`` of each segment of an exact beam, whose coordinates come first in ``T``."""
    lines = T[2 * np.arange(len(lengths))[:, None] + np.arange(4)]
    lines[:, 1::2] *= lengths[:, None, None]
    return lines.reshape(-1, T.shape[1])


def _segment_mesh(beam: Beam, stations: list[float]) -> BeamMesh:
    """Return a mesh whose elements are the uniform segments between attachments."""
    marks = tuple(element_nodes(beam, (0.0, *distinct(stations, beam.length), beam.length)))
    if len(marks) == 2:
        # the natural frequencies of a free segment are those of a clamped one, where its own stiffness is infinite
        marks = (marks[0], _DIVISION * beam.length, marks[1])
    return FiniteElements(marks).mesh(beam, stations)


def _segment_lengths(beam: Beam, nodes: Array, points: Sequence[Point]) -> Array:
    """Return the lengths of an exact beam's segments.

    They are distances between attachments, or lengths of segments of the beam: a difference of stations, which are relative
    to the start of the beam, is inaccurate for a short segment.  Lengths that are equal to within this error are identified,
    so that equal segments are computed once.
    """
    lengths, lost = np.diff(nodes), CANCELLED * beam.length
    attached = [beam.parent, *(point for point in points if point.body.name == beam.name)]
    stations = np.array([beam.station(point.x, point.y) for point in attached])
    marks = np.cumsum([0.0, *(section.length for section in beam.segments)])
    for i, ends in enumerate(pairwise(nodes)):
        near, sections = ([np.flatnonzero(np.abs(x - end) <= lost)[:1] for end in ends] for x in (stations, marks))
        if all(map(len, near)):
            a, b = (attached[indices[0]] for indices in near)
            lengths[i] = hypot(b.x - a.x, b.y - a.y)
        elif all(map(len, sections)) and sections[1][0] == sections[0][0] + 1:
            lengths[i] = beam.segments[sections[0][0]].length
    order = np.argsort(lengths)
    for a, b in pairwise(order):
        if lengths[b] - lengths[a] <= lost:
            lengths[b] = lengths[a]
    return lengths


def _ports(assembly: Assembly, motion: Kinematics, rows: Callable[[list[Row]], Array]) -> Ports:
    """Return the inputs and outputs of an assembly over its free coordinates."""
    columns = rows([motion.relative(f.point, f.reaction_point, f.direction) for f in assembly.forces]).T
    lines = rows([motion.relative(o.point, o.relative_to, o.direction) for o in assembly.outputs])
    derivative = np.array([o.derivative for o in assembly.outputs], dtype=int)
    L = np.array([lines * (derivative == k)[:, None] for k in range(3)]).reshape(3, *lines.shape)
    L.setflags(write=False)
    ports = Ports.of_forces(tuple(f.name for f in assembly.forces), columns, tuple(o.name for o in assembly.outputs), L)
    return replace(
        ports,
        bandwidths=tuple(None if o.bandwidth_hz is None else 2 * np.pi * o.bandwidth_hz for o in assembly.outputs),
        units={f.name: "N m" if f.direction == "theta" else "N" for f in assembly.forces}
        | {o.name: motion_unit(o.direction == "theta", o.derivative) for o in assembly.outputs},
    )


def _condensation(structure: Structure, ports: Ports, massless: Array) -> tuple[Array, Array]:
    """Return the static condensation of massless coordinates.

    It is exact if only beams with one common damping constant act on them.
    """
    (k, c), names, K = (structure.weights.k, structure.weights.c), structure.coordinates, structure.K
    acting = structure.layout.R[:, massless] != 0.0
    rows = acting.any(axis=1)
    ratio = c[rows].sum() / k[rows].sum() if k[rows].any() else 0.0
    uneven = rows & (np.abs(c - ratio * k) > ALIKE * c[rows].max(initial=0.0))
    blocked = np.flatnonzero(acting[uneven].any(axis=0) | ports.B[0][massless].any(axis=1))
    if len(blocked):
        name = names[massless[blocked[0]]]
        raise ValueError(f"a damper or torque acts on coordinate {name!r}, which has no inertia: give it some")
    weak = np.flatnonzero(~acting[k > 0.0].any(axis=0))
    if len(weak):
        raise ValueError(f"coordinate {names[massless[weak[0]]]!r} has neither inertia nor stiffness: give it some")
    retained = np.delete(np.arange(structure.n), massless)
    T = np.zeros((structure.n, len(retained)))
    T[retained, np.arange(len(retained))] = 1.0
    T[massless] = -linalg.solve(K[massless][:, massless], K[massless][:, retained], assume_a="pos")
    return T, retained
