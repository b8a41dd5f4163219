"""Modes from records: those of the truth and no others, intervals that hold, models that predict, one line for bad input."""

import warnings

import control
import numpy as np
import pytest
from matplotlib.figure import Figure
from scipy import linalg, signal

import boomctl as bc
from boomctl.identification import MeasuredFrequencyResponse
from boomctl.identification.modal.common_poles import CommonPoles, fitted
from boomctl.identification.modal.spectra import Spectra
from boomctl.identification.record import Record
from boomctl.lab.benchmark.scenes.identification import BAND, frame_records
from boomctl.lab.benchmark.scenes.identification import STEP as STEP_OF_FRAME
from boomctl.structure import SecondOrderModel
from tests.identification.chain import response_of_record, three_masses
from tests.identification.test_response import STEP, noise
from tests.profiles import is_hunt


def poles_of(model, top_hz=np.inf):
    """Return the poles with positive imaginary part, by frequency."""
    poles = np.linalg.eigvals(model.to_statespace().A)
    poles = poles[(poles.imag > 0.0) & (poles.imag < 2.0 * np.pi * top_hz)]
    return poles[np.argsort(poles.imag)]


def driven(model, count, seed, errors=0.0, top_hz=12.0, step=STEP):
    """Return a record of a structure that has been driven for long."""
    scale = step / STEP
    u = noise(2 * count, len(model.input_labels), top_hz * scale, seed)
    y = response_of_record(model, u, step)[count:]
    rng = np.random.default_rng(seed + 1)
    return u[count:], y + errors * y.std(axis=0) * rng.standard_normal(y.shape)


def errors_of(found, poles):
    """Return relative errors of frequencies and dampings."""
    assert len(found.modes) == len(poles)
    hz = np.array([mode.frequency_hz for mode in found.modes]) / (poles.imag / (2.0 * np.pi)) - 1.0
    return np.abs(hz), np.abs(
        np.array([mode.damping_ratio for mode in found.modes]) / (-poles.real / np.abs(poles)) - 1.0
    )


@pytest.fixture(scope="module")
def chain():
    model = three_masses(0.01)
    u, y = driven(model, 5000, seed=3, errors=0.02)
    return model, u, y, bc.identify(u, y, STEP)


def test_the_modes_are_those_of_the_truth(chain):
    model, _, _, found = chain
    frequencies, dampings = errors_of(found, poles_of(model))
    assert frequencies.max() < 2e-4
    assert dampings.max() < 0.02
    assert sum(mode.energy_fraction for mode in found.modes) == pytest.approx(1.0, abs=1e-3)
    assert min(mode.stabilization for mode in found.modes) > 0.5


def test_system_and_structure_answer_as_the_truth(chain):
    model, _, _, found = chain
    omega = 2.0 * np.pi * np.linspace(1.0, 10.0, 300)
    exact = model.frequency_response(omega).frdata
    assert found.system.input_labels == ["in_1", "in_2"]
    size = np.linalg.norm(exact, ord=2, axis=(0, 1))
    for answer in (found.system(1j * omega), found.model.frequency_response(omega).frdata):
        assert (np.linalg.norm(answer - exact, ord=2, axis=(0, 1)) < 0.02 * size.max() * 0.1 + 0.05 * size).all()
    assert found.model.eigenfrequencies_hz(3) == pytest.approx(model.eigenfrequencies_hz(3), rel=2e-4)
    assert found.system.nstates == 6  # nothing moves outside the band


def test_what_is_held_back_is_predicted_but_for_its_errors(chain):
    _, _, _, found = chain
    # errors of 2 % are white up to 25 Hz, and half of their power lies within the band up to 12 Hz
    assert all(fit == pytest.approx(100.0 - 2.0 * np.sqrt(12.0 / 25.0), abs=0.2) for fit in found.fit_percent.values())
    assert min(found.whiteness_p_value.values()) > 1e-4


def test_shapes_are_those_of_the_structure(chain):
    model, _, _, found = chain
    shapes = linalg.eigh(model.K, model.M)[1]
    for k, mode in enumerate(found.modes):
        exact = shapes[:, k] / shapes[np.argmax(np.abs(shapes[:, k])), k]
        assert np.abs(mode.shape - exact).max() < 0.02


