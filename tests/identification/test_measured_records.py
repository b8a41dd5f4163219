"""Identification of measured records, of which the folder is in ``BOOMCTL_RECORDS``, and of simulated ones of their kinds."""

import gzip
import os
import warnings
from pathlib import Path

import control
import numpy as np
import pytest
from hypothesis import given
from scipy import io, signal

import boomctl as bc
from boomctl import tunable
from tests.profiles import examples
from tests.strategies import seeds

_STEP = 0.01


def _records():
    folder = os.environ.get("BOOMCTL_RECORDS")
    if not folder:
        pytest.skip("BOOMCTL_RECORDS is not set")
    return Path(folder)


def _free_run_percent(system, u, y, step, band, begin):
    """Return the fit in a band from a sample on, of the response of a system to the whole input, by NumPy alone."""
    w = 2j * np.pi * np.fft.rfftfreq(len(u), step)
    poles, V = np.linalg.eig(system.A)
    modal = np.fft.rfft(u, axis=0) @ np.linalg.solve(V, system.B).T / (w[:, None] - poles)
    predicted = np.fft.irfft(modal @ (system.C @ V).T + np.fft.rfft(u, axis=0) @ system.D.T, len(u), axis=0)
    error, reference = (y - predicted)[begin:-40], y[begin:-40] - y[begin:-40].mean(axis=0)
    hz = np.fft.rfftfreq(len(error), step)
    inside = (hz >= band[0]) & (hz <= band[1])
    sizes = [
        np.linalg.norm(np.fft.rfft(np.hanning(len(part))[:, None] * part, axis=0)[inside], axis=0)
        for part in (error, reference)
    ]
    return 100.0 * (1.0 - sizes[0] / sizes[1])


@pytest.mark.slow
def test_steel_frame_record_free_run_and_modes():
    found = io.loadmat(_records() / "steel_frame" / "flexibleStructure.mat")
    data = next(value for name, value in found.items() if not name.startswith("_"))
    data = data - data[:6000].mean(axis=0)
    u, y, step, band = data[:, :2], data[:, 2:], 1.0 / 1024.0, (5.0, 490.0)
    results = [
        bc.identify(u[:6000], y[:6000], step, frequency_range_hz=band, quantity="acceleration", order=order)
        for order in (40, 80)
    ]
    percent = _free_run_percent(results[0].system, u, y, step, band, 6000)
    assert percent.mean() > 96.3
    assert percent.min() > 93.9
    assert results[0].system.nstates <= 36
    assert 14 <= len(results[0].modes) <= 16
    frequencies = [[mode.frequency_hz for mode in result.modes] for result in results]
    assert frequencies[0] == pytest.approx(frequencies[1], rel=1e-5)
    for mode in results[0].modes:
        assert mode.damping_ratio_interval[1] < 4.0 * mode.damping_ratio_interval[0]
    held = _free_run_percent(results[0].system, u[:6000], y[:6000], step, band, 4200).mean()
    assert np.mean(list(results[0].fit_percent.values())) == pytest.approx(held, abs=1.0)


@pytest.mark.slow
def test_tower_records_share_modes():
    results = []
    for name in ("wn_01.dat.gz", "wn_02.dat.gz"):
        with gzip.open(_records() / "unison_tower" / name) as file:
            data = np.loadtxt(file)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # the first record predicts less than half of an output
            found = bc.identify(
                data[:, 1],
                data[:, 2:7],
                0.01,
                quantity="acceleration",
                frequency_range_hz=(0.3, 15.0),
                intersample="bl",
            )
        results.append(found)
    hz = [np.array([mode.frequency_hz for mode in result.modes]) for result in results]
    assert all(6 <= len(frequencies) <= 10 for frequencies in hz)
    assert sum(np.abs(hz[1] / each - 1.0).min() < 0.03 for each in hz[0]) >= 5


