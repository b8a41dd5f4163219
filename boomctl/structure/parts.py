"""Parts of a machine: bodies, joints, springs and dampers, forces, outputs.

A description is plain frozen data that corresponds to a drawing; :class:`boomctl.structure.Assembly` turns it
into equations of motion.  Positions are those at rest, in the inertial frame: ``x`` along the page, ``y`` across it,
``theta`` about the normal.
"""

from collections.abc import Sequence
from dataclasses import InitVar, dataclass, field
from math import cos, hypot, isclose, pi, sin
from typing import TYPE_CHECKING, ClassVar, Protocol

from boomctl.checks import (
    exactly,
    instance,
    known,
    nonnegative,
    positive,
    real,
    sequence,
    shown,
    signal_name,
    truth,
    up_to,
    whole,
)
from boomctl.printing import compact
from boomctl.structure.beams.mesh import BeamMesh


@dataclass(frozen=True)
class Joint:
    """Joint of a body with its parent; usual joints are `fixed`, `revolute`, `prismatic` and `planar`.

    Parameters
    ----------
    translations : tuple of (str, float)
        Directions of translation: a name for the coordinate, and the angle of the direction from the x axis [rad].
    rotation : bool
        If True, the body may rotate about the joint.

    Raises
    ------
    TypeError, ValueError
        If ``translations`` are not pairs of a name and a finite angle, or if ``rotation`` is not True or False.

    Examples
    --------
    >>> import boomctl as bc
    >>> slide = bc.structure.Joint(translations=(("slide", 0.0),), rotation=True)  # as of a pin in a slot along x
    >>> slide.rotation
    True
    """

    _made_by = "revolute(), prismatic(...), fixed() or planar(...)"

    translations: tuple[tuple[str, float], ...] = ()
    rotation: bool = False

    def __post_init__(self) -> None:
        for slide in sequence("translations of a joint", self.translations, "pairs of name and angle"):
            if not isinstance(slide, tuple) or len(slide) != 2:
                raise TypeError(f"translations of a joint: expected pairs of name and angle, got {shown(slide)}")
            signal_name("name of a slide", slide[0])
            _radians("angle of a slide", slide[1])
        truth("rotation of a joint", self.rotation)


def fixed() -> Joint:
    """Return a rigid joint.

    Returns
    -------
    Joint
        The body has no coordinates.

    Examples
    --------
    >>> import boomctl as bc
    >>> bc.structure.fixed()
    Joint(translations=(), rotation=False)
    """
    return Joint()


def revolute() -> Joint:
    """Return a hinge: the body rotates about the joint.

    Returns
    -------
    Joint
        The body has one coordinate, ``NAME.theta`` [rad].

    Examples
    --------
    >>> import boomctl as bc
    >>> bc.structure.revolute().rotation
    True
    """
    return Joint(rotation=True)


def prismatic(angle: float = pi / 2, name: str = "slide") -> Joint:
    """Return a slide: the body moves along a straight line and does not rotate.

    Parameters
    ----------
    angle : float
        Direction of the line, from the x axis [rad]; by default along y.
    name : str
        The coordinate is called ``BODY.name``.

    Returns
    -------
    Joint
        The body gets one coordinate, its displacement along the line [m].

    Raises
    ------
    TypeError, ValueError
        ``angle`` is not a finite number, or ``name`` is not a name.

    Examples
    --------
    >>> import boomctl as bc
    >>> bc.structure.prismatic(0.0, "along").translations
    (('along', 0.0),)
    """
    return Joint(translations=((name, _radians("angle", angle)),))