@pytest.mark.slow
def test_exact_records_give_exact_modes():
    """Held inputs from rest, without errors: discrete motion and free motions are exact, whatever the damping."""
    model = three_masses(0.02)
    plant = model.to_statespace()
    u = np.random.default_rng(5).standard_normal((3000, 2))
    discrete = signal.cont2discrete((plant.A, plant.B, plant.C, plant.D), STEP)
    y = signal.dlsim(discrete, u)[1]
    found = bc.identify(u, y, STEP, intersample="zoh", frequency_range_hz=(0.0, 20.0))
    frequencies, dampings = errors_of(found, poles_of(model))
    assert frequencies.max() < 1e-6
    assert dampings.max() < 1e-4
    assert min(found.fit_percent.values()) > 99.99


@pytest.mark.slow
def test_identify_mode_not_aliased():
    """Of held inputs both answer alike: what is found above the band lies in none."""
    omega, damping = 2.0 * np.pi * np.array([4.0, 36.0]), np.array([0.005, 0.04])
    columns = {"f": [1.0, 1.0]}, {"y": [1.0, 1.0]}
    plant = SecondOrderModel(np.eye(2), np.diag(2.0 * damping * omega), np.diag(omega**2), *columns).to_statespace()
    discrete = signal.cont2discrete((plant.A, plant.B, plant.C, plant.D), 0.01)
    for seed in range(6):
        rng = np.random.default_rng(seed)
        u = rng.standard_normal((1500, 1))
        y = signal.dlsim(discrete, u)[1]
        y += 0.01 * y.std() * rng.standard_normal(y.shape)
        found = bc.identify(u, y, 0.01, intersample="zoh")
        assert [mode.frequency_hz for mode in found.modes] == pytest.approx([4.0, 36.0], rel=0.01)


@pytest.mark.parametrize("seed", range(12))
def test_a_pole_too_fast_to_be_told_stays_a_number(seed):
    u, y = np.random.default_rng(seed).standard_normal((2, 200, 2))
    data = Spectra.of_record(Record.of(u, y, 0.01, "displacement", "zoh"), 0.0, 50.0)
    for low in (0.0, 100.0, 200.0):
        around = data.within(low, low + 24.0 * data.resolution)
        assert np.isfinite(fitted(CommonPoles(around, np.array([-2000.0 + 1j * (low + 1.0)]), np.zeros(0))).poles).all()


@pytest.mark.parametrize("quantity", [pytest.param("velocity", marks=pytest.mark.slow), "acceleration"])
def test_other_quantities_have_same_poles_and_structure(quantity):
    model, u, power = three_masses(0.01), noise(5000, 2, 12.0, seed=4), {"velocity": 1, "acceleration": 2}[quantity]
    y = response_of_record(model, u, STEP, power)
    y += 0.02 * y.std(axis=0) * np.random.default_rng(0).standard_normal(y.shape)
    found = bc.identify(u, y, STEP, quantity=quantity)
    frequencies, dampings = errors_of(found, poles_of(model))
    assert frequencies.max() < 5e-4
    assert dampings.max() < 0.05
    grid = 2.0 * np.pi * np.linspace(1.0, 9.0, 60)
    exact = model.frequency_response(grid).frdata * (1j * grid) ** power
    off = np.abs(found.model.frequency_response(grid).frdata - exact).max() / np.abs(exact).max()
    assert (found.model.ncoordinates, found.model.input_labels, found.model.output_labels) == (
        3,
        *(tuple(x) for x in (found.system.input_labels, found.system.output_labels)),
    )
    assert off < 0.02
    shapes = [shape / shape[np.argmax(np.abs(shape))] for shape in linalg.eigh(model.K, model.M)[1].T]
    assert all(np.abs(mode.shape - shape).max() < 0.05 for mode, shape in zip(found.modes, shapes, strict=True))


@pytest.mark.parametrize("damping", [0.002914805550677383, pytest.param(0.016040793121684927, marks=pytest.mark.slow)])
def test_exact_response_gives_exact_modes(damping):
    """Rounding errors are no mode."""
    model = three_masses(damping)
    exact = model.frequency_response(2.0 * np.pi * np.linspace(0.5, 10.0, 500))
    data = MeasuredFrequencyResponse(exact.omega / (2.0 * np.pi), np.zeros((2, 500)), ("", ""), exact.frdata)
    frequencies, dampings = errors_of(bc.identify(data), poles_of(model))
    assert frequencies.max() < 1e-8
    assert dampings.max() < 1e-6


def test_record_of_forced_response_has_one_mode():
    """Inputs run straight between samples, which neither assumption describes: what that leaves is no mode."""
    force, mass = np.random.default_rng(0).standard_normal(400), [[1.0]]
    model = SecondOrderModel(mass, [[0.2]], [[16.0]], {"force": [1.0]}, {"place": [1.0]})
    moved = bc.forced_response(model, 0.1 * np.arange(400), {"force": force})["place"]
    (mode,) = bc.identify(force, moved, 0.1, frequency_range_hz=(0.1, 2.5)).modes
    assert mode.frequency_hz == pytest.approx(4.0 * np.sqrt(1.0 - 0.025**2) / (2.0 * np.pi), rel=1e-5)
    assert mode.damping_ratio == pytest.approx(0.025, rel=1e-3)


