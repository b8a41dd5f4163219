"""The spray boom, with a specified discretization or a required accuracy."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Unpack

from boomctl.arrays import Array
from boomctl.boom.model import boom_discretization, boom_model, checked_nozzles
from boomctl.boom.parameters import BoomChanges, BoomParameters
from boomctl.checks import known, positive, shown, truth
from boomctl.parameters import or_default, signature_of
from boomctl.structure.displacement_input import MOTIONS
from boomctl.structure.matrices import check_size
from boomctl.structure.model import SecondOrderModel
from boomctl.threads import one_blas_thread


@one_blas_thread
def spray_boom(
    parameters: BoomParameters | None = None,
    discretization: str | None = None,
    elements: int | Sequence[float] | Array | None = None,
    excitation: str = "displacement",
    accelerometer_bandwidth_hz: float | None = None,
    order: int | None = None,
    reaction_forces: bool = False,
    nozzles: Sequence[float] | Array | None = None,
    accuracy: float | None = None,
    max_frequency_hz: float | None = None,
    **changes: Unpack[BoomChanges],
) -> SecondOrderModel:
    """Return the horizontal dynamics of the spray boom.

    Source: Anthonis & Ramon (2003).

    Parameters
    ----------
    parameters : BoomParameters, optional
        By default those of Anthonis & Ramon (2003), Table 2.
    discretization : "finite", "high-order", "discrete-hermite" or "discrete-geometric"
        Discretization of the beam.  "finite": equal cubic elements.  "high-order": elements of polynomial order ``order``
        with nodes at hinge and springs.  The other two: massless elements between mass points, at tips, springs and
        hinge, with Hermitian or with point masses.  By default "finite".
    elements : int or sequence of float
        A number of elements, or node positions ``x`` [m] from ``-length/2`` to ``length/2``.  Discrete elements: an
        even number, at least 4; 2 of them are between the springs, 4 from 20 elements on.  High-order: the same.  By
        default 6.  A model has at most 1,000 coordinates (499 cubic elements); the documented accuracy holds up to 400
        (199 elements).
    excitation : "displacement", "velocity", "acceleration" or "force"
        Quantity that the two platform actuators impose.
    accelerometer_bandwidth_hz : float, optional
        Adds outputs ``tip_left_acceleration``, ``tip_right_acceleration`` [m/s^2] behind a second-order low pass of
        this bandwidth [Hz].
    order : int
        Polynomial order of the elements of ``"high-order"``; by default 12.
    reaction_forces : bool
        Adds outputs ``actuator_left_force``, ``actuator_right_force`` [N]: the forces of the actuators.
    nozzles : sequence of float, optional
        Positions ``x`` [m] along the boom, ascending; adds outputs ``nozzle_01``, ``nozzle_02``, ... [m], absolute as
        those of the tips.
    accuracy, max_frequency_hz : float, optional
        Instead of ``discretization``, ``elements`` and ``order``: relative accuracy of the response at all frequencies up
        to ``max_frequency_hz`` [Hz], including resonances.  Selects the coarsest such mesh of high-order elements, with
        the exact beam as reference; the model's `selection` records the tested meshes.
    **changes : float
        Parameters of the boom by name, in place of those of ``parameters``.

    Returns
    -------
    SecondOrderModel
        Inputs ``actuator_left``, ``actuator_right`` (motion [m] of the platform at ``x = -+L_t/2``, or the
        quantity ``excitation``), ``suspension_left``, ``suspension_right``, ``cradle`` (forces [N]).  Outputs ``tip_left``,
        ``tip_right`` (motion of the tips), ``stroke_left``, ``stroke_right`` (of the boom on the platform, at the
        springs) and ``cradle_slip`` (of the cradle on the platform), all [m].

    Raises
    ------
    TypeError, ValueError
        If a parameter, discretization or excitation is unknown, if there are fewer than one element or more than 1,000
        coordinates, if nodes are unsorted or do not cover the boom, or if `accuracy` is specified without
        `max_frequency_hz`, together with a mesh, or is not met by any mesh.

    Examples
    --------
    >>> import boomctl as bc
    >>> boom = bc.spray_boom()
    >>> boom.eigenfrequencies_hz(3).round(3)
    array([0.245, 0.587, 0.935])
    >>> bc.spray_boom(spring_stiffness=900.0).eigenfrequencies_hz(1).round(3)  # softer springs
    array([0.224])
    >>> finer = bc.spray_boom(elements=20, nozzles=[-3.0, 3.0])
    >>> finer.output_labels[-2:]
    ('nozzle_01', 'nozzle_02')
    >>> bc.spray_boom(accuracy=1e-3, max_frequency_hz=10.0).selection.order
    9
    """
    p = or_default(BoomParameters, "parameters", parameters, changes, signature_of(spray_boom))
    known("excitation", excitation, (*MOTIONS, "force"))
    if truth("reaction_forces", reaction_forces) and excitation == "force":
        raise ValueError("reaction_forces = True: the actuators' forces are inputs where excitation = 'force'")
    positions = () if nozzles is None else checked_nozzles(p, nozzles)
    chosen, choices = None, {"discretization": discretization, "elements": elements, "order": order}
    mesh: dict[str, Any] = {name: value for name, value in choices.items() if value is not None}
    if accuracy is not None or max_frequency_hz is not None:
        for name, value in mesh.items():
            raise ValueError(f"`{name}` must be None with `accuracy`, which chooses the mesh, got {shown(value)}.")
        from boomctl.boom.accuracy import chosen_mesh  # and the exact beam

        chosen = chosen_mesh(
            p, positive("accuracy", accuracy), positive("max_frequency_hz", max_frequency_hz), excitation, positions
        )
        mesh = {"discretization": "high-order", "elements": chosen.elements, "order": chosen.order}
    model = boom_model(
        p,
        boom_discretization(p, **mesh),
        excitation,
        accelerometer_bandwidth_hz=accelerometer_bandwidth_hz,
        reactions=reaction_forces,
        nozzles=positions,
    )
    check_size(model.ncoordinates)
    return model if chosen is None else SecondOrderModel.of(model.structure, model.ports, chosen)
