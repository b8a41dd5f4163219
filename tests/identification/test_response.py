"""Frequency responses of records: exact without noise, deviations that are those of the errors, one line for bad input."""

import os
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from scipy import signal
from scipy.io import loadmat

import boomctl as bc
from boomctl.identification.record import Record
from boomctl.identification.response import _intersample_of_outputs, with_intersample
from tests.identification.chain import response_of_record, three_masses
from tests.refusals import assert_refused, refusals

STEP = 0.02


def noise(count, inputs, top_hz, seed):
    """Return band-limited noise, (count, inputs)."""
    spectrum = np.fft.rfft(np.random.default_rng(seed).standard_normal((count, inputs)), axis=0)
    spectrum[np.fft.rfftfreq(count, STEP) > top_hz] = 0.0
    return np.fft.irfft(spectrum, count, axis=0)


@pytest.fixture(scope="module")
def driven():
    """Return three masses, noise that pushes two of them and where they are, long before the record began."""
    model = three_masses(0.03)
    u = noise(12000, 2, 12.0, seed=3)
    return model, u[4000:], response_of_record(model, u, STEP)[4000:]


def test_deviations_are_those_of_the_errors(driven):
    model, u, y = driven
    rng = np.random.default_rng(1)
    noisy = y + 0.1 * y.std(axis=0) * rng.standard_normal(y.shape)
    H = bc.estimate_frequency_response({"left": u[:, 0], "right": u[:, 1]}, noisy, STEP, frequency_range_hz=(0.5, 10.0))
    assert (H.input_labels, H.output_labels) == (["left", "right"], ["out_1", "out_2", "out_3"])
    exact = model.frequency_response(H.omega).frdata
    away = (H.frdata - exact) / H.deviation
    assert 0.85 < np.sqrt(np.mean(away.real**2)) < 1.3  # 1 but for bias beside resonances; some 1,000 numbers
    assert 0.85 < np.sqrt(np.mean(away.imag**2)) < 1.3
    assert H.coherence.min() >= 0.0
    assert H.coherence.max() <= 1.0


@pytest.mark.parametrize("damping", [0.05, 0.001])
def test_response_from_transient_record_is_exact(damping):
    """A record of noise on a decaying response to stronger excitation before it; resonances narrower than a line."""
    model = three_masses(damping)
    u = noise(3000, 2, 12.0, seed=5)
    y = response_of_record(model, np.vstack([20.0 * u, u]), STEP)[3000:]
    H = bc.estimate_frequency_response(u, y, STEP, frequency_range_hz=(0.5, 10.0))
    exact = model.frequency_response(H.omega).frdata
    size = np.abs(exact).max(axis=2, keepdims=True)
    assert np.abs((H.frdata - exact) / size).max() < 1e-3


def test_response_of_periods_exact_with_deviation():
    model, rng = three_masses(0.01), np.random.default_rng(2)
    one = [noise(1000, 2, 12.0, seed=k) for k in (1, 2)]
    u = [np.tile(each, (8, 1)) for each in one]
    y = [np.tile(response_of_record(model, each, STEP), (8, 1)) for each in one]
    H = bc.estimate_frequency_response(u, y, STEP, period=20.0)
    exact = model.frequency_response(H.omega).frdata
    assert np.abs(H.frdata / exact - 1.0).max() < 1e-9
    assert H.omega.max() / (2.0 * np.pi) == pytest.approx(12.0, abs=0.06)
    noisy = [each + 0.01 * each.std(axis=0) * rng.standard_normal(each.shape) for each in y]
    H = bc.estimate_frequency_response(u, noisy, STEP, period=20.0)
    away = (H.frdata - exact) / H.deviation
    assert 0.95 < np.sqrt(np.mean(np.abs(away) ** 2) / 2.0) < 1.15  # 1, with 14 degrees of freedom of each deviation


def impacts(seed, count, start, step=1e-3, length=2000, hits=1):
    """Return forces and displacements of impacts on a drawn structure, frequencies [Hz], dampings and the response.

    The first impact of a record is at about a time ``start``.  Convolution with modal impulse responses in steps of a
    sixteenth of a sample.
    """
    rng, fine = np.random.default_rng(seed), 16
    n = rng.integers(1, 4)
    hz = np.cumsum(rng.uniform(0.01, 0.05, n)) / step
    ratio, errors = 10.0 ** rng.uniform(-3.0, -1.5, n), 10.0 ** rng.uniform(-3.0, -1.7)
    poles = 2.0 * np.pi * hz * (1j - ratio / np.sqrt(1.0 - ratio**2))
    gains = np.r_[1.0, rng.uniform(0.3, 1.0, n - 1) * rng.choice([-1.0, 1.0], n - 1)]
    time = np.arange(length * fine) * step / fine
    u, y = [], []
    for _ in range(count):
        at = [start * rng.uniform(1.0, 1.2), *(length * step * rng.uniform(0.05, 0.9, hits - 1))]
        force = np.sum([np.exp(-0.5 * ((time - t) / step / rng.uniform(1.1, 1.6)) ** 2) for t in at], axis=0)
        modal = [signal.lfilter([0.5], [1.0, -np.exp(p * step / fine)], force)[::fine].imag for p in poles]
        moved = step / fine * 2.0 * gains @ np.array(modal)
        u.append(force[::fine])
        y.append(moved + errors * moved.std() * rng.standard_normal(length))

    def response(omega):
        s = 1j * omega[:, None]
        return (gains * poles.imag / ((s - poles) * (s - poles.conj()))).sum(axis=1)

    return (u, y, step) if count > 1 else (u[0], y[0], step), hz, ratio, response


