"""The spray boom with an exact beam: frequency response and eigenfrequencies without discretization."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from boomctl.arrays import Array
from boomctl.boom.model import ACTUATORS, boom_assembly, boom_mirror
from boomctl.boom.parameters import BoomParameters
from boomctl.checks import MOST, frequencies, instance, known, some_names, truth, whole
from boomctl.structure.beams.eigenvalues import damped_eigenvalues, undamped_frequencies
from boomctl.structure.beams.elements import FiniteElements
from boomctl.structure.beams.exact import ExactModel
from boomctl.structure.displacement_input import MOTIONS
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    import control

_START_ORDER = 12  # Polynomial order of the elements that start Newton's method; their error is far below 1e-3.


@lru_cache(maxsize=16)
def exact_boom(
    parameters: BoomParameters, excitation: str = "displacement", nozzles: tuple[float, ...] = ()
) -> ExactModel:
    """Return the boom with exact beam segments between tips, springs and hinge.

    Parameters
    ----------
    parameters : BoomParameters
    excitation : "displacement" or "force"
        Quantity imposed by the platform actuators.
    nozzles : tuple of float
        Positions along the boom whose motions are additional outputs [m].
    """
    model = boom_assembly(parameters, FiniteElements(1), nozzles=nozzles).to_exact()
    model = model.mirrored(boom_mirror(model.coordinates, nozzles))
    return model if excitation == "force" else model.prescribed(ACTUATORS)


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
        If a name is unknown, or a frequency is negative or not finite.

    Warns
    -----
    AccuracyWarning
        If rounding errors may exceed 1e-9 of the largest output, as near an undamped resonance; the message contains
        an estimate.

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
    model = exact_boom(parameters, excitation)
    ins, outs = some_names("input", inputs, model.ports.inputs), some_names("output", outputs, model.ports.outputs)
    ports, order = model.ports.select(ins, outs), {"velocity": 1, "acceleration": 2}.get(excitation, 0)
    ports = replace(ports, integrators=tuple(order if name in ACTUATORS else 0 for name in ins))
    response = ports.conditioned(1j * grid, model.response(grid, ins, outs))
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
        Number of eigenfrequencies.
    damped : bool
        If True, ``Im(lambda)/2 pi`` of the damped system, as in Anthonis & Ramon (2003), Table 1.  If False, those of the
        boom without damping, all of which are computed (count of Wittrick & Williams 1971).

    Returns
    -------
    (count,) ndarray
        Eigenfrequencies, ascending [Hz].

    Raises
    ------
    TypeError, ValueError
        If ``parameters`` is not a `BoomParameters`, or if ``count`` is not a whole number above zero.
    ArithmeticError
        If an eigenvalue iteration did not converge, or if two converged to the same eigenvalue.

    Warns
    -----
    AccuracyWarning
        If the rounding error of an eigenfrequency may exceed 1e-9, with its estimate.

    Examples
    --------
    >>> import boomctl as bc
    >>> bc.exact_eigenfrequencies_hz(bc.BoomParameters(), 3).round(3)
    array([0.244, 0.586, 0.933])
    """
    instance("parameters", parameters, BoomParameters)
    wanted = whole("count", count, most=MOST)
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
