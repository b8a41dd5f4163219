"""The parts that a machine is described with: bodies, joints, springs and dampers, forces, outputs.

A description is plain frozen data that can be read beside a drawing; :class:`boomctl.structure.Assembly` turns it
into equations of motion.  Positions are those at rest, in the inertial frame: ``x`` along the page, ``y`` across it,
``theta`` about the normal.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import cos, hypot, isclose, pi, sin
from typing import ClassVar, Protocol

from boomctl.checks import known, nonnegative, positive, real
from boomctl.printing import compact
from boomctl.structure.beams.mesh import BeamMesh


@dataclass(frozen=True)
class Joint:
    """What a body may do relative to its parent: slide along directions (name, angle in rad) and turn."""

    slides: tuple[tuple[str, float], ...] = ()
    turns: bool = False


def fixed() -> Joint:
    """Return a joint without freedom."""
    return Joint()


def revolute() -> Joint:
    """Return a hinge: the body turns about the joint point (coordinate ``theta``)."""
    return Joint(turns=True)


def prismatic(angle: float = pi / 2, name: str = "slide") -> Joint:
    """Return a slide along the direction at ``angle`` (rad, from the x axis; default: along y)."""
    return Joint(slides=((name, real("angle", angle)),))


def free(*freedoms: str) -> Joint:
    """Return a joint with the freedoms named, any of ``"x"``, ``"y"``, ``"theta"``."""
    for freedom in freedoms:
        known("freedom", freedom, ("x", "y", "theta"))
    slides = tuple((name, angle) for name, angle in (("x", 0.0), ("y", pi / 2)) if name in freedoms)
    return Joint(slides=slides, turns="theta" in freedoms)


@dataclass(frozen=True)
class Point:
    """A point of a body, given by its position at rest [m]."""

    body: "Ground | RigidBody | Beam"
    x: float
    y: float

    def __post_init__(self) -> None:
        real("x", self.x)
        real("y", self.y)
        if isinstance(self.body, Beam):
            self.body.station(self.x, self.y)

    def __repr__(self) -> str:
        return f"{'GROUND' if isinstance(self.body, Ground) else self.body.name}.at({self.x:g}, {self.y:g})"


@dataclass(frozen=True)
class Ground:
    """The inertial frame."""

    name: ClassVar[str] = "ground"

    def __repr__(self) -> str:
        return "GROUND"

    def at(self, x: float, y: float = 0.0) -> Point:
        """Return the point that stands at ``(x, y)``."""
        return Point(self, x, y)


GROUND = Ground()


@dataclass(frozen=True)
class RigidBody:
    """A rigid body.

    Parameters
    ----------
    name : str
        Its coordinates are called ``name.y``, ``name.theta``, ``name.slide``, ...
    parent : Point
        Where on which body its joint sits.
    joint : Joint
        What it may do there.
    mass, inertia : float
        Mass [kg] and moment of inertia about the centre of mass [kg m^2]; zero is allowed.
    centre : (float, float), optional
        Centre of mass at rest [m]; by default the joint.
    """

    name: str
    parent: Point
    joint: Joint
    mass: float = 0.0
    inertia: float = 0.0
    centre: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        nonnegative(f"mass of {self.name!r}", self.mass)
        nonnegative(f"inertia of {self.name!r}", self.inertia)
        for value in self.centre or ():
            real(f"centre of {self.name!r}", value)

    __repr__ = compact

    def at(self, x: float, y: float = 0.0) -> Point:
        """Return the point of the body that rests at ``(x, y)``."""
        return Point(self, x, y)


@dataclass(frozen=True)
class BeamSection:
    """A stretch of a beam with one cross section.

    Parameters
    ----------
    length : float
        Length of the stretch [m].
    mass_per_length : float
        ``rho A`` [kg/m].
    bending_stiffness : float
        ``E I`` [N m^2].
    damping : float
        Stiffness-proportional structural damping ``c_b`` [s]: bending moment ``E I (kappa + c_b kappa')``.
    """

    length: float
    mass_per_length: float
    bending_stiffness: float
    damping: float = 0.0

    def __post_init__(self) -> None:
        positive("length of a beam section", self.length)
        positive("mass_per_length", self.mass_per_length)
        positive("bending_stiffness", self.bending_stiffness)
        nonnegative("damping of a beam section", self.damping)


class Discretization(Protocol):
    """A way to turn a beam into coordinates."""

    def mesh(self, beam: "Beam", attachments: Sequence[float]) -> BeamMesh:
        """Return the mesh of ``beam``; something is attached to it at the stations ``attachments``."""
        ...


@dataclass(frozen=True)
class Beam:
    """An inextensible Euler-Bernoulli beam, straight at rest, in one or more stretches of uniform section.

    Parameters
    ----------
    name : str
        Its coordinates are called ``name.w3`` (transverse displacement of node 3) and ``name.phi3`` (slope).
    parent : Point
        Where its joint sits; the point must lie on the beam.
    joint : Joint
        What it may do there.
    start : (float, float)
        Where station 0 rests [m].
    sections : sequence of BeamSection
        The stretches from the start on.
    discretization : Discretization
        How the beam is turned into coordinates.
    angle : float
        Direction of the beam's axis at rest [rad, from the x axis]; the transverse direction is 90 degrees further.
    """

    name: str
    parent: Point
    joint: Joint
    start: tuple[float, float]
    sections: tuple[BeamSection, ...]
    discretization: Discretization
    angle: float = 0.0
    length: float = field(init=False)

    def __post_init__(self) -> None:
        if not self.sections:
            raise ValueError(f"beam {self.name!r}: expected at least one section")
        for value in (*self.start, self.angle):
            real(f"start or angle of beam {self.name!r}", value)
        object.__setattr__(self, "length", float(sum(section.length for section in self.sections)))
        self.station(self.parent.x, self.parent.y)

    __repr__ = compact

    def station(self, x: float, y: float) -> float:
        """Return how far along the beam the point at ``(x, y)`` rests; a point off the beam is an error."""
        dx, dy = x - self.start[0], y - self.start[1]
        along, across = dx * cos(self.angle) + dy * sin(self.angle), dy * cos(self.angle) - dx * sin(self.angle)
        slack = 1e-9 * self.length
        if not (-slack <= along <= self.length + slack and abs(across) <= slack):
            raise ValueError(
                f"point ({x:g}, {y:g}) is not on beam {self.name!r}: it lies {along:g} m along and {across:g} m beside"
                f" an axis of {self.length:g} m"
            )
        return min(max(along, 0.0), self.length)

    def at(self, x: float, y: float = 0.0) -> Point:
        """Return the point of the beam that rests at ``(x, y)``."""
        return Point(self, x, y)

    def at_station(self, station: float) -> Point:
        """Return the point of the beam that rests ``station`` [m] from its start."""
        return Point(self, self.start[0] + station * cos(self.angle), self.start[1] + station * sin(self.angle))


def direction_angle(direction: "str | float") -> float | None:
    """Return the angle [rad] of ``"x"``, ``"y"`` or a number; ``None`` stands for ``"theta"``, a rotation."""
    if isinstance(direction, str):
        return {"x": 0.0, "y": pi / 2, "theta": None}[known("direction", direction, ("x", "y", "theta"))]
    return real("direction", direction)


def _check_pair(a: Point, b: Point, what: str, direction: "str | float") -> None:
    direction_angle(direction)
    if a.body.name == b.body.name:
        raise ValueError(f"{what}: both ends are on {a.body.name!r}; expected two bodies")


@dataclass(frozen=True)
class SpringDamper:
    """A linear spring and viscous damper between points of two bodies.

    Parameters
    ----------
    a, b : Point
        Its ends; its elongation is the displacement of ``a`` less that of ``b`` along ``direction``.
    direction : "x", "y", "theta" or float
        Line of action; ``"theta"`` makes it rotational, a number is an angle from the x axis [rad].
    stiffness : float
        [N/m], or [N m/rad] if rotational.
    damping : float
        [N s/m], or [N m s/rad] if rotational.
    """

    a: Point
    b: Point
    direction: "str | float"
    stiffness: float = 0.0
    damping: float = 0.0

    def __post_init__(self) -> None:
        nonnegative("stiffness of a spring", self.stiffness)
        nonnegative("damping of a damper", self.damping)
        _check_pair(self.a, self.b, "spring or damper", self.direction)

    __repr__ = compact


@dataclass(frozen=True)
class Force:
    """A force (or torque, direction ``"theta"``) input on ``point``, with its reaction on another body if given."""

    name: str
    point: Point
    direction: "str | float" = "y"
    reaction: Point | None = None

    def __post_init__(self) -> None:
        direction_angle(self.direction)
        if self.reaction is not None:
            _check_pair(self.point, self.reaction, f"force {self.name!r}", self.direction)

    __repr__ = compact


@dataclass(frozen=True)
class Output:
    """A measured motion: of ``point`` along ``direction``, less that of ``relative_to`` if given.

    ``derivative`` is 0 for displacement, 1 for velocity, 2 for acceleration.  ``bandwidth_hz`` puts a second-order
    low-pass filter (damping ratio ``1/sqrt 2``) behind it, as in a band-limited accelerometer.
    """

    name: str
    point: Point
    direction: "str | float" = "y"
    relative_to: Point | None = None
    derivative: int = 0
    bandwidth_hz: float | None = None

    def __post_init__(self) -> None:
        direction_angle(self.direction)
        if self.derivative not in (0, 1, 2):
            raise ValueError(f"derivative of output {self.name!r} = {self.derivative!r}: expected 0, 1 or 2")
        if self.bandwidth_hz is not None:
            positive(f"bandwidth_hz of output {self.name!r}", self.bandwidth_hz)

    __repr__ = compact


@dataclass(frozen=True)
class CutJoint:
    """A joint that closes a kinematic chain: points ``a`` and ``b`` stay together along ``directions``."""

    a: Point
    b: Point
    directions: tuple["str | float", ...] = ("x", "y")

    def __post_init__(self) -> None:
        for direction in self.directions:
            _check_pair(self.a, self.b, "cut joint", direction)
        gap = hypot(self.a.x - self.b.x, self.a.y - self.b.y)
        if not isclose(gap, 0.0, abs_tol=1e-9 * (1.0 + hypot(self.a.x, self.a.y))):
            raise ValueError(f"cut joint: its points rest {gap:g} m apart; expected one place")
