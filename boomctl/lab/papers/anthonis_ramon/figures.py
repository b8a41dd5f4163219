"""Anthonis & Ramon (2003) computed again: Table 1, Fig. 3, convergence, mode shapes, and the boom in motion."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from boomctl.analysis.sigma import SigmaResult, sigma
from boomctl.arrays import Array
from boomctl.boom.exact import exact_eigenfrequencies_hz, exact_frequency_response
from boomctl.boom.factory import spray_boom
from boomctl.boom.model import ACTUATORS, TIPS, boom_assembly
from boomctl.boom.parameters import BoomParameters
from boomctl.boom.published import COMPUTED_HZ, MEASURED_HZ
from boomctl.structure.beams.elements import DiscreteElements
from boomctl.structure.displacement_input import prescribe_displacement
from boomctl.structure.model import SecondOrderModel
from boomctl.structure.response.poles import damped_poles, undamped_modes

NAMES = {
    "finite": "finite elements",
    "discrete-hermite": "discrete elements, Hermitian mass",
    "discrete-geometric": "discrete elements, geometrical mass",
}
"""What the paper calls the discretisations."""

_MODES = 5  # eigenfrequencies that the paper lists
_FINITE = (4, 5, 6, 7, 8, 10, 12, 14, 16, 20, 24, 28, 32, 40, 48, 64, 80, 100, 128, 160, 200, 256, 320, 400)
_ATTACHED = (4, 6, 8, 10, 12, 16, 20, 24, 32, 40, 48, 64, 80, 100, 128, 160, 200, 256, 320, 400)
"""Numbers of elements over which errors are shown: any, and even ones, as a node at the hinge and at springs asks for."""
_ORDERS = tuple(range(3, 15))  # polynomial orders over which errors are shown: until rounding ends their fall
_SHAPE_ELEMENTS = 48  # of the boom whose shapes are drawn: smooth to the eye


@dataclass(frozen=True)
class Method:
    """A column of Table 1: what was published, what is computed here [Hz], and the difference in per cent."""

    name: str
    published_hz: Array
    computed_hz: Array

    @property
    def difference_percent(self) -> Array:
        """Computed less published, in per cent of published."""
        return 100.0 * (self.computed_hz / self.published_hz - 1.0)


@dataclass(frozen=True)
class Reading:
    """One way to read "geometrical mass allocation, 20 elements", and the frequencies that it gives [Hz]."""

    mass: str
    inner: int
    computed_hz: Array


@dataclass(frozen=True)
class Convergence:
    """Relative errors of the first five damped eigenfrequencies, (sizes, 5), over the size of the mesh."""

    name: str
    sizes: Array
    unknowns: Array
    error: Array
    of: str


@dataclass(frozen=True)
class ModeShape:
    """A mode with the platform held: its frequency, its damping ratio, and the boom's deflection over ``x``."""

    title: str
    freq_hz: float
    x: Array
    boom: Array
    damping_ratio: float


@dataclass(frozen=True)
class BoomReproduction:
    """Everything of the paper that is computed again.

    ``deviation`` is the largest one, relative, of both singular values from the exact ones, over the exact curve's
    frequencies.
    """

    measured_hz: Array
    exact_hz: Array
    exact_undamped_hz: Array
    methods: tuple[Method, ...]
    readings: tuple[Reading, ...]
    sigma: dict[str, SigmaResult]
    deviation: dict[str, Array]
    convergence: tuple[Convergence, ...]
    modes: tuple[ModeShape, ...]


def compute(parameters: BoomParameters | None = None) -> BoomReproduction:
    """Compute the paper's results from Table 2, or from other parameters.

    Parameters
    ----------
    parameters : BoomParameters, optional
    """
    p = BoomParameters() if parameters is None else parameters
    exact = exact_eigenfrequencies_hz(p, _MODES)
    curves, deviation = _curves(p)
    return BoomReproduction(
        measured_hz=np.array(MEASURED_HZ),
        exact_hz=exact,
        exact_undamped_hz=exact_eigenfrequencies_hz(p, _MODES, damped=False),
        methods=tuple(_method(p, *mesh, values) for mesh, values in COMPUTED_HZ.items()),
        readings=tuple(_reading(p, mass, inner) for mass in ("lumped", "linear") for inner in (2, 4, 6, 8)),
        sigma=curves,
        deviation=deviation,
        convergence=_convergence(p, exact),
        modes=_mode_shapes(p),
    )


def _method(p: BoomParameters, discretization: str, elements: int, published: tuple[float, ...]) -> Method:
    computed = spray_boom(p, discretization, elements).eigenfrequencies_hz(_MODES)
    return Method(f"{NAMES[discretization]}, {elements}", np.array(published), computed)


