"""Reductions where others lose digits: hardly any damping, a fine mesh, poles far apart."""

import control
import numpy as np
import pytest

import boomctl as bc
from boomctl.analysis import sigma
from boomctl.boom.factory import spray_boom
from boomctl.boom.model import ACTUATORS, TIPS
from boomctl.exceptions import ReductionError
from boomctl.lti.system import of
from boomctl.reduction import reduce
from boomctl.reduction.verify import SystemParts
from boomctl.structure import SecondOrderModel
from tests.reduction.test_reduce import METHODS as STATES
from tests.reduction.test_reduce import gap

METHODS = (*STATES, "second-order")


def chain(count, ratio=1e-2, seed=0, dashpot=0.0):
    """Masses between springs, both ends held, two forces and two displacements; damping ratio at 1 rad/s."""
    rng = np.random.default_rng(seed)
    k, mass = rng.uniform(20.0, 60.0, count + 1), rng.uniform(0.5, 1.5, count)
    K = np.diag(k[:-1] + k[1:]) - np.diag(k[1:-1], 1) - np.diag(k[1:-1], -1)
    C = 2.0 * ratio * K
    C[-1, -1] += dashpot
    lines = rng.standard_normal((4, count))
    forces, places = {"f1": lines[0], "f2": lines[1]}, {"y1": lines[2], "y2": lines[3]}
    return SecondOrderModel(np.diag(mass), C, K, forces, places)


def around(model, count):
    """Frequencies across every resonance of a structure, within its half-power width."""
    poles = of(model).balanced().poles
    poles = poles[poles.imag > 0.0]
    near = poles.imag[:, None] + np.abs(poles.real)[:, None] * np.linspace(-2.0, 2.0, count)
    return np.sort(np.abs(near.ravel()))


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("ratio", [1e-6, 1e-4])
def test_hardly_any_damping(method, ratio):
    model = chain(8, ratio)
    red = reduce(model, order=6, method=method)
    seen = gap(model, red.system, around(model, 21))
    peak = sigma(model).peak
    assert seen.max() <= red.error_norm * (1 + 1e-4) + 1e-6 * peak
    assert red.error_norm <= 1.01 * seen.max() + 1e-6 * peak
    assert red.error_norm <= red.error_bound * (1 + 1e-3)


@pytest.mark.parametrize("elements", [36, pytest.param(60, marks=pytest.mark.slow)])
def test_modal_coordinates_keep_the_digits_of_a_fine_mesh(elements):
    """Seen through the strains of its elements, with accelerometers."""
    outputs = (*TIPS, "tip_left_acceleration", "tip_right_acceleration")
    model = spray_boom(elements=elements, accelerometer_bandwidth_hz=50.0).select(ACTUATORS, outputs)
    core = SystemParts.of(model._modal_form)
    omega = np.unique(np.concatenate([np.geomspace(0.1, 200.0, 100), 2.0 * np.pi * model.eigenfrequencies_hz(3)]))
    full = np.asarray(model.frequency_response(omega).frdata)
    stable = core.stable.response(omega) if core.modal is None else core.modal.response(omega)
    off = np.abs(full - stable - core.retained.response(omega)).max(axis=2)
    assert (off <= 1e-7 * np.abs(full).max(axis=2)).all()


@pytest.mark.parametrize("seed", [1, 5, 53, 74, 131, 1437])
def test_slow_poles_far_below_the_fastest_are_not_overlooked(seed):
    """Poles over twelve decades: the error at zero frequency is measured, or the reduction is refused."""
    rng = np.random.default_rng(seed)
    poles = -np.sort(10.0 ** rng.uniform(-6.0, 6.0, 10))
    B, C = rng.standard_normal((10, 2)), rng.standard_normal((2, 10))
    for order in (3, 5):
        try:
            found = bc.reduce(control.ss(np.diag(poles), B, C, 0.0), order, "hankel")
        except ReductionError:
            continue
        R = found.system
        error = np.linalg.norm((C / -poles) @ B + R.C @ np.linalg.solve(R.A, R.B) - R.D, 2)
        assert error <= found.error_norm * (1.0 + 1e-3)


@pytest.mark.parametrize("shape", [(2, 3, 2), (2, 1, 3), (3, 5, 4)])
def test_chains_with_more_signals_than_states(shape):
    """Equal poles have no modal coordinates; the Gramians come from their factors, however many signals there are."""
    n, m, p = shape
    rng = np.random.default_rng(0)
    chain = control.ss(
        -np.eye(n) + np.diag(np.full(n - 1, 40.0), 1), rng.standard_normal((n, m)), rng.standard_normal((p, n)), 0.0
    )
    size = bc.hinf_norm(chain).upper_bound
    for order in range(n + 1):
        found = bc.reduce(chain, order)
        assert found.order == order
        assert gap(chain, found.system, np.array([0.7]))[0] <= found.error_norm * (1.0 + 1e-6)
        assert found.error_norm <= found.error_bound * (1.0 + 1e-3) + 2e-9 * size
    assert bc.h2_norm(chain).certified
