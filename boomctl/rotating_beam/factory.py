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
    """Return the hub-beam in a model.

    Parameters
    ----------
    parameters : HubBeamParameters or None
        None: Table 1 of Bai et al. (2009) without tip mass.
    model : str
        "tlam", "sfoam" (as printed, Eq. 40), "sfoam-consistent" (with ``Q_theta``: it conserves energy and angular
        momentum), "foam", "cfoam" or "geometrically-exact".
    modes : int
        Number of transverse modes and, where the model has them, of axial ones.

    Returns
    -------
    AssumedModesBeam or GeometricallyExactBeam

    Raises
    ------
    TypeError
        If `parameters` or `modes` is of another kind.
    ValueError
        If the model is unknown, or `modes` less than 1 or too many.
    """
    return in_model(HubBeamParameters() if parameters is None else parameters, model, modes)
