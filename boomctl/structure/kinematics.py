"""From a description to rows: the coordinates of a machine, and the motion of each of its points over them."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from math import cos, pi, sin

import numpy as np

from boomctl.arrays import Array
from boomctl.lti.rounding import CANCELLED
from boomctl.structure.beams.mesh import BeamMesh
from boomctl.structure.matrices import check_size
from boomctl.structure.parts import Beam, CutJoint, Ground, Point, RigidBody, direction_angle

Body = RigidBody | Beam


@dataclass(frozen=True)
class Row:
    """A linear combination of coordinates.

    In a system of small motions everything is a row: a spring adds ``k r^T r``, a force acts through ``r^T``,
    an output reads ``r z``.

    Attributes
    ----------
    terms : (n,) or () ndarray
        Coefficients of the coordinates.
    sizes : (n,) or () ndarray
        Largest term of the sum of each coefficient; values far below it are rounding error.
    """

    terms: Array = field(default_factory=lambda: np.zeros(()))
    sizes: Array = field(default_factory=lambda: np.zeros(()))

    def scaled(self, factor: float, size: float) -> "Row":
        """Return the row times a factor with terms of magnitude ``size``; zero if the factor is rounding error."""
        if factor == size == 1.0 or not self.terms.ndim:
            return self
        if abs(factor) <= CANCELLED * size:
            return Row()
        return Row(factor * self.terms, size * self.sizes)

    def __add__(self, other: "Row") -> "Row":
        if not (self.terms.ndim and other.terms.ndim):  # one is zero
            return self if self.terms.ndim else other
        total, size = self.terms + other.terms, np.maximum(self.sizes, other.sizes)
        significant = np.abs(total) > CANCELLED * size
        return Row(np.where(significant, total, 0.0), np.where(significant, size, 0.0))

    def __sub__(self, other: "Row") -> "Row":
        return self + Row(-other.terms, other.sizes)


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


@dataclass(frozen=True)
class Kinematics:
    """The motions of a machine.

    Attributes
    ----------
    index : mapping from coordinate to int
        Indices of all coordinates, including those that joints eliminate.
    weights : ndarray
        Preference: coordinates of larger weight become dependent first.
    meshes : mapping from beam to BeamMesh
    frames : mapping from body to Frame
        Motion of each body's frame at its joint.
    held : list of (str, Row)
        Motions that joints and cut joints constrain to zero, each with its name in messages.
    """

    index: Mapping[str, int]
    weights: Array
    meshes: Mapping[str, BeamMesh]
    frames: dict[str, Frame] = field(default_factory=dict)
    held: list[tuple[str, Row]] = field(default_factory=list)

    def matrix(self, rows: Sequence[Row]) -> Array:
        """Stack rows into a matrix, one line a row and one column a coordinate."""
        result = np.zeros((len(rows), len(self.index)))
        for line, row in zip(result, rows, strict=True):
            line[:] = row.terms
        return result

    def coordinate(self, name: str) -> Row:
        """Return the row of one coordinate."""
        terms = np.zeros(len(self.index))
        terms[self.index[name]] = 1.0
        return Row(terms, terms)

    def motion(self, point: Point) -> Frame:
        """Return the motion of a point of any body."""
        body = point.body
        if isinstance(body, Ground):
            return Frame(point.x, point.y)
        if isinstance(body, RigidBody):
            return self.frames[body.name].moved_to(point.x, point.y)
        w, phi = self.beam_rows(body, point)
        axial = self.frames[body.name].along(body.angle)
        x = _along(axial, body.angle, cos) - _along(w, body.angle, sin)
        y = _along(axial, body.angle, sin) + _along(w, body.angle, cos)
        return Frame(point.x, point.y, x, y, phi)

    def beam_rows(self, beam: Beam, point: Point) -> tuple[Row, Row]:
        """Return the rows of a beam's deflection and slope at a point of its axis."""
        mesh, station = self.meshes[beam.name], beam.station(point.x, point.y)
        first, rows = self.index[f"{beam.name}.{mesh.names[0]}"], np.zeros((2, len(self.index)))
        for derivative in (0, 1):
            indices, values = mesh.interpolation(station, derivative)
            rows[derivative, first + indices] = values
        return Row(rows[0], np.abs(rows[0])), Row(rows[1], np.abs(rows[1]))

    def relative(self, a: Point, b: Point | None, direction: "str | float") -> Row:
        """Return the row of the displacement (or rotation) of ``a`` less that of ``b`` along ``direction``."""
        angle = direction_angle(direction)

        def component(point: Point) -> Row:
            motion = self.motion(point)
            return motion.theta if angle is None else motion.along(angle)

        return component(a) if b is None else component(a) - component(b)

    def add_body(self, body: Body) -> None:
        """Add the motion of a body, whose parent is present, and the constraints of its joint."""
        parent = self.motion(body.parent)
        x, y, theta = parent.x, parent.y, parent.theta
        for label, angle in body.joint.translations:
            slide = self.coordinate(f"{body.name}.{label}")
            x, y = x + _along(slide, angle, cos), y + _along(slide, angle, sin)
        if body.joint.rotation and isinstance(body, RigidBody):
            theta = theta + self.coordinate(f"{body.name}.theta")
        frame = self.frames[body.name] = Frame(parent.x0, parent.y0, x, y, theta)
        if isinstance(body, Beam):
            w, phi = self.beam_rows(body, body.parent)
            self.held.append((f"joint of {body.name} (deflection)", w - frame.along(body.angle + pi / 2)))
            if not body.joint.rotation:
                self.held.append((f"joint of {body.name} (slope)", phi - frame.theta))


