"""Gain-scheduled controllers, whose matrices are interpolated linearly between the values of a signal."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from boomctl.arrays import Array
from boomctl.checks import finite_array, names, real, sequence, shown, signal_name
from boomctl.lti.system import Lti, check_scales, of
from boomctl.printing import between, count
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    import control


@dataclass(frozen=True, repr=False, eq=False)
class ScheduledController:
    """Controller whose matrices depend on a measured signal, as returned by :func:`boomctl.gain_schedule`.

    At a value ``w`` of the signal it is ``x' = A(w) x + B(w) y``, ``u = C(w) x + D(w) y``.  Between adjacent ``values`` each
    matrix is interpolated linearly; outside their range the matrices of the nearest value are used.

    Attributes
    ----------
    signal : str
        Scheduling signal, one of the measurements.
    values : (k,) ndarray
        Values of the scheduling signal, ascending.
    A, B, C, D : ndarray
        Matrices at each value, (k, n, n), (k, n, p), (k, m, n), (k, m, p).
    input_labels, output_labels, state_labels : tuple of str
        Names.  ``signal`` is one of the inputs, with columns of zeros if no controller uses it.
    dt : float
        Sampling time [s]; 0 for continuous time.

    Examples
    --------
    >>> import boomctl as bc
    >>> import control
    >>> signals = {"inputs": "hub_speed", "outputs": "torque"}
    >>> slow, fast = (control.ss([], [], [], [[gain]], **signals) for gain in (-200.0, -300.0))
    >>> scheduled = bc.gain_schedule([slow, fast], [0.0, 6.0], "hub_speed")
    >>> float(scheduled.at(1.5).D[0, 0])
    -225.0
    """

    _made_by = "gain_schedule(...)"

    signal: str
    values: Array
    A: Array
    B: Array
    C: Array
    D: Array
    input_labels: tuple[str, ...]
    output_labels: tuple[str, ...]
    state_labels: tuple[str, ...] = field(default=())
    dt: float = 0.0

    def __repr__(self) -> str:
        size, ends = count(self.A.shape[1], "state"), f"{self.values[0]:.6g} to {self.values[-1]:.6g}"
        time = f", every {self.dt:g} s" if self.dt else ""
        return (
            f"ScheduledController: {size}{time}, {between(self.input_labels, self.output_labels)}\n"
            f"  over {self.signal}: {count(len(self.values), 'controller')} from {ends}, straight lines between them"
        )

    @property
    def _signal_index(self) -> int:
        """Index of the scheduling signal among the inputs."""
        return self.input_labels.index(self.signal)

    @cached_property
    def systems(self) -> tuple[Lti, ...]:
        """The controllers at the values."""
        both = (self.input_labels, self.output_labels, self.state_labels, self.dt)
        return tuple(Lti(*item, *both) for item in zip(self.A, self.B, self.C, self.D, strict=True))

    def at(self, value: float) -> control.StateSpace:
        """Return the controller at a constant value of the signal.

        Parameters
        ----------
        value : float
            Value of the signal, in its unit.

        Returns
        -------
        control.StateSpace
            Controller with ``u = K y``.

        Raises
        ------
        TypeError, ValueError
            If `value` is not a finite number.
        """
        return frozen(self, real(self.signal, value)).statespace("controller")

    def to_nlsys(self, references: str | Sequence[str] = ()) -> control.NonlinearIOSystem:
        """Return the controller as a nonlinear input-output system of python-control.

        Parameters
        ----------
        references : str or sequence of str
            Measurements from which a reference is subtracted before they enter the matrices.  Each adds an input with the
            name of the measurement and the suffix ``_reference``.  The schedule follows the measurement itself.

        Returns
        -------
        control.NonlinearIOSystem
            System from the measurements and the references to the controls, with the time step of the controller.

        Raises
        ------
        TypeError, ValueError
            If a name is not a measurement.
        """
        from boomctl.lti.python_control import control

        wanted = names("reference", references, self.input_labels)
        rows, p = [self.input_labels.index(name) for name in wanted], len(self.input_labels)

        def split(u: Any) -> tuple[Lti, Array]:
            read = np.array(u[:p], dtype=float)
            here = frozen(self, float(read[self._signal_index]))
            read[rows] -= u[p:]
            return here, read

        def update(t: float, x: Any, u: Any, params: Any) -> Array:
            here, read = split(u)
            return here.A @ x + here.B @ read

        def output(t: float, x: Any, u: Any, params: Any) -> Array:
            here, read = split(u)
            return here.C @ x + here.D @ read

        inputs = [*self.input_labels, *(f"{name}_reference" for name in wanted)]
        states = list(self.state_labels) or self.A.shape[1]
        signals = {"inputs": inputs, "outputs": list(self.output_labels), "states": states, "dt": self.dt}
        return control.nlsys(update, output, **signals, name="scheduled_controller")


def frozen(controller: ScheduledController, value: float) -> Lti:
    """Return a scheduled controller at a value of its signal."""
    K = controller
    w = [float(np.interp(value, K.values, unit)) for unit in np.eye(len(K.values))]
    A, B, C, D = (np.tensordot(w, X, 1) for X in (K.A, K.B, K.C, K.D))
    return Lti(A, B, C, D, K.input_labels, K.output_labels, K.state_labels, K.dt)


@one_blas_thread
def gain_schedule(
    controllers: Sequence[control.StateSpace], values: ArrayLike, signal: str = "hub_speed"
) -> ScheduledController:
    """Return a gain-scheduled controller that interpolates linearly between controllers designed at values of a signal.

    The states of all controllers must have the same meaning; otherwise the interpolated controllers are meaningless.  This is
    the case for regulators with an observer of the same plant (:func:`boomctl.lqg`, :func:`boomctl.lqr`) or of the same
    structure, but not for controllers that were balanced or reduced separately.  :func:`boomctl.robust_stability` proves
    stability at every constant value of the signal.  No proof covers a changing signal; use :func:`boomctl.simulate_loop`.

    Parameters
    ----------
    controllers : sequence of control.StateSpace
        Two or more controllers with the same signals, number of states and time step.
    values : (k,) array_like
        Values of the signal, ascending, one for each controller.
    signal : str
        Scheduling signal: a measurement, and in :func:`boomctl.robust_stability` the parameter of this name.  It becomes an
        input if the controllers do not use it.

    Returns
    -------
    ScheduledController
        Controller for :func:`boomctl.simulate_loop` and :func:`boomctl.robust_stability`.

    Raises
    ------
    TypeError, ValueError
        If a system has an unsupported type, there are fewer than two controllers, their signals, numbers of states or time
        steps differ, or `values` are not ascending.

    Examples
    --------
    A regulator for a hub-beam at each of three hub speeds:

    >>> import boomctl as bc
    >>> beam = bc.hub_beam(model="sfoam", modes=2)
    >>> speeds = [0.0, 3.0, 6.0]
    >>> weights = {"Q": {"hub_angle": 10.0, "hub_speed": 100.0}, "R": 1.0}
    >>> scheduled = bc.gain_schedule([bc.lqr(beam.linearize(w), **weights).controller for w in speeds], speeds)
    >>> scheduled
    ScheduledController: 0 states, hub_angle, ... (6) -> torque
      over hub_speed: 3 controllers from 0 to 6, straight lines between them
    """
    systems = [
        of(item, f"controllers[{i}]", expected="StateSpace", any_time=True)
        for i, item in enumerate(sequence("controllers", controllers, "StateSpace"))
    ]
    for item in systems:
        check_scales(item)
    nodes = finite_array("values", values, ndim=1)
    if len(systems) < 2 or len(nodes) != len(systems):
        raise ValueError(
            f"values: expected one for each of two or more controllers, got {len(nodes)} and {len(systems)} controllers"
        )
    if not (np.diff(nodes) > 0.0).all():
        raise ValueError(f"values = {shown(nodes.tolist())}: expected ascending ones")
    first, followed = systems[0], signal_name("signal", signal)
    for i, item in enumerate(systems):
        for what in ("input_labels", "output_labels", "dt", "nstates"):
            own, wanted = (len(K.A) if what == "nstates" else getattr(K, what) for K in (item, first))
            if own != wanted:
                raise ValueError(f"controllers[{i}]: expected the {what} of the first, {wanted}, got {own}")
    inputs = first.input_labels if followed in first.input_labels else (*first.input_labels, followed)
    A, B, C, D = (np.array([getattr(item, letter) for item in systems]) for letter in "ABCD")
    B, D = (np.pad(X, ((0, 0), (0, 0), (0, len(inputs) - X.shape[2]))) for X in (B, D))
    return ScheduledController(followed, nodes, A, B, C, D, inputs, first.output_labels, first.state_labels, first.dt)
