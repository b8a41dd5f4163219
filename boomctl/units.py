"""SI units of signals: of motions, of forces, and of those of a symmetric machine's halves."""

from collections.abc import Mapping, Sequence

from boomctl.arrays import Array
from boomctl.checks import warn_user

HALVES = {"_sym": "the mean", "_anti": "half the difference"}
"""How the names of a half's signals end, and what these are root of two times (right and left, right less left)."""

_RATES = ("", "/s", "/s^2")
_SLOW, _FAST = 1e-4, 1e5  # Hz: no machine's lowest mode takes hours, or microseconds (a choice)
_STIFFER = 1e-2  # Hz: a soft spring in a machine has stiffer modes beside it, above this (a choice)


def motion_unit(turns: bool, derivative: int) -> str:
    """Return the unit of a place or turn, of its speed or its acceleration."""
    return f"{'rad' if turns else 'm'}{_RATES[derivative]}"


def is_half(name: str) -> bool:
    """Return whether a signal is named as one of a half: no sensor reads it, and no actuator takes it."""
    return name.endswith(tuple(HALVES))


def half_unit(unit: str, name: str) -> str:
    """Return the unit of a signal of a half in words: ``"m (orthonormal, root of two times the mean)"``."""
    of = next((words for ending, words in HALVES.items() if name.endswith(ending)), "")
    return f"{unit} (orthonormal, root of two times {of})" if of and unit else unit


def gain_unit(units: Mapping[str, str], inputs: Sequence[str], outputs: Sequence[str]) -> str:
    """Return the unit of a gain between signals, ``"m/N"``: of several, all that there are; ``""`` where one is unknown."""
    plain = {name: unit.partition(" (")[0] for name, unit in units.items()}  # without the words of a half
    sides = [dict.fromkeys(plain.get(name, "") for name in names) for names in (outputs, inputs)]
    if any("" in side for side in sides):
        return ""
    above, below = (" or ".join(side) for side in sides)
    return f"{above}/{below}" if above.isalnum() and below.isalnum() else f"{above} per {below}"


def warn_of_units(frequencies_hz: Array) -> None:
    """Warn of eigenfrequencies, ascending, that no machine has in SI units; lengths in mm and moduli in GPa give such."""
    elastic = frequencies_hz[frequencies_hz > 0.0]
    if len(elastic) and (elastic[0] > _FAST or (elastic[0] < _SLOW and elastic[-1] < _STIFFER)):
        warn_user(
            f"the lowest eigenfrequency is {elastic[0]:.3g} Hz; expected SI units: lengths in m, masses in kg, stiffness in"
            " N/m, Young's modulus in Pa, density in kg/m^3"
        )