def _along(row: Row, angle: float, component: Callable[[float], float]) -> Row:
    """Return the component of a row along an angle, its cosine or sine, which is as exact as one is."""
    return row.scaled(component(angle), 1.0)


def attachments(beam: Beam, points: Iterable[Point]) -> list[float]:
    """Return the stations of the attachments of ``beam``, ascending."""
    here = [beam.parent, *(point for point in points if point.body.name == beam.name)]
    return sorted({beam.station(point.x, point.y) for point in here})


def kinematics(
    bodies: Sequence[Body], meshes: Mapping[str, BeamMesh], cuts: Sequence[CutJoint], prescribed: int
) -> Kinematics:
    """Walk the tree from the ground and write down coordinates, motions and joint conditions.

    ``prescribed`` is the number of displacements that may be prescribed, each of which eliminates a coordinate.
    """
    names: list[str] = []
    weights: list[float] = []
    depth, conditions = {Ground.name: 0}, sum(len(cut.directions) for cut in cuts)
    for body in bodies:
        depth[body.name] = depth[body.parent.body.name] + 1
        own = [label for label, _ in body.joint.translations]
        own += ["theta"] if body.joint.rotation and isinstance(body, RigidBody) else []
        weights += [100.0 * depth[body.name]] * len(own)
        if isinstance(body, Beam):
            local = meshes[body.name].names
            # Slopes are scaled to displacements over an element, so that the choice does not depend on the unit of length.
            element = body.length / (len(meshes[body.name].nodes) - 1)
            weights += [1.0 if name.startswith("w") else 1.0 / element for name in local]
            own, conditions = [*own, *local], conditions + 1 + (not body.joint.rotation)
        names += [f"{body.name}.{name}" for name in own]
    if not names:
        raise ValueError("the assembly has no coordinates: expected a body that can move or a beam")
    check_size(len(names) - conditions - prescribed)
    result = Kinematics({name: i for i, name in enumerate(names)}, np.array(weights), meshes)
    for body in bodies:
        result.add_body(body)
    for cut in cuts:
        for direction in cut.directions:
            label = f"cut joint between {cut.a.body.name} and {cut.b.body.name} along {direction}"
            result.held.append((label, result.relative(cut.a, cut.b, direction)))
    return result
