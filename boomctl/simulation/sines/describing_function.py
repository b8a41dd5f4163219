"""Coulomb friction by its describing function: the fundamental of a plant that slips, sticks and is shaken by a sine.

Sliding friction of amplitude ``F`` has the fundamental ``4 F/pi``, opposite to the slip velocity: an equivalent viscous
damping ``4 F/(pi omega A)`` at the slip amplitude ``A``.  With the plant's receptances the harmonic balance
``|A + j (4 F/pi) H| = |S|`` (``S`` the slip without friction, ``H`` the slip per unit friction force) is a quadratic in
``A``, solved here in closed form; where it has no positive root the contact sticks.

Source: Den Hartog (1931) for the damper, Gelb & Vander Velde (1968) for the method.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from boomctl.arrays import Array
from boomctl.checks import frequencies, instance, known, names, positive, some_names
from boomctl.lti.frequency import singular_values
from boomctl.printing import between
from boomctl.simulation.contact.friction import CoulombFriction
from boomctl.structure.model import SecondOrderModel
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    import control


@dataclass(frozen=True)
class SineResponse:
    """Fundamental of the steady response to a sine with friction.

    Attributes
    ----------
    omega : (n,) ndarray
        Angular frequencies [rad/s].
    response : (outputs, n) complex ndarray
        Fundamental of the outputs per unit excitation.
    slip : (n,) ndarray
        Amplitude of the slip's fundamental [m].
    stuck : (n,) ndarray of bool
        Whether the contact never slips.
    amplitude : float
        Amplitude of the excitation [unit of the input].
    inputs, outputs : tuple of str
        Excited and read signals.
    settled : (n,) ndarray
        Change of the response from the last but one window of periods to the last, relative to its size; 0 for a
        harmonic balance.
    """

    omega: Array
    response: Array
    slip: Array
    stuck: Array
    amplitude: float
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    settled: Array

    def __repr__(self) -> str:
        grid = f"{len(self.omega)} frequencies, {self.omega[0]:.4g} to {self.omega[-1]:.4g} rad/s"
        state = f"stuck at {int(self.stuck.sum())} of them"
        return (
            f"SineResponse: {between(self.inputs, self.outputs)}, amplitude {self.amplitude:.4g}\n"
            f"  {grid}; {state}\n  largest gain {self.gain.max():.6g}"
        )

    @property
    def gain(self) -> Array:
        """Length of the response per length of the excitation: the singular value of a single pattern, (n,)."""
        return singular_values(self.response[:, None, :])[0]

    def plot(self, ax: Any = None, *, unit: str | None = None, **style: Any) -> Array:
        """Draw the gain of each output and the slip over frequency.  Hollow markers: the contact sticks.

        Parameters
        ----------
        ax : sequence of matplotlib Axes, or a figure, optional
            Where to draw: gains and slip; by default a new figure of pyplot.
        unit : {"Hz", "rad/s"}, optional
            Of the frequency axis, by default Hz.
        **style
            Of the curves, as matplotlib's lines take it; a ``label`` stands before their names.

        Returns
        -------
        ndarray of matplotlib.axes.Axes
            Those drawn on, in the order in which ``ax`` names them.
        """
        return import_module("boomctl.plotting").plot_sines(self, ax, unit=unit, **style)


def sine_pattern(inputs: Sequence[str], excitation: str | dict[str, complex]) -> tuple[tuple[str, ...], Array]:
    """Return the inputs excited and their complex amplitudes, scaled to length one."""
    if not isinstance(excitation, (str, Mapping)):
        raise TypeError(f"excitation = {excitation!r}: expected an input, or a mapping from inputs to amplitudes")
    shares = {excitation: 1.0 + 0.0j} if isinstance(excitation, str) else dict(excitation)
    for name, share in shares.items():
        known("excited input", name, inputs)
        if not isinstance(share, (int, float, complex, np.number)):
            raise TypeError(f"excitation[{name!r}] = {share!r}: expected a number")
    vector = np.array(list(shares.values()), dtype=complex)
    length = float(np.linalg.norm(vector))
    if not len(vector) or not np.isfinite(length) or length == 0.0:
        raise ValueError("excitation: expected an input, or a mapping from inputs to amplitudes that are not all zero")
    return tuple(shares), vector / length


def receptances(
    plant: SecondOrderModel | control.StateSpace, omega: Array, inputs: Sequence[str], outputs: Sequence[str]
) -> Array:
    """Return the frequency response of some signals, (outputs, inputs, frequencies)."""
    if isinstance(plant, SecondOrderModel):
        return np.asarray(plant.frequency_response(omega, inputs=list(inputs), outputs=list(outputs)).frdata)
    ins, outs = plant_inputs(plant), plant_outputs(plant)
    i = [ins.index(name) for name in names("input", list(inputs), ins)]
    o = [outs.index(name) for name in names("output", list(outputs), outs)]
    return np.asarray(plant.frequency_response(omega).frdata)[np.ix_(o, i)]


@one_blas_thread
def describing_function(
    plant: SecondOrderModel | control.StateSpace,
    friction: CoulombFriction,
    omega: ArrayLike,
    excitation: str | dict[str, complex],
    amplitude: float,
    outputs: str | Sequence[str] | None = None,
) -> SineResponse:
    """Return the response of a plant with friction to sines, by harmonic balance (a describing function).

    Friction is replaced by the fundamental of its force at the slip that results.

    Parameters
    ----------
    plant : SecondOrderModel or control.StateSpace
        The plant without friction, in continuous time.
    friction : CoulombFriction
        Where friction acts.  Its static force is not used: a sine in balance does not know of break-away.
    omega : array_like
        Angular frequencies [rad/s], above zero.
    excitation : str or mapping from input to complex
        The input that is shaken, or a pattern of several inputs, whose length is scaled to one.
    amplitude : float
        Amplitude of the excitation, in the unit of the input.
    outputs : str or sequence of str, optional
        Outputs that are read; by default all.

    Returns
    -------
    SineResponse
        Fundamentals of the outputs per unit excitation, the slip, and where the contact sticks.

    Raises
    ------
    TypeError, ValueError
        Unknown signals, amplitude or frequencies not above zero, an undamped resonance among these.

    Examples
    --------
    >>> import boomctl as bc
    >>> dry = bc.CoulombFriction(3.0)
    >>> for amplitude in (0.001, 0.01, 0.1):  # m: the larger the motion, the less friction matters
    ...     print(bc.simulation.describing_function(bc.spray_boom(), dry, [9.0], "actuator_left", amplitude).gain.round(3))
    [0.935]
    [1.43]
    [1.487]
    """
    grid, size, law = (
        positive_grid(omega),
        positive("amplitude", amplitude),
        instance("friction", friction, CoulombFriction),
    )
    excited, shape = sine_pattern(plant_inputs(plant), excitation)
    read = some_names("output", outputs, plant_outputs(plant))
    known("input of the friction", law.input, plant_inputs(plant))
    known("output of the friction", law.output, plant_outputs(plant))
    ins, outs = tuple(dict.fromkeys((*excited, law.input))), tuple(dict.fromkeys((*read, law.output)))
    with np.errstate(all="ignore"):
        H = finite_response(receptances(plant, grid, ins, outs), grid)
        acts, slips = ins.index(law.input), outs.index(law.output)
        rows = [outs.index(name) for name in read]
        moved = size * np.einsum("oin,i->on", H[:, [ins.index(name) for name in excited]], shape)
        force, slip = balanced_friction(moved[slips], H[slips, acts], law.force)
        response = finite_response((moved[rows] + H[rows, acts] * force) / size, grid)
    return SineResponse(
        omega=grid,
        response=response,
        slip=finite_response(slip, grid),
        stuck=slip == 0.0,
        amplitude=size,
        inputs=excited,
        outputs=read,
        settled=np.zeros(len(grid)),
    )


def finite_response(response: Array, omega: Array) -> Array:
    """Return a response (..., frequencies), real or complex, that is finite throughout; otherwise say where it is not."""
    bad = ~np.isfinite(response.reshape(-1, len(omega))).all(axis=0)
    if bad.any():
        raise ValueError(
            f"omega: the response is not finite at {omega[bad][0]:g} rad/s; expected no undamped resonance there, and "
            "frequencies and amplitudes of finite squares"
        )
    return response


def balanced_friction(slip: Array, receptance: Array, force: float) -> tuple[Array, Array]:
    """Return the fundamental of the friction force and the slip amplitude, from the slip without friction.

    ``slip`` and ``receptance`` (slip per unit force) are complex, one a frequency.
    """
    level = 4.0 * force / np.pi
    turned = 1j * level * receptance
    free = np.abs(slip) ** 2 - np.imag(turned) ** 2
    amplitude = np.where(free > 0.0, np.sqrt(np.maximum(free, 0.0)) - np.real(turned), 0.0)
    amplitude = np.maximum(amplitude, 0.0)
    sliding = amplitude > 0.0
    with np.errstate(divide="ignore", invalid="ignore"):
        direction = np.where(sliding, slip / (amplitude + turned), 0.0)
        held = np.where(sliding, -1j * level * direction, -slip / receptance)
    return held, amplitude


def plant_inputs(plant: SecondOrderModel | control.StateSpace) -> tuple[str, ...]:
    """Return the names of a plant's inputs; another kind of plant is an error."""
    from boomctl.lti.python_control import control

    instance("plant", plant, (control.StateSpace, SecondOrderModel))
    return plant.inputs if isinstance(plant, SecondOrderModel) else tuple(plant.input_labels)


def plant_outputs(plant: SecondOrderModel | control.StateSpace) -> tuple[str, ...]:
    """Return the names of a plant's outputs."""
    return plant.outputs if isinstance(plant, SecondOrderModel) else tuple(plant.output_labels)


def positive_grid(omega: ArrayLike) -> Array:
    """Return frequencies [rad/s], all above zero."""
    grid = frequencies("omega", omega)
    if (grid == 0.0).any():
        raise ValueError("omega: expected frequencies above zero")
    return grid
