"""The factory of hub-beams in all models."""

from typing import Literal, overload

from boomctl.rotating_beam.assumed_modes import AssumedModesBeam
from boomctl.rotating_beam.beam import HubBeam, in_model
from boomctl.rotating_beam.exact.beam import GeometricallyExactBeam
from boomctl.rotating_beam.parameters import HubBeamParameters


@overload
def hub_beam(
    parameters: HubBeamParameters | None = None,
    model: Literal["tlam", "sfoam", "sfoam-consistent", "foam", "cfoam"] = "sfoam",
    modes: int = 5,
) -> AssumedModesBeam: ...


@overload
def hub_beam(
    parameters: HubBeamParameters | None, model: Literal["geometrically-exact"], modes: int = 5
) -> GeometricallyExactBeam: ...


@overload
def hub_beam(
    parameters: HubBeamParameters | None = None, *, model: Literal["geometrically-exact"], modes: int = 5
) -> GeometricallyExactBeam: ...


@overload
def hub_beam(parameters: HubBeamParameters | None = None, model: str = "sfoam", modes: int = 5) -> HubBeam: ...


def hub_beam(parameters: HubBeamParameters | None = None, model: str = "sfoam", modes: int = 5) -> HubBeam:
    """Return a flexible beam on a rotating hub, in one of several models.

    Parameters
    ----------
    parameters : HubBeamParameters or None
        The machine; None: Table 1 of Bai et al. (2009) without tip mass.
    model : str
        "foam": terms of the kinetic energy up to second order, axial modes included.  "sfoam": FOAM without axial
        modes, as printed, Eq. (40); "sfoam-consistent": with ``Q_theta``, so that it conserves energy and angular
        momentum.  "tlam": linear, without dynamic stiffening.  "cfoam": all terms of the kinetic energy.
        "geometrically-exact": a beam of finite rotation, against which the others can be judged.
    modes : int
        Number of transverse modes and, where the model has them, of axial ones.

    Returns
    -------
    AssumedModesBeam or GeometricallyExactBeam
        What is simulated, linearised, or slewed: see `HubBeam`.

    Raises
    ------
    TypeError
        If `parameters` or `modes` is of another kind.
    ValueError
        If the model is unknown, or `modes` less than 1 or too many.

    Examples
    --------
    >>> import boomctl as bc
    >>> beam = bc.hub_beam(bc.HubBeamParameters(tip_mass=1.0), "sfoam", modes=3)
    >>> beam.frequencies_hz().round(3)  # at rest
    array([0.247, 2.207, 6.916])
    >>> beam.frequencies_hz(hub_speed=4.0).round(3)  # stiffer, as it turns
    array([0.385, 3.146, 8.112])
    """
    return in_model(HubBeamParameters() if parameters is None else parameters, model, modes)
