"""Result of the selection of a hub-beam model by its accuracy in a maneuver."""

from dataclasses import dataclass
from typing import final

from boomctl.maneuvers import Maneuver
from boomctl.printing import compact, count


@final
@dataclass(frozen=True, repr=False)
class ModelChoice:
    """Model of the hub-beam selected by its accuracy in a maneuver, with the tested candidates.

    An error is the largest difference of the free end's transverse displacement from the displacement of the geometrically
    exact beam over the maneuver, relative to the largest displacement.

    Attributes
    ----------
    accuracy, time : float
        Requested accuracy, and the time until which it holds [s].
    maneuver : PrescribedMotion or TorqueDriven
        Maneuver in which it holds, from rest.
    model, modes : str, int
        Selected model and its number of modes.
    error : float
        Error of the selected model.
    rtol, atol : float
        Tolerance [relative, m] of the simulation that determined the error; the default of ``simulate`` in this maneuver.
    largest : float
        Largest displacement [m].
    reference : tuple of (int, int, float)
        Numbers of polynomials of the two geometrically exact beams that agree, and their difference relative to the largest
        displacement, including solver errors. ``error`` refers to the second beam, and is uncertain by the difference.
    tried : tuple of (str, int, float)
        Model, modes and error of each tested candidate, in order; the error is inf if the model's motion overflows.
    """

    accuracy: float
    time: float
    maneuver: Maneuver
    model: str
    modes: int
    error: float
    rtol: float
    atol: float
    largest: float
    reference: tuple[int, int, float]
    tried: tuple[tuple[str, int, float], ...]

    __repr__ = compact

    def __str__(self) -> str:
        result = f"{count(self.modes, 'mode')} of {self.model}: error {self.error:.1e} up to {self.time:.6g} s"
        best: dict[str, float] = {}
        for model, _, error in self.tried:
            if error > self.accuracy:
                best[model] = min(error, best.get(model, error))
        rejected = ", ".join(f"{model} {error:.1e}" for model, error in best.items() if model != self.model)
        return f"{result}, {self.accuracy:.3g} requested{f'; not with {rejected}' if rejected else ''}"
