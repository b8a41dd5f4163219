"""Noise entering a plant and its measurements, as intensities (two-sided spectral densities)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from boomctl.arrays import Array
from boomctl.checks import finite_array
from boomctl.synthesis.lq.quadratic import Weight, definite, semidefinite
from boomctl.synthesis.plants.named import NamedMatrices


@dataclass(frozen=True)
class Noise:
    """Intensities of the noise on ``x'``, ``W``, on the measurements, ``V``, between them, ``S``; inputs it enters by."""

    W: Array
    V: Array
    S: Array
    inputs: tuple[str, ...] = ()


def noise_of(
    plant: NamedMatrices,
    process_noise: Weight,
    measurement_noise: Weight,
    measurements: Sequence[str],
    disturbances: str | Sequence[str] | None,
) -> Noise:
    """Return the noise of a plant, checked.

    ``process_noise`` is over the inputs named in ``disturbances``; without these, a mapping is over the inputs that
    it names, and a number, vector or matrix over the states.
    """
    if isinstance(process_noise, Mapping) and disturbances is None:
        disturbances = plant.chosen_inputs("process_noise", tuple(process_noise))
    V = definite("measurement_noise", measurement_noise, measurements)
    if disturbances is None:
        array = finite_array("process_noise", process_noise)  # type: ignore[arg-type]
        W = semidefinite("process_noise", array, plant.states)
        return Noise(W, V, W[:, :0] @ V[:0])
    entering = plant.chosen_inputs("disturbances", disturbances)
    intensity = semidefinite("process_noise", process_noise, entering)
    way = plant.block(measurements, entering)
    B, D = way.B, way.D
    return Noise(_even(B @ intensity @ B.T), _even(V + D @ intensity @ D.T), B @ intensity @ D.T, entering)


def _even(matrix: Array) -> Array:
    return 0.5 * (matrix + matrix.T)
