"""Assembly: a machine's description, and its equations of motion."""

from collections.abc import Mapping
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
        points = self.points()
        beams = [body for body in self.bodies if isinstance(body, Beam)]
        meshes = {beam.name: beam.discretization.mesh(beam, attachments(beam, points)) for beam in beams}
        return _equations(self, reduced_coordinates(self, meshes))

    def exact(self) -> ExactModel:
        """Return the structure with exact beams, forces as inputs; the beams' discretisations are not used."""
        points = self.points()
        beams = [body for body in self.bodies if isinstance(body, Beam)]
        meshes = {beam.name: _segment_mesh(beam, attachments(beam, points)) for beam in beams}
        return _exact_equations(self, reduced_coordinates(self, meshes))


@dataclass(frozen=True)
class Reduced:
    """Kinematics, and the map from the free coordinates to all of them."""

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


def reduced_coordinates(assembly: Assembly, meshes: Mapping[str, BeamMesh]) -> Reduced:
    """Return the free coordinates that the joints and cut joints leave."""
    motion = kinematics(assembly.bodies, meshes, assembly.cuts)
    if not motion.coordinates:
        raise ValueError("the assembly has no coordinates: expected a body that can move or a beam")
    index = {name: i for i, name in enumerate(motion.coordinates)}
    if not motion.held:
        return Reduced(motion, index, sparse.csr_array(sparse.eye_array(len(index))), motion.coordinates)
    held = row_matrix(motion.held, index)
    choice = eliminate(sparse.csr_array(held.T), motion.held_names, motion.weights)
    return Reduced(motion, index, choice.T_q, tuple(motion.coordinates[i] for i in choice.independent))


def _equations(assembly: Assembly, reduced: Reduced) -> SecondOrderModel:
    """Return mass, strain rows and ports over the free coordinates, massless coordinates condensed."""
    n = len(reduced.names)
    M = sparse.csr_array((n, n))
    strain, stiffness, damping = [], [], []
    for body in assembly.bodies:
        M = M + (_rigid_mass(body, reduced) if isinstance(body, RigidBody) else _beam_mass(body, reduced))
        if isinstance(body, Beam):
            mesh = reduced.kinematics.meshes[body.name]
            strain.append(sparse.csr_array(mesh.strain @ reduced.local(body)))
            stiffness.append(mesh.stiffness)
            damping.append(mesh.damping)
    links = [reduced.kinematics.relative(link.a, link.b, link.direction) for link in assembly.links]
    strain.append(reduced.rows(links))
    stiffness.append(np.array([link.stiffness for link in assembly.links]))
    damping.append(np.array([link.damping for link in assembly.links]))
    elastic = ElasticRows(sparse.csr_array(sparse.vstack(strain)), np.concatenate(stiffness), np.concatenate(damping))
    ports = reduced.ports(assembly)
    massless = np.flatnonzero(M.diagonal() == 0.0)
    names = reduced.names
    if len(massless):
        T, kept = _condensation(elastic, ports, massless, names)
        M, elastic, ports = sparse.csr_array(T.T @ M @ T), elastic.congruent(T), ports.congruent(T)
        names = tuple(names[i] for i in kept)
    structure = Structure.of(sparse.csr_array(M), elastic.C, elastic.K, names, elastic=elastic)
    return SecondOrderModel.of(structure, ports)


def _rigid_mass(body: RigidBody, reduced: Reduced) -> sparse.csr_array:
    x, y = body.centre or (body.parent.x, body.parent.y)
    centre = reduced.kinematics.motion(body.at(x, y))
    rows = reduced.rows([centre.x, centre.y, centre.theta])
    weight = sparse.diags_array([float(body.mass), float(body.mass), float(body.inertia)])
    return sparse.csr_array(rows.T @ weight @ rows)


def _beam_mass(beam: Beam, reduced: Reduced) -> sparse.csr_array:
    local = reduced.local(beam)
    bending = local.T @ reduced.kinematics.meshes[beam.name].mass @ local
    return sparse.csr_array(bending + _axial_mass(beam, reduced))


def _axial_mass(beam: Beam, reduced: Reduced) -> sparse.csr_array:
    """Return the mass matrix of a beam's motion along its axis, as a whole."""
    axial = reduced.rows([reduced.kinematics.frames[beam.name].along(beam.angle)])
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


def _exact_equations(assembly: Assembly, reduced: Reduced) -> ExactModel:
    n = len(reduced.names)
    M = np.zeros((n, n))
    placed: list[PlacedSegment] = []
    for body in assembly.bodies:
        if isinstance(body, RigidBody):
            M += _rigid_mass(body, reduced).toarray()
            continue
        mesh, local = reduced.kinematics.meshes[body.name], reduced.local(body).toarray()
        section = section_values(body, mesh.nodes)
        M += _axial_mass(body, reduced).toarray()
        for e, length in enumerate(np.diff(mesh.nodes)):
            values = (section.mass_per_length[e], section.bending_stiffness[e], section.damping[e])
            segment = Segment(round(float(length), 13), *(float(value) for value in values))
            placed.append(PlacedSegment(segment, local[2 * e : 2 * e + 4]))
    links = reduced.rows([reduced.kinematics.relative(link.a, link.b, link.direction) for link in assembly.links])
    elastic = ElasticRows(
        links,
        np.array([link.stiffness for link in assembly.links], dtype=float),
        np.array([link.damping for link in assembly.links], dtype=float),
    )
    return ExactModel(
        M, elastic.C.toarray(), elastic.K.toarray(), tuple(placed), reduced.ports(assembly), reduced.names
    )