def planar(*freedoms: str) -> Joint:
    """Return a joint with the named degrees of freedom.

    Parameters
    ----------
    *freedoms : "x", "y" or "theta"
        Degrees of freedom: translations along x and y, and rotation; any number of these words.

    Returns
    -------
    Joint
        The body has one coordinate per degree of freedom: ``NAME.x`` and ``NAME.y`` [m], ``NAME.theta`` [rad].

    Raises
    ------
    ValueError
        If a word is unknown.

    Examples
    --------
    >>> import boomctl as bc
    >>> joint = bc.structure.planar("y", "theta")
    >>> [name for name, angle in joint.translations], joint.rotation
    (['y'], True)
    """
    for dof in freedoms:
        known("dof", dof, ("x", "y", "theta"))
    translations = tuple((name, angle) for name, angle in (("x", 0.0), ("y", pi / 2)) if name in freedoms)
    return Joint(translations=translations, rotation="theta" in freedoms)


@dataclass(frozen=True)
class Point:
    """A point of a body; see ``body.at_point(x, y)`` and, on a beam, ``beam.at(s)``.

    Parameters
    ----------
    body : RigidBody, Beam or GROUND
        Body that carries the point.
    x, y : float
        Position at rest in the inertial frame [m].

    Raises
    ------
    TypeError, ValueError
        If `body` has another type, if a value is not finite, or if a point of a beam is not on its axis.

    Examples
    --------
    >>> import boomctl as bc
    >>> bc.structure.GROUND.at_point(1.5)
    GROUND.at_point(1.5, 0)
    """

    _made_by = ".at(s) of a beam, .at_point(x, y) of a body or of GROUND"

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
        return f"{'GROUND' if isinstance(self.body, Ground) else self.body.name}.at_point({self.x:g}, {self.y:g})"


@dataclass(frozen=True)
class Ground:
    """The inertial frame; its only instance is `boomctl.structure.GROUND`."""

    name: ClassVar[str] = "ground"

    def __repr__(self) -> str:
        return "GROUND"

    def at_point(self, x: float, y: float = 0.0) -> Point:
        """Return the point of the ground at ``(x, y)``; ``at`` is an alias.

        Parameters
        ----------
        x, y : float
            Position [m].

        Returns
        -------
        Point
            The fixed point.

        Raises
        ------
        TypeError, ValueError
            If ``x`` or ``y`` is not a finite number.

        Examples
        --------
        >>> import boomctl as bc
        >>> bc.structure.GROUND.at_point(2.0, 0.5)
        GROUND.at_point(2, 0.5)
        """
        return Point(self, x, y)

    at = at_point


GROUND = Ground()


@dataclass(frozen=True)
class RigidBody:
    """A rigid body that hangs on its parent by a joint.

    Parameters
    ----------
    name : str
        Name of the body; its coordinates are ``name.y``, ``name.theta``, ``name.slide``, ...
    parent : Point
        Point of another body, or of the ground, at which its joint is.
    joint : Joint
        Joint with the parent at that point.
    mass, inertia : float
        Mass [kg] and moment of inertia about the center of mass [kg m^2]; zero is allowed.
    center_of_mass : (float, float), optional
        Position of the center of mass at rest in the inertial frame [m], not relative to the joint; by default that of
        the joint.

    Raises
    ------
    TypeError, ValueError
        If `name` is not a name, if `parent` or `joint` has another type, if mass or inertia is negative, or if the center
        of mass is not two numbers.

    Examples
    --------
    >>> import boomctl as bc
    >>> s = bc.structure
    >>> rod = s.RigidBody("rod", s.GROUND.at(0.0), s.revolute(), mass=3.0, inertia=0.25, center_of_mass=(0.5, 0.0))
    >>> machine = s.Assembly((rod,), (s.SpringDamper(rod.at(1.0), s.GROUND.at(1.0), "y", stiffness=100.0),))
    >>> machine.assemble().eigenfrequencies_hz(1).round(4)  # 10/(2 pi): the inertia about the hinge is 1 kg m^2
    array([1.5915])
    """

    name: str
    parent: Point
    joint: Joint
    mass: float = 0.0
    inertia: float = 0.0
    center_of_mass: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        signal_name("name of a body", self.name)
        instance(f"parent of {self.name!r}", self.parent, Point)
        instance(f"joint of {self.name!r}", self.joint, Joint)
        nonnegative(f"mass of {self.name!r}", self.mass)
        nonnegative(f"inertia of {self.name!r}", self.inertia)
        if self.center_of_mass is not None:
            _position(f"center of {self.name!r}", self.center_of_mass)

    __repr__ = compact

    def at_point(self, x: float, y: float = 0.0) -> Point:
        """Return the point of the body at ``(x, y)`` at rest; ``at`` is an alias.

        Parameters
        ----------
        x, y : float
            Position at rest in the inertial frame [m]; not limited to the outline of the body.

        Returns
        -------
        Point
            The point, fixed to the body.

        Raises
        ------
        TypeError, ValueError
            If ``x`` or ``y`` is not a finite number.

        Examples
        --------
        >>> import boomctl as bc
        >>> s = bc.structure
        >>> rod = s.RigidBody("rod", s.GROUND.at_point(2.0), s.revolute(), mass=3.0)
        >>> rod.at_point(3.0)  # 1 m beyond the hinge
        rod.at_point(3, 0)
        """
        return Point(self, x, y)

    at = at_point


