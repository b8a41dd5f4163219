"""From a description to rows: which coordinates a machine has, and how every point of it moves with them."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import cos, pi, sin

import numpy as np

from boomctl.arrays import Array
from boomctl.lti.rounding import CANCELLED
from boomctl.structure.beams.mesh import BeamMesh
from boomctl.structure.parts import Beam, CutJoint, Ground, Point, RigidBody, direction_angle

Body = RigidBody | Beam


@dataclass(frozen=True)
class Row:
    """A linear combination of coordinates, ``sum(terms[name] * coordinate[name])``.

    In a system of small motions everything is a row: a spring adds ``k r^T r``, a force acts through ``r^T``,
    an output reads ``r z``.

    Attributes
    ----------
    terms : mapping from coordinate to float
    sizes : mapping from coordinate to float
        Of what each was made of, where this was larger: what is left of it may be rounding.
    """

    terms: Mapping[str, float] = field(default_factory=dict)
    sizes: Mapping[str, float] = field(default_factory=dict)

    def size(self, name: str) -> float:
        """Return how large what the term of a coordinate was made of is; zero without one."""
        return self.sizes.get(name, abs(self.terms.get(name, 0.0)))

    def scaled(self, factor: float, size: float) -> "Row":
        """Return the row times a factor that was made of numbers as large as ``size``; zero if it is what rounding left."""
        if abs(factor) <= CANCELLED * size:
            return Row()
        return Row(
            {name: factor * value for name, value in self.terms.items()},
            {name: size * self.size(name) for name in self.terms},
        )

    def __add__(self, other: "Row") -> "Row":
        terms, sizes = {}, {}
        for name in {**self.terms, **other.terms}:
            total, size = self.terms.get(name, 0.0) + other.terms.get(name, 0.0), max(self.size(name), other.size(name))
            if abs(total) > CANCELLED * size:
                terms[name], sizes[name] = total, size
        return Row(terms, sizes)

    def __neg__(self) -> "Row":
        return Row({name: -value for name, value in self.terms.items()}, self.sizes)

    def __sub__(self, other: "Row") -> "Row":
        return self + (-other)


@dataclass(frozen=True)
class Frame:
    """The small motion of a body-fixed frame whose origin rests at ``(x0, y0)``: two displacements, one rotation."""

    x0: float
    y0: float
    x: Row = field(default_factory=Row)
    y: Row = field(default_factory=Row)
    theta: Row = field(default_factory=Row)

    def moved_to(self, x0: float, y0: float) -> "Frame":
        """Return the motion of the point of the same rigid body that rests at ``(x0, y0)``."""
        along = self.theta.scaled(x0 - self.x0, max(abs(x0), abs(self.x0)))
        across = self.theta.scaled(y0 - self.y0, max(abs(y0), abs(self.y0)))
        return Frame(x0, y0, self.x - across, self.y + along, self.theta)

    def along(self, angle: float) -> Row:
        """Return the displacement along the direction at ``angle`` (rad, from the x axis)."""
        return _along(self.x, angle, cos) + _along(self.y, angle, sin)


def row_matrix(rows: Sequence[Row], index: Mapping[str, int]) -> Array:
    """Stack rows into a matrix, one line a row and one column a coordinate of ``index``."""
    stacked = np.zeros((len(rows), len(index)))
    for i, row in enumerate(rows):
        for name, value in row.terms.items():
            stacked[i, index[name]] = value
    return stacked


@dataclass(frozen=True)
class Kinematics:
    """How a machine can move.

    Attributes
    ----------
    frames : mapping from body to Frame
        Motion of each body's frame at its joint.
    meshes : mapping from beam to BeamMesh
    coordinates : tuple of str
        Names of all coordinates, those that joints will take away included.
    weights : ndarray
        Preference: a coordinate of larger weight is rather made dependent.
    held : tuple of (str, Row)
        What joints and cut joints hold at zero, each with what a message calls it.
    """

    frames: Mapping[str, Frame]
    meshes: Mapping[str, BeamMesh]
    coordinates: tuple[str, ...] = ()
    weights: Array = field(default_factory=lambda: np.zeros(0))
    held: tuple[tuple[str, Row], ...] = ()

    def motion(self, point: Point) -> Frame:
        """Return the motion of a point of any body."""
        body = point.body
        if isinstance(body, Ground):
            return Frame(point.x, point.y)
        if isinstance(body, RigidBody):
            return self.frames[body.name].moved_to(point.x, point.y)
        w, phi = beam_rows(body, self.meshes[body.name], body.station(point.x, point.y))
        axial = self.frames[body.name].along(body.angle)
        x = _along(axial, body.angle, cos) - _along(w, body.angle, sin)
        y = _along(axial, body.angle, sin) + _along(w, body.angle, cos)
        return Frame(point.x, point.y, x, y, phi)

    def relative(self, a: Point, b: Point | None, direction: "str | float") -> Row:
        """Return the row of the displacement (or rotation) of ``a`` less that of ``b`` along ``direction``."""
        angle = direction_angle(direction)

        def component(point: Point) -> Row:
            motion = self.motion(point)
            return motion.theta if angle is None else motion.along(angle)

        return component(a) if b is None else component(a) - component(b)


def _along(row: Row, angle: float, component: Callable[[float], float]) -> Row:
    """Return the component of a row along an angle, its cosine or sine, which is as exact as one is."""
    return row.scaled(component(angle), 1.0)


def beam_rows(beam: Beam, mesh: BeamMesh, station: float) -> tuple[Row, Row]:
    """Return the rows of a beam's deflection and slope at ``station``."""
    rows = []
    for derivative in (0, 1):
        places, values = mesh.interpolation(station, derivative)
        rows.append(
            Row({f"{beam.name}.{mesh.names[p]}": float(v) for p, v in zip(places, values, strict=True) if v != 0.0})
        )
    return rows[0], rows[1]


