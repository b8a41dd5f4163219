"""Cross sections of beams: area and second moment of tubes, bars and I sections, bent in the plane of the machine.

The depth is measured in the plane in which the beam bends, the width across it.  Sums of parts that are all positive, so
that thin walls lose no digits; corners are sharp.
"""

from dataclasses import dataclass
from math import pi

from boomctl.checks import exactly, positive, up_to


@dataclass(frozen=True)
class CrossSection:
    """What bending knows of a beam's cross section; `BeamSection.from_cross_section` makes a stretch of a beam of it.

    Attributes
    ----------
    area : float
        Area of the section [m^2].
    second_moment : float
        Second moment of area about the axis across the plane of motion, through the centre of area [m^4].

    Raises
    ------
    TypeError, ValueError
        Numbers that are not above zero.

    Notes
    -----
    Beams are those of Euler and Bernoulli, in small motions in a plane: no shear deformation, no rotary inertia of the
    section, no torsion, and no gravity.  That holds while the half-waves of a mode are long beside the depth.

    Examples
    --------
    >>> import boomctl as bc
    >>> bc.structure.CrossSection(area=3e-4, second_moment=2e-8).area
    0.0003
    """

    _made_by = "tube_section(...), round_tube_section(...), bar_section(...), rod_section(...) or i_section(...)"

    area: float
    second_moment: float

    def __post_init__(self) -> None:
        positive("area", self.area)
        positive("second_moment", self.second_moment)


def tube_section(width: float, depth: float, wall: float | tuple[float, float]) -> CrossSection:
    """Return the section of a rectangular tube.

    Parameters
    ----------
    width, depth : float
        Outer sides [m]: across the plane of bending, and in it.
    wall : float or (float, float)
        Thickness of the walls [m].  Of two, the first is that of the walls left and right of the width, the second that
        of the walls on both sides of the depth.

    Returns
    -------
    CrossSection
        Area [m^2] and second moment of area [m^4].

    Raises
    ------
    TypeError, ValueError
        Numbers that are not above zero; walls that leave no room between them.

    Examples
    --------
    >>> import boomctl as bc
    >>> tube = bc.structure.tube_section(0.0603, 0.02, (0.00215, 0.0021))  # of the spray boom
    >>> round(tube.area * 1e6, 2), round(tube.second_moment * 1e12, 1)  # mm^2, mm^4
    (321.2, 21793.2)
    """
    sides, covers = wall if isinstance(wall, tuple) and len(wall) == 2 else (wall, wall)
    b, h, s, t = positive("width", width), positive("depth", depth), positive("wall", sides), positive("wall", covers)
    _room("wall", s, b, "width")
    _room("wall", t, h, "depth")
    inside = b - 2.0 * s
    area = 2.0 * (s * h + inside * t)
    return CrossSection(area, s * h**3 / 6.0 + inside * t * (t * t / 6.0 + 0.5 * (h - t) ** 2))


def round_tube_section(diameter: float, wall: float) -> CrossSection:
    """Return the section of a round tube.

    Parameters
    ----------
    diameter : float
        Outer diameter [m].
    wall : float
        Thickness of the wall [m].

    Returns
    -------
    CrossSection
        Area [m^2] and second moment of area [m^4].

    Raises
    ------
    TypeError, ValueError
        Numbers that are not above zero; a wall that leaves no room within.

    Examples
    --------
    >>> import boomctl as bc
    >>> round(bc.structure.round_tube_section(0.06, 0.002).area * 1e6, 3)  # mm^2
    364.425
    """
    d, t = positive("diameter", diameter), positive("wall", wall)
    _room("wall", t, d, "diameter")
    area = pi * t * (d - t)
    return CrossSection(area, area * (d * d + (d - 2.0 * t) ** 2) / 16.0)


def bar_section(width: float, depth: float) -> CrossSection:
    """Return the section of a solid rectangular bar.

    Parameters
    ----------
    width, depth : float
        Sides [m]: across the plane of bending, and in it.

    Returns
    -------
    CrossSection
        Area [m^2] and second moment of area [m^4].

    Raises
    ------
    TypeError, ValueError
        Numbers that are not above zero.

    Examples
    --------
    >>> import boomctl as bc
    >>> round(bc.structure.bar_section(0.03, 0.01).second_moment * 1e12, 6)  # mm^4
    2500.0
    """
    b, h = positive("width", width), positive("depth", depth)
    return CrossSection(b * h, b * h**3 / 12.0)


def rod_section(diameter: float) -> CrossSection:
    """Return the section of a solid round rod.

    Parameters
    ----------
    diameter : float
        Diameter [m].

    Returns
    -------
    CrossSection
        Area [m^2] and second moment of area [m^4].

    Raises
    ------
    TypeError, ValueError
        A diameter that is not above zero.

    Examples
    --------
    >>> import boomctl as bc
    >>> round(bc.structure.rod_section(0.02).area * 1e6, 3)  # mm^2
    314.159
    """
    d = positive("diameter", diameter)
    return CrossSection(0.25 * pi * d * d, pi * d**4 / 64.0)


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
    b, h, s, t = positive("width", width), positive("depth", depth), positive("web", web), positive("flange", flange)
    _room("flange", t, h, "depth")
    if s > b:
        raise ValueError(f"web = {exactly(s)}: expected at most the width, {up_to(b)} m")
    tall = h - 2.0 * t
    flanges = 2.0 * b * t
    return CrossSection(flanges + s * tall, flanges * (t * t / 12.0 + 0.25 * (h - t) ** 2) + s * tall**3 / 12.0)


def _room(what: str, wall: float, size: float, of: str) -> None:
    if 2.0 * wall >= size:
        raise ValueError(f"{what} = {exactly(wall)}: expected less than half the {of}, {up_to(0.5 * size)} m")