@dataclass(frozen=True)
class CrossSection:
    """Cross section of a beam; see `BeamSegment.from_cross_section`.

    Functions return the sections of tubes, bars, rods and I beams, for bending in the plane of the machine: the depth is
    measured in that plane, the width across it.  They are sums of positive terms, which are accurate for thin walls; corners
    are sharp.

    Attributes
    ----------
    area : float
        Area of the section [m^2].
    second_moment : float
        Second moment of area about the axis across the plane of motion, through the center of area [m^4].

    Raises
    ------
    TypeError, ValueError
        If a value is not above zero.

    Notes
    -----
    Beams are those of Euler and Bernoulli, in small motions in a plane: no shear deformation, no rotary inertia of the
    section, no torsion, and no gravity.  The theory holds if the half-waves of a mode are long relative to the depth.

    Examples
    --------
    >>> import boomctl as bc
    >>> bc.structure.CrossSection(area=3e-4, second_moment=2e-8).area
    0.0003
    """

    _made_by = "rectangular_section(...), circular_section(...) or i_section(...)"

    area: float
    second_moment: float

    def __post_init__(self) -> None:
        positive("area", self.area)
        positive("second_moment", self.second_moment)


def rectangular_section(width: float, depth: float, wall: float | tuple[float, float] | None = None) -> CrossSection:
    """Return the section of a rectangular tube or of a solid rectangular bar.

    Parameters
    ----------
    width, depth : float
        Outer sides [m]: across the plane of bending, and in it.
    wall : float or (float, float), optional
        Thickness of the walls [m].  Of two, the first is that of the walls left and right of the width, the second that
        of the walls on both sides of the depth.  If None, the section is solid.

    Returns
    -------
    CrossSection
        Area [m^2] and second moment of area [m^4].

    Raises
    ------
    TypeError, ValueError
        If a value is not above zero, or if walls overlap.

    Examples
    --------
    >>> import boomctl as bc
    >>> tube = bc.structure.rectangular_section(0.0603, 0.02, (0.00215, 0.0021))  # of the spray boom
    >>> round(tube.area * 1e6, 2), round(tube.second_moment * 1e12, 1)  # mm^2, mm^4
    (321.2, 21793.2)
    >>> round(bc.structure.rectangular_section(0.03, 0.01).second_moment * 1e12, 6)
    2500.0
    """
    b, h = positive("width", width), positive("depth", depth)
    s, t = 0.5 * b, 0.5 * h
    if wall is not None:
        sides, covers = wall if isinstance(wall, tuple) and len(wall) == 2 else (wall, wall)
        s, t = _wall("wall", sides, b, "width"), _wall("wall", covers, h, "depth")
    inside = b - 2.0 * s
    area = 2.0 * (s * h + inside * t)
    return CrossSection(area, s * h**3 / 6.0 + inside * t * (t * t / 6.0 + 0.5 * (h - t) ** 2))


