"""The parts that a machine is described with: bodies, joints, springs and dampers, forces, outputs.

A description is plain frozen data that can be read beside a drawing; :class:`boomctl.structure.Assembly` turns it
into equations of motion.  Positions are those at rest, in the inertial frame: ``x`` along the page, ``y`` across it,
``theta`` about the normal.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import cos, hypot, isclose, pi, sin
from typing import ClassVar, Protocol

from boomctl.checks import instance, known, nonnegative, positive, real, sequence, shown, signal_name, truth, whole
from boomctl.printing import compact
from boomctl.structure.beams.cross_sections import CrossSection
from boomctl.structure.beams.mesh import BeamMesh


@dataclass(frozen=True)
class Joint:
    """What a body may do relative to its parent: slide along directions (name, angle in rad) and turn."""

    slides: tuple[tuple[str, float], ...] = ()
    turns: bool = False

    def __post_init__(self) -> None:
        for slide in sequence("slides of a joint", self.slides, "pairs of name and angle"):
            if not isinstance(slide, tuple) or len(slide) != 2:
                raise TypeError(f"slides of a joint: expected pairs of name and angle, got {shown(slide)}")
            signal_name("name of a slide", slide[0])
            real("angle of a slide", slide[1])
        truth("turns of a joint", self.turns)


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
        instance("body of a point", self.body, (Ground, RigidBody, Beam), "GROUND, a RigidBody or a Beam")
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
        signal_name("name of a body", self.name)
        instance(f"parent of {self.name!r}", self.parent, Point)
        instance(f"joint of {self.name!r}", self.joint, Joint)
        nonnegative(f"mass of {self.name!r}", self.mass)
        nonnegative(f"inertia of {self.name!r}", self.inertia)
        if self.centre is not None:
            _place(f"centre of {self.name!r}", self.centre)

    __repr__ = compact

    def at(self, x: float, y: float = 0.0) -> Point:
        """Return the point of the body that rests at ``(x, y)``."""
        return Point(self, x, y)


@dataclass(frozen=True)
class BeamSection:
    """A stretch of a beam with one cross section.

    `BeamSection.from_cross_section` takes the section of a tube, a bar or an I beam and a material instead.

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

    @classmethod
    def from_cross_section(
        cls, length: float, section: CrossSection, youngs_modulus: float, density: float, damping: float = 0.0
    ) -> "BeamSection":
        """Return a stretch of one material and one cross section.

        Parameters
        ----------
        length : float
            Of the stretch [m].
        section : CrossSection
            From `tube_section`, `round_tube_section`, `bar_section`, `rod_section` or `i_section`.
        youngs_modulus, density : float
            Of the material [Pa], [kg/m^3].
        damping : float
            As of `BeamSection` [s].

        Raises
        ------
        TypeError, ValueError
            Another kind of section; numbers out of range.

        Examples
        --------
        >>> from boomctl.structure import tube_section
        >>> round(BeamSection.from_cross_section(3.0, tube_section(0.04, 0.04, 0.003), 210e9, 7850.0).mass_per_length, 6)
        3.4854
        """
        given = instance("section", section, CrossSection)
        stiffness = positive("youngs_modulus", youngs_modulus) * given.second_moment
        return cls(length, positive("density", density) * given.area, stiffness, damping)


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
        signal_name("name of a body", self.name)
        instance(f"parent of beam {self.name!r}", self.parent, Point)
        instance(f"joint of beam {self.name!r}", self.joint, Joint)
        for section in sequence(f"sections of beam {self.name!r}", self.sections, "BeamSection"):
            instance(f"section of beam {self.name!r}", section, BeamSection)
        if not len(self.sections):
            raise ValueError(f"beam {self.name!r}: expected at least one section")
        if not callable(getattr(self.discretization, "mesh", None)):
            given = shown(self.discretization)
            raise TypeError(f"discretization of beam {self.name!r} = {given}: expected FiniteElements or another one")
        _place(f"start of beam {self.name!r}", self.start)
        real(f"angle of beam {self.name!r}", self.angle)
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
        station = real("station", station)
        return Point(self, self.start[0] + station * cos(self.angle), self.start[1] + station * sin(self.angle))


def _place(name: str, value: object) -> None:
    """Check that a value is a pair of finite numbers."""
    pair = sequence(name, value, "two numbers")
    if len(pair) != 2:
        raise ValueError(f"{name}: expected two numbers, x and y, got {len(pair)}")
    for number in pair:
        real(name, number)


def direction_angle(direction: "str | float") -> float | None:
    """Return the angle [rad] of ``"x"``, ``"y"`` or a number; ``None`` stands for ``"theta"``, a rotation."""
    if isinstance(direction, str):
        return {"x": 0.0, "y": pi / 2, "theta": None}[known("direction", direction, ("x", "y", "theta"))]
    return real("direction", direction)


def _check_pair(a: Point, b: Point, what: str, direction: "str | float") -> None:
    direction_angle(direction)
    for point in (a, b):
        instance(f"an end of a {what}", point, Point)
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
        signal_name("name of a force", self.name)
        instance(f"point of force {self.name!r}", self.point, Point)
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
        signal_name("name of an output", self.name)
        instance(f"point of output {self.name!r}", self.point, Point)
        if self.relative_to is not None:
            instance(f"relative_to of output {self.name!r}", self.relative_to, Point)
        direction_angle(self.direction)
        if whole(f"derivative of output {self.name!r}", self.derivative, least=0) > 2:
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
        if isinstance(self.directions, str):
            raise TypeError(f"directions of a cut joint = {self.directions!r}: expected a tuple, as ('x', 'y')")
        directions = sequence("directions of a cut joint", self.directions, "directions")
        if not directions:
            raise ValueError("directions of a cut joint: expected at least one")
        for direction in directions:
            _check_pair(self.a, self.b, "cut joint", direction)
        gap = hypot(self.a.x - self.b.x, self.a.y - self.b.y)
        if not isclose(gap, 0.0, abs_tol=1e-9 * (1.0 + hypot(self.a.x, self.a.y))):
            raise ValueError(f"cut joint: its points rest {gap:g} m apart; expected one place")