def _accelerations(name):
    """Return inputs, outputs and the time between samples of a record of accelerations."""
    if name == "tower":
        x = np.loadtxt(_records() / "unison_tower" / "wn_01.dat.gz")[:15000]
        return x[:, 1:2], x[:, 2:7], 0.01
    stored = io.loadmat(_records() / "steel_frame" / "flexibleStructure.mat")
    x = next(value for key, value in stored.items() if not key.startswith("_"))[:6000]
    return x[:, :2], x[:, 2:], 1.0 / 1024.0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("record", "modes", "frequency_range_hz"), [("frame", 14, (5.0, 490.0)), ("tower", 6, (0.3, 15.0))]
)
def test_family_of_measured_accelerations_is_proved(record, modes, frequency_range_hz):
    """A low-pass filtered acceleration fed back at the largest resonance; poles at points of the box are an oracle."""
    u, y, step = _accelerations(record)
    inputs, outputs = ({f"{name}{k}": x for k, x in enumerate(X.T)} for name, X in (("u", u), ("y", y)))
    found = bc.identify(
        inputs, outputs, step, quantity="acceleration", frequency_range_hz=frequency_range_hz, modes=modes
    )
    family, largest = found.family(), max(found.modes, key=lambda mode: mode.energy_fraction)
    rate = 2.0 * np.pi * largest.frequency_hz
    peak = np.abs(family.nominal.frequency_response([rate]).frdata[0, 0, 0])
    K = control.ss([[-rate]], [[rate]], [[0.1 / peak]], [[0.0]], inputs=["y0"], outputs=["u0"])
    answer = bc.robust_stability(family, K)
    assert family.nparameters == 2 * modes
    assert answer.proved, answer.message
    rng = np.random.default_rng(0)
    for delta in rng.choice([-1.0, 1.0], (50, family.nparameters)):
        assert bc.feedback_loop(family.at(delta), K, injection_points="u0").poles().real.max() < 0.0


@pytest.mark.slow
def test_beam_responses_six_modes():
    folder = _records() / "pyuff_beam"
    lines = [(folder / f"meas_point_{k}.txt").read_text().split("\n")[:1000] for k in (1, 2, 3)]
    H = np.array([[complex(value.strip().strip("()")) for value in column] for column in lines])[:, None, 1:]
    found = bc.identify(control.frd(H, 2.0 * np.pi * np.arange(1.0, 1000.0)), quantity="acceleration")
    expected = [51.5, 142.18, 278.66, 460.39, 687.16, 958.5]
    assert [mode.frequency_hz for mode in found.modes] == pytest.approx(expected, rel=1e-3)


def test_repeated_frequencies_outliers_have_little_weight():
    rng = np.random.default_rng(0)
    omega = np.repeat(2.0 * np.pi * np.geomspace(0.5, 15.0, 60), 8)
    s, natural = 1j * omega, 2.0 * np.pi * 4.6
    exact = 1.5 * (s**2 / 676.0 + 1.0) / (s * (s / 55.0 + 1.0) * (s**2 / natural**2 + 0.53 * s / natural + 1.0))
    measured = exact * (1.0 + 0.01 * (rng.standard_normal(480) + 1j * rng.standard_normal(480)))
    measured[rng.permutation(480)[:12]] *= 20.0
    found = bc.identify(control.frd(measured[None, None], omega))
    (mode,), (pole,) = found.modes, found.real_poles
    assert mode.frequency_hz == pytest.approx(4.6 * np.sqrt(1.0 - 0.265**2), rel=0.01)
    assert mode.damping_ratio == pytest.approx(0.265, rel=0.03)
    assert pole.rate == pytest.approx(55.0, rel=0.05)
    assert found.integrators == 1


_DAYS = ("16-Apr-2025_1819", "07-May-2025_1825", "09-May-2025_1421", "18-Apr-2025_1205")
_GAIN = 1.65  # V/rad of the position loop that was closed