def circular_section(diameter: float, wall: float | None = None) -> CrossSection:
    """Return the section of a round tube or of a solid round rod.

    Parameters
    ----------
    diameter : float
        Outer diameter [m].
    wall : float, optional
        Thickness of the wall [m].  If None, the section is solid.

    Returns
    -------
    CrossSection
        Area [m^2] and second moment of area [m^4].

    Raises
    ------
    TypeError, ValueError
        If a value is not above zero, or if the wall fills the section.

    Examples
    --------
    >>> import boomctl as bc
    >>> round(bc.structure.circular_section(0.06, 0.002).area * 1e6, 3)  # mm^2
    364.425
    >>> round(bc.structure.circular_section(0.02).area * 1e6, 3)
    314.159
    """
    d = positive("diameter", diameter)
    t = 0.5 * d if wall is None else _wall("wall", wall, d, "diameter")
    area = pi * t * (d - t)
    return CrossSection(area, area * (d * d + (d - 2.0 * t) ** 2) / 16.0)


def i_section(width: float, depth: float, web: float, flange: float) -> CrossSection:
    """Return the section of an I beam that bends in the plane of its web.

    Parameters
    ----------
    width, depth : float
        Outer sides [m]: the width of the flanges, and the height over both of them.
    web, flange : float
        Thickness of the web and of each flange [m].

    Returns
    -------
    CrossSection
        Area [m^2] and second moment of area [m^4].

    Raises
    ------
    TypeError, ValueError
        Numbers that are not above zero; flanges that meet; a web wider than the flanges.

    Examples
    --------
    >>> import boomctl as bc
    >>> round(bc.structure.i_section(0.1, 0.2, 0.0056, 0.0085).area * 1e6)  # mm^2
    2725
    """
    b, h, s = positive("width", width), positive("depth", depth), positive("web", web)
    t = _wall("flange", flange, h, "depth")
    if s > b:
        raise ValueError(f"web = {exactly(s)}: expected at most the width, {up_to(b)} m")
    tall = h - 2.0 * t
    flanges = 2.0 * b * t
    return CrossSection(flanges + s * tall, flanges * (t * t / 12.0 + 0.25 * (h - t) ** 2) + s * tall**3 / 12.0)


def _wall(name: str, wall: float, size: float, of: str) -> float:
    """Return the checked thickness of one of two walls, which must not overlap."""
    if 2.0 * positive(name, wall) >= size:
        raise ValueError(f"{name} = {exactly(wall)}: expected less than half the {of}, {up_to(0.5 * size)} m")
    return wall


@dataclass(frozen=True)
class BeamSegment:
    """A segment of a beam with one cross section.

    `BeamSegment.from_cross_section` accepts the section of a tube, a bar or an I beam and a material instead.

    Parameters
    ----------
    length : float
        Length of the stretch [m].
    mass_per_length : float
        ``rho A`` [kg/m].
    bending_stiffness : float
        ``E I`` [N m^2].
    stiffness_damping : float
        Stiffness-proportional structural damping ``c_b`` [s]: bending moment ``E I (kappa + c_b kappa')``.

    Raises
    ------
    TypeError, ValueError
        A length, mass or stiffness that is not above zero; a negative damping.

    Examples
    --------
    >>> import boomctl as bc
    >>> bc.structure.BeamSegment(length=3.0, mass_per_length=3.5, bending_stiffness=20e3).stiffness_damping
    0.0
    """

    length: float
    mass_per_length: float
    bending_stiffness: float
    stiffness_damping: float = 0.0

    def __post_init__(self) -> None:
        positive("length of a beam section", self.length)
        positive("mass_per_length", self.mass_per_length)
        positive("bending_stiffness", self.bending_stiffness)
        nonnegative("damping of a beam section", self.stiffness_damping)

    @classmethod
    def from_cross_section(
        cls, length: float, section: CrossSection, youngs_modulus: float, density: float, damping: float = 0.0
    ) -> "BeamSegment":
        """Return a stretch of one material and one cross section.

        Parameters
        ----------
        length : float
            Length of the stretch [m].
        section : CrossSection
            Result of `rectangular_section`, `circular_section` or `i_section`.
        youngs_modulus, density : float
            Young's modulus [Pa] and density [kg/m^3] of the material.
        damping : float
            Stiffness-proportional structural damping, as for `BeamSegment` [s].

        Returns
        -------
        BeamSegment
            With ``rho A`` and ``E I`` of that section and material.

        Raises
        ------
        TypeError, ValueError
            If `section` has another type, or if a value is out of range.

        Examples
        --------
        >>> import boomctl as bc
        >>> steel = {"youngs_modulus": 210e9, "density": 7850.0}
        >>> tube = bc.structure.rectangular_section(0.04, 0.04, wall=0.003)
        >>> round(bc.structure.BeamSegment.from_cross_section(3.0, tube, **steel).mass_per_length, 4)
        3.4854
        """
        cross_section = instance("section", section, CrossSection)
        stiffness = positive("youngs_modulus", youngs_modulus) * cross_section.second_moment
        return cls(length, positive("density", density) * cross_section.area, stiffness, damping)


