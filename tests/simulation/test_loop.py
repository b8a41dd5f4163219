"""Sampled loops: against loops stepped in physical coordinates, and by laws."""

import control as ct
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

import boomctl as bc
from boomctl.simulation.loop import simulate_loop
from boomctl.simulation.stepping import run_smooth
from tests.profiles import examples
from tests.simulation.cases import conditioning_gain, mass_on_spring, random_controller, random_plant, stepped_loop
from tests.strategies import seeds

_H = 0.05
_STROKES, _SUSPENSION = ["stroke_left", "stroke_right"], ["suspension_left", "suspension_right"]


def _scene(seed, points=140):
    rng = np.random.default_rng(seed)
    plant, law = random_plant(rng), random_controller(rng, _H)
    share = 0.5 / _loop_gain(plant, law)  # by small gain: a loop that saturates is then not chaotic
    law = ct.ss(law.A, law.B, share * law.C, share * law.D, _H, inputs=law.input_labels, outputs=law.output_labels)
    time = _H * np.arange(points)
    return plant, law, time, np.cumsum(rng.standard_normal(points)) * 0.5


def _loop_gain(plant, law):
    omega = np.linspace(1e-3, np.pi / _H, 200)
    sampled = ct.sample_system(plant, _H, "zoh")[: law.ninputs, 1:]
    size = [
        np.linalg.norm(np.moveaxis(system(np.exp(1j * omega * _H)), 2, 0), 2, axis=(1, 2)) for system in (sampled, law)
    ]
    return size[0].max() * size[1].max()


def _close(a, b, tolerance=1e-9):
    np.testing.assert_allclose(a, b, atol=tolerance * max(1.0, np.abs(b).max()))


@given(
    seed=seeds,
    share=st.sampled_from([np.inf, 0.3, 0.8]),
    slow=st.sampled_from([np.inf, 0.4]),
    delay=st.sampled_from([0.0, 0.4, 1.0, 2.7]),
)
@examples(40)
def test_the_loop_is_the_one_stepped_in_physical_coordinates(seed, share, slow, delay):
    plant, law, time, w = _scene(seed)
    free = stepped_loop(plant, law, w, _H)[1]
    limit, rate = share * np.abs(free).max(), slow * np.abs(np.diff(free)).max() / _H
    outputs, controls = stepped_loop(plant, law, w, _H, limit, rate, delay * _H)
    limits = {name: x for name, x in (("control_limit", limit), ("rate_limit", rate)) if x < np.inf}
    found = simulate_loop(plant, law, time, {"w": w}, sample_time=_H, delay=delay * _H, anti_windup=False, **limits)
    scale = max(1.0, np.abs(outputs).max())
    for name, values in zip(plant.output_labels, outputs, strict=True):
        np.testing.assert_allclose(found[name], values, atol=1e-8 * scale)
    late = int(np.ceil(delay - 1e-9))
    for k, name in enumerate(law.output_labels):
        acting = found.controls[name][late:-1]
        np.testing.assert_allclose(acting, controls[k][: len(time) - 1 - late], atol=1e-8 * scale)
        assert np.abs(found.controls[name]).max() <= limit
        assert np.abs(np.diff(found.controls[name])).max() <= rate * _H * (1.0 + 1e-12)


@pytest.mark.parametrize("quantized", [[], _STROKES[:1], _STROKES])
@pytest.mark.parametrize("delay", [0.0, 0.4e-2, 1e-2])
def test_stepping_in_blocks_changes_nothing(delay, quantized, monkeypatch):
    eye, time = np.eye(2), 1e-2 * np.arange(1500)
    law = ct.ss(-6.0 * eye, 6.0 * eye, 150.0 * eye, -300.0 * eye, inputs=_STROKES, outputs=_SUSPENSION)
    platform = {"actuator_left": 0.01 * np.sin(3.0 * time), "actuator_right": 0.01 * np.sin(2.0 * time)}
    options = {"sample_time": 1e-2, "delay": delay, "control_limit": 1.0, "rate_limit": 10.0}
    options["quantization"] = dict.fromkeys(quantized, 1e-3)
    monkeypatch.setattr("boomctl.simulation.blocks.STORED", 1000)
    found = simulate_loop(bc.spray_boom(elements=6), law, time, platform, **options)
    monkeypatch.setattr("boomctl.simulation.loop.run_fast", run_smooth)
    slow = simulate_loop(bc.spray_boom(elements=6), law, time, platform, **options)
    assert found.method == ("steps" if quantized else "blocks")
    for kind in ("outputs", "controls", "commanded"):
        for name, values in getattr(slow, kind).items():
            _close(getattr(found, kind)[name], values)
    assert (found.saturation_fraction, found.rate_limit_fraction) == (
        slow.saturation_fraction,
        slow.rate_limit_fraction,
    )
    assert min(found.saturation_fraction.values()) > 0.01
    assert max(found.rate_limit_fraction.values()) > 0.01