def _rotary_beam(day, closed):
    omega, size, phase = np.loadtxt(_records() / "kyoto_rotary_beam" / f"{day}.dat", delimiter=",")
    G = size * np.exp(1j * phase)
    G = G if closed else G / (1.0 - _GAIN * G)
    return control.frd(G[None, None], omega, inputs="volt", outputs="angle")


@pytest.mark.slow
@pytest.mark.parametrize("band", [None, (1.0, 15.0), (2.0, 12.0), (1.0, 40.0), (0.5, 60.0)])
@pytest.mark.parametrize(("day", "clamped"), [*zip(_DAYS, (4.12, 4.12, 4.14, 4.37), strict=True)])
def test_rotary_beam_responses_give_resonance_and_zeros(day, clamped, band):
    for closed, rates in ((False, (55.0,)), (True, (2.9, 51.0))):  # the loop moves integrator and friction
        found = bc.identify(_rotary_beam(day, closed), frequency_range_hz=band)
        assert found.modes[0].frequency_hz / clamped == pytest.approx(1.06, abs=0.04)
        assert found.modes[0].damping_ratio == pytest.approx(0.29, abs=0.03)
        assert np.abs(np.abs(found.system.zeros()) / (2.0 * np.pi) - clamped).min() < 0.02
        assert sorted(pole.rate for pole in found.real_poles)[: len(rates)] == pytest.approx(rates, rel=0.35)
        for mode in found.modes[1:]:  # beside a zero: the second clamped frequency
            assert np.abs(np.abs(found.system.zeros()) / (2.0 * np.pi) / mode.frequency_hz - 1.0).min() < 0.01


@pytest.mark.slow
def test_rotary_beam_tuned_controllers_are_stable_over_days():
    *days, altered = (bc.identify(_rotary_beam(day, closed=False), frequency_range_hz=(1.0, 15.0)) for day in _DAYS)
    # a fit of seven parameters with a dead time gives 4.404, 4.414, 4.450 Hz
    assert [day.modes[0].frequency_hz for day in days] == pytest.approx([4.404, 4.414, 4.450], abs=0.01)
    frequencies = np.linspace(5.0, 8.0, 300)
    for day in days:
        assert 5.6 < frequencies[np.abs(day.system(2j * np.pi * frequencies)).argmax()] < 6.1
    family = days[0].family(union_with=days[1:])

    def weighted(model):
        return bc.generalized_plant(
            model,
            disturbances={"volt": 1.0},
            performance={"angle": 5.0},
            effort={"volt": 0.3},
            noise={"angle": 0.05},
            measurements="angle",
            controls="volt",
        )

    structure = tunable.pid(integral=False, omega_max=100.0) * tunable.notch(26.0, 100.0)
    tuned = bc.tune(weighted, structure=structure, family=family, n_starts=1, fastest_pole=100.0)
    optimal = bc.h_infinity(weighted(family.nominal), fastest_pole=100.0)
    for design in (tuned, optimal):
        assert bc.robust_stability(family, design.controller).proved
        assert control.feedback(altered.system, design.controller, sign=1).poles().real.max() < 0.0


@pytest.mark.slow
def test_wing_record_without_excitation_raises():
    data = io.loadmat(_records() / "maewing1_wing" / "maewing_runtest.mat", squeeze_me=True)["signalIn"]
    with pytest.raises(ValueError, match="got evidence of 0"):
        bc.identify(data[:, 1], data[:, 2:4], 1.0 / 2000.0, quantity="acceleration", intersample="bl")


def _motor(rng):
    """Return the state matrices of a motor that turns one or two loads through soft shafts, with friction or free."""
    count = int(rng.integers(1, 3))
    J, C = np.append(1.0, rng.uniform(0.2, 2.0, count)), np.zeros((count + 1, count + 1))
    K, first = np.zeros_like(C), 2.0 * np.pi * rng.uniform(3.0, 8.0)
    for k in range(count):
        omega, ends = first * (1.0 + 1.2 * k), np.eye(count + 1)[k] - np.eye(count + 1)[k + 1]
        stiffness = omega**2 * J[k] * J[k + 1] / (J[k] + J[k + 1])
        K += stiffness * np.outer(ends, ends)
        C += 2.0 * rng.uniform(0.003, 0.03) / omega * stiffness * np.outer(ends, ends)
    friction = bool(rng.integers(2))
    C[0, 0] += friction * 2.0 * np.pi * rng.uniform(0.1, 1.5) * J.sum()
    n = count + 1
    A = np.block([[np.zeros((n, n)), np.eye(n)], [-K / J[:, None], -C / J[:, None]]])
    return A, np.eye(2 * n)[:, [n]], friction


