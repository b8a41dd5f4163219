"""Public constructors of tunable controller blocks, with argument checks."""

from collections.abc import Sequence

from boomctl.checks import instance, positive, real, sequence, signal_name, truth, whole
from boomctl.synthesis.plants.channels import listed_names
from boomctl.tunable.structures import (
    ControllerForm,
    Decentralized,
    Gain,
    Notch,
    Physical,
    Pid,
    Ppf,
    StateSpace,
)

_LARGEST_ORDER = 60  # largest order of a free state space: limits the number of free parameters
_MOST_MODES = 20  # largest number of terms of a positive position feedback


def gain() -> ControllerForm:
    """Return a matrix of gains, one from each measurement to each control.

    Returns
    -------
    ControllerForm
        For :func:`boomctl.tune`.

    Examples
    --------
    >>> import boomctl as bc
    >>> bc.tunable.gain()
    Gain()
    """
    return Gain()


def pid(
    integral: bool = True, derivative: bool = True, *, omega_min: float | None = None, omega_max: float | None = None
) -> ControllerForm:
    """Return proportional, integral and derivative gains, ``G_p + G_i/s + G_d s/(s/w + 1)``.

    Parameters
    ----------
    integral, derivative : bool
        If False, the part is omitted.
    omega_min, omega_max : float, optional
        Ends of the range of the derivative's corner ``w`` [rad/s]; by default a hundred times the plant's band.

    Returns
    -------
    ControllerForm
        For :func:`boomctl.tune`.

    Raises
    ------
    TypeError, ValueError
        If an argument has the wrong type, or the ends are not positive and ascending.

    Examples
    --------
    >>> import boomctl as bc
    >>> pd = bc.tunable.pid(integral=False, omega_max=200.0)
    >>> pd * bc.tunable.notch(10.0, 30.0)  # the notch reads the measurement
    Series(Pid, Notch)
    """
    return Pid(truth("integral", integral), truth("derivative", derivative), *_ends(omega_min, omega_max))


def notch(omega_min: float | None = None, omega_max: float | None = None) -> ControllerForm:
    """Return a notch on each of the signals that pass, ``(s^2 + 2 a w s + w^2)/(s^2 + 2 b w s + w^2)``.

    It has unit gain: connect it in series with a block that has a gain.

    Parameters
    ----------
    omega_min, omega_max : float, optional
        Ends of the range of its frequency ``w`` [rad/s]; by default a hundred times the plant's band.

    Returns
    -------
    ControllerForm
        For :func:`boomctl.tune`.

    Raises
    ------
    TypeError, ValueError
        Ends that are not positive and ascending.

    Examples
    --------
    >>> import boomctl as bc
    >>> bc.tunable.gain() * bc.tunable.notch(5.0, 50.0)
    Series(Gain, Notch)
    """
    return Notch(*_ends(omega_min, omega_max))


def ppf(modes: int = 1, omega_min: float | None = None, omega_max: float | None = None) -> ControllerForm:
    """Return positive position feedback, a sum of ``G w^2/(s^2 + 2 z w s + w^2)`` (Fanson & Caughey 1990).

    Gains may have either sign, as may the plant's gain.

    Parameters
    ----------
    modes : int
        Number of terms.
    omega_min, omega_max : float, optional
        Ends of the range of their frequencies ``w`` [rad/s]; by default a hundred times the plant's band.

    Returns
    -------
    ControllerForm
        For :func:`boomctl.tune`.

    Raises
    ------
    TypeError, ValueError
        If `modes` is out of range, or the ends are not positive and ascending.

    Examples
    --------
    >>> import boomctl as bc
    >>> bc.tunable.ppf(2, omega_max=100.0)
    Ppf(modes=2, high=100)
    """
    return Ppf(whole("modes", modes, 1, _MOST_MODES), *_ends(omega_min, omega_max))


def state_space(order: int, strictly_proper: bool = False) -> ControllerForm:
    """Return a state-space controller with all matrices free.

    Parameters
    ----------
    order : int
        Number of states; with 0 it is a matrix of gains.
    strictly_proper : bool
        If True, ``D = 0``.

    Returns
    -------
    ControllerForm
        For :func:`boomctl.tune`.

    Raises
    ------
    TypeError, ValueError
        If `order` is out of range, or 0 with `strictly_proper`.

    Examples
    --------
    >>> import boomctl as bc
    >>> bc.tunable.state_space(3, strictly_proper=True)
    StateSpace(order=3, strictly_proper=True)
    """
    result = StateSpace(whole("order", order, 0, _LARGEST_ORDER), truth("strictly_proper", strictly_proper))
    if result.order == 0 and result.strictly_proper:
        raise ValueError("order = 0: a strictly proper controller without states does nothing; expected 1 or more")
    return result if result.order else Gain()