@given(
    seed=seeds,
    delay=st.sampled_from([0.0, 0.4, 1.0, 2.7]),
    shared=st.booleans(),
    power=st.sampled_from([0.0, 0.7, 1.5]),
)
@example(seed=3, delay=0.4, shared=False, power=1.5)
@examples(60)
def test_the_loop_that_is_run_is_the_loop_that_is_analyzed(seed, delay, shared, power):
    """Both queues hold what is on its way; the one that is run has also the controls given last, which nothing need feel.

    A loop that grows says so.
    """
    plant, weak, time, _ = _scene(seed, 21)
    law = ct.ss(10.0**power * weak, inputs=weak.input_labels, outputs=weak.output_labels)
    if shared:  # a control that an output feels at once
        plant.D[-1, 1] = 0.5
    run = simulate_loop(plant, law, time, None, sample_time=_H, delay=delay * _H)
    poles = np.linalg.eigvals(run._sampled), bc.feedback_loop(plant, law, delay=delay * _H).poles()
    radius = np.abs(poles[1]).max()
    if abs(radius - 1.0) > 1e-6:
        assert ("unstable" in repr(run)) == ("unstable" in run.message) == (not run.success) == (radius > 1.0)
    ours, theirs = (np.poly(each) for each in poles)
    more = len(ours) - len(theirs)
    assert more in (0, law.noutputs, law.noutputs - 1)
    _close(ours, np.append(theirs, np.zeros(more)))


@given(seed=seeds, ratios=st.tuples(*(st.floats(1e-2, 1e2) for _ in range(3))))
@examples(20)
def test_units_do_not_matter(seed, ratios):
    plant, law, time, w = _scene(seed)
    given_as, forces, lengths = ratios
    ins, outs = np.diag([given_as, forces, forces]), np.diag([lengths] * 3)
    other = ct.ss(outs * plant * np.linalg.inv(ins), inputs=plant.input_labels, outputs=plant.output_labels)
    labels = {"inputs": law.input_labels, "outputs": law.output_labels}
    scaled = ct.ss(law.A, law.B / lengths, law.C * forces, law.D * forces / lengths, _H, **labels)
    plain = simulate_loop(plant, law, time, {"w": w}, sample_time=_H, control_limit=0.5)
    found = simulate_loop(other, scaled, time, {"w": given_as * w}, sample_time=_H, control_limit=0.5 * forces)
    for name, values in plain.outputs.items():
        np.testing.assert_allclose(found[name] / lengths, values, atol=1e-6 * max(1.0, np.abs(values).max()))


def test_measurements_are_rounded_to_their_steps():
    plant, _, time, w = _scene(7)
    gain = ct.ss([], [], [], [[2.0]], _H, inputs=["y0"], outputs=["u0"])
    found = simulate_loop(plant, gain, time, {"w": w}, sample_time=_H, quantization={"y0": 0.25})
    steps = found.commanded["u0"][:-1] / 0.5
    np.testing.assert_allclose(steps, np.rint(steps), atol=1e-9)
    assert np.abs(found.commanded["u0"][:-1] - 2.0 * found["y0"][:-1]).max() <= 0.25 + 1e-9
    assert np.abs(found.commanded["u0"]).max() > 0.0


@given(seed=seeds)
@examples(15)
def test_anti_windup_does_nothing_while_no_limit_is_met(seed):
    plant, law, time, w = _scene(seed)
    plain = simulate_loop(plant, law, time, {"w": w}, sample_time=_H)
    most = 1.01 * max(np.abs(values).max() for values in plain.commanded.values())
    with_it, without = (
        simulate_loop(plant, law, time, {"w": w}, sample_time=_H, control_limit=most, anti_windup=chosen)
        for chosen in (True, False)
    )
    for name, values in plain.outputs.items():
        np.testing.assert_array_equal(with_it[name], without[name])
        _close(with_it[name], values)


