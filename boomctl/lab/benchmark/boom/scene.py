"""The common ground of all lines of the boom's benchmark: parameters, frequencies, and the truth in fifty digits."""

from dataclasses import dataclass

import numpy as np

from boomctl.arrays import Array
from boomctl.boom.factory import spray_boom
from boomctl.boom.parameters import BoomParameters
from boomctl.lab.benchmark.boom.high_precision import damped_eigenvalues, exact_response, sigma_of
from boomctl.structure.model import SecondOrderModel
from boomctl.structure.response.poles import damped_poles


@dataclass(frozen=True)
class Settings:
    """How much a run does; the defaults are those of a run that is not full.

    Attributes
    ----------
    points, cluster : int
        Frequencies between 0.1 and 10 Hz, and around each of the first five resonances.
    peers : tuple of int
        Meshes on which python-control is timed.
    skipped : tuple of int
        Meshes on which it would be timed in a full run.
    rounds : int
        Rounds of the quick jobs; long ones get fewer.
    judged : int
        Every how many-th frequency meshes are solved in fifty digits.
    rounding, memory, orders, finite, discrete : tuple of int
        Meshes (orders) of the respective lines.
    processes : int
        New processes for each first call and command; 0: none.
    """

    points: int = 500
    cluster: int = 21
    peers: tuple[int, ...] = (6, 20, 50, 100)
    skipped: tuple[int, ...] = (500,)
    rounds: int = 15
    judged: int = 9
    rounding: tuple[int, ...] = (6, 20, 50, 100, 200, 500)
    memory: tuple[int, ...] = (1000, 2000, 5000, 10_000)
    orders: tuple[int, ...] = tuple(range(4, 17))
    finite: tuple[int, ...] = (6, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10_000)
    discrete: tuple[int, ...] = (6, 10, 20, 50, 100, 200, 400)
    processes: int = 7

    @classmethod
    def of(cls, full: bool) -> "Settings":
        """Return the settings of a full run, or of one that is not."""
        return cls(peers=(6, 20, 50, 100, 500), skipped=(), rounds=25, judged=1, processes=15) if full else cls()


@dataclass(frozen=True)
class Scene:
    """Parameters, frequencies [rad/s], and the exact singular values there, in fifty digits."""

    parameters: BoomParameters
    omega: Array
    exact: Array
    judged: Array

    def model(self, elements: int, discretization: str = "finite", order: int = 12) -> SecondOrderModel:
        """Return a new model, its halves and their bands made, in which no modes or responses are kept from before."""
        made = spray_boom(self.parameters, discretization=discretization, elements=elements, order=order)
        if made.mirror is not None:
            for half in (made.structure.symmetric_half, made.structure.antisymmetric_half):
                _ = half.structure.pencil
        return made

    def error(self, sigma: Array) -> float:
        """Return the largest relative error of any singular value at any frequency."""
        return float(np.abs(sigma / self.exact - 1.0).max())


def resonance_grid(eigenvalues: Array, points: int, cluster: int) -> Array:
    """Return frequencies from 0.1 to 10 Hz, and ``cluster`` over three half-power widths to either side of each peak.

    The half-power width of an eigenvalue ``-a + i b`` is ``2 a``; frequencies of 0.1 Hz and less are left out.
    """
    base = 2.0 * np.pi * np.geomspace(0.1, 10.0, points)
    width = 2.0 * np.abs(eigenvalues.real)
    around = np.abs(eigenvalues.imag)[:, None] + width[:, None] * np.linspace(-3.0, 3.0, cluster)
    return np.unique(np.concatenate([base, around[around > base[0]]]))


def scene(settings: Settings, parameters: BoomParameters | None = None) -> Scene:
    """Return the scene of a run: exact resonances, frequencies around them, exact singular values."""
    p = BoomParameters() if parameters is None else parameters
    eigenvalues = damped_eigenvalues(p, damped_poles(spray_boom(p, elements=20).structure, 5))
    omega = resonance_grid(eigenvalues, settings.points, settings.cluster)
    return Scene(p, omega, sigma_of(exact_response(p, omega)[:2, :2]), np.arange(0, len(omega), settings.judged))
