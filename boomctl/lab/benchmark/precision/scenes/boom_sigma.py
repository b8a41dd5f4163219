"""The boom's singular values at 500 frequencies, from parameters to numbers."""

from collections.abc import Callable, Iterator
from functools import partial
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
from boomctl.lab.benchmark.boom.high_precision import damped_eigenvalues, exact_response, sigma_of
from boomctl.lab.benchmark.boom.scene import resonance_grid
from boomctl.lab.benchmark.precision.scene import Extent, Scene, Setting
from boomctl.lab.benchmark.precision.scenes.peers import MESHES, missing, pymor_boom, sigma_of_response, there
from boomctl.lab.benchmark.precision.scenes.plain_boom import PlainBoom, boom_peer, varied
from boomctl.lti.python_control import control
from boomctl.structure.response.poles import damped_poles

_POINTS, _CLUSTER = 395, 21  # frequencies from 0.1 to 10 Hz, and around each of the first five resonances: 500 together
_JUDGED: dict[Extent, int] = {"quick": 7, "whole": 1}  # every how many-th frequency is judged
_SPANS = 4  # high-order elements: one between each two of tip, spring, hinge, spring, tip
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


def boom_sigma(extent: Extent) -> Scene:
    """Return the scene of the boom's singular values."""
    p = BoomParameters()
    eigenvalues = damped_eigenvalues(p, damped_poles(spray_boom(p, "high-order", 4).structure, 5))
    omega = resonance_grid(eigenvalues, _POINTS, _CLUSTER)
    judged = slice(None, None, _JUDGED[extent])
    exact = sigma_of(exact_response(p, omega[judged])[:2, :2])
    return Scene(
        key="boom-sigma",
        title=f"Singular values of the spray boom at {len(omega)} frequencies",
        question="From the boom's parameters to the singular values, actuators -> tips, at frequencies from 0.1 to 10 Hz and"
        " around the first five resonances.",
        measure="Largest relative error of any singular value"
        + (" at any frequency" if _JUDGED[extent] == 1 else f" at every {_JUDGED[extent]}th frequency")
        + ", against the exact beam in 50 digits.",
        settings=(*_ours(p, omega, extent), *_others(p, omega, extent)),
        error=lambda found: float(np.abs(np.asarray(found)[:, judged] / exact - 1.0).max()),
        missing=missing(pyMOR="pymor", slycot="slycot"),
        remarks=(
            "Other programs are given the same cubic finite elements by a plain NumPy code (`plain_boom.py`), which is timed"
            " with them in cold calls; python-control is given dense matrices, pyMOR sparse ones, SciPy bands.",
            "Cold: another spring in each call. Hot: parameters as before, the model and what it keeps by itself ready.",
            "scipy.signal.freqresp takes one input and one output: it is called four times.",
        ),
    )


def _ours(p: BoomParameters, omega: Array, extent: Extent) -> Iterator[Setting]:
    names = {"finite": "finite elements", "high-order": "high-order elements"}
    for kind, sizes in _OURS[extent].items():
        for size in sizes:
            chosen: dict[str, Any] = {"elements": _SPANS, "order": size} if kind == "high-order" else {"elements": size}
            made = partial(_boom, p, {"discretization": kind, **chosen})
            words = ", ".join(f"{name}={value}" for name, value in chosen.items())
            yield Setting(
                names.get(kind, f"{kind} elements"),
                f"order {size}" if kind == "high-order" else f"{size} elements",
                ours=True,
                cold=lambda change, made=made: sigma(made(change), omega).sigma,
                hot=lambda model: sigma(model, omega).sigma,
                prepare=partial(made, 0.0),
                call=f'bc.sigma(bc.spray_boom(p, "{kind}", {words}), omega)',
            )
    for accuracy in _WANTED[extent]:
        made = partial(_boom, p, {"accuracy": accuracy, "band_hz": _BAND_HZ})
        yield Setting(
            "chosen by accuracy=",
            f"accuracy={accuracy:g}",
            ours=True,
            cold=lambda change, made=made: sigma(made(change), omega).sigma,
            hot=lambda model: sigma(model, omega).sigma,
            prepare=partial(made, 0.0),
            call=f"bc.sigma(bc.spray_boom(p, accuracy={accuracy:g}, band_hz={_BAND_HZ:g}), omega)",
        )

    def exact(q: BoomParameters) -> Array:
        return sigma(exact_frequency_response(q, omega, ACTUATORS, TIPS)).sigma

    yield Setting(
        "exact beam",
        "exact",
        ours=True,
        cold=lambda change: exact(varied(p, change)),
        hot=exact,
        prepare=lambda: p,
        call="bc.sigma(bc.exact_frequency_response(p, omega, actuators, tips))",
    )


def _boom(p: BoomParameters, options: dict[str, Any], change: float) -> Any:
    return spray_boom(varied(p, change), **options)


def _others(p: BoomParameters, omega: Array, extent: Extent) -> Iterator[Setting]:
    def peer(name: str, elements: int, made: Callable[[PlainBoom], Any], asked: Callable[[Any], Array]) -> Setting:
        return boom_peer(p, name, f"{elements} elements", elements, made, asked)

    for elements in MESHES[extent]:
        yield peer("python-control", elements, _control_system, lambda system: _control_sigma(system, omega))
    if there("pymor"):
        for elements in MESHES[extent]:
            yield peer("pyMOR", elements, pymor_boom, lambda model: _pymor_sigma(model, omega))
    for elements in _BANDED[extent]:
        yield peer("SciPy, banded solves", elements, _bands, lambda bands: _banded_sigma(bands, omega))
    for elements in _SISO[extent]:
        yield peer("scipy.signal", elements, _channels, lambda channels: _channel_sigma(channels, omega))


def _control_system(boom: PlainBoom) -> Any:
    return control.ss(*boom.statespace())


def _control_sigma(system: Any, omega: Array) -> Array:
    return np.abs(np.asarray(control.singular_values_response(system, omega).frdata)[:, 0])


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