@pytest.mark.parametrize(
    ("rate", "law", "wound", "share", "jump"),
    [
        (-0.2, ct.ss([[0.0]], [[1.0]], [[-2.0]], [[-2.0]]), -2.0, 0.25, 0.11),
        (-0.5, ct.tf2ss([-8.0], [1.0, 4.0, 1e-3]), -1.0, 0.5, 0.1),
    ],
    ids=["integrator", "roll-off"],
)
def test_anti_windup_keeps_what_was_saturated_from_overshooting(rate, law, wound, share, jump):
    """A zero of the controller at the sampling rate must not make the correction ring."""
    plant = ct.ss([[rate]], [[1.0, 1.0]], [[1.0]], 0.0, inputs=["w", "u"], outputs=["y"])
    law = ct.ss(law, inputs=["y"], outputs=["u"])
    time = 0.02 * np.arange(2000)
    w = np.where(time < 10.0, 3.0, 0.0)
    with_it, without = (
        simulate_loop(plant, law, time, {"w": w}, sample_time=0.02, control_limit=1.0, anti_windup=chosen)
        for chosen in (True, False)
    )
    after = time > 10.0
    assert without["y"][after].min() < wound
    assert with_it["y"][after].min() > share * without["y"][after].min()
    assert np.abs(np.diff(with_it.commanded["u"][after])).max() < jump


def test_anti_windup_gain_matches_hanus():
    rng = np.random.default_rng(2)
    A, B, C = 0.3 * np.eye(2), rng.standard_normal((2, 2)), 0.1 * rng.standard_normal((2, 2))
    D = 2.0 * np.eye(2)
    assert np.abs(np.linalg.eigvals(A - B @ np.linalg.inv(D) @ C)).max() < 1.0
    np.testing.assert_allclose(conditioning_gain(A, B, C, D, softening=0.0), B @ np.linalg.inv(D), atol=1e-6)


def test_the_result_is_a_named_time_response():
    plant, law, time, w = _scene(1)
    response = simulate_loop(plant, law, time, {"w": w}, sample_time=_H).response
    assert isinstance(response, ct.TimeResponseData)
    assert response.output_labels == plant.output_labels
    assert response.input_labels == ["w", "u0", "u1"]
    np.testing.assert_array_equal(response.inputs[0].ravel(), w)


def test_an_open_loop_takes_an_array():
    time = np.linspace(0.0, 2.0, 101)
    by_name = simulate_loop(mass_on_spring(), None, time, {"f": np.sin(time)}, sample_time=0.02)
    by_row = simulate_loop(mass_on_spring(), None, time, np.sin(time), sample_time=0.02)
    np.testing.assert_array_equal(by_name["x"], by_row["x"])


@pytest.mark.parametrize("share", [0.0, 0.5, 1.0, 1.5])
def test_delay_of_a_plant_without_states(share):
    plant = ct.ss([], [], [], [[1.0, 1.0]], inputs=["u", "d"], outputs=["y"])
    law = ct.ss([], [], [], [[-0.5]], 0.01, inputs=["y"], outputs=["u"])
    time = 0.01 * np.arange(8)
    found = simulate_loop(plant, law, time, {"d": np.ones(8)}, sample_time=0.01, delay=share * 0.01)
    late, whole = int(np.ceil(share)), int(share)
    given, before = [], 0.0
    for k in range(8):
        given.append(-0.5 * (1.0 + before))
        before = given[k - whole] if k >= whole else 0.0
    np.testing.assert_allclose(found.controls["u"], [0.0] * late + given[: 8 - late], atol=1e-15)


@pytest.mark.parametrize("per_sample", [2, *(pytest.param(count, marks=pytest.mark.slow) for count in (1, 3))])
@pytest.mark.parametrize(
    "limits", [{}, {"control_limit": 0.3}, {"quantization": 1e-6}, {"end_stop": {"x": (9.0, "u")}}]
)
def test_more_points_change_nothing_at_those_before(per_sample, limits):
    """The controller is sampled at the last time as well, when a sample falls on it."""
    A, B = [[0.0, 1.0], [-40.0, -2.0]], [[0.0, 0.0], [1.0, 1.0]]
    plant = ct.ss(A, B, [[1.0, 0.0], [-40.0, -2.0]], [[0.0, 0.0], [1.0, 1.0]], inputs=["u", "d"], outputs=["x", "a"])
    h = 0.01
    law = ct.ss(0.5, 1.0, [[-9.0]], [[-20.0]], per_sample * h, inputs=["x"], outputs=["u"])
    whole = 1 + 6 * 32
    pushed = 2.0 * np.sin(5.0 * h * np.arange(whole)) + 1.0

    def run(count):
        time = h * np.arange(count)
        return simulate_loop(plant, law, time, {"d": pushed[:count]}, sample_time=per_sample * h, **limits)

    full = run(whole)
    for count in (2, 3, 4, 64, 65, 66, 95, 96, 97, 98, 128, 129, 130):
        part = run(count)
        for name in ("x", "a"):
            np.testing.assert_allclose(part[name], full[name][:count], atol=1e-10)
        np.testing.assert_allclose(part.controls["u"], full.controls["u"][:count], atol=1e-8)
        np.testing.assert_allclose(part.commanded["u"], full.commanded["u"][:count], atol=1e-8)
