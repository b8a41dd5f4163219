"""Assembly: a machine's description, and its equations of motion."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy import linalg, sparse

from boomctl.arrays import Array
from boomctl.checks import signal_name
from boomctl.printing import count, listed, signals
from boomctl.structure.beams.dynamic_stiffness import Segment
from boomctl.structure.beams.elements import FiniteElements, distinct, element_nodes, section_values
from boomctl.structure.beams.exact import ExactModel, PlacedSegment
from boomctl.structure.beams.mesh import BeamMesh
from boomctl.structure.elimination import eliminate
from boomctl.structure.kinematics import Kinematics, Row, attachments, kinematics, row_matrix
from boomctl.structure.matrices import ElasticRows, Structure
from boomctl.structure.model import SecondOrderModel
from boomctl.structure.parts import Beam, CutJoint, Force, Ground, Output, Point, RigidBody, SpringDamper
from boomctl.structure.ports import Ports

_UNEVEN = 0.41421356  # share of its length at which a free beam is cut in two: sqrt 2 - 1, no node of a low mode


@dataclass(frozen=True)
class Assembly:
    """A planar, linear flexible multibody system: a tree of bodies, what connects them, forces and outputs.

    Parameters
    ----------
    bodies : tuple of RigidBody and Beam
        Each after its parent.
    links : tuple of SpringDamper
        Springs and dampers between any two points.
    forces : tuple of Force
        Force and torque inputs.
    outputs : tuple of Output
        Measured motions.
    cuts : tuple of CutJoint
        Joints that close kinematic chains.

    Raises
    ------
    ValueError
        Two bodies, forces or outputs of one name; a body before its parent.
    """

    bodies: tuple[RigidBody | Beam, ...]
    links: tuple[SpringDamper, ...] = ()
    forces: tuple[Force, ...] = ()
    outputs: tuple[Output, ...] = ()
    cuts: tuple[CutJoint, ...] = ()

    def __post_init__(self) -> None:
        for what, items in (("body", self.bodies), ("force", self.forces), ("output", self.outputs)):
            seen = [signal_name(f"name of a {what}", item.name) for item in items]
            for name in seen:
                if seen.count(name) > 1:
                    raise ValueError(f"two of the assembly's {what} names are {name!r}")
        there = {Ground.name}
        for body in self.bodies:
            self._require(body.parent, there, f"body {body.name!r}")
            there.add(body.name)
        for point in self.points():
            self._require(point, there, "a link, force, output or cut joint")

    def __repr__(self) -> str:
        joints = f", {count(len(self.cuts), 'cut joint')}" if self.cuts else ""
        ports = signals([force.name for force in self.forces], [output.name for output in self.outputs])
        bodies = listed([body.name for body in self.bodies], 50)
        return f"Assembly: {bodies}; {count(len(self.links), 'link')}{joints}\n{ports}"

    @staticmethod
    def _require(point: Point, there: set[str], user: str) -> None:
        if point.body.name not in there:
            raise ValueError(f"{user} refers to body {point.body.name!r}; expected one listed before: {sorted(there)}")

    def points(self) -> list[Point]:
        """Return every point that something is attached to, bodies' joints included."""
        points = [body.parent for body in self.bodies]
        points += [point for link in self.links for point in (link.a, link.b)]
        points += [point for cut in self.cuts for point in (cut.a, cut.b)]
        points += [force.point for force in self.forces]
        points += [force.reaction for force in self.forces if force.reaction is not None]
        points += [output.point for output in self.outputs]
        points += [output.relative_to for output in self.outputs if output.relative_to is not None]
        return points

    def assemble(self) -> SecondOrderModel:
        """Return the equations of motion, forces as inputs.

        Raises
        ------
        ValueError
            The joints contradict each other, or a coordinate without mass is acted upon.
        """
        free = self._free_coordinates(lambda beam, stations: beam.discretization.mesh(beam, stations))
        n, names, ports = len(free.names), free.names, free.ports(self)
        M = sparse.csr_array((n, n))
        for body in self.bodies:
            M = M + (_rigid_mass(body, free) if isinstance(body, RigidBody) else _beam_mass(body, free))
        beams = [
            (free.kinematics.meshes[body.name], free.local(body)) for body in self.bodies if isinstance(body, Beam)
        ]
        links = free.links(self)
        elastic = ElasticRows(
            sparse.csr_array(sparse.vstack([*(sparse.csr_array(mesh.strain @ T) for mesh, T in beams), links.R])),
            np.concatenate([*(mesh.stiffness for mesh, _ in beams), links.k]),
            np.concatenate([*(mesh.damping for mesh, _ in beams), links.c]),
        )
        massless = np.flatnonzero(M.diagonal() == 0.0)
        if len(massless):
            T, kept = _condensation(elastic, ports, massless, names)
            M, elastic, ports = sparse.csr_array(T.T @ M @ T), elastic.congruent(T), ports.congruent(T)
            names = tuple(names[i] for i in kept)
        return SecondOrderModel.of(Structure.of(M, elastic.C, elastic.K, names, elastic=elastic), ports)

    def exact(self) -> ExactModel:
        """Return the structure with exact beams, forces as inputs; the beams' discretisations are not used."""
        free = self._free_coordinates(_segment_mesh)
        M = np.zeros((len(free.names), len(free.names)))
        placed: list[PlacedSegment] = []
        for body in self.bodies:
            if isinstance(body, RigidBody):
                M += _rigid_mass(body, free).toarray()
                continue
            mesh, local = free.kinematics.meshes[body.name], free.local(body).toarray()
            section = section_values(body, mesh.nodes)
            M += _axial_mass(body, free).toarray()
            for e, length in enumerate(np.diff(mesh.nodes)):
                values = (section.mass_per_length[e], section.bending_stiffness[e], section.damping[e])
                segment = Segment(round(float(length), 13), *(float(value) for value in values))
                placed.append(PlacedSegment(segment, local[2 * e : 2 * e + 4]))
        links = free.links(self)
        return ExactModel(
            M=M,
            C=links.C.toarray(),
            K=links.K.toarray(),
            placed=tuple(placed),
            ports=free.ports(self),
            coordinates=free.names,
        )

    def _free_coordinates(self, mesh: Callable[[Beam, list[float]], BeamMesh]) -> "FreeCoordinates":
        """Return the coordinates that the joints and cut joints leave, beams turned into coordinates by ``mesh``."""
        points = self.points()
        meshes = {body.name: mesh(body, attachments(body, points)) for body in self.bodies if isinstance(body, Beam)}
        motion = kinematics(self.bodies, meshes, self.cuts)
        if not motion.coordinates:
            raise ValueError("the assembly has no coordinates: expected a body that can move or a beam")
        index = {name: i for i, name in enumerate(motion.coordinates)}
        if not motion.held:
            return FreeCoordinates(motion, index, sparse.csr_array(sparse.eye_array(len(index))), motion.coordinates)
        labels, rows = zip(*motion.held, strict=True)
        choice = eliminate(sparse.csr_array(row_matrix(rows, index).T), labels, motion.weights)
        return FreeCoordinates(motion, index, choice.T_q, tuple(motion.coordinates[i] for i in choice.independent))