def nearest_modes(found, hz):
    """Return the identified mode nearest to each frequency."""
    return [min(found.modes, key=lambda mode: abs(mode.frequency_hz - f)) for f in hz]


def contained(modes, hz, ratio):
    """Return whether the intervals of modes contain frequencies and damping ratios, (2, modes)."""
    intervals = np.array([[mode.frequency_interval_hz, mode.damping_ratio_interval] for mode in modes])
    return ((intervals[..., 0] <= np.c_[hz, ratio]) & (np.c_[hz, ratio] <= intervals[..., 1])).T


@pytest.mark.parametrize(
    "seeds", [[1], pytest.param([0, *range(2, 104), 123], marks=pytest.mark.slow)], ids=["quick", "all"]
)
@pytest.mark.filterwarnings("ignore:intersample")  # half of an impact at the beginning is lost, and with it the lag
def test_impacts_give_modes_response_and_intervals(seeds):
    """Mode frequencies and dampings from the record and from its response; deviations and intervals hold."""
    within, scatter = [], []
    for seed in seeds:
        record, hz, ratio, response = impacts(seed, 1 + 2 * (seed % 3 == 0), (0.0, 0.007, 0.03)[seed % 4 % 3])
        H = bc.estimate_frequency_response(*record, intersample="bl", frequency_range_hz=(3.0, 200.0))
        if seed % 4 % 3:  # half of an impact at the beginning is lost, which the response shows
            scatter.append(np.abs(H.frdata[0, 0] - response(H.omega)) / H.deviation[0, 0] / np.sqrt(2.0))
        for found in (bc.identify(*record, intersample="bl", frequency_range_hz=(3.0, 200.0)), bc.identify(H)):
            nearest = nearest_modes(found, hz)
            assert [mode.frequency_hz for mode in nearest] == pytest.approx(hz, rel=2e-3)
            assert [mode.damping_ratio for mode in nearest] == pytest.approx(ratio, rel=0.1)
            within.append(contained(nearest, hz, ratio))
    assert 0.6 < np.sqrt(np.mean(np.square(np.concatenate(scatter)))) < 1.3
    assert (np.concatenate(within, axis=1).mean(axis=1) >= 0.9).all()


@pytest.mark.parametrize("seeds", [[44], pytest.param(range(60), marks=pytest.mark.slow)], ids=["quick", "all"])
def test_long_impact_records_give_modes_and_intervals(seeds):
    """Records of 10 to 40 s, most of them at rest, of two to four impacts; the last one may be in the part held back."""
    within = []
    for seed in seeds:
        rng = np.random.default_rng([seed, 7])
        length, hits = int(rng.integers(2000, 8000)), int(rng.integers(2, 5))
        record, hz, ratio, _ = impacts(seed, 1, (0.035, 0.5)[seed % 2], 0.005, length, hits)
        nearest = nearest_modes(bc.identify(*record, intersample="bl", frequency_range_hz=(0.6, 40.0)), hz)
        assert [mode.frequency_hz for mode in nearest] == pytest.approx(hz, rel=2e-3)
        H = bc.estimate_frequency_response(*record, intersample="bl", frequency_range_hz=(0.6, 40.0))
        within.append(contained(nearest_modes(bc.identify(H), hz), hz, ratio))
    assert (np.concatenate(within, axis=1).mean(axis=1) >= 0.9).all()


@pytest.mark.slow
def test_response_of_record_identification_is_that_of_record(driven):
    u, y = driven[1][:3000], driven[2][:3000, :1]
    H = bc.estimate_frequency_response(u, y, STEP, frequency_range_hz=(0.5, 10.0))
    frequency_range_hz = tuple(H.omega[[0, -1]] / (2.0 * np.pi))
    modes = bc.identify(
        u, y, STEP, frequency_range_hz=frequency_range_hz, intersample="bl", validation_fraction=0.0
    ).modes
    assert repr(bc.identify(H).modes) == repr(modes)
    with pytest.raises(ValueError, match="read-only"):
        H.frdata[0] *= 2.0
    doubled = bc.identify(2.0 * H, quantity="displacement")  # other data, which has no record
    assert [mode.frequency_hz for mode in doubled.modes] == pytest.approx([m.frequency_hz for m in modes], rel=1e-2)