@given(seed=seeds)
@examples(30)
def test_motor_with_and_without_friction_modes_and_integrators(seed):
    rng = np.random.default_rng(seed)
    A, B, friction = _motor(rng)
    n, power = len(A) // 2, int(rng.integers(3))
    rows = np.eye(n)[[0, -1]]
    C = [np.hstack([rows, 0.0 * rows]), np.hstack([0.0 * rows, rows]), rows @ A[n:]][power]
    D = rows @ B[n:] if power == 2 else np.zeros((2, 1))
    u = rng.standard_normal((6000, 1))
    y = signal.dlsim(signal.cont2discrete((A, B, C, D), _STEP), u)[1]
    poles = [pole for pole in np.linalg.eigvals(A).tolist() if pole.imag > 1.0]
    # errors a twentieth as large as the smallest mode
    s = 2j * np.pi * np.fft.rfftfreq(len(u), _STEP)[:, None]
    values, V = np.linalg.eig(A + 0j)
    parts = [
        np.linalg.norm(
            2.0 * np.fft.rfft(u, axis=0) / (s - values[k]) * (np.linalg.pinv(V)[k] @ B) * (C @ V[:, k]), axis=0
        )
        for k in np.flatnonzero(values.imag > 1.0)
    ]
    noise = 0.05 * np.sqrt(2.0) * np.min(parts, axis=0) / len(u)
    y = y + np.maximum(noise, 1e-9 * y.std(axis=0)) * rng.standard_normal(y.shape)
    quantity = ("displacement", "velocity", "acceleration")[power]
    found = bc.identify(u, y, _STEP, quantity=quantity, intersample="zoh")
    assert len(found.modes) == len(poles)
    for mode, pole in zip(found.modes, sorted(poles, key=lambda p: p.imag), strict=True):
        assert mode.frequency_hz == pytest.approx(pole.imag / (2.0 * np.pi), rel=0.01)
    assert found.integrators == max(2 - power - friction, 0)
    assert len(found.real_poles) == friction


@pytest.mark.parametrize("count", [1, pytest.param(100, marks=pytest.mark.slow)])
def test_close_modes_are_listed_or_marked(count):
    rng = np.random.default_rng(3)
    missing, s = 0, 2j * np.pi * np.fft.rfftfreq(12000, _STEP)[:, None]
    for _ in range(count):
        hz, apart = rng.uniform(4.0, 20.0), 10.0 ** rng.uniform(-2.3, -1.3)
        omega = 2.0 * np.pi * hz * np.array([1.0, 1.0 + apart])
        poles = omega * (-(10.0 ** rng.uniform(-3.0, -1.7, 2)) + 1j)
        U = np.fft.rfft(rng.standard_normal((12000, 1)), axis=0) * (s.imag < 2.0 * np.pi * 45.0)
        c = rng.standard_normal((2, 4)) * omega[:, None] ** 2
        Y = U * (1.0 / ((s - poles) * (s - poles.conj()))) @ c
        u, y = (np.fft.irfft(part, axis=0)[6000:] for part in (U, Y))
        y += 0.01 * y.std(axis=0) * rng.standard_normal(y.shape)
        modes = bc.identify(u, y, _STEP, frequency_range_hz=(0.5, 45.0), intersample="bl").modes
        missing += len(modes) < 2 and not any(mode.closely_spaced for mode in modes)
    assert missing <= 0.02 * count