def _reading(p: BoomParameters, mass: str, inner: int) -> Reading:
    """Return the frequencies of 20 discrete elements, ``inner`` of them between the springs."""
    half, spring = p.length / 2, p.spring_distance / 2
    outer = np.linspace(-half, -spring, (20 - inner) // 2 + 1)
    x = np.concatenate([outer[:-1], np.linspace(-spring, spring, inner + 1), -outer[-2::-1]])
    force_driven = boom_assembly(p, DiscreteElements(tuple(x + half), mass)).assemble()
    return Reading(mass, inner, prescribe_displacement(force_driven, ACTUATORS).eigenfrequencies_hz(_MODES))


def _curves(p: BoomParameters) -> tuple[dict[str, SigmaResult], dict[str, Array]]:
    """Return the curves of Fig. 3 on grids that resolve the peaks of each, and how far two of them lie from the exact one."""
    models = {
        "finite elements, 6": spray_boom(p, "finite", 6),
        "discrete elements, geometrical mass, 20": spray_boom(p, "discrete-geometric", 20),
    }
    fine = sigma(spray_boom(p, "high-order", 4))
    exact = sigma(exact_frequency_response(p, fine.omega, ACTUATORS, TIPS))
    ratios = {name: sigma(model, exact.omega).sigma / exact.sigma - 1.0 for name, model in models.items()}
    deviation = {name: np.abs(ratio).max(axis=0) for name, ratio in ratios.items()}
    return {name: sigma(model) for name, model in models.items()} | {"exact beam": exact}, deviation


def _convergence(p: BoomParameters, exact: Array) -> tuple[Convergence, ...]:
    def errors(
        name: str, models: Iterable[SecondOrderModel], sizes: Sequence[int], of: str = "elements"
    ) -> Convergence:
        found = [(model.n, np.abs(model.eigenfrequencies_hz(_MODES) / exact - 1.0)) for model in models]
        unknowns, error = map(np.array, zip(*found, strict=True))
        return Convergence(name, np.array(sizes), unknowns, error, of)

    def meshes(discretization: str, counts: Sequence[int]) -> Iterable[SecondOrderModel]:
        return (spray_boom(p, discretization, n) for n in counts)

    attached = (spray_boom(p, "finite", _attached(p, n)) for n in _ATTACHED)
    orders = (spray_boom(p, "high-order", 4, order=k) for k in _ORDERS)
    return (
        errors("finite elements, equal", meshes("finite", _FINITE), _FINITE),
        errors("finite elements, nodes at hinge and springs", attached, _ATTACHED),
        errors("discrete elements, Hermitian mass", meshes("discrete-hermite", _ATTACHED), _ATTACHED),
        errors("discrete elements, geometrical mass", meshes("discrete-geometric", _ATTACHED), _ATTACHED),
        errors("high-order elements, 4", orders, _ORDERS, "order"),
    )


def _attached(p: BoomParameters, elements: int) -> Array:
    """Return node positions at tips, springs and hinge with elements as equal as can be, refined alike everywhere."""
    half, spring = p.length / 2, p.spring_distance / 2
    inner = max(1, round(elements / 2 * spring / half))
    outer = np.linspace(-half, -spring, elements // 2 - inner + 1)
    left = np.concatenate([outer, np.linspace(-spring, 0.0, inner + 1)[1:]])
    return np.concatenate([left, -left[-2::-1]])


def _shape_model(p: BoomParameters) -> tuple[SecondOrderModel, Array]:
    """Return a model that reads the boom's deflection at its nodes, and the nodes' places."""
    model = spray_boom(p, "finite", _attached(p, _SHAPE_ELEMENTS), reactions=False)
    places = [i for i, name in enumerate(model.coordinates) if name.startswith("boom.w")]
    L = np.eye(model.n)[places]
    ports = replace(
        model.ports.select(ACTUATORS, TIPS),
        outputs=tuple(model.coordinates[i] for i in places),
        L=np.array([L, 0 * L, 0 * L]),
    )
    E = np.zeros((len(places), len(ACTUATORS)))
    ports = replace(ports, E=np.array([E, E, E]), bandwidths=(None,) * len(places))
    return SecondOrderModel.of(model.structure, ports), _attached(p, _SHAPE_ELEMENTS)


def _mode_shapes(p: BoomParameters) -> tuple[ModeShape, ...]:
    """Return the first five modes, platform held; shapes undamped, frequencies and damping of the damped system."""
    model, x = _shape_model(p)
    _, shapes = undamped_modes(model.structure, _MODES)
    poles = damped_poles(model.structure, _MODES)
    motions = []
    for k, pole in enumerate(poles):
        w = model.ports.L[0] @ shapes[:, k]
        w = w / w[np.argmax(np.abs(w))]
        motions.append(ModeShape(f"mode {k + 1}", pole.imag / (2 * np.pi), x, w, -pole.real / abs(pole)))
    return tuple(motions)
