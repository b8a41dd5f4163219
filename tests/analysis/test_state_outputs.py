"""Plants with their states as outputs: regulators in loops that meet by name, and the laws of these loops."""

from dataclasses import replace

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import boomctl as bc
from boomctl.structure import SecondOrderModel
from tests.profiles import examples


def random_plant(seed, n=4, m=2, dt=0.0):
    """Return a random plant, stable or not, every state of which its controls move."""
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((n, n))
    if dt:
        A *= rng.uniform(0.5, 1.3) / np.abs(np.linalg.eigvals(A)).max()
    signals = {
        "inputs": ["w", *(f"u{i}" for i in range(m))],
        "outputs": ["y0", "y1"],
        "states": [f"x.{i}" for i in range(n)],
    }
    return control.ss(A, rng.standard_normal((n, m + 1)), rng.standard_normal((2, n)), 0.0, dt, **signals), rng


def regulator(plant, rng):
    controls = [name for name in plant.input_labels if name != "w"]
    weight = rng.standard_normal((plant.nstates, plant.nstates))
    return bc.lqr(plant, weight @ weight.T, np.exp(rng.uniform(-1.0, 1.0, len(controls))), controls=controls), controls


@given(st.integers(0, 10**6))
@examples(20)
def test_a_regulator_of_one_control_has_kalmans_margins(seed):
    plant, rng = random_plant(seed, m=1)
    design, (u,) = regulator(plant, rng)
    found = bc.margins(bc.with_state_outputs(plant), design.controller)[u]
    assert found.gain_margin[1] == np.inf
    assert found.gain_margin[0] <= 0.5 * (1.0 + 1e-6)
    assert found.phase_margin_deg >= 60.0 - 1e-6
    # Kalman's inequality itself: |S| is at most one
    S = bc.feedback_loop(bc.with_state_outputs(plant), design.controller, u)
    i, o = S.input_labels.index(f"{u}_injected"), S.output_labels.index(u)
    assert bc.hinf_norm(control.ss(S.A, S.B[:, [i]], S.C[[o]], S.D[[o], [i]])).upper_bound <= 1.0 + 1e-5


@pytest.mark.parametrize("dt", [0.0, 0.1])
@given(st.integers(0, 10**6))
@examples(20)
def test_the_loop_of_a_regulator_is_that_written_by_hand(dt, seed):
    plant, rng = random_plant(seed, dt=dt)
    design, controls = regulator(plant, rng)
    wide = bc.with_state_outputs(plant)
    assert bc.with_state_outputs(wide).output_labels == wide.output_labels  # they are there already
    loop = bc.feedback_loop(wide, design.controller)
    columns = [plant.input_labels.index(name) for name in controls]
    by_hand = plant.A - plant.B[:, columns] @ design.gain
    np.testing.assert_allclose(loop.A, by_hand, rtol=1e-12, atol=1e-12 * np.abs(by_hand).max())
    assert loop.input_labels == ["w"]
    assert loop.output_labels == ["y0", "y1", "x_0", "x_1", "x_2", "x_3", *controls]
    assert loop.C[-2:] == pytest.approx(-design.gain)
    assert bc.hinf_norm(bc.synthesis.select_channels(loop, outputs=["y0", "y1"])).lower_bound == pytest.approx(
        bc.hinf_norm(design.closed_loop).lower_bound, rel=1e-8
    )


def test_integral_action_joins_a_regulator_by_name():
    mass = control.ss(
        [[0, 1], [0, 0]], [[0, 0], [1, 1]], [[1, 0]], 0, inputs=["force", "load"], outputs="place", states=["x", "v"]
    )
    design = bc.lqr(mass, None, 1.0, output_weight={"place": 1.0}, controls="force", integral_action=["place"])
    loop = bc.feedback_loop(bc.with_state_outputs(mass), design.controller)
    assert np.sort_complex(loop.poles()) == pytest.approx(np.sort_complex(design.poles))
    assert loop.dcgain()[0] == pytest.approx(0.0, abs=1e-12)  # a constant load leaves no error in what is integrated


@pytest.mark.parametrize("excitation", ["displacement", "force"])
def test_a_family_reads_the_states_of_its_middle_everywhere(excitation):
    """In the middle they are the states; elsewhere the same sums, of places and speeds that other outputs show."""
    family = bc.boom_family(subsystem="yaw", excitation=excitation)
    found = bc.with_state_outputs(family)
    assert (found.names, type(found)) == (family.names, type(family))
    plain, wide = bc.with_state_outputs(family.nominal), found.nominal.to_statespace()
    assert wide.output_labels == plain.output_labels
    for letter in "ABCD":
        own, other = np.asarray(getattr(wide, letter)), np.asarray(getattr(plain, letter))
        np.testing.assert_allclose(own, other, rtol=1e-9, atol=1e-9 * max(np.abs(other).max(), 1.0))
    tip, place = ([found.nominal.output_labels.index(name)] for name in ("tip_anti", "mode1_x1"))
    for delta in ([1.0, -1.0], [-0.4, 0.9]):
        there = found.at(delta)
        assert np.array_equal(there.ports.L, found.nominal.ports.L)
        assert np.array_equal(there.ports.E, found.nominal.ports.E)
        # the tip is the same sum of states that are places as in the middle
        count = len(plain.state_labels) // 2
        C = np.asarray(plain.C)[tip[0], :count]
        response = there.frequency_response([0.7, 9.0]).frdata
        states = response[place[0] : place[0] + count]
        np.testing.assert_allclose(np.tensordot(C, states, 1), response[tip[0]], rtol=1e-8)


@pytest.mark.parametrize("half", ["jolt", "yaw"])
def test_states_of_a_family_that_are_there_are_not_there_twice(half):
    family = bc.boom_family(subsystem=half)
    once = bc.with_state_outputs(family)
    assert bc.with_state_outputs(once).nominal.output_labels == once.nominal.output_labels
    few = (*family.nominal.output_labels, "mode2_x1")
    again = bc.with_state_outputs(replace(once, nominal=once.nominal.select(None, few)))
    assert again.nominal.output_labels[: len(few)] == few
    assert set(again.nominal.output_labels) == set(once.nominal.output_labels)
    ports = once.nominal.ports
    wrong = SecondOrderModel.of(once.nominal.structure, replace(ports, L=2.0 * ports.L))
    with pytest.raises(ValueError, match="expected output 'mode1_x1' to be the state of this name"):
        bc.with_state_outputs(replace(once, nominal=wrong))