class Discretization(Protocol):
    """Protocol of beam discretizations."""

    def mesh(self, beam: "Beam", attachments: Sequence[float]) -> BeamMesh:
        """Return the mesh of ``beam`` with attachments at the stations ``attachments``."""
        ...


@dataclass(frozen=True)
class Beam:
    """An inextensible Euler-Bernoulli beam, straight at rest, in one or more segments of uniform section.

    Parameters
    ----------
    name : str
        Name of the beam; its coordinates are ``name.w3`` (transverse displacement of node 3) and ``name.phi3`` (slope).
    parent : Point
        Point of another body, or of the ground, at which its joint is; it must be on the beam.
    joint : Joint
        Joint with the parent at that point.
    start : (float, float) or Point
        Position of the start of the beam at rest [m].  For a Point, such as ``other.end``, its position is used.  The
        attribute ``start`` is the point of the beam at its start.
    segments : sequence of BeamSegment
        The segments, in order from the start.
    discretization : FiniteElements or DiscreteElements
        Discretization of the beam: one of these, or any object with the same method ``mesh``.
    angle : float
        Direction of the beam's axis at rest, from the x axis [rad]; the transverse direction is 90 degrees further.

    Attributes
    ----------
    length : float
        Sum of the lengths of the segments [m].
    end : Point
        Point of the beam at its end.

    Raises
    ------
    TypeError, ValueError
        If a parent, joint, segment or discretization has another type, if there is no segment, or if the parent is not on
        the beam.

    Examples
    --------
    >>> import boomctl as bc
    >>> s = bc.structure
    >>> stretch = s.BeamSegment(length=2.0, mass_per_length=3.0, bending_stiffness=5e3)
    >>> beam = s.Beam("beam", s.GROUND.at(0.0), s.fixed(), (0.0, 0.0), (stretch,), s.FiniteElements(8))
    >>> s.Assembly((beam,)).assemble().eigenfrequencies_hz(2).round(3)  # of a cantilever
    array([ 5.711, 35.795])
    >>> load = s.RigidBody("load", beam.end, s.fixed(), mass=2.0)
    >>> s.Assembly((beam, load)).assemble().eigenfrequencies_hz(1).round(3)
    array([3.72])
    """

    name: str
    parent: Point
    joint: Joint
    _origin: tuple[float, float] = field(init=False)
    segments: tuple[BeamSegment, ...]
    discretization: Discretization
    angle: float
    length: float = field(init=False)
    if TYPE_CHECKING:

        @property
        def start(self) -> Point:
            """Point of the beam at its start."""
            ...

    else:  # An argument for `dataclasses.replace`, no field: the point refers to the beam.
        start: InitVar[object] = property(
            lambda self: Point(self, *self._origin), doc="Point of the beam at its start."
        )

    def __init__(
        self,
        name: str,
        parent: Point,
        joint: Joint,
        start: tuple[float, float] | Point,
        segments: Sequence[BeamSegment],
        discretization: Discretization,
        angle: float = 0.0,
    ) -> None:
        of = f"of beam {signal_name('name of a body', name)!r}"
        segments = sequence(f"segments {of}", segments, "BeamSegment")
        for segment in segments:
            instance(f"segment {of}", segment, BeamSegment)
        if not segments:
            raise ValueError(f"beam {name!r}: expected at least one segment")
        if not callable(getattr(discretization, "mesh", None)):
            raise TypeError(f"discretization {of} = {shown(discretization)}: expected FiniteElements or another one")
        self.__dict__.update(
            name=name,
            parent=instance(f"parent {of}", parent, Point),
            joint=instance(f"joint {of}", joint, Joint),
            segments=segments,
            discretization=discretization,
            angle=_radians(f"angle {of}", angle),
            length=float(sum(segment.length for segment in segments)),
            _origin=(start.x, start.y) if isinstance(start, Point) else _position(f"start {of}", start),
        )
        self.station(parent.x, parent.y)

    def __repr__(self) -> str:
        return compact(self).replace("_origin=", "start=")

    def station(self, x: float, y: float) -> float:
        """Return the station on the beam of the point at ``(x, y)`` at rest.

        Parameters
        ----------
        x, y : float
            Position at rest [m].

        Returns
        -------
        float
            Distance from the beam's start [m].

        Raises
        ------
        ValueError
            If the point is not on the beam's axis.
        """
        dx, dy = x - self._origin[0], y - self._origin[1]
        along, across = dx * cos(self.angle) + dy * sin(self.angle), dy * cos(self.angle) - dx * sin(self.angle)
        slack = 1e-9 * self.length
        if not (-slack <= along <= self.length + slack and abs(across) <= slack):
            raise ValueError(
                f"point ({x:g}, {y:g}) is not on beam {self.name!r}: it is {along:g} m along and {across:g} m off"
                f" an axis of {self.length:g} m"
            )
        return min(max(along, 0.0), self.length)

    @property
    def end(self) -> Point:
        """Point of the beam at its end."""
        return self.at(self.length)

    def at(self, s: float, y: None = None) -> Point:
        """Return the point of the beam at a distance from its start.

        Parameters
        ----------
        s : float
            Distance from the start along the axis [m], from 0 to ``length``.
        y : None
            Not accepted: `at_point` takes a position ``(x, y)``.

        Returns
        -------
        Point
            The point; its rotation is the slope of the beam.

        Raises
        ------
        TypeError
            If ``s`` is not a number, or if two numbers are passed.
        ValueError
            If ``s`` is not finite, or outside the beam.

        Examples
        --------
        >>> import boomctl as bc
        >>> s = bc.structure
        >>> stretch = s.BeamSegment(length=3.0, mass_per_length=3.0, bending_stiffness=5e3)
        >>> arm = s.Beam("arm", s.GROUND.at_point(2.0), s.fixed(), (2.0, 0.0), (stretch,), s.FiniteElements(8))
        >>> arm.at(1.0)  # 1 m from the start, which is at x = 2 m
        arm.at_point(3, 0)
        """
        slack = 1e-9 * self.length
        if y is not None:
            raise TypeError(
                f"`s` must be one number, the distance from the start of beam {self.name!r} along its axis, got {shown(s)}"
                f" and {shown(y)}. Use `at_point(x, y)` for a position in the drawing."
            )
        if not -slack <= real("s", s) <= self.length + slack:
            raise ValueError(
                f"`s` must be from 0 to {self.length:g} m, the length of beam {self.name!r}, got {exactly(s)}. Use"
                " `at_point(x, y)` for a position in the drawing."
            )
        s = min(max(float(s), 0.0), self.length)
        return Point(self, self._origin[0] + s * cos(self.angle), self._origin[1] + s * sin(self.angle))

    def at_point(self, x: float, y: float = 0.0) -> Point:
        """Return the point of the beam at ``(x, y)`` at rest.

        Parameters
        ----------
        x, y : float
            Position at rest in the inertial frame [m], on the axis of the beam.

        Returns
        -------
        Point
            The point; its rotation is the slope of the beam.

        Raises
        ------
        TypeError, ValueError
            If ``x`` or ``y`` is not a finite number, or the position is not on the axis of the beam.

        Examples
        --------
        >>> import boomctl as bc
        >>> s = bc.structure
        >>> stretch = s.BeamSegment(length=3.0, mass_per_length=3.0, bending_stiffness=5e3)
        >>> arm = s.Beam("arm", s.GROUND.at_point(2.0), s.fixed(), (2.0, 0.0), (stretch,), s.FiniteElements(8))
        >>> arm.at_point(3.0) == arm.at(1.0)
        True
        """
        return Point(self, x, y)


