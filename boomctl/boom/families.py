"""What is not known of a spray boom: the stiffness of its springs and the mass of its beam.

Both enter mass, damping and stiffness matrix linearly, so that the boom is an exactly affine family over a box of them.
The beam's mass is uncertain as a whole: ``boom_mass``, ``boom_inertia`` and ``density`` are scaled by one factor, so that
the tube's share of mass and inertia stays what it is and never exceeds the boom's.  Tanks, hoses and nozzles spread along
the boom, and spray liquid in its pipes, are such a change.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from boomctl.boom.factory import spray_boom
from boomctl.boom.parameters import BoomParameters, boom_parameters
from boomctl.checks import known, positive
from boomctl.structure.families import AffineFamily, interval
from boomctl.structure.model import SecondOrderModel, split_symmetric
from boomctl.threads import one_blas_thread

_HALVES = ("jolt", "yaw")
_STIFFEST = 1e4  # times the present stiffness and its inverse: where the search for a spring ends (a choice)


def scaled_boom(parameters: BoomParameters, spring_factor: float = 1.0, mass_factor: float = 1.0) -> BoomParameters:
    """Return a boom with springs and mass multiplied by factors."""
    positive("spring_factor", spring_factor)
    positive("mass_factor", mass_factor)
    return replace(
        parameters,
        spring_stiffness=spring_factor * parameters.spring_stiffness,
        boom_mass=mass_factor * parameters.boom_mass,
        boom_inertia=mass_factor * parameters.boom_inertia,
        density=mass_factor * parameters.density,
    )


def _part(model: SecondOrderModel, half: str | None) -> SecondOrderModel:
    return model if half is None else split_symmetric(model)[_HALVES.index(known("half", half, _HALVES))]


@one_blas_thread
def boom_family(
    parameters: BoomParameters | None = None,
    spring_factor: tuple[float, float] = (0.7, 1.3),
    mass_factor: tuple[float, float] = (0.8, 1.2),
    subsystem: str | None = None,
    elements: int = 6,
    discretization: str = "finite",
    excitation: str = "displacement",
    accelerometer_bandwidth_hz: float | None = None,
) -> AffineFamily:
    """Return the boom over a box of spring stiffness and beam mass.

    Parameters
    ----------
    parameters : BoomParameters, optional
        By default those of Anthonis & Ramon (2003), Table 2.
    spring_factor, mass_factor : (float, float)
        Least and largest factor on the spring stiffness, and on the mass of the beam; the family's parameters are
        called ``"spring_factor"`` and ``"mass_factor"``.
    subsystem : "jolt" or "yaw", optional
        One half of the symmetric boom; by default the whole boom.
    elements, discretization, excitation, accelerometer_bandwidth_hz
        As for :func:`boomctl.spray_boom`.

    Returns
    -------
    AffineFamily
        The boom at every point of the box; for :func:`boomctl.robust_stability` and its like.

    Raises
    ------
    TypeError, ValueError
        As for :func:`boomctl.spray_boom`; ranges not positive or not ascending.

    Examples
    --------
    >>> import boomctl as bc
    >>> family = bc.boom_family(subsystem="yaw")
    >>> for spring in (-1.0, 1.0):  # the lower and the upper end, springs 0.7 and 1.3 times as stiff
    ...     print(family.at([spring, 0.0]).eigenfrequencies_hz(1).round(3))
    [0.208]
    [0.275]
    """
    p = boom_parameters(parameters)

    def make(values: Mapping[str, float]) -> SecondOrderModel:
        scaled = scaled_boom(p, **values)
        return _part(spray_boom(scaled, discretization, elements, excitation, accelerometer_bandwidth_hz), subsystem)

    ranges = {
        "spring_factor": interval("spring_factor", spring_factor),
        "mass_factor": interval("mass_factor", mass_factor),
    }
    for name, (low, _) in ranges.items():
        positive(f"lower end of {name}", low)
    return AffineFamily.from_function(ranges, make)


@one_blas_thread
def yaw_family(
    parameters: BoomParameters | None = None,
    max_yaw_frequency_hz: float = 0.34,
    subsystem: str | None = None,
    elements: int = 6,
    discretization: str = "finite",
    excitation: str = "displacement",
    accelerometer_bandwidth_hz: float | None = None,
) -> AffineFamily:
    """Return the boom over a range of spring stiffness, chosen by the yaw frequency that it leads to.

    The range runs from the stiffness given to the one that brings the first yaw frequency to ``max_yaw_frequency_hz``.  By
    default that is 0.34 Hz, as measured by Anthonis & Ramon (2003), Table 1, where their model has 0.245 Hz.

    Parameters
    ----------
    parameters : BoomParameters, optional
        By default those of Anthonis & Ramon (2003), Table 2.
    max_yaw_frequency_hz : float
        First yaw frequency at the upper end of the range [Hz].
    subsystem : "jolt" or "yaw", optional
        One half of the symmetric boom; by default the whole boom.
    elements, discretization, excitation, accelerometer_bandwidth_hz
        As for :func:`boomctl.spray_boom`.

    Returns
    -------
    AffineFamily
        With one parameter, ``"spring_stiffness"`` [N/m].

    Raises
    ------
    TypeError, ValueError
        As for :func:`boomctl.spray_boom`; a frequency that no spring stiffness gives, or that a softer spring gives.

    Examples
    --------
    >>> import boomctl as bc
    >>> family = bc.boom.yaw_family(subsystem="yaw")
    >>> family.low.round(), family.high.round()  # N/m
    (array([1100.]), array([2375.]))
    >>> family.at([1.0]).eigenfrequencies_hz(1).round(3)
    array([0.34])
    """
    p = boom_parameters(parameters)
    stiffest = spring_for_yaw(p, max_yaw_frequency_hz, elements, discretization)
    return spring_family(
        p,
        stiffest,
        half=subsystem,
        elements=elements,
        discretization=discretization,
        excitation=excitation,
        accelerometer_bandwidth_hz=accelerometer_bandwidth_hz,
    )


def spring_family(
    p: BoomParameters, stiffest: float, *, half: str | None, elements: int, **options: Any
) -> AffineFamily:
    """Return the boom from its own spring stiffness to another one [N/m]; options as for :func:`boomctl.spray_boom`."""

    def make(values: Mapping[str, float]) -> SecondOrderModel:
        return _part(spray_boom(replace(p, **values), elements=elements, **options), half)

    return AffineFamily.from_function({"spring_stiffness": (p.spring_stiffness, stiffest)}, make)


def spring_for_yaw(
    parameters: BoomParameters, frequency_hz: float, elements: int = 6, discretization: str = "finite"
) -> float:
    """Return the spring stiffness [N/m] at which the first (damped) yaw frequency is ``frequency_hz``.

    Raises
    ------
    ValueError
        No stiffness up to ten thousand times the present one does it.
    """
    from scipy import optimize  # long to import, and boom_family does not come here

    parameters, wanted = boom_parameters(parameters), positive("frequency_hz", frequency_hz)

    def excess(factor: float) -> float:
        changed = scaled_boom(parameters, spring_factor=factor)
        yaw = split_symmetric(spray_boom(changed, discretization, elements))[1]
        return float(yaw.eigenfrequencies_hz(1)[0]) - wanted

    if excess(1.0 / _STIFFEST) > 0.0 or excess(_STIFFEST) < 0.0:
        raise ValueError(f"frequency_hz = {wanted:g}: no spring stiffness brings the first yaw frequency there")
    factor = float(optimize.brentq(excess, 1.0 / _STIFFEST, _STIFFEST, xtol=1e-12))  # type: ignore[arg-type]
    return factor * parameters.spring_stiffness
