"""The boom's singular values, from parameters to numbers: at 500 frequencies, and what rounding does to them."""

from collections.abc import Callable, Iterator
from functools import cache, partial
from typing import Any

import numpy as np
from scipy import signal
from scipy.linalg import solve_banded

from boomctl.analysis.sigma import sigma
from boomctl.arrays import Array
from boomctl.boom.exact import exact_frequency_response
from boomctl.boom.factory import spray_boom
from boomctl.boom.model import ACTUATORS, TIPS
from boomctl.boom.parameters import BoomParameters
from boomctl.lab.benchmark.peers.boom import (
    MESHES,
    boom_peer,
    control_boom,
    control_sigma,
    our_boom,
    our_mesh,
    pymor_boom,
    sigma_of_response,
    varied,
)
from boomctl.lab.benchmark.peers.plain_boom import PlainBoom
from boomctl.lab.benchmark.promise import Who, exact, no_less_exact, times_as_fast
from boomctl.lab.benchmark.references.high_precision import damped_eigenvalues, exact_response, mesh_response, sigma_of
from boomctl.lab.benchmark.scene import Extent, Scene, Setting, asked, missing, there
from boomctl.structure.response.poles import damped_poles

_POINTS, _CLUSTER = 500, 21  # frequencies from 0.1 to 10 Hz, and around each of the first five resonances: 602 together
_JUDGED: dict[Extent, int] = {"quick": 7, "whole": 1}  # every how many-th frequency is judged
_WIDTH = 3  # rows above and below the diagonal of a plain boom's matrices

_OURS: dict[Extent, dict[str, tuple[int, ...]]] = {
    "quick": {
        "finite": (6, 20, 100),
        "high-order": (4, 8, 12),
        "discrete-hermite": (20,),
        "discrete-geometric": (20,),
    },
    "whole": {
        "finite": (4, 6, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10_000),
        "high-order": (4, 5, 6, 7, 8, 9, 10, 11, 12, 14, 16),
        "discrete-hermite": (4, 6, 10, 20, 50, 100, 200, 400),
        "discrete-geometric": (4, 6, 10, 20, 50, 100, 200, 400),
    },
}
# accuracies asked for by `accuracy=`, and elements where a band alone is asked for (choices)
_WANTED: dict[Extent, tuple[float, ...]] = {"quick": (1e-3,), "whole": (1e-2, 1e-3, 1e-6)}
_BANDED: dict[Extent, tuple[int, ...]] = {"quick": (6, 20), "whole": (6, 10, 20, 50, 100, 200, 500, 1000)}
_SISO: dict[Extent, tuple[int, ...]] = {"quick": (6,), "whole": (4, 6, 10, 20)}
_BAND_HZ = 10.0  # the frequencies asked for end there
# where rounding is told: from a coarse mesh to one whose rounding shows in six digits, and at how many frequencies, each of
# which takes fifty digits a millisecond an element
_ROUNDED: dict[Extent, tuple[int, ...]] = {"quick": (6, 20), "whole": (6, 20, 50, 100, 200, 500)}
_ROUNDED_AT: dict[Extent, int] = {"quick": 12, "whole": 60}


_AS_EXACT = 1.0 + 1e-3  # times another's error that ours may have: both are that of the same mesh (a choice)

# numbers of elements at which something is promised
_CONTROL_6, _CONTROL_20, _CONTROL_100 = (Who("python-control", f"{n} elements") for n in (6, 20, 100))
_FINITE_6, _FINITE_20, _FINITE_100 = (Who("finite elements", f"{n} elements") for n in (6, 20, 100))
_PROMISES = (
    times_as_fast(Who("exact beam"), _CONTROL_6, 4.0),
    times_as_fast(Who("exact beam"), _CONTROL_100, 150.0),
    times_as_fast(Who("exact beam"), _CONTROL_6, 3.0, "cold"),
    exact(Who("exact beam"), 1e-9),
    times_as_fast(_FINITE_100, _CONTROL_100, 40.0),
    times_as_fast(_FINITE_6, _CONTROL_6, 3.0, "cold"),
    times_as_fast(_FINITE_20, _CONTROL_20, 7.0, "cold"),
    times_as_fast(_FINITE_100, _CONTROL_100, 40.0, "cold"),
    no_less_exact(_FINITE_100, _CONTROL_100, _AS_EXACT),
    exact(Who("finite elements", "500 elements"), 1e-4),
    exact(Who("high-order elements", "order 12"), 1e-9),  # 46 unknowns
)


def resonance_grid(eigenvalues: Array, points: int, cluster: int) -> Array:
    """Return frequencies from 0.1 to 10 Hz, and ``cluster`` over three half-power widths to either side of each peak.

    The half-power width of an eigenvalue ``-a + i b`` is ``2 a``; frequencies of 0.1 Hz and less are left out.
    """
    base = 2.0 * np.pi * np.geomspace(0.1, 10.0, points)
    width = 2.0 * np.abs(eigenvalues.real)
    around = np.abs(eigenvalues.imag)[:, None] + width[:, None] * np.linspace(-3.0, 3.0, cluster)
    return np.unique(np.concatenate([base, around[around > base[0]]]))