def _position(name: str, value: object) -> tuple[float, float]:
    """Return a pair of finite numbers."""
    pair = sequence(name, value, "two numbers")
    if len(pair) != 2:
        raise ValueError(f"{name}: expected two numbers, x and y, got {len(pair)}")
    return real(name, pair[0]), real(name, pair[1])


_ANGLES = {"x": 0.0, "y": pi / 2, "theta": None}  # from the x axis [rad]; none of a rotation


def direction_angle(direction: "str | float") -> float | None:
    """Return the angle of a direction from the x axis [rad]; ``None`` of a rotation."""
    if isinstance(direction, str):
        return _ANGLES[direction if direction in _ANGLES else known("direction", direction, _ANGLES)]
    return _radians("direction", direction)


def _radians(name: str, value: object) -> float:
    """Return an angle of at most one turn [rad]; larger values are probably degrees."""
    if abs(real(name, value)) > 2.0 * pi:
        raise ValueError(
            f"{name} = {value!r}: expected radians, at most one turn; math.radians({value!r}) makes them of degrees"
        )
    return real(name, value)


def _check_pair(a: Point, b: Point, what: str, direction: "str | float") -> None:
    direction_angle(direction)
    for point in (a, b):
        instance(f"an end of a {what}", point, Point)
    if a.body.name == b.body.name:
        raise ValueError(f"{what}: both ends are on {a.body.name!r}; expected two bodies")


