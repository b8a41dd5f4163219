"""Public functions for scaled signals: plants divided by their scales, and controllers back in the units of the machine."""

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from boomctl.checks import mapping, positive
from boomctl.lti.system import Lti, controller_of, of, rescale, unscaled

if TYPE_CHECKING:
    import control

    from boomctl.lti.python_control import ScaledStateSpace
    from boomctl.structure.model import SecondOrderModel


def scale_signals(system: "control.StateSpace | SecondOrderModel", scales: Mapping[str, float]) -> "ScaledStateSpace":
    """Divide the signals of a system by their scales.

    A synthesis weights all signals alike only if they have similar magnitudes, see section 1.4 of Skogestad &
    Postlethwaite (2005). The states are unchanged.

    Parameters
    ----------
    system : control.StateSpace or SecondOrderModel
        System with labeled signals, not scaled yet.
    scales : mapping from str to float
        Scale of each input and output: the value that is scaled to one [unit of the signal], such as 0.05 for a
        stroke of 50 mm.

    Returns
    -------
    ScaledStateSpace
        The scaled system, which carries its scales.

    Raises
    ------
    TypeError
        If `system` is not a StateSpace or SecondOrderModel.
    ValueError
        If a scale is missing, is not positive or has the name of no signal, or if `system` is scaled already.

    Examples
    --------
    >>> import boomctl as bc
    >>> import control
    >>> spring = control.ss([[-1.0]], [[1.0]], [[0.001]], 0.0, inputs="force", outputs="position")  # 1 mm/N
    >>> scaled = bc.scale_signals(spring, {"force": 100.0, "position": 0.001})  # 100 N, 1 mm
    >>> float(abs(scaled.dcgain()).round(3))
    100.0
    """
    plain = of(system, any_time=True)
    if plain.scales:
        raise ValueError("`system` must not be scaled, got one with scales. Scale the system that it was made of.")
    scaled: Any = rescale(plain, _checked(scales, plain, "system")).statespace(getattr(system, "name", "plant"))
    return scaled


def unscale_controller(
    controller: "control.StateSpace", scales: Mapping[str, float] | None = None
) -> "control.StateSpace":
    """Convert a controller of a scaled plant to the units of the machine.

    The designs of boomctl need no conversion: their `.controller` is in the units of the machine.

    Parameters
    ----------
    controller : control.StateSpace
        Controller ``u = K y`` of the scaled plant.
    scales : mapping from str to float, optional
        Scale of each signal of the controller, as given to :func:`scale_signals`. If None, those that a
        `ScaledStateSpace` carries.

    Returns
    -------
    control.StateSpace
        The same controller in the units of the machine.

    Raises
    ------
    TypeError
        If `controller` is not a StateSpace.
    ValueError
        If `controller` is in the units of the machine, if `scales` differ from those it carries, or if a scale is
        missing, is not positive or has the name of no signal of the controller.

    Examples
    --------
    >>> import boomctl as bc
    >>> import control
    >>> gain = control.ss([], [], [], [[-2.0]], inputs="position", outputs="force")
    >>> bc.unscale_controller(gain, {"force": 100.0, "position": 0.001}).D.round(1)  # N/m
    array([[-200000.]])
    """
    K = controller_of(controller, any_time=True)
    if K.scales is not None and not K.scales:
        raise ValueError(
            "`controller` must be in scaled signals, got one in the units of the machine. Use it as it is."
        )
    if scales is not None:
        checked = _checked(scales, K, "controller")
        if K.scales and any(value != K.scales.get(label, 1.0) for label, value in checked.items()):
            raise ValueError(
                f"`scales` must be those of the controller, {dict(K.scales)}, got {checked}. Omit `scales`."
            )
        K = replace(K, scales=checked)
    if K.scales is None:
        raise ValueError("`scales` must be given for a controller that carries none, got None.")
    return unscaled(K).statespace(controller.name)


def _checked(scales: Mapping[str, float], system: Lti, what: str) -> dict[str, float]:
    """Return scales as floats, checked to be those of the signals of a system."""
    labels = (*system.input_labels, *system.output_labels)
    values = mapping("scales", scales, "signals to their scales")
    for name in (*labels, *values):
        if (name in labels) != (name in values):
            raise ValueError(
                f"`scales` must have an entry for each signal of `{what}`, {', '.join(labels)}, and no other, got"
                f" {'none' if name in labels else 'one'} for {name!r}."
            )
    return {name: positive(f"scales[{name!r}]", value) for name, value in values.items()}