def attachments(beam: Beam, points: Iterable[Point]) -> list[float]:
    """Return the stations of ``beam`` at which something is attached, ascending."""
    here = [beam.parent, *(point for point in points if point.body.name == beam.name)]
    return sorted({beam.station(point.x, point.y) for point in here})


def kinematics(bodies: Sequence[Body], meshes: Mapping[str, BeamMesh], cuts: Sequence[CutJoint]) -> Kinematics:
    """Walk the tree from the ground and write down coordinates, motions and joint conditions."""
    names: list[str] = []
    weights: list[float] = []
    frames: dict[str, Frame] = {}
    held: list[tuple[str, Row]] = []
    depth = {Ground.name: 0}
    so_far = Kinematics(frames, meshes)
    for body in bodies:
        depth[body.name] = depth[body.parent.body.name] + 1
        joint_names, frame = _joint_motion(body, so_far.motion(body.parent))
        if isinstance(body, Beam):
            joint_names = [name for name in joint_names if not name.endswith(".theta")]
            held += _beam_conditions(body, meshes[body.name], frame)
        names += joint_names
        weights += [100.0 * depth[body.name]] * len(joint_names)
        frames[body.name] = frame
        if isinstance(body, Beam):
            local = meshes[body.name].names
            names += [f"{body.name}.{name}" for name in local]
            # slopes count by what they move over an element, so that the choice does not depend on the unit of length
            element = body.length / (len(meshes[body.name].nodes) - 1)
            weights += [1.0 if name.startswith("w") else 1.0 / element for name in local]
    for cut in cuts:
        for direction in cut.directions:
            label = f"cut joint between {cut.a.body.name} and {cut.b.body.name} along {direction}"
            held.append((label, so_far.relative(cut.a, cut.b, direction)))
    return replace(so_far, coordinates=tuple(names), weights=np.array(weights), held=tuple(held))


def _joint_motion(body: Body, parent: Frame) -> tuple[list[str], Frame]:
    """Return the joint's coordinates and the motion of the body's frame at the joint."""
    x, y, theta = parent.x, parent.y, parent.theta
    names = []
    for label, angle in body.joint.translations:
        slide = Row({f"{body.name}.{label}": 1.0})
        x, y = x + _along(slide, angle, cos), y + _along(slide, angle, sin)
        names.append(f"{body.name}.{label}")
    if body.joint.rotation:
        theta = theta + Row({f"{body.name}.theta": 1.0})
        names.append(f"{body.name}.theta")
    return names, Frame(parent.x0, parent.y0, x, y, theta)


def _beam_conditions(beam: Beam, mesh: BeamMesh, frame: Frame) -> list[tuple[str, Row]]:
    """Return the rows that keep a beam at its joint: its deflection there and, unless it turns, its slope."""
    w, phi = beam_rows(beam, mesh, beam.station(beam.parent.x, beam.parent.y))
    conditions = [(f"joint of {beam.name} (deflection)", w - frame.along(beam.angle + pi / 2))]
    if not beam.joint.rotation:
        conditions.append((f"joint of {beam.name} (slope)", phi - frame.theta))
    return conditions