@pytest.mark.parametrize("errors", [None, pytest.param("absolute", marks=pytest.mark.slow)])
def test_errors_that_grow_with_a_measured_response_show_no_modes(chain, errors):
    model, omega, rng = chain[0], 2.0 * np.pi * np.linspace(0.5, 10.0, 600), np.random.default_rng(0)
    exact = model.frequency_response(omega).frdata
    size = np.abs(exact) if errors is None else np.sqrt(np.square(np.abs(exact)).mean(axis=2, keepdims=True))
    noise = (rng.standard_normal((2, *exact.shape)).T @ [1.0, 1.0j]).T * size
    measured = control.FrequencyResponseData(exact + 0.01 * noise, omega)
    found = bc.identify(measured, error_model=errors)
    frequencies, dampings = errors_of(found, poles_of(model))
    assert len(found.modes) == len(poles_of(model))
    assert frequencies.max() < 1e-3
    assert dampings.max() < 0.05
    assert found.uncertainty_source.endswith(f"errors assumed {errors or 'relative'}")


@pytest.mark.parametrize(
    "drift", ["ramp", *(pytest.param(name, marks=pytest.mark.slow) for name in ("settling", "swing"))]
)
def test_a_drift_is_no_mode(chain, drift):
    model, u, y, plain = chain
    u, y = u[:2500], y[:2500]
    along = np.linspace(0.0, 1.0, len(y))[:, None]
    shape = {"ramp": 2.0 * along, "settling": 1.0 - np.exp(-6.0 * along), "swing": np.sin(4.4 * along)}[drift]
    found = bc.identify(u, y + y.std(axis=0) * shape, STEP)
    assert len(found.modes) == len(plain.modes)
    frequencies, dampings = errors_of(found, poles_of(model))
    assert frequencies.max() < 1e-3
    assert dampings.max() < 0.05


def test_several_records_are_one_identification(chain):
    model, u, y, _ = chain
    parts = [slice(0, 2000), slice(2500, 5000)]
    found = bc.identify([u[part] for part in parts], [y[part] for part in parts], STEP)
    frequencies, dampings = errors_of(found, poles_of(model))
    assert frequencies.max() < 5e-4
    assert dampings.max() < 0.03


@pytest.mark.slow
def test_feedback_in_the_record_is_said(chain):
    model, _, _, _ = chain
    plant = model.select("f1", "y1").to_statespace()
    discrete = signal.cont2discrete((plant.A, plant.B, plant.C, plant.D), STEP)[:4]
    rng = np.random.default_rng(0)
    x, u, y = np.zeros(6), np.zeros(4000), np.zeros(4000)
    for k in range(4000):
        y[k] = (discrete[2] @ x)[0] + 0.3e-3 * rng.standard_normal()
        u[k] = 0.2 * rng.standard_normal() + (250.0 * (y[k - 4] if k > 3 else 0.0))
        x = discrete[0] @ x + discrete[1][:, 0] * u[k]
    with pytest.warns(UserWarning, match="closed loop"):
        bc.identify(u, y, STEP, intersample="zoh", frequency_range_hz=(0.0, 20.0))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        bc.identify(*driven(model, 3000, seed=1, errors=0.1), STEP)


@pytest.mark.slow
def test_the_spray_boom_from_ten_minutes():
    """Frequencies below 5 Hz to 0.1 %, dampings to 5 %; the mode of 19 % damping to 1 % and 10 %."""
    boom = bc.spray_boom().select(["actuator_left", "actuator_right"], ["tip_left", "tip_right"])
    u, y = driven(boom, 30000, seed=0, errors=0.01, top_hz=6.0)
    found = bc.identify(u, y, STEP)
    frequencies, dampings = errors_of(found, poles_of(boom, top_hz=5.0))
    wide = np.array([mode.damping_ratio > 0.1 for mode in found.modes])
    assert wide.sum() == 1
    assert (frequencies < np.where(wide, 0.01, 0.001)).all()
    assert (dampings < np.where(wide, 0.1, 0.05)).all()


