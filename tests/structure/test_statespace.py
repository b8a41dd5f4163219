"""State-space systems say what the frequency response says, and refuse what no state space can say."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given

from boomctl.structure import Output, SecondOrderModel, prescribe_displacement
from tests.references import state_space_response
from tests.strategies import random_machine, seeds, structures

OMEGA = np.array([0.3, 1.1, 1.9, 2.7, 6.0])
S = 1j * OMEGA
KINDS = ("position", "velocity", "acceleration")


def watched(seed, **options):
    """Return a random machine of rigid bodies and what two of its points do: position, velocity and acceleration."""
    machine = random_machine(seed, kinds=["rigid"])
    outputs = []
    for name, force in (("moved", machine.forces[0]), ("other", machine.forces[1])):
        outputs += [
            Output(f"{name}_{kind}", force.point, force.direction, derivative=k, **options)
            for k, kind in enumerate(KINDS)
        ]
    return replace(machine, outputs=tuple(outputs)).assemble()


def close(found, expected, rtol=1e-12):
    """Say whether responses agree, relative to the largest: by default 1e-14 times cond(M), a hundred at most here."""
    return np.abs(found - expected).max() <= rtol * np.abs(expected).max()


@given(seeds)
def test_velocity_and_acceleration_outputs(seed):
    Y = watched(seed).frequency_response(OMEGA).frdata.reshape(2, 3, -1, 5)
    assert np.allclose(Y[:, 1], S * Y[:, 0], rtol=1e-13, atol=0)
    assert np.allclose(Y[:, 2], S**2 * Y[:, 0], rtol=1e-13, atol=0)


@pytest.mark.parametrize("motion", ["velocity", "acceleration", None])
@given(seed=seeds)
def test_outputs_as_smooth_as_the_motion_imposed_are_proper(seed, motion):
    """The integrators are states, so that an output may use them; where forces alone drive, all are proper."""
    driven = watched(seed) if motion is None else prescribe_displacement(watched(seed), "p0", motion=motion)
    kinds = KINDS[: 2 if motion == "velocity" else 3]
    names = [f"{point}_{kind}" for point in ("moved", "other") for kind in kinds]
    truth = driven.frequency_response(OMEGA, outputs=names).frdata
    assert close(state_space_response(driven.to_statespace(outputs=names), OMEGA), truth)


@pytest.mark.parametrize("motion", ["displacement", "velocity", "acceleration", None])
@given(seed=seeds)
def test_a_band_limited_sensor_is_the_filter_times_the_sensor(seed, motion):
    """Whatever is imposed: the filter has two poles more than zeros, so that even accelerations are proper."""
    hertz = 0.4
    b = 2 * np.pi * hertz
    plain, filtered = watched(seed), watched(seed, bandwidth_hz=hertz)
    if motion is not None:
        plain, filtered = (prescribe_displacement(m, "p0", motion=motion) for m in (plain, filtered))
    expected = plain.frequency_response(OMEGA).frdata * (b**2 / (S**2 + np.sqrt(2) * b * S + b**2))
    assert close(filtered.frequency_response(OMEGA).frdata, expected, 1e-14)
    assert close(state_space_response(filtered.to_statespace(), OMEGA), expected)


@given(structures(inputs=2))
def test_states_are_named_after_coordinates_and_integrals(structure):
    driven = prescribe_displacement(structure.model, "f0", motion="acceleration")
    system = driven.to_statespace(inputs=["f1", "f0"], outputs="y1")
    n = list(driven.coordinates)
    states = [f"{q}.x1" for q in n] + [f"{q}.x2" for q in n] + ["f0.displacement", "f0.velocity"]
    assert system.state_labels == states
    assert (system.input_labels, system.output_labels) == (["f1", "f0"], ["y1"])


@given(structures(inputs=2), seeds)
def test_unsymmetric_matrices_are_realized_as_they_are(structure, seed):
    """Rotating frames, followers and feedback leave no matrix symmetric."""
    skew = 0.1 * np.random.default_rng(seed).standard_normal((3, *structure.M.shape))
    M, C, K = (X + s for X, s in zip((structure.M, structure.C, structure.K), skew, strict=True))
    model = SecondOrderModel(M, C, K, {"f": structure.B[:, 0]}, {"y": structure.L[0]})
    expected = [structure.L[0] @ np.linalg.solve(K + s * C + s * s * M, structure.B[:, 0]) for s in S]
    assert close(model.frequency_response(OMEGA).frdata.ravel(), expected, 1e-12)
    assert close(state_space_response(model.to_statespace(), OMEGA).ravel(), expected, 1e-12)


def test_a_coordinate_without_inertia_has_no_state_space():
    model = SecondOrderModel(np.diag([1.0, 0.0]), np.eye(2), np.eye(2), {"f": [1, 0]}, {"y": [1, 0]})
    with pytest.raises(ValueError, match="mass matrix is singular"):
        model.to_statespace()
    assert abs(model.frequency_response([2.0]).frdata[0, 0, 0] - 1 / (2j + 1 - 4)) < 1e-15