@dataclass(frozen=True)
class SpringDamper:
    """A linear spring and a viscous damper, side by side, between points of two bodies.

    Parameters
    ----------
    a, b : Point
        End points; the elongation is the displacement of ``a`` minus that of ``b`` along ``direction``.
    direction : "x", "y", "theta" or float
        Direction in which it acts; a number is an angle from the x axis [rad]; ``"theta"`` for a torsion spring.
    stiffness : float
        Force over elongation [N/m]; for ``"theta"`` torque over angle [N m/rad].
    damping : float
        Force over rate [N s/m]; for ``"theta"`` torque over turning rate [N m s/rad].

    Raises
    ------
    TypeError, ValueError
        If the points are not of two bodies, the direction is unknown, or a stiffness or damping is negative.

    Examples
    --------
    >>> import boomctl as bc
    >>> s = bc.structure
    >>> mass = s.RigidBody("mass", s.GROUND.at(0.0), s.prismatic(), mass=2.0)
    >>> spring = s.SpringDamper(mass.at(0.0), s.GROUND.at(0.0), "y", stiffness=50.0, damping=0.4)
    >>> model = s.Assembly((mass,), (spring,)).assemble()
    >>> model.M, model.C, model.K
    (array([[2.]]), array([[0.4]]), array([[50.]]))
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
    """An input of the machine: a force or a torque on a point.

    Parameters
    ----------
    name : str
        Name of the input.
    point : Point
        Point at which it acts.
    direction : "x", "y", "theta" or float
        Direction of the force [N]; a number is an angle from the x axis [rad]; ``"theta"`` for a torque [N m].
    reaction_point : Point, optional
        Point of another body at which the opposite force acts, as for an actuator between two bodies.  If None, the force
        is external.

    Raises
    ------
    TypeError, ValueError
        If `name` is not a name, if the points do not belong to two bodies, or if the direction is unknown.

    Examples
    --------
    >>> import boomctl as bc
    >>> s = bc.structure
    >>> mass = s.RigidBody("mass", s.GROUND.at(0.0), s.prismatic(), mass=2.0)
    >>> push, place = s.Force("push", mass.at(0.0)), s.Output("place", mass.at(0.0))
    >>> s.Assembly((mass,), forces=(push,), outputs=(place,)).assemble().input_labels
    ('push',)
    """

    name: str
    point: Point
    direction: "str | float" = "y"
    reaction_point: Point | None = None

    def __post_init__(self) -> None:
        signal_name("name of a force", self.name)
        instance(f"point of force {self.name!r}", self.point, Point)
        direction_angle(self.direction)
        if self.reaction_point is not None:
            _check_pair(self.point, self.reaction_point, f"force {self.name!r}", self.direction)

    __repr__ = compact


@dataclass(frozen=True)
class Output:
    """An output of the machine: a measured motion.

    Parameters
    ----------
    name : str
        Name of the output.
    point : Point
        The point whose motion is measured.
    direction : "x", "y", "theta" or float
        Direction of the motion [m]; a number is an angle from the x axis [rad]; ``"theta"`` for the rotation [rad].
    relative_to : Point, optional
        Point whose motion along the same direction is subtracted, as for a sensor between two bodies.
    derivative : 0, 1 or 2
        Displacement, velocity or acceleration.
    bandwidth_hz : float, optional
        Puts a second-order low-pass filter (damping ratio ``1/sqrt 2``) of this bandwidth [Hz] behind it, as in an
        accelerometer.

    Raises
    ------
    TypeError, ValueError
        If `name` is not a name, if `point` is not a point, if the direction or derivative is unknown, or if the bandwidth is
        not above zero.

    Examples
    --------
    >>> import boomctl as bc
    >>> s = bc.structure
    >>> mass = s.RigidBody("mass", s.GROUND.at(0.0), s.prismatic(), mass=2.0)
    >>> s.Output("acceleration", mass.at(0.0), derivative=2, bandwidth_hz=50.0).derivative
    2
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
        whole(f"derivative of output {self.name!r}", self.derivative, 0, 2)
        if self.bandwidth_hz is not None:
            positive(f"bandwidth_hz of output {self.name!r}", self.bandwidth_hz)

    __repr__ = compact


@dataclass(frozen=True)
class CutJoint:
    """A joint that closes a kinematic chain: its two points coincide.

    Parameters
    ----------
    a, b : Point
        Points of two bodies with the same position at rest.
    directions : tuple of "x", "y", "theta" or float
        Constrained directions; ``"x"`` and ``"y"`` together are a hinge, with ``"theta"`` a rigid connection.

    Raises
    ------
    TypeError, ValueError
        If the points do not belong to two bodies or differ at rest, or if a direction is missing or unknown.

    Examples
    --------
    >>> import boomctl as bc
    >>> s = bc.structure
    >>> left = s.RigidBody("left", s.GROUND.at(0.0), s.revolute(), 1.0, 0.1)
    >>> right = s.RigidBody("right", s.GROUND.at(2.0), s.revolute(), 1.0, 0.1)
    >>> pin = s.CutJoint(left.at(1.0), right.at(1.0), directions=("y",))
    >>> s.Assembly((left, right), cut_joints=(pin,)).assemble().ncoordinates  # two angles, one of them bound to the other
    1
    """

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
            raise ValueError(f"cut joint: its points must coincide at rest, got a distance of {gap:g} m")