@dataclass(frozen=True)
class FreeCoordinates:
    """The coordinates that the joints leave, and how all others follow: where things are, not what they weigh.

    Attributes
    ----------
    kinematics : Kinematics
    index : mapping from name to int
        Places of all coordinates.
    T : sparse array
        From the free coordinates to all of them.
    names : tuple of str
        Of the free coordinates.
    """

    kinematics: Kinematics
    index: Mapping[str, int]
    T: sparse.csr_array
    names: tuple[str, ...]

    def rows(self, rows: list[Row]) -> sparse.csr_array:
        """Return rows over the free coordinates, as a sparse matrix."""
        return sparse.csr_array(row_matrix(rows, self.index) @ self.T)

    def local(self, beam: Beam) -> sparse.csr_array:
        """Return the map from the free coordinates to those of a beam."""
        first = self.index[f"{beam.name}.{self.kinematics.meshes[beam.name].names[0]}"]
        return sparse.csr_array(self.T[first : first + len(self.kinematics.meshes[beam.name].names)])

    def links(self, assembly: Assembly) -> ElasticRows:
        """Return the elongations of the springs and dampers over the free coordinates."""
        rows = self.rows([self.kinematics.relative(link.a, link.b, link.direction) for link in assembly.links])
        stiffness = np.array([link.stiffness for link in assembly.links], dtype=float)
        return ElasticRows(rows, stiffness, np.array([link.damping for link in assembly.links], dtype=float))

    def ports(self, assembly: Assembly) -> Ports:
        """Return the inputs and outputs of an assembly over the free coordinates."""
        relative = self.kinematics.relative
        columns = self.rows([relative(f.point, f.reaction, f.direction) for f in assembly.forces]).toarray().T
        lines = self.rows([relative(o.point, o.relative_to, o.direction) for o in assembly.outputs]).toarray()
        derivative = np.array([o.derivative for o in assembly.outputs], dtype=int)
        L0, L1, L2 = (lines * (derivative == k)[:, None] for k in range(3))
        return Ports.of_forces(
            inputs=tuple(f.name for f in assembly.forces),
            columns=columns,
            outputs=tuple(o.name for o in assembly.outputs),
            lines=(L0, L1, L2),
            bandwidths=tuple(None if o.bandwidth_hz is None else 2 * np.pi * o.bandwidth_hz for o in assembly.outputs),
        )