def twin(seed):
    """Return a record of a random structure, its poles and their shares, how large the errors are, and its slowest periods.

    Every second one has modes 1 % apart, every third one is quantized, of every fourth one errors are colored.
    """
    rng = np.random.default_rng(seed)
    modes, inputs = int(rng.integers(2, 9)), int(rng.integers(1, 4))
    outputs = int(rng.integers(inputs, 9))
    hz = rng.uniform(3.0, 38.0, modes)
    if seed % 2 == 0:
        hz[1] = 1.01 * hz[0]
    hz = np.sort(hz)
    damping = 10.0 ** rng.uniform(np.log10(5e-4), np.log10(0.05), modes)
    count = int(np.clip(10.0 ** rng.uniform(np.log10(8.0), np.log10(600.0)) / hz[0] / 0.01, 1500, 20000))
    poles = 2.0 * np.pi * hz * (-damping + 1j * np.sqrt(1.0 - damping**2))
    b, c = rng.standard_normal((modes, inputs)), rng.standard_normal((modes, outputs))
    s = 2j * np.pi * np.fft.rfftfreq(2 * count, 0.01)[:, None]
    U = np.fft.rfft(rng.standard_normal((2 * count, inputs)), axis=0) * (s.imag < 2.0 * np.pi * 45.0)
    parts = (np.square(np.abs(poles)) / ((s - poles) * (s - poles.conj())) * (U @ b.T))[:, :, None] * c
    energy = np.square(np.abs(parts)).sum(axis=0)
    u, y = (np.fft.irfft(each, axis=0)[count:] for each in (U, parts.sum(axis=1)))
    errors, white = 10.0 ** rng.uniform(-3.0, np.log10(0.3)), rng.standard_normal(y.shape)
    drawn = 0.6 * signal.lfilter([1.0], [1.0, -0.8], white, axis=0) if seed % 4 == 1 else white
    y = y + errors * y.std(axis=0) * drawn
    if seed % 3 == 0:
        step = y.std(axis=0) * 10.0 ** rng.uniform(-3.0, -1.0)
        y, errors = step * np.round(y / step), np.hypot(errors, (step / y.std(axis=0)).max() / np.sqrt(12.0))
    return u, y, poles, (energy / energy.sum(axis=0)).mean(axis=1), errors, count * 0.01 * hz[0]


@pytest.mark.slow
def test_identify_intervals_of_random_systems():
    """Errors of 0.1 to 30 %, white and colored, dampings of 0.05 to 5 %, modes 1 % apart, 8 to 600 periods, quantized."""
    held, false = [], 0
    seeds = range(200) if is_hunt() else [*range(60), 169, 192]  # a weak mode near a strong one; a weak pair 1 % apart
    for seed in seeds:
        u, y, poles, shares, errors, periods = twin(seed)
        modes = list(bc.identify(u, y, 0.01, frequency_range_hz=(0.5, 45.0)).modes)
        for pole, share in sorted(zip(poles, shares, strict=True), key=lambda each: -each[1]):
            hz, damping = pole.imag / (2.0 * np.pi), -pole.real / abs(pole)
            mode = min(modes, key=lambda each: abs(each.frequency_hz - hz), default=None)
            if mode is None or abs(mode.frequency_hz - hz) > max(0.02, 3.0 * damping) * hz:
                assert share < 0.01 or errors > 0.05 or periods < 100.0, (seed, hz)
                continue
            modes.remove(mode)
            (low, high), (least, most) = mode.frequency_interval_hz, mode.damping_ratio_interval
            held.append([low <= hz <= high, least <= damping <= most])
        false += bool(modes)
    assert (np.mean(held, axis=0) > 0.9).all()
    assert (np.mean(held, axis=0) < 0.98).all()
    assert false <= 0.05 * len(seeds)


def record_with_modes_outside(seed, band, outside):
    """Return inputs, outputs and poles in the band of a structure that has modes of equal strength outside it."""
    rng, count, quantity = np.random.default_rng(seed), 5000, seed % 3
    hz = np.linspace(*band, 5)[:4] + rng.uniform(1.0, 6.0, 4)
    hz = np.r_[hz, [rng.uniform(*ends) for ends in outside]]
    damping = 10.0 ** rng.uniform(-2.5, -1.5, len(hz))
    poles = 2.0 * np.pi * hz * (-damping + 1j * np.sqrt(1.0 - damping**2))
    b, c = rng.standard_normal((len(hz), 1 + seed % 2)), rng.standard_normal((len(hz), 3))
    s = 2j * np.pi * np.fft.rfftfreq(2 * count, 0.01)[:, None]
    U = np.fft.rfft(rng.standard_normal((2 * count, b.shape[1])), axis=0) * (s.imag < 2.0 * np.pi * 48.0)
    modal = np.abs(poles) ** (2 - quantity) * s**quantity / ((s - poles) * (s - poles.conj()))
    u, y = (np.fft.irfft(each, axis=0)[count:] for each in (U, (modal * (U @ b.T)) @ c))
    return u, y + 0.03 * y.std(axis=0) * rng.standard_normal(y.shape), poles[:4]


