"""Parameters of the spray boom."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import sqrt
from typing import Any, TypedDict

from boomctl.checks import exactly, from_on, positive, warn_user, within
from boomctl.parameters import Parameters, compared_with_defaults, replaced

_LARGEST = 1e15  # Limit on any parameter, SI units: a thousand times the stiffness of diamond in N/m^2.
# Range of the lowest bending frequency [rad/s]; beyond, double precision does not suffice.
_BENDING = (1e-5, 1e6)
_HINGE_TOLERANCE = 1e-3  # Largest change of mass or inertia at the hinge without a warning, relative to the tube.
_TUBE = ("density", "length", "outer_width", "inner_width", "outer_height", "inner_height")
_LESS_THAN = {"inner_width": "outer_width", "inner_height": "outer_height", "spring_distance": "length"}
_FIRST = 1.8751040687119611  # first root of cos x cosh x = -1: a clamped beam's lowest mode
_DAMPING = ("cradle_damping", "hinge_damping", "stiffness_damping")
_MAY_BE_ZERO = (*_DAMPING, "spring_stiffness", "inner_width", "inner_height")


class BoomChanges(TypedDict, total=False):
    """The keywords with which `spray_boom` changes parameters: those of `BoomParameters`."""

    platform_mass: float
    cradle_mass: float
    boom_mass: float
    platform_inertia: float
    cradle_inertia: float
    boom_inertia: float
    density: float
    youngs_modulus: float
    length: float
    actuator_distance: float
    spring_distance: float
    outer_width: float
    inner_width: float
    outer_height: float
    inner_height: float
    spring_stiffness: float
    cradle_damping: float
    hinge_damping: float
    stiffness_damping: float


@compared_with_defaults
@dataclass(frozen=True, repr=False)
class BoomParameters(Parameters):
    """Physical properties of the spray boom and its suspension, SI units.

    The defaults are those of Anthonis & Ramon (2003), Table 2.  The paper's ``b`` is a width here (20 mm, the depth in
    bending), its ``h`` a height.  The mass and inertia of the boom in excess of its tube are at the hinge; `scaled`
    changes tube and boom together.

    Parameters
    ----------
    platform_mass, platform_inertia : float
        Mass ``m_1`` [kg] and moment of inertia ``I_1`` [kg m^2] of the platform; no influence if the actuators
        impose motion.
    cradle_mass, cradle_inertia : float
        Mass ``m_2`` [kg] and moment of inertia ``I_2`` [kg m^2] of the cradle.
    boom_mass, boom_inertia : float
        Mass ``m_3`` [kg] and moment of inertia ``I_3`` [kg m^2] of the full boom.
    density, youngs_modulus : float
        Density ``rho_3`` [kg/m^3] and Young's modulus ``E_b`` [N/m^2] of the tube.
    length : float
        Length of the boom from tip to tip [m].
    actuator_distance, spring_distance : float
        Distances ``L_t``, ``L_k`` between the two actuators and between the two springs [m].
    outer_width, inner_width, outer_height, inner_height : float
        Outer and inner sides ``b_bu, b_bi, h_bu, h_bi`` of the rectangular tube [m].
    spring_stiffness : float
        Stiffness ``k_s`` of each spring [N/m].
    cradle_damping, hinge_damping : float
        Damping ``c_g`` between platform and cradle [N s/m], and ``c_t`` in the hinge [N m s/rad].
    stiffness_damping : float
        Stiffness-proportional damping ``c_b`` of the boom [s].

    Raises
    ------
    TypeError, ValueError
        If a value is not a finite number, negative or above 1e15, if the section is larger inside than outside, if a spring
        is beyond the end of the boom, if mass or inertia is less than that of the tube, or if the first bending frequency
        of the arms is not between 1e-5 and 1e6 rad/s.

    Warns
    -----
    BoomctlWarning
        If ``boom_mass`` or ``boom_inertia`` is changed and the tube is not, or the tube is and one of them is not.

    Examples
    --------
    >>> import boomctl as bc
    >>> stiffer = bc.BoomParameters(spring_stiffness=2000.0)
    >>> round(stiffer.bending_stiffness), round(stiffer.tube_mass, 2)  # N m^2, kg
    (3923, 30.06)
    >>> bc.exact_eigenfrequencies_hz(stiffer, 2).round(3)
    array([0.315, 0.61 ])
    """

    platform_mass: float = 250.0
    cradle_mass: float = 50.0
    boom_mass: float = 35.76
    platform_inertia: float = 250.0
    cradle_inertia: float = 50.0
    boom_inertia: float = 361.38
    density: float = 7800.0
    youngs_modulus: float = 1.8e11
    length: float = 12.0
    actuator_distance: float = 1.78
    spring_distance: float = 1.318
    outer_width: float = 0.02
    inner_width: float = 0.0158
    outer_height: float = 0.0603
    inner_height: float = 0.056
    spring_stiffness: float = 1100.0
    cradle_damping: float = 160.0
    hinge_damping: float = 2.0
    stiffness_damping: float = 1e-4

    def __post_init__(self) -> None:
        for name, given in vars(self).items():
            value = within(name, given, 0.0, _LARGEST, "in SI units")
            if name not in _MAY_BE_ZERO:
                positive(name, value)
        self._plain()
        for name, limit in _LESS_THAN.items():
            value, larger = getattr(self, name), getattr(self, limit)
            if value >= larger:
                raise ValueError(f"`{name}` must be less than `{limit}`, {exactly(larger)}, got {exactly(value)}.")
        for name in ("mass", "inertia"):
            value, tube = getattr(self, f"boom_{name}"), getattr(self, f"tube_{name}")
            if value < tube * (1.0 - 1e-12):
                raise ValueError(
                    f"`boom_{name}` must be at least that of the tube, {from_on(tube)}, got {exactly(value)}. Change the tube"
                    " by BoomParameters().scaled(length=..., ...), which scales mass and inertia too."
                )
        wave, mass = 2.0 * _FIRST / self.length, self.mass_per_length
        bending = wave * wave * sqrt(self.bending_stiffness / mass) if mass > 0.0 else 0.0
        if not _BENDING[0] <= bending <= _BENDING[1]:
            raise ValueError(
                f"youngs_modulus = {self.youngs_modulus:g}, density = {self.density:g}, length = {self.length:g},"
                f" outer_width = {self.outer_width:g}: the boom's arms would bend at {bending:.3g} rad/s;"
                f" expected {_BENDING[0]:g} to {_BENDING[1]:g} rad/s, in SI units"
            )

    def _look_back(self, before: Any, changes: Mapping[str, Any]) -> None:
        resized = any(getattr(self, name) != getattr(before, name) for name in _TUBE)
        at_hinge = []
        for name in ("mass", "inertia"):
            boom, tube = (getattr(self, kind + name) - getattr(before, kind + name) for kind in ("boom_", "tube_"))
            consistent = resized and f"boom_{name}" in changes
            if not consistent and abs(boom - tube) > _HINGE_TOLERANCE * getattr(before, f"tube_{name}"):
                at_hinge.append(f"`boom_{name}`")
        if not at_hinge:
            return
        old = "BoomParameters()" if before == type(before)() else "p"
        arguments = ", ".join(f"{name}={value:g}" for name, value in changes.items())
        change, remedy = "unchanged, but the tube changed", f"`{old}.scaled({arguments})`"
        if not resized:  # Without values: Python displays one of the equal warnings of a sweep or fit of `boom_mass`.
            change = "changed, but the tube did not"
            remedy = "`p.scaled(density=1.1 * p.density)`, or `cradle_mass` for a point mass"
        names = " and ".join(at_hinge)
        warn_user(f"{names} {change}; the difference is placed at the hinge. To change both, use {remedy}.")

    def scaled(self, **changes: float) -> "BoomParameters":
        """Return the parameters with another tube, and with the mass and inertia of the boom changed accordingly.

        The mass and inertia in excess of the tube, at the hinge, are unchanged.

        Parameters
        ----------
        **changes : float
            New values by name, such as ``length``, ``density`` or the sides of the section.  Specified mass and inertia
            of the boom are used unchanged.

        Returns
        -------
        BoomParameters
            A new record.

        Raises
        ------
        TypeError, ValueError
            As of :meth:`replace`.

        Examples
        --------
        >>> import boomctl as bc
        >>> wide = bc.BoomParameters().scaled(length=24.0)
        >>> round(wide.boom_mass, 2), round(wide.boom_inertia, 1)  # kg, kg m^2
        (65.82, 2886.8)
        """
        heavy = dict.fromkeys(("boom_mass", "boom_inertia"), _LARGEST)
        tube = replaced(self, {**heavy, **changes})
        mass, inertia = tube.tube_mass - self.tube_mass, tube.tube_inertia - self.tube_inertia
        along = {"boom_mass": self.boom_mass + mass, "boom_inertia": self.boom_inertia + inertia}
        return self.replace(**{**along, **changes})

    @property
    def area(self) -> float:
        """Cross-sectional area of the tube [m^2]."""
        return self.outer_height * self.outer_width - self.inner_height * self.inner_width

    @property
    def second_moment(self) -> float:
        """Second moment of area for bending in the horizontal plane [m^4]."""
        return (self.outer_height * self.outer_width**3 - self.inner_height * self.inner_width**3) / 12.0

    @property
    def mass_per_length(self) -> float:
        """Mass per length of the tube [kg/m]."""
        return self.density * self.area

    @property
    def bending_stiffness(self) -> float:
        """``E I`` [N m^2]."""
        return self.youngs_modulus * self.second_moment

    @property
    def tube_mass(self) -> float:
        """Mass of the tube alone [kg]."""
        return self.mass_per_length * self.length

    @property
    def tube_inertia(self) -> float:
        """Moment of inertia of the tube alone about its center [kg m^2]."""
        return self.tube_mass * self.length**2 / 12.0
