"""What was chosen of the models of the hub-beam for its accuracy in a maneuver, and what was tried."""

from dataclasses import dataclass
from typing import final

from boomctl.maneuvers import Maneuver
from boomctl.printing import compact, count


@final
@dataclass(frozen=True, repr=False)
class ModelChoice:
    """A model of the hub-beam that was chosen for its accuracy in a maneuver, and what was tried.

    Errors are those of the free end's transverse displacement, the largest over the maneuver, relative to the largest
    displacement in it; against the geometrically exact beam.

    Attributes
    ----------
    accuracy, time : float
        What was asked for, and until when it holds [s].
    maneuver : PrescribedMotion or TorqueDriven
        In which it holds, from rest.
    model, modes : str, int
        What was chosen.
    error : float
        The error that was found.
    rtol, atol : float
        Tolerance of a simulation [relative, m] with which it was found; ``simulate`` takes it in this maneuver.
    largest : float
        The largest displacement [m].
    reference : tuple of (int, int, float)
        Polynomials of the two geometrically exact beams that agree, and by how much, relative to the largest displacement,
        their solvers' errors included; ``error`` is measured against the second one, and may be wrong by that.
    tried : tuple of (str, int, float)
        Model, modes and error of each that was tried, in turn; the error is inf where the model does not last so long.
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
        missed = ", ".join(f"{model} {error:.1e}" for model, error in best.items() if model != self.model)
        return f"{result}, {self.accuracy:.3g} asked for{f'; not with {missed}' if missed else ''}"
