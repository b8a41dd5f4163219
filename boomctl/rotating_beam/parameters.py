"""Physical parameters of the rotating hub-beam."""

from dataclasses import dataclass
from typing import TypedDict

from boomctl.checks import nonnegative, positive
from boomctl.parameters import Parameters


class HubBeamChanges(TypedDict, total=False):
    """Keywords by which `hub_beam` changes parameters: the fields of `HubBeamParameters`."""

    length: float
    density: float
    area: float
    youngs_modulus: float
    second_moment: float
    hub_inertia: float
    hub_radius: float
    tip_mass: float
    tip_mass_position: float | None
    damping_ratio: float


@dataclass(frozen=True, repr=False)
class HubBeamParameters(Parameters):
    """A flexible beam clamped radially to a rigid hub that turns in the plane, with a point mass on the beam.

    The defaults are Table 1 of Bai et al. (2009), except for the tip mass, which is absent.

    Parameters
    ----------
    length : float
        Length L of the beam, m.
    density : float
        Mass per unit volume rho, kg/m^3.
    area : float
        Area A of the cross section, m^2.
    youngs_modulus : float
        Young's modulus E, N/m^2.
    second_moment : float
        Second moment of area I for bending in the plane, m^4.
    hub_inertia : float
        Moment of inertia J_h of the hub about its axis, kg m^2; may be 0.
    hub_radius : float
        Distance r_A from the axis to the clamp, m; may be 0.
    tip_mass : float
        Point mass m_t on the beam, kg; may be 0.
    tip_mass_position : float or None
        Distance l of the point mass from the clamp, m, within [0, length]; None puts it at the free end.
    damping_ratio : float
        Damping ratio of every clamped mode of the beam at rest, transverse and axial; in [0, 1), 0 in the paper.

    Raises
    ------
    TypeError
        If a value is not a real number.
    ValueError
        If a value is not finite or out of its range.

    Examples
    --------
    >>> import boomctl as bc
    >>> loaded = bc.HubBeamParameters(tip_mass=2.0)
    >>> round(loaded.bending_stiffness, 2), round(loaded.rigid_body_inertia, 2)  # N m^2, kg m^2
    (566.71, 385.82)
    """

    _toml_table = "hub_beam"

    length: float = 8.0
    density: float = 2.7667e3
    area: float = 7.2968e-5
    youngs_modulus: float = 6.8952e10
    second_moment: float = 8.2189e-9
    hub_inertia: float = 200.0
    hub_radius: float = 0.5
    tip_mass: float = 0.0
    tip_mass_position: float | None = None
    damping_ratio: float = 0.0

    def __post_init__(self) -> None:
        for name in ("length", "density", "area", "youngs_modulus", "second_moment"):
            positive(name, getattr(self, name))
        for name in ("hub_inertia", "hub_radius", "tip_mass"):
            nonnegative(name, getattr(self, name))
        if (
            self.tip_mass_position is not None
            and nonnegative("tip_mass_position", self.tip_mass_position) > self.length
        ):
            raise ValueError(
                f"tip_position = {self.tip_mass_position!r}: expected a place on the beam, 0 to {self.length} m"
            )
        if nonnegative("damping_ratio", self.damping_ratio) >= 1.0:
            raise ValueError(f"damping_ratio = {self.damping_ratio!r}: expected a ratio in [0, 1)")
        self._plain()

    @property
    def mass_per_length(self) -> float:
        """Mass per unit length rho A, kg/m."""
        return self.density * self.area

    @property
    def bending_stiffness(self) -> float:
        """Bending stiffness E I, N m^2."""
        return self.youngs_modulus * self.second_moment

    @property
    def axial_stiffness(self) -> float:
        """Axial stiffness E A, N."""
        return self.youngs_modulus * self.area

    @property
    def _mass_position(self) -> float:
        """Distance of the point mass from the clamp, m."""
        return self.length if self.tip_mass_position is None else self.tip_mass_position

    @property
    def rigid_body_inertia(self) -> float:
        """Moment of inertia J_h + J_b of hub, straight beam and point mass about the axis, kg m^2 (Eq. 13 and A1)."""
        inner, outer = self.hub_radius, self.hub_radius + self.length
        beam = self.mass_per_length * (outer**3 - inner**3) / 3.0
        return self.hub_inertia + beam + self.tip_mass * (self.hub_radius + self._mass_position) ** 2
