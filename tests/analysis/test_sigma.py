"""Singular values: laws, automatic grids, and what other programs make of them."""

import sys

import control
import numpy as np
import pytest

import boomctl as bc
from boomctl.boom.model import ACTUATORS, TIPS
from boomctl.plotting.canvas import new_figure
from boomctl.structure import SecondOrderModel
from boomctl.structure.response.poles import damped_poles


def test_the_automatic_grid_resolves_every_peak():
    model = bc.spray_boom()
    result = bc.sigma(model)
    assert result.certified
    assert result.sigma[0].max() == pytest.approx(result.peak, rel=1e-9)
    for pole in damped_poles(model.structure, 5):
        assert (np.abs(result.omega - pole.imag) < np.abs(pole.real)).sum() >= 5


def test_sigma_of_model_state_space_and_data_agree():
    model, omega = bc.spray_boom(), np.geomspace(0.6, 60.0, 80)
    ours = bc.sigma(model, omega)
    halves = [bc.sigma(part, omega).sigma[0] for part in bc.split_symmetric(model)]
    assert -np.sort(-np.array(halves), axis=0) == pytest.approx(ours.sigma, rel=1e-12)
    system = model.to_statespace(ACTUATORS, TIPS)
    assert np.abs(bc.sigma(system, omega).sigma / ours.sigma - 1).max() < 1e-8
    assert np.abs(bc.sigma(model.frequency_response(omega, ACTUATORS, TIPS)).sigma / ours.sigma - 1).max() < 1e-10
    data = bc.hinf_norm(model.frequency_response(omega, ACTUATORS, TIPS))
    assert (data.lower_bound, data.upper_bound) == (pytest.approx(ours.sigma.max(), rel=1e-10), np.inf)
    peers = control.singular_values_response(system, omega)
    assert np.abs(np.real(peers.frdata[:, 0]) / ours.sigma - 1).max() < 1e-6
    assert bc.sigma(system).peak == pytest.approx(ours.peak, rel=1e-7)


def test_signals_that_were_selected_are_those_meant():
    boom = bc.spray_boom(elements=6)
    for ins, outs in ((["actuator_left"], ["tip_left"]), (["cradle"], None), (None, ["stroke_left", "tip_left"])):
        asked = bc.sigma(boom, [1.0, 9.0], ins, outs)
        selected = bc.sigma(boom.select(ins, outs), [1.0, 9.0])
        np.testing.assert_array_equal(selected.sigma, asked.sigma)
        assert (selected.input_labels, selected.output_labels) == (asked.input_labels, asked.output_labels)


@pytest.mark.parametrize("excitation", ["velocity", "acceleration", "force"])
def test_integrating_modes_have_an_infinite_peak(excitation):
    assert bc.sigma(bc.spray_boom(excitation=excitation), [1.0]).peak == np.inf


@pytest.mark.parametrize("damping", [0.0, 0.1])
@pytest.mark.parametrize("shows", [0.0, 1e-15, 1e-9, 1e-6, 1e-3, 1.0])
@pytest.mark.parametrize("reads", [True, False])
def test_sigma_grid_avoids_undamped_modes(damping, shows, reads):
    """Two masses on springs, the second undamped; beside its resonance it is a known addition to the first one's."""
    read = shows if reads else 1.0
    model = SecondOrderModel(
        np.eye(2), np.diag([damping, 0.0]), np.diag([1.0, 4.0]), {"u": [1.0, shows]}, {"y": [1.0, read]}
    )
    result = bc.sigma(model)
    s = 1j * result.omega
    exact = np.abs(1.0 / (s**2 + damping * s + 1.0) + shows * read / (s**2 + 4.0))
    assert np.isfinite(result.sigma).all()
    assert (np.abs(result.omega - 2.0) < 1e-6).any()
    away = np.abs(result.omega[:, None] - [1.0, 2.0]).min(axis=1) > 1e-3
    assert result.sigma[0][away] == pytest.approx(exact[away], rel=1e-9)
    assert not damping or shows or result.peak == pytest.approx(1.0 / (0.1 * np.sqrt(1.0 - 0.0025)), rel=1e-6)


def of_mass(damping, stiffness=1.0):
    return SecondOrderModel([[1.0]], [[damping]], [[stiffness]], {"u": [1.0]}, {"y": [1.0]})


def loop():
    plant = control.ss([[-1.0]], [[1.0]], [[1.0]], 0.0, inputs=["u"], outputs=["y"])
    return bc.feedback_loop(plant, control.ss([], [], [], [[3.0]], inputs=["y"], outputs=["u"]), "u")


@pytest.mark.parametrize(
    ("system", "unstable"),
    [
        (loop(), True),
        (control.ss(np.diag([1.0, -1.0]), [[0.0], [1.0]], [[0.0, 1.0]], 0.0), True),  # does not show
        (of_mass(-0.1), True),
        (of_mass(0.1, -1.0), True),
        (of_mass(0.1), False),
        (of_mass(0.0), False),
        (of_mass(0.0).to_statespace(), False),
        (bc.spray_boom(elements=54), False),  # too large for the poles to be printed
    ],
)
@pytest.mark.parametrize("omega", [None, [0.5, 2.0]])
def test_picture_and_print_say_whether_system_is_unstable(system, unstable, omega):
    ax = new_figure().add_subplot()
    result = bc.sigma(system, omega)
    assert ("unstable" in repr(result)) == (not result.stable) == unstable
    result.plot(ax, label="mine")
    assert any("unstable" in text.get_text() for text in ax.texts) == unstable
    assert ({line.get_linestyle() for line in ax.lines} == {":"}) == unstable
    assert ax.get_legend().get_texts()[0].get_text() == ("mine (unstable)" if unstable else "mine")


def test_a_certified_peak_takes_few_calls():
    """What a small model costs is Python's calls: two eigenproblems of 28 x 28 take a tenth of them."""
    model, calls = bc.spray_boom(elements=6), []
    assert bc.sigma(model, [1.0]).certified  # what belongs to the model is there

    def look(frame, event, given):
        if event in ("call", "c_call"):
            calls.append(event)

    sys.setprofile(look)
    try:
        bc.sigma(model, [1.0]).peak  # noqa: B018
    finally:
        sys.setprofile(None)
    assert len(calls) < 1100  # some 900; of another numpy's wrappers a few more
