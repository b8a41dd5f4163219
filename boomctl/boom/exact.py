"""The spray boom with an exact beam: frequency response and eigenfrequencies without discretisation."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from boomctl.arrays import Array
from boomctl.boom.model import ACTUATORS, boom_assembly, boom_mirror
from boomctl.boom.parameters import BoomParameters
from boomctl.checks import frequencies, instance, known, some_names, truth, whole
from boomctl.structure.beams.eigenvalues import damped_eigenvalues, undamped_frequencies
from boomctl.structure.beams.elements import FiniteElements
from boomctl.structure.beams.exact import ExactModel, PreparedResponse
from boomctl.structure.displacement_input import MOTIONS
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    import control

_START_ORDER = 12  # polynomial order of the elements that start Newton's method: good to far below its 1e-3
_MOST = (
    1000  # frequencies of the exact boom that can be asked for: the last of them is far beyond slender beams (a choice)
)


def exact_boom(
    parameters: BoomParameters, excitation: str = "displacement", nozzles: tuple[float, ...] = ()
) -> ExactModel:
    """Return the boom with exact beam segments between tips, springs and hinge.

    Parameters
    ----------
    parameters : BoomParameters
    excitation : "displacement" or "force"
        What the platform actuators impose.
    nozzles : tuple of float
        Places along the boom whose motions are outputs too [m].
    """
    model = _exact_boom(parameters, nozzles)
    return model if excitation == "force" else model.prescribed(ACTUATORS)


@lru_cache(maxsize=8)
def _exact_boom(parameters: BoomParameters, nozzles: tuple[float, ...]) -> ExactModel:
    model = boom_assembly(parameters, FiniteElements(1), nozzles=nozzles).to_exact()
    return model.mirrored(boom_mirror(model.coordinates, nozzles))


@lru_cache(maxsize=16)
def _prepared(
    parameters: BoomParameters, forced: bool, inputs: tuple[str, ...], outputs: tuple[str, ...]
) -> PreparedResponse:
    return exact_boom(parameters, "force" if forced else "displacement").prepared(inputs, outputs)


@one_blas_thread
def exact_frequency_response(
    parameters: BoomParameters,
    omega: ArrayLike,
    inputs: str | Sequence[str] | None = None,
    outputs: str | Sequence[str] | None = None,
    excitation: str = "displacement",
) -> control.FrequencyResponseData:
    """Return the frequency response of the boom with an exact Euler-Bernoulli beam.

    Parameters
    ----------
    parameters : BoomParameters
        The boom.
    omega : array_like
        Angular frequencies [rad/s]; above zero where velocity or acceleration is imposed.
    inputs, outputs : str or sequence of str, optional
        Names as for :func:`boomctl.spray_boom`; by default all.
    excitation : "displacement", "velocity", "acceleration" or "force"
        What the platform actuators impose.

    Returns
    -------
    control.FrequencyResponseData
        Outputs by inputs by frequencies, signals named; in SI units.

    Raises
    ------
    TypeError, ValueError
        Unknown names; frequencies negative or not finite.

    Warns
    -----
    AccuracyWarning
        Rounding may exceed 1e-9 of the largest output to an input, and by how much: next to an undamped resonance.

    Examples
    --------
    >>> import boomctl as bc
    >>> response = bc.exact_frequency_response(bc.BoomParameters(), [1.0, 10.0], "actuator_left", "tip_left")
    >>> abs(response.complex).round(3)
    array([6.492, 0.247])
    """
    instance("parameters", parameters, BoomParameters)
    grid = frequencies("omega", omega)
    known("excitation", excitation, (*MOTIONS, "force"))
    ports = _exact_boom(parameters, ()).ports
    ins, outs = some_names("input", inputs, ports.inputs), some_names("output", outputs, ports.outputs)
    response = _prepared(parameters, excitation == "force", ins, outs).at(grid)
    integrations = MOTIONS.index(excitation) if excitation in MOTIONS else 0
    if integrations:
        if (grid == 0.0).any():
            raise ValueError(f"omega = 0: the response to an imposed {excitation} is not finite there")
        for i, name in enumerate(ins):
            if name in ACTUATORS:
                response[:, i] /= (1j * grid) ** integrations
    from boomctl.lti.python_control import control

    return control.frd(response, grid, inputs=list(ins), outputs=list(outs), name="exact boom")


@one_blas_thread
def exact_eigenfrequencies_hz(parameters: BoomParameters, count: int = 5, damped: bool = True) -> Array:
    """Return the lowest eigenfrequencies of the boom with an exact beam, platform held by its actuators [Hz].

    Parameters
    ----------
    parameters : BoomParameters
        The boom.
    count : int
        How many eigenfrequencies.
    damped : bool
        True: ``Im(lambda)/2 pi`` of the damped system, as in Anthonis & Ramon (2003), Table 1.  False: of the boom
        without damping; none is missed (count of Wittrick & Williams 1971).

    Returns
    -------
    (count,) ndarray
        Eigenfrequencies, ascending [Hz].

    Raises
    ------
    TypeError, ValueError
        ``parameters`` are not the boom's, ``count`` is not a whole number above zero.
    ArithmeticError
        An eigenvalue iteration did not converge, or two came to the same eigenvalue.

    Warns
    -----
    AccuracyWarning
        Rounding may exceed 1e-9 of an eigenfrequency, and by how much.

    Examples
    --------
    >>> import boomctl as bc
    >>> bc.exact_eigenfrequencies_hz(bc.BoomParameters(), 3).round(3)
    array([0.244, 0.586, 0.933])
    """
    instance("parameters", parameters, BoomParameters)
    wanted = whole("count", count, most=_MOST)
    model = exact_boom(parameters)
    if not truth("damped", damped):
        return undamped_frequencies(model, wanted) / (2.0 * np.pi)
    start = boom_assembly(parameters, fine_mesh(parameters, wanted)).assemble()
    return np.sort(damped_eigenvalues(model, start, ACTUATORS, wanted).imag) / (2.0 * np.pi)


def fine_mesh(parameters: BoomParameters, modes: int) -> FiniteElements:
    """Return a mesh that knows so many modes far better than to a thousandth."""
    half, spring = parameters.length / 2, parameters.spring_distance / 2
    outer = np.linspace(-half, -spring, 3 + modes // 4)
    return FiniteElements(tuple(np.concatenate([outer, [0.0], -outer[::-1]]) + half), _START_ORDER)
