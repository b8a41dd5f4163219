"""Plants with their states as additional outputs, for controllers that read states."""

from dataclasses import replace
from typing import TYPE_CHECKING, Any, overload

import numpy as np

from boomctl.arrays import Array
from boomctl.lti.system import Lti, of
from boomctl.structure.families import AffineFamily, PolynomialFamily, Slope
from boomctl.structure.model import SecondOrderModel

if TYPE_CHECKING:
    import control


@overload
def with_state_outputs(plant: AffineFamily) -> AffineFamily: ...
@overload
def with_state_outputs(plant: PolynomialFamily) -> PolynomialFamily: ...
@overload
def with_state_outputs(
    plant: "SecondOrderModel | control.StateSpace | control.TransferFunction",
) -> "control.StateSpace": ...
def with_state_outputs(plant: Any) -> "control.StateSpace | AffineFamily | PolynomialFamily":
    """Return the plant with its states as additional outputs, under their names.

    A regulator of :func:`boomctl.lqr` reads states.  Signals of its controller and of this plant are matched by name, so that
    :func:`boomctl.margins`, :func:`boomctl.feedback_loop` and :func:`boomctl.simulate_loop` accept it like a controller that
    reads outputs, also sampled and delayed.

    Parameters
    ----------
    plant : SecondOrderModel, AffineFamily, PolynomialFamily, control.StateSpace or control.TransferFunction
        Plant with p outputs and n states, in continuous or discrete time.  The states of a structure are those of its
        ``to_statespace()``, which :func:`boomctl.lqr` uses.  The states of a family are those of its nominal plant: the same
        linear functions of positions, speeds and displacements of inputs at every point of the box.

    Returns
    -------
    control.StateSpace, AffineFamily or PolynomialFamily
        Plant with the same inputs and states (a family for a family), and with the p outputs followed by the n states, dots
        in their names replaced by ``_``.  A state that is already an output under its name is not repeated.

    Raises
    ------
    TypeError, ValueError
        If `plant` has an unsupported type or an entry that is not finite, a state has the name of another output or state, or
        a family has output filters or integrated inputs.

    Examples
    --------
    >>> import boomctl as bc
    >>> import control
    >>> signals = {"inputs": "force", "outputs": "position", "states": ["x", "v"]}
    >>> mass = control.ss([[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]], [[1.0, 0.0]], 0.0, **signals)
    >>> regulator = bc.lqr(mass, None, 1.0, output_weight={"position": 1.0})
    >>> bc.with_state_outputs(mass).output_labels
    ['position', 'x', 'v']
    >>> margin = bc.margins(bc.with_state_outputs(mass), regulator.controller)["force"]
    >>> bool(margin.phase_margin_deg > 60.0)  # Kalman's inequality
    True
    """
    if isinstance(plant, AffineFamily | PolynomialFamily):
        center = _center_with_state_outputs(plant.nominal)
        more = len(center.output_labels) - len(plant.nominal.output_labels)

        def wider(slope: Slope) -> Slope:  # rows of states do not depend on parameters
            return replace(slope, L=np.pad(slope.L, ((0, 0), (0, more), (0, 0))) if slope.L.any() else np.zeros(()))

        coefficients = tuple((power, wider(slope)) for power, slope in plant.coefficients)
        return replace(plant, nominal=center, coefficients=coefficients)
    system = of(plant, "plant", "SecondOrderModel, a family, StateSpace or TransferFunction", any_time=True)
    plain, n = system.without_dots(), len(system.A)
    labels, rows = _joined(system, plain.output_labels, np.hstack([plain.C, plain.D]), np.eye(n, n + plain.B.shape[1]))
    C, D = np.hsplit(rows, [n])
    name = getattr(plant, "name", None)
    return replace(plain, C=C, D=D, output_labels=labels).statespace(name if isinstance(name, str) else "plant")


def _joined(plant: Lti, outputs: tuple[str, ...], read: Array, states: Array) -> tuple[tuple[str, ...], Array]:
    """Append states that are not yet outputs: return all names, and their rows along the last but one axis.

    Raises
    ------
    ValueError
        If two states have the same name, or an output has the name of a different state.
    """
    labels, new = [label.replace(".", "_") for label in plant.state_labels], []
    for i, label in enumerate(labels):
        if label in labels[:i]:
            raise ValueError(f"plant: expected states of different names, got {label!r} twice")
        if label not in outputs:
            new.append(i)
        elif not np.array_equal(read[..., outputs.index(label), :], states[..., i, :]):
            raise ValueError(f"plant: expected output {label!r} to be the state of this name; rename one of them")
    return (*outputs, *(labels[i] for i in new)), np.concatenate([read, states[..., new, :]], axis=-2)


def _center_with_state_outputs(model: SecondOrderModel) -> SecondOrderModel:
    """Return a structure with additional outputs for the states, in terms of positions, speeds and displacements."""
    ports, n, m = model.ports, model.ncoordinates, len(model.input_labels)
    if any(ports.integrators) or any(bandwidth is not None for bandwidth in ports.bandwidths):
        filtered = [name for name, b in zip(model.output_labels, ports.bandwidths, strict=True) if b is not None]
        which = f"a filter behind {filtered[0]!r}" if filtered else "an input that is integrated"
        raise ValueError(f"plant: expected a family without filters and integrators, got {which}")
    none = np.zeros((n, n))
    positions = replace(
        ports,
        outputs=model.coordinates,
        L=np.stack([np.eye(n), none, none]),
        E=np.zeros((3, n, m)),
        bandwidths=(None,) * n,
        primary=None,
    )
    x = of(SecondOrderModel.of(model.structure, positions), "plant")
    # q = C x + D d, and q' = C (A x + B d) + D d'
    position, speed = np.hsplit(np.linalg.inv(np.vstack([x.C, x.C @ x.A])), [n])
    at_rest, moving = -position @ x.D - speed @ (x.C @ x.B), -speed @ x.D
    states = np.stack([np.hstack([position, at_rest]), np.hstack([speed, moving]), np.zeros((2 * n, n + m))])
    labels, read = _joined(x, model.output_labels, np.concatenate([ports.L, ports.E], axis=2), states)
    L, E = np.split(read, [n], axis=2)
    wider = replace(ports, outputs=labels, L=L, E=E, bandwidths=(None,) * len(labels))
    return SecondOrderModel.of(model.structure, wider)