@pytest.mark.slow
@pytest.mark.parametrize("outside", [[(30.6, 38.0)], [(1.0, 1.95)], [(30.6, 38.0), (1.0, 1.95)]])
def test_identify_intervals_with_strong_modes_just_outside_the_band(outside):
    held, band = [], (2.0, 30.0)
    for seed in range(40):
        u, y, poles = record_with_modes_outside(seed, band, outside)
        quantity = ("displacement", "velocity", "acceleration")[seed % 3]
        found = bc.identify(u, y, 0.01, frequency_range_hz=band, quantity=quantity, intersample="bl")
        for pole in poles:
            mode = min(found.modes, key=lambda each: abs(each.frequency_hz - pole.imag / (2.0 * np.pi)))
            (low, high), (least, most) = mode.frequency_interval_hz, mode.damping_ratio_interval
            held.append([low <= pole.imag / (2.0 * np.pi) <= high, least <= -pole.real / abs(pole) <= most])
    assert (np.mean(held, axis=0) > 0.92).all()  # of 160, with 95 % expected


@pytest.mark.slow
def test_what_has_no_modes_is_said_in_one_line(chain):
    _, u, y, _ = chain
    rng = np.random.default_rng(0)
    rates = np.fft.irfft(2j * np.pi * np.fft.rfftfreq(len(u), STEP)[:, None] * np.fft.rfft(u, axis=0), len(u), axis=0)
    for nothing in (rng.standard_normal(y.shape), rates @ rng.standard_normal((2, 3))):
        with pytest.raises(ValueError, match=r"expected 1 mode from .* got evidence of 0") as refused:
            bc.identify(u, nothing, STEP, intersample="bl")
        assert "\n" not in str(refused.value)
    with pytest.raises(ValueError, match=r"expected 5 modes from .* got evidence of 3"):
        bc.identify(u, y, STEP, modes=5)
    assert len(bc.identify(u, y, STEP, modes=2).modes) == 2


@pytest.mark.parametrize("kind", ["steps", "second-order noise"])
@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 2))])
def test_default_band_of_low_pass_inputs_has_the_mode(kind, seed):
    rng = np.random.default_rng(seed)
    hz, ratio = rng.uniform(2.0, 8.0), 0.01
    if kind == "steps":
        u = np.repeat(rng.standard_normal((4, 2)), 500, axis=0)
    else:
        u = signal.lfilter(*signal.butter(2, 0.02), rng.standard_normal((2000, 2)), axis=0)
    pole = 2.0 * np.pi * hz * (-ratio + 1j * np.sqrt(1.0 - ratio**2))
    b = rng.standard_normal(2) / 2j * np.expm1(pole * 0.01) / pole  # of a held input, over one sample
    y = 2.0 * signal.lfilter([0.0, 1.0], [1.0, -np.exp(0.01 * pole)], u @ b).real[:, None]
    y += 0.003 * y.std() * rng.standard_normal(y.shape)
    found = bc.identify(u, y, 0.01, intersample="zoh")
    assert [mode.frequency_hz for mode in found.modes] == pytest.approx([hz], rel=2e-3)


def test_the_picture_shows_modes_and_what_is_not_predicted(chain):
    _, _, _, found = chain
    stabilization, validation = found.plot(ax=Figure())
    hz = [line.get_xdata()[0] for line in stabilization.get_lines()[-3:]]
    assert hz == [mode.frequency_hz for mode in found.modes]
    measured, left = validation.get_lines()
    assert np.mean(left.get_ydata() ** 2) < 1e-3 * np.mean(measured.get_ydata() ** 2)
    assert str(found).count("%") >= 9


@pytest.mark.slow
def test_a_frame_of_28_accelerometers():
    """16 modes up to 490 Hz, 8,523 samples, 3 % errors: no mode more, none less, each output predicted to 94 %."""
    u, (y, *_), poles = frame_records(28)
    found = bc.identify(u, y, STEP_OF_FRAME, frequency_range_hz=BAND, quantity="acceleration")
    frequencies, dampings = errors_of(found, poles)
    assert frequencies.max() < 1e-3
    assert np.median(dampings) < 0.02
    assert min(found.fit_percent.values()) > 94.0
    assert found.system.nstates <= 40