def _rigid_mass(body: RigidBody, free: FreeCoordinates) -> sparse.csr_array:
    x, y = body.centre or (body.parent.x, body.parent.y)
    centre = free.kinematics.motion(body.at(x, y))
    rows = free.rows([centre.x, centre.y, centre.theta])
    weight = sparse.diags_array([float(body.mass), float(body.mass), float(body.inertia)])
    return sparse.csr_array(rows.T @ weight @ rows)


def _beam_mass(beam: Beam, free: FreeCoordinates) -> sparse.csr_array:
    local = free.local(beam)
    bending = local.T @ free.kinematics.meshes[beam.name].mass @ local
    return sparse.csr_array(bending + _axial_mass(beam, free))


def _axial_mass(beam: Beam, free: FreeCoordinates) -> sparse.csr_array:
    """Return the mass matrix of a beam's motion along its axis, as a whole."""
    axial = free.rows([free.kinematics.frames[beam.name].along(beam.angle)])
    mass = sum(section.length * section.mass_per_length for section in beam.sections)
    return sparse.csr_array(mass * (axial.T @ axial))


def _condensation(
    elastic: ElasticRows, ports: Ports, massless: Array, names: tuple[str, ...]
) -> tuple[sparse.csr_array, Array]:
    """Return the map that lets massless coordinates follow the others statically, which is exact for them.

    It is exact as long as nothing but beams with one common damping constant acts on them.
    """
    K, C = elastic.K.tocsr(), elastic.C.tocsr()
    n = K.shape[0]
    kept = np.setdiff1d(np.arange(n), massless)
    K_mm, C_mm = K[massless][:, massless], C[massless][:, massless]
    ratio = C_mm.diagonal().sum() / max(K_mm.diagonal().sum(), np.finfo(float).tiny)
    uneven = np.abs(C_mm.diagonal() - ratio * K_mm.diagonal()) > 1e-9 * np.abs(C_mm.diagonal()).max(initial=1e-300)
    forced = (np.abs(ports.B[0][massless]) > 0).any(axis=1)
    if (uneven | forced).any():
        name = names[massless[np.flatnonzero(uneven | forced)[0]]]
        raise ValueError(f"a damper or torque acts on coordinate {name!r}, which has no inertia: give it some")
    weak = np.flatnonzero(K_mm.diagonal() <= 0.0)
    if len(weak):
        raise ValueError(f"coordinate {names[massless[weak[0]]]!r} has neither inertia nor stiffness: give it some")
    follow = -linalg.solve(K_mm.toarray(), K[massless][:, kept].toarray(), assume_a="pos")
    T = np.zeros((n, len(kept)))
    T[kept, np.arange(len(kept))] = 1.0
    T[massless] = follow
    return sparse.csr_array(T), kept


def _segment_mesh(beam: Beam, stations: list[float]) -> BeamMesh:
    """Return a mesh whose elements are the uniform segments between attachments."""
    marks = tuple(element_nodes(beam, (0.0, *distinct(stations, beam.length), beam.length)))
    if len(marks) == 2:
        # the natural frequencies of a free segment are those of a clamped one, where its own stiffness is infinite
        marks = (marks[0], _UNEVEN * beam.length, marks[1])
    return FiniteElements(marks).mesh(beam, stations)