def boom_sigma(extent: Extent) -> Scene:
    """Return the scene of the boom's singular values."""
    p = BoomParameters()
    eigenvalues = damped_eigenvalues(p, damped_poles(spray_boom(p, "high-order", 4).structure, 5))
    omega = resonance_grid(eigenvalues, _POINTS, _CLUSTER)
    judged = slice(None, None, _JUDGED[extent])
    true = cache(lambda: sigma_of(exact_response(p, omega[judged])[:2, :2]))
    return Scene(
        key="boom-sigma",
        title=f"Singular values of the spray boom at {len(omega)} frequencies",
        question="From the boom's parameters to the singular values, actuators -> tips, at frequencies from 0.1 to 10 Hz and"
        " around the first five resonances.",
        measure="Largest relative error of any singular value"
        + (" at any frequency" if _JUDGED[extent] == 1 else f" at every {_JUDGED[extent]}th frequency")
        + ", against the exact beam in 50 digits.",
        settings=(*_ours(p, omega, extent), *_others(p, omega, extent)),
        error=lambda found: float(np.abs(np.asarray(found)[:, judged] / true() - 1.0).max()),
        missing=missing(pyMOR="pymor", slycot="slycot"),
        remarks=(
            "Other programs are given the same cubic finite elements by a plain NumPy code (`plain_boom.py`), which is timed"
            " with them in cold calls; python-control is given dense matrices, pyMOR sparse ones, SciPy bands.",
            "Cold: another spring in each call. Hot: parameters as before, the model and what it keeps by itself ready.",
            "scipy.signal.freqresp takes one input and one output: it is called four times.",
        ),
        promises=_PROMISES,
    )


def boom_rounding(extent: Extent) -> Scene:
    """Return the scene of rounding in finite elements."""
    p, omega = BoomParameters(), 2 * np.pi * np.geomspace(0.1, 10.0, _ROUNDED_AT[extent])
    true = cache(lambda elements: sigma_of(mesh_response(p, omega, elements)))

    def answer(elements: int, change: float) -> tuple[int, Array]:
        return elements, sigma(our_boom(p, change, elements=elements), omega).sigma

    return Scene(
        key="boom-rounding",
        title=f"Rounding in finite elements of the boom, {len(omega)} frequencies",
        question="From the boom's parameters to the singular values, actuators -> tips, from 0.1 to 10 Hz.",
        measure="Largest relative error of any singular value, against the same mesh in 50 digits.",
        settings=tuple(
            Setting("finite elements", f"{n} elements", ours=True, cold=partial(answer, n), size=n)
            for n in _ROUNDED[extent]
        ),
        error=lambda answer: float(np.abs(answer[1] / true(answer[0]) - 1.0).max()),
        promises=(exact(Who("finite elements"), 2e-5),),
        shows="promises",
    )


def _ours(p: BoomParameters, omega: Array, extent: Extent) -> Iterator[Setting]:
    def ask(model: Any) -> Array:
        return sigma(model, omega).sigma

    for kind, sizes in _OURS[extent].items():
        for size in sizes:
            label = "{} {}" if kind == "high-order" else f"{size} elements"
            yield our_mesh(p, kind, size, ask, "bc.sigma({}, omega)", label)
    for accuracy in _WANTED[extent]:
        made = partial(our_boom, p, accuracy=accuracy, band_hz=_BAND_HZ)
        call = f"bc.sigma(bc.spray_boom(p, accuracy={accuracy:g}, band_hz={_BAND_HZ:g}), omega)"
        yield asked("chosen by accuracy=", f"accuracy={accuracy:g}", made, ask, ours=True, call=call)
    yield asked(
        "exact beam",
        "exact",
        partial(varied, p),
        lambda q: sigma(exact_frequency_response(q, omega, ACTUATORS, TIPS)).sigma,
        ours=True,
        call="bc.sigma(bc.exact_frequency_response(p, omega, actuators, tips))",
    )


def _others(p: BoomParameters, omega: Array, extent: Extent) -> Iterator[Setting]:
    peers: list[tuple[str, tuple[int, ...], Callable[[PlainBoom], Any], Callable[[Any, Array], Array]]] = [
        ("python-control", MESHES[extent], control_boom, control_sigma),
        ("pyMOR", MESHES[extent] if there("pymor") else (), pymor_boom, _pymor_sigma),
        ("SciPy, banded solves", _BANDED[extent], _bands, _banded_sigma),
        ("scipy.signal", _SISO[extent], _channels, _channel_sigma),
    ]
    for name, sizes, made, ask in peers:
        for n in sizes:
            yield boom_peer(p, name, f"{n} elements", n, made, lambda model, ask=ask: ask(model, omega))


def _pymor_sigma(model: Any, omega: Array) -> Array:
    return sigma_of_response(model.transfer_function.freq_resp(omega))


def _bands(boom: PlainBoom) -> tuple[Array, ...]:
    """Return the bands of ``M``, ``C``, ``K`` as LAPACK keeps them, loads and rates."""
    found = []
    for matrix in (boom.M, boom.C, boom.K):
        band = np.zeros((2 * _WIDTH + 1, matrix.shape[0]))
        for k in range(-_WIDTH, _WIDTH + 1):
            diagonal = matrix.diagonal(k)
            band[_WIDTH - k, max(k, 0) : max(k, 0) + len(diagonal)] = diagonal
        found.append(band)
    return (*found, boom.F, boom.G)


def _banded_sigma(bands: tuple[Array, ...], omega: Array) -> Array:
    M, C, K, F, G = bands
    found = np.empty((len(omega), 2, 2), complex)
    for k, w in enumerate(omega):
        q = solve_banded((_WIDTH, _WIDTH), K + 1j * w * C - w * w * M, F + 1j * w * G, check_finite=False)
        found[k] = q[[0, -2]]
    return sigma_of_response(found)


def _channels(boom: PlainBoom) -> list[Any]:
    A, B, C, D = boom.statespace()
    return [
        signal.StateSpace(A, B[:, j : j + 1], C[i : i + 1], D[i : i + 1, j : j + 1]) for i in range(2) for j in range(2)
    ]


def _channel_sigma(channels: list[Any], omega: Array) -> Array:
    values = np.stack([signal.freqresp(channel, omega)[1] for channel in channels], axis=-1)
    return sigma_of_response(values.reshape(len(omega), 2, 2))
