"""Families of spray booms with uncertain stiffness of the springs and mass of the beam.

Both enter mass, damping and stiffness matrix linearly, so the boom is an exactly affine family over a box of them.  A single
factor scales ``boom_mass``, ``boom_inertia`` and ``density``, so the fractions of the tube in mass and inertia are constant
and never exceed those of the boom.  Tanks, hoses and nozzles distributed along the boom, and spray liquid in its pipes, are
such a change.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

from boomctl.boom.factory import spray_boom
from boomctl.boom.parameters import BoomParameters
from boomctl.checks import known, positive
from boomctl.parameters import or_default
from boomctl.structure.families import AffineFamily
from boomctl.structure.model import SecondOrderModel, split_symmetric
from boomctl.threads import one_blas_thread

_SUBSYSTEMS = ("jolt", "yaw")
_MAX_FACTOR = 1e4  # Limit of the search for a spring, on its stiffness and the inverse, relative to the present one.


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


def family_of(
    ranges: Mapping[str, tuple[float, float]],
    parameters: Callable[..., BoomParameters],
    subsystem: str | None,
    *options: Any,
) -> AffineFamily:
    """Return the boom over ranges of the arguments of ``parameters``.

    ``options`` are the arguments of :func:`boomctl.spray_boom` from `discretization` on.
    """

    def model(values: Mapping[str, float]) -> SecondOrderModel:
        boom = spray_boom(parameters(**values), *options)
        return boom if subsystem is None else split_symmetric(boom)[_SUBSYSTEMS.index(subsystem)]

    if subsystem is not None:
        known("subsystem", subsystem, _SUBSYSTEMS)
    return AffineFamily.from_function(ranges, model)


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
        Minimum and maximum factor on the spring stiffness, and on the mass of the beam; the parameters of the family
        are ``"spring_factor"`` and ``"mass_factor"``.
    subsystem : "jolt" or "yaw", optional
        Subsystem of the symmetric boom; by default the full boom.
    elements, discretization, excitation, accelerometer_bandwidth_hz
        As for :func:`boomctl.spray_boom`.

    Returns
    -------
    AffineFamily
        The boom at every point of the box, for :func:`boomctl.robust_stability`, :func:`boomctl.worst_case` and
        :func:`boomctl.tune`.

    Raises
    ------
    TypeError, ValueError
        As for :func:`boomctl.spray_boom`, or if a range is not positive or not ascending.

    Examples
    --------
    >>> import boomctl as bc
    >>> family = bc.boom_family(subsystem="yaw")
    >>> for spring in (-1.0, 1.0):  # the lower and the upper end, springs 0.7 and 1.3 times as stiff
    ...     print(family.at([spring, 0.0]).eigenfrequencies_hz(1).round(3))
    [0.208]
    [0.275]
    """
    p = or_default(BoomParameters, "parameters", parameters)
    ranges = {"spring_factor": spring_factor, "mass_factor": mass_factor}
    options = discretization, elements, excitation, accelerometer_bandwidth_hz
    return family_of(ranges, partial(scaled_boom, p), subsystem, *options)


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
    """Return the boom over a range of spring stiffness, which is specified by the first yaw frequency.

    The range is from the nominal stiffness to the one whose first yaw frequency is ``max_yaw_frequency_hz``.  By
    default that is 0.34 Hz, as measured by Anthonis & Ramon (2003), Table 1, where their model has 0.245 Hz.

    Parameters
    ----------
    parameters : BoomParameters, optional
        By default those of Anthonis & Ramon (2003), Table 2.
    max_yaw_frequency_hz : float
        First yaw frequency at the upper end of the range [Hz].
    subsystem : "jolt" or "yaw", optional
        Subsystem of the symmetric boom; by default the full boom.
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
    p = or_default(BoomParameters, "parameters", parameters)
    highest = positive("max_yaw_frequency_hz", max_yaw_frequency_hz)
    stiffest = spring_for_yaw(p, highest, elements, discretization)
    options = discretization, elements, excitation, accelerometer_bandwidth_hz
    return family_of({"spring_stiffness": (p.spring_stiffness, stiffest)}, p.replace, subsystem, *options)


def spring_for_yaw(
    parameters: BoomParameters, frequency_hz: float, elements: int = 6, discretization: str = "finite"
) -> float:
    """Return the spring stiffness [N/m] at which the first (damped) yaw frequency is ``frequency_hz``.

    Raises
    ------
    ValueError
        If no stiffness up to 1e4 times the present one yields it.
    """
    from scipy import optimize  # Slow to import, and not needed by `boom_family`.

    def excess(factor: float) -> float:
        changed = scaled_boom(parameters, spring_factor=factor)
        yaw = split_symmetric(spray_boom(changed, discretization, elements))[1]
        return float(yaw.eigenfrequencies_hz(1)[0]) - frequency_hz

    if excess(1.0 / _MAX_FACTOR) > 0.0 or excess(_MAX_FACTOR) < 0.0:
        raise ValueError(
            f"`max_yaw_frequency_hz` must be a first yaw frequency that some spring stiffness yields, got {frequency_hz:g}."
        )
    factor = float(optimize.brentq(excess, 1.0 / _MAX_FACTOR, _MAX_FACTOR, xtol=1e-12))  # type: ignore[arg-type]
    return factor * parameters.spring_stiffness
