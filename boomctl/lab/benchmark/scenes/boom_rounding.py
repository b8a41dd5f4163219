"""What rounding does to the boom's meshes: finite elements beside the same meshes in fifty digits."""

from functools import cache, partial

import numpy as np

from boomctl.analysis.sigma import sigma
from boomctl.arrays import Array
from boomctl.boom.factory import spray_boom
from boomctl.boom.parameters import BoomParameters
from boomctl.lab.benchmark.peers.plain_boom import varied
from boomctl.lab.benchmark.promise import Who, exact
from boomctl.lab.benchmark.references.high_precision import mesh_response, sigma_of
from boomctl.lab.benchmark.scene import Extent, Scene, Setting

# elements: from a coarse mesh to one whose rounding shows in six digits
_MESHES: dict[Extent, tuple[int, ...]] = {"quick": (6, 20), "whole": (6, 20, 50, 100, 200, 500)}
_POINTS: dict[Extent, int] = {
    "quick": 12,
    "whole": 60,
}  # frequencies: fifty digits take a millisecond an element and point


def boom_rounding(extent: Extent) -> Scene:
    """Return the scene of rounding in finite elements."""
    p, omega = BoomParameters(), 2 * np.pi * np.geomspace(0.1, 10.0, _POINTS[extent])
    true = cache(lambda elements: sigma_of(mesh_response(p, omega, elements)))

    def answer(elements: int, change: float) -> tuple[int, Array]:
        return elements, sigma(spray_boom(varied(p, change), elements=elements), omega).sigma

    def error(answer: tuple[int, Array]) -> float:
        return float(np.abs(answer[1] / true(answer[0]) - 1.0).max())

    return Scene(
        key="boom-rounding",
        title=f"Rounding in finite elements of the boom, {len(omega)} frequencies",
        question="From the boom's parameters to the singular values, actuators -> tips, from 0.1 to 10 Hz.",
        measure="Largest relative error of any singular value, against the same mesh in 50 digits.",
        settings=tuple(
            Setting("finite elements", f"{n} elements", ours=True, cold=partial(answer, n), size=n)
            for n in _MESHES[extent]
        ),
        error=error,
        promises=(exact(Who("finite elements"), 2e-5),),
        shows="promises",
    )
