"""SI units of signals, also of the subsystems of a symmetric machine."""

from collections.abc import Mapping, Sequence

from boomctl.arrays import Array
from boomctl.checks import warn_user

HALVES = {"_sym": "the mean", "_anti": "half the difference"}
"""Suffixes of the signals of subsystems; the signal is root of two times the quantity named."""

_RATES = ("", "/s", "/s^2")
_LOWEST_HZ, _HIGHEST_HZ = 1e-4, 1e5  # Plausible lowest natural frequencies of a machine [Hz].
_ELASTIC_HZ = 1e-2  # A machine with a soft spring has further modes above this frequency [Hz].


def motion_unit(turns: bool, derivative: int) -> str:
    """Return the unit of a position or angle, its velocity or acceleration."""
    return f"{'rad' if turns else 'm'}{_RATES[derivative]}"


def is_half(name: str) -> bool:
    """Return True for the name of a subsystem's signal."""
    return name.endswith(tuple(HALVES))


def half_unit(unit: str, name: str) -> str:
    """Return the unit of a subsystem's signal: ``"m (sqrt(2) times the mean)"``."""
    of = next((words for ending, words in HALVES.items() if name.endswith(ending)), "")
    return f"{unit} (sqrt(2) times {of})" if of and unit else unit


def gain_unit(units: Mapping[str, str], inputs: Sequence[str], outputs: Sequence[str]) -> str:
    """Return the unit of a gain, such as ``"m/N"``; ``""`` if a unit is unknown."""
    plain = {name: unit.partition(" (")[0] for name, unit in units.items()}  # without the words of a half
    sides = [dict.fromkeys(plain.get(name, "") for name in names) for names in (outputs, inputs)]
    if any("" in side for side in sides):
        return ""
    above, below = (" or ".join(side) for side in sides)
    return f"{above}/{below}" if above.isalnum() and below.isalnum() else f"{above} per {below}"


def warn_of_units(frequencies_hz: Array) -> None:
    """Warn of implausible natural frequencies (ascending), as from lengths in mm or moduli in GPa."""
    elastic = frequencies_hz[frequencies_hz > 0.0]
    if len(elastic) and (elastic[0] > _HIGHEST_HZ or (elastic[0] < _LOWEST_HZ and elastic[-1] < _ELASTIC_HZ)):
        warn_user(
            f"the lowest eigenfrequency is {elastic[0]:.3g} Hz; expected SI units: lengths in m, masses in kg, stiffness in"
            " N/m, Young's modulus in Pa, density in kg/m^3"
        )