@pytest.mark.parametrize("top_hz", [12.0, pytest.param(25.0, marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    "quantity",
    [
        "acceleration",
        pytest.param("displacement", marks=pytest.mark.slow),
        pytest.param("velocity", marks=pytest.mark.slow),
    ],
)
@pytest.mark.parametrize("intersample", ["bl", "zoh"])
def test_intersample_by_default_matches_record(intersample, quantity, top_hz):
    """Phase errors below one degree up to a third of the Nyquist frequency; the wrong one warned of."""
    plant = three_masses(0.01).to_statespace()
    A, B, C = plant.A, plant.B[:, :1], plant.C[-1:]
    D = np.zeros((1, 1))
    for _ in range(["displacement", "velocity", "acceleration"].index(quantity)):
        C, D = C @ A, C @ B
    force = noise(24000, 1, top_hz, seed=4)
    omega = 2.0 * np.pi * np.fft.rfftfreq(24000, STEP)

    def exact(omega):
        return (C @ np.linalg.solve(1j * omega[:, None, None] * np.eye(len(A)) - A, B) + D)[:, 0, 0]

    if intersample == "zoh":
        y = signal.dlsim(signal.cont2discrete((A, B, C, D), STEP), force)[1][4000:, 0]
    else:
        y = np.fft.irfft(exact(omega) * np.fft.rfft(force[:, 0]), 24000)[4000:]
    u = force[4000:, 0]
    H = bc.estimate_frequency_response(u, y, STEP, quantity=quantity, frequency_range_hz=(0.5, 25.0 / 3.0))
    phase = np.angle(H.frdata[0, 0] / exact(H.omega), deg=True)
    assert np.median(np.abs(phase)) < 1.0
    wrong = {"bl": "zoh", "zoh": "bl"}[intersample]
    with pytest.warns(UserWarning, match=f"intersample = '{wrong}': .* indicates '{intersample}'"):
        bc.estimate_frequency_response(u, y, STEP, quantity=quantity, intersample=wrong, frequency_range_hz=(0.5, 8.0))


@pytest.mark.slow
def test_intersample_of_drawn_structures_is_never_wrong():
    rng = np.random.default_rng(7)
    clear = 0
    for case in range(300):
        count, length = rng.integers(1, 4), int(rng.choice([500, 2000, 6000]))
        omega, ratio = 2.0 * np.pi * rng.uniform(1.0, 15.0, count), 10.0 ** rng.uniform(-3.0, -1.3, count)
        poles = omega * (-ratio + 1j * np.sqrt(1.0 - ratio**2))
        gains = rng.standard_normal(count) / poles.imag
        u = noise(3 * length, 1, rng.choice([12.5, 20.0, 23.75]), seed=case)[:, 0]
        s = 2j * np.pi * np.fft.rfftfreq(3 * length, STEP)[:, None]
        z = np.exp(s * STEP)
        if case % 2:  # residues 1 / 2j of real modes, their responses over a step in closed form
            parts = gains / 2j * np.expm1(poles * STEP) / poles / (z - np.exp(poles * STEP))
            other = -gains / 2j * np.expm1(poles.conj() * STEP) / poles.conj() / (z - np.exp(poles.conj() * STEP))
        else:
            parts, other = gains / 2j / (s - poles), -gains / 2j / (s - poles.conj())
        y = np.fft.irfft((parts + other).sum(axis=1) * np.fft.rfft(u), 3 * length)[length:]
        y += rng.choice([0.01, 0.03, 0.1]) * y.std() * rng.standard_normal(len(y))
        record = Record.of(u[length:], y, STEP, "displacement", None)
        shown = _intersample_of_outputs(record)
        assert shown in (None, "zoh" if case % 2 else "bl")
        clear += shown is not None
    assert clear > 225


@pytest.mark.parametrize("held", [1, 5, 20])
def test_intersample_of_stepped_inputs_is_zoh(held):
    """Outputs of pure noise show nothing: a computed sequence held over one or several samples."""
    rng = np.random.default_rng(held)
    u = np.repeat(rng.standard_normal(4000 // held), held)
    record = with_intersample(Record.of(u, rng.standard_normal(len(u)), STEP, "displacement", None), 25.0)
    assert record.intersample == "zoh"


def test_intersample_of_filtered_input_and_noise_is_asked():
    rng = np.random.default_rng(0)
    u, y = noise(4000, 1, 10.0, seed=1), rng.standard_normal(4000)
    with pytest.warns(UserWarning, match="give intersample"):
        assert with_intersample(Record.of(u, y, STEP, "displacement", None), 10.0).intersample == "bl"
    with_intersample(Record.of(u, y, STEP, "displacement", None), 0.2)  # below one degree: no warning


RECORDS = os.environ.get("BOOMCTL_RECORDS")


@pytest.mark.skipif(RECORDS is None, reason="BOOMCTL_RECORDS names no folder")
@pytest.mark.parametrize(
    ("file", "expected"),
    [
        pytest.param("steel_frame/flexibleStructure.mat", "bl", marks=pytest.mark.slow),
        *((f"ruler_robot/ruler_swept{k}.txt", "zoh") for k in range(1, 6)),
    ],
)
def test_intersample_of_measured_records_is_determined(file, expected):
    path = Path(RECORDS or "") / file
    if path.suffix == ".mat":
        x = next(value for name, value in loadmat(path).items() if not name.startswith("_"))
        record = Record.of(x[:, :2], x[:, 2:], 1.0 / 1024.0, "acceleration", None)
    else:
        x = np.loadtxt(path)
        kinds = {"out_1": "displacement", "out_2": "acceleration"}
        record = Record.of(x[:, 3], x[:, 4:6], 1.0 / 500.0, kinds, None)
    assert with_intersample(record, 0.5 / record.step).intersample == expected


def record(**changed):
    """Estimate a response of a record of which something is changed."""
    return bc.estimate_frequency_response(**{"inputs": {"f": F}, "outputs": {"y": Y}, "sample_time": STEP} | changed)


RNG, T = np.random.default_rng(0), STEP * np.arange(500)
F, Y, GAP = RNG.standard_normal(500), np.sin(T) + 0.1 * RNG.standard_normal(500), (T < 4.0) | (T >= 6.0)
BAD = r"""
record(outputs=Y[:-1]) -> outputs: expected 500 samples, as inputs has, got 499
record(outputs={"y": Y, "z": Y[1:]}) -> outputs: expected 500 samples of 'z', got 499
record(inputs=np.ones(500)) -> inputs: expected signals that vary, got 'in_1' constant at 1
record(inputs=F * GAP, outputs=Y * GAP) -> expected no gap, but every signal is constant from 4 to 5.98 s
record(outputs=np.minimum(Y, 0.8)) -> got 'out_1' saturated: .* samples at 0.8
record(inputs=np.column_stack([F, -2.0 * F])) -> linearly dependent inputs cannot be separated
record(inputs=F[:20], outputs=Y[:20]) -> expected at least 32 samples, got 20
record(inputs=np.random.default_rng(1).standard_normal((50, 6)), outputs=Y[:50])
    -> expected records of at least 64 samples for 6 inputs, got 50
record(inputs=F[None, :]) -> expected one row per sample, got shape \(1, 500\); is it transposed
record(frequency_range_hz=(1.0, 30.0)) -> frequency_range_hz = .*: expected at most 25 Hz
record(quantity={"x": "velocity"}) -> unknown output in quantity 'x'
record(outputs={"f": Y}) -> outputs: 'f' is the name of an input too
record(period=0.031) -> period = 0.031: expected a whole number of samples
record(period=6.0) -> expected at least two periods in each record, got 1
record(outputs=[np.c_[Y], np.c_[Y]]) -> outputs: expected as many records as inputs has, 1, got 2
record(period=2.0, resolution_hz=0.5) -> `resolution_hz` must be None with a period
"""


@refusals(BAD)
def test_bad_records_are_refused_in_one_line(call, words):
    assert_refused(call, words, globals())


def test_coarse_and_binary_signals_accepted():
    rng = np.random.default_rng(0)
    levels = np.sign(rng.standard_normal(2000))
    swinging = np.round(20.0 * np.sin(STEP * np.arange(2000) * 3.0)) + levels
    record = Record.of({"f": levels}, {"y": swinging}, STEP, "displacement", "zoh")
    assert np.allclose(record.y[0][:, 0], swinging - swinging.mean())


def test_response_plot_panels(driven):
    _, u, y = driven
    H = bc.estimate_frequency_response(u, y, STEP, frequency_range_hz=(0.5, 10.0))
    magnitude, phase, coherence = H.plot(ax=Figure(), color="#123456")
    assert (magnitude.get_xlabel(), coherence.get_xlabel()) == ("", "frequency [Hz]")
    assert len(magnitude.get_lines()) == len(magnitude.collections) == 6
    assert [line.get_color() for line in coherence.get_lines()] == ["#123456"] * 3
    assert np.allclose(magnitude.get_lines()[0].get_ydata(), np.abs(H.frdata[0, 0]))
    assert np.allclose(phase.get_lines()[0].get_ydata(), np.degrees(np.angle(H.frdata[0, 0])))