def decentralized(
    *loops: "ControllerForm | tuple[str | Sequence[str], str | Sequence[str], ControllerForm]",
    shared_parameters: bool = False,
) -> ControllerForm:
    """Return a decentralized controller: several loops with separate signals.

    Parameters
    ----------
    *loops : ControllerForm, or tuples of measurements, controls and a structure
        A single structure connects the first measurement with the first control, the second ones, and so on.
    shared_parameters : bool
        If True, all loops have the same parameters; for a single structure.

    Returns
    -------
    ControllerForm
        For :func:`boomctl.tune`.

    Raises
    ------
    TypeError, ValueError
        If there are no loops, an argument has the wrong type, a loop contains a plant parameter, or
        `shared_parameters` is used with several structures.

    Examples
    --------
    >>> import boomctl as bc
    >>> bc.tunable.decentralized(("stroke_left", "suspension_left", bc.tunable.gain()))
    Decentralized(stroke_left -> suspension_left: Gain)
    >>> bc.tunable.decentralized(bc.tunable.ppf(), shared_parameters=True)
    Decentralized(each: Ppf, shared)
    """
    same = truth("shared_parameters", shared_parameters)
    if not loops:
        raise ValueError("loops: expected at least one")
    if len(loops) == 1 and isinstance(loops[0], ControllerForm):
        return Decentralized((), _inner(loops[0]), same)
    if same:
        raise ValueError("shared_parameters = True: expected one structure alone")
    result = []
    for loop in loops:
        if isinstance(loop, ControllerForm):
            raise ValueError(
                "loops: expected one structure alone, or measurements, controls and structure of each loop"
            )
        parts = sequence("loop", loop, "measurements, controls and a structure")
        if len(parts) != 3:
            raise ValueError(f"loop: expected measurements, controls and a structure, got {len(parts)} things")
        result.append((listed_names("measurement", parts[0]), listed_names("control", parts[1]), _inner(parts[2])))
    return Decentralized(tuple(result))


def plant_parameter(name: str, low: float, high: float) -> ControllerForm:
    """Return a parameter of the plant that is tuned with the controller, or without one.

    The plant's matrices must be smooth functions of the parameters, as for springs, dampers, masses and positions: they are
    approximated by polynomials of up to degree 128 by each parameter, through at most 2000 plants.  This requires parameters
    of a family, or a function whose plants have the same states everywhere, as from ``to_statespace(states="coordinates")``.
    Others, and wide ranges of several parameters that need more plants, raise an error.

    Parameters
    ----------
    name : str
        Name of the parameter in the family, or in the mapping passed to the plant function.
    low, high : float
        Bounds of the parameter, in its unit.

    Returns
    -------
    ControllerForm
        For :func:`boomctl.tune`, to be added to others.

    Raises
    ------
    TypeError, ValueError
        If `name` is not a name, or the bounds do not ascend.

    Examples
    --------
    >>> import boomctl as bc
    >>> bc.tunable.gain() + bc.tunable.plant_parameter("hinge_damping", 1.0, 3000.0)
    Sum(Gain, Physical hinge_damping 1 to 3000)
    """
    parameter, start, end = signal_name("parameter", name), real("low", low), real("high", high)
    if start >= end:
        raise ValueError(f"low, high = {start:g}, {end:g}: expected ascending ends of {parameter}")
    return Physical(parameter, start, end)


def _ends(low: object, high: object) -> tuple[float | None, float | None]:
    result = None if low is None else positive("omega_min", low), None if high is None else positive("omega_max", high)
    if result[0] is not None and result[1] is not None and result[0] >= result[1]:
        raise ValueError(f"omega_min, omega_max = {result[0]:g}, {result[1]:g}: expected ascending ends")
    return result


def _inner(form: object) -> ControllerForm:
    structure = instance("structure", form, ControllerForm, "a structure of boomctl.tunable")
    if structure.physicals():
        raise ValueError("decentralized: a loop cannot contain a plant parameter; add it")
    return structure
