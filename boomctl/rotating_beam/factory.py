"""The factory of hub-beams in all models."""

from __future__ import annotations

from typing import Literal, Unpack, overload

from numpy.typing import ArrayLike

from boomctl.checks import shown
from boomctl.maneuvers import Maneuver
from boomctl.parameters import or_default, signature_of
from boomctl.rotating_beam.assumed_modes import AssumedModesBeam
from boomctl.rotating_beam.beam import HubBeam, in_model
from boomctl.rotating_beam.exact.beam import GeometricallyExactBeam
from boomctl.rotating_beam.parameters import HubBeamChanges, HubBeamParameters


@overload
def hub_beam(
    parameters: HubBeamParameters | None = None,
    model: Literal["tlam", "sfoam", "sfoam-consistent", "foam", "cfoam"] | None = None,
    modes: int | None = None,
    **changes: Unpack[HubBeamChanges],
) -> AssumedModesBeam: ...


@overload
def hub_beam(
    parameters: HubBeamParameters | None,
    model: Literal["geometrically-exact"],
    modes: int | None = None,
    **changes: Unpack[HubBeamChanges],
) -> GeometricallyExactBeam: ...


@overload
def hub_beam(
    parameters: HubBeamParameters | None = None,
    *,
    model: Literal["geometrically-exact"],
    modes: int | None = None,
    **changes: Unpack[HubBeamChanges],
) -> GeometricallyExactBeam: ...


@overload
def hub_beam(
    parameters: HubBeamParameters | None = None,
    model: str | None = None,
    modes: int | None = None,
    **changes: Unpack[HubBeamChanges],
) -> HubBeam: ...


@overload
def hub_beam(
    parameters: HubBeamParameters | None = None,
    *,
    accuracy: float,
    maneuver: Maneuver,
    timepts: float | ArrayLike | None = None,
    **changes: Unpack[HubBeamChanges],
) -> HubBeam: ...


def hub_beam(
    parameters: HubBeamParameters | None = None,
    model: str | None = None,
    modes: int | None = None,
    accuracy: float | None = None,
    maneuver: Maneuver | None = None,
    timepts: float | ArrayLike | None = None,
    **changes: Unpack[HubBeamChanges],
) -> HubBeam:
    """Return a flexible beam on a rotating hub, in one of several models.

    Parameters
    ----------
    parameters : HubBeamParameters or None
        Parameters of beam and hub. If None, Table 1 of Bai et al. (2009) without tip mass.
    model : str
        "foam": terms of the kinetic energy up to second order, axial modes included.  "sfoam": FOAM without axial
        modes, as printed, Eq. (40); "sfoam-consistent": with ``Q_theta``, so that it conserves energy and angular
        momentum.  "tlam": linear, without dynamic stiffening.  "cfoam": all terms of the kinetic energy.
        "geometrically-exact": a beam of finite rotation, the reference for the other models.
        By default "sfoam".
    modes : int
        Number of transverse modes, and of axial modes if the model has them; for a geometrically exact beam, number
        of polynomials. By default 5.
    accuracy : float, optional
        Instead of `model` and `modes`: the first of "sfoam" with 1, 2, 3, 5, 8 modes and "geometrically-exact" with
        3, 4, 6, 8, 12 polynomials is chosen whose transverse tip displacement in `maneuver`, from rest, agrees with
        that of a converged geometrically exact beam. The maximum error over the motion, solver error included, is at
        most `accuracy` times the maximum displacement. The residual vibration after the maneuver may be far smaller,
        and its relative error larger. The beam's `selection` lists the tested candidates; ``simulate`` has this
        accuracy in this maneuver by default.
    maneuver : PrescribedMotion or TorqueDriven, optional
        As for ``simulate``; required with `accuracy`.
    timepts : float or array_like, optional
        Time until which the accuracy holds [s]; the last one of an array. By default five periods of the slowest mode after
        the last breakpoint of the maneuver.
    **changes : float
        Parameters of the machine by name, which replace values of `parameters`.

    Returns
    -------
    AssumedModesBeam or GeometricallyExactBeam
        Model for simulation, linearization and slews: see `HubBeam`.

    Raises
    ------
    TypeError
        If `parameters`, `modes` or another argument has the wrong type, or a parameter is unknown.
    ValueError
        If the model is unknown, `modes` is less than 1 or too large, or `accuracy` is given with a model, given without a
        maneuver, or cannot be reached or verified.

    Examples
    --------
    >>> import boomctl as bc
    >>> beam = bc.hub_beam(model="sfoam", modes=3, tip_mass=1.0)
    >>> beam.eigenfrequencies_hz().round(3)  # at rest
    array([0.247, 2.207, 6.916])
    >>> beam.eigenfrequencies_hz(hub_speed=4.0).round(3)  # stiffer, as it turns
    array([0.385, 3.146, 8.112])
    >>> spin = bc.spin_up(final_speed=2.8, duration=30.0)
    >>> print(bc.hub_beam(accuracy=1e-3, maneuver=spin).selection)
    3 modes of sfoam: error 3.3e-04 up to 40.7898 s, 0.001 requested
    """
    p = or_default(HubBeamParameters, "parameters", parameters, changes, signature_of(hub_beam))
    if accuracy is None and maneuver is None and timepts is None:
        return in_model(p, "sfoam" if model is None else model, 5 if modes is None else modes)
    for name, value in (("model", model), ("modes", modes)):
        if value is not None:
            raise ValueError(f"{name} = {shown(value)}: expected None with accuracy and maneuver, which select it")
    from boomctl.rotating_beam.accuracy import chosen_beam  # imports the geometrically exact beam

    return chosen_beam(p, accuracy, maneuver, timepts)
