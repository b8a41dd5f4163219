"""Records: defects of measurement raise, and motion that only resembles them does not."""

import numpy as np
import pytest

from boomctl.identification.record import Record

RNG = np.random.default_rng(0)
RISE = np.polyval([6.0, -15.0, 10.0, 0.0, 0.0, 0.0], np.linspace(0.0, 1.0, 800))


def read(u, y):
    """Return the record of one input and of outputs."""
    return Record.of(u, y, 1e-3, "displacement", None)


def filtered(count, top, seed):
    """Return noise without power above a fraction of the Nyquist frequency, of standard deviation one."""
    spectrum = np.fft.rfft(np.random.default_rng(seed).standard_normal(count))
    spectrum[round(top * len(spectrum)) :] = 0.0
    signal = np.fft.irfft(spectrum, count)
    return signal / signal.std()


TIME = np.arange(3000.0)
SMOOTH = {
    "dwell at largest deflection": np.r_[np.zeros(500), RISE, np.ones(140), RISE[::-1], np.zeros(500)],
    "critically damped step": np.r_[np.zeros(200), 1.0 - np.exp(-TIME / 100.0) * (1.0 + TIME / 100.0)],
    "steps of first order": np.concatenate([1.0 - np.exp(-TIME / 60.0), np.exp(-TIME / 60.0)] * 3),
    "decay": np.exp(-TIME / 300.0) * np.cos(TIME / 20.0),
    "slow sine": np.sin(TIME / 400.0),
}


@pytest.mark.parametrize("quantum", [0.0, 0.001, 0.01, 0.03])
@pytest.mark.parametrize("y", SMOOTH.values(), ids=SMOOTH)
def test_record_with_smooth_extremum_or_rest_is_accepted(y, quantum):
    y = np.round(y / quantum) * quantum if quantum else y
    u = RNG.standard_normal(len(y))
    for sign in (1.0, -1.0):
        assert read(u, sign * y).y[0].std() > 0.0


@pytest.mark.parametrize("quantum", [0.0, 0.001, 0.01])
@pytest.mark.parametrize("limit", [0.5, 0.8, 0.95])
@pytest.mark.parametrize(("kind", "noise"), [(1.3, 0.0), (17.0, 0.003), ("noise", 0.0)])
def test_record_of_clipped_output_raises(kind, noise, limit, quantum):
    if kind == "noise":
        y, limit = filtered(4000, 0.1, seed=1), 2.0 * limit
    else:
        y = np.sin(2.0 * np.pi * kind * 1e-3 * np.arange(4000))
    y = np.minimum(y + noise * RNG.standard_normal(4000), limit)
    y = np.round(y / quantum) * quantum if quantum else y
    for sign in (1.0, -1.0):
        with pytest.raises(ValueError, match=r"got 'out_1' saturated: \d+ samples at"):
            read(RNG.standard_normal(4000), sign * y)


def step_tests():
    """Return input and output of a mass on a spring with a step that begins at rest, quantized as by a converter."""
    u = np.r_[np.zeros(400), np.ones(3000), np.zeros(3000)]
    at = np.arange(3000.0)
    once = 1.0 - np.exp(-at / 150.0) * np.cos(at / 15.0)
    acceleration = np.r_[1.0, np.diff(once, 2), 0.0] * 225.0  # that of the mass jumps with the force
    y = np.c_[np.r_[np.zeros(400), once, 1.0 - once], np.r_[np.zeros(400), acceleration, -acceleration]]
    y = 0.01 * np.round(100.0 * y)
    y[0] += 0.01  # a converter's last digit, as noise moves it
    return u, y


def test_record_with_rests_between_steps_is_accepted():
    u, y = step_tests()
    for outputs in (y, y[:, :1], y[:, 1:]):
        assert np.diff(np.flatnonzero(np.diff(outputs, axis=0).any(axis=1))).max() > 300  # a rest before the step
        read(u, outputs)
    read(u, 0.01 * np.round(100.0 * (1.0 - np.exp(-np.arange(6400.0) / 3000.0))))  # the last digit alone changes


@pytest.mark.parametrize("lost", ["zero", "held"])
@pytest.mark.parametrize("seed", range(5))
def test_record_with_lost_samples_raises(lost, seed):
    u, y = filtered(3000, 0.5, seed), np.c_[filtered(3000, 0.1, seed + 10), filtered(3000, 0.1, seed + 20)]
    for signal in (u, y):
        signal[1000:1100] = 0.0 if lost == "zero" else signal[1000]
    with pytest.raises(ValueError, match="every signal is constant from"):
        read(u, y)


@pytest.mark.parametrize("container", [list, tuple])
def test_record_from_vectors_is_one_experiment_each(container):
    u, y = (container(RNG.standard_normal(n) for n in (200, 300, 250)) for _ in range(2))
    record = read(u, y)
    assert [len(each) for each in record.u] == [200, 300, 250]
    for each, given in zip(record.y, y, strict=True):
        assert np.allclose(each[:, 0], given - given.mean())
    nested = read([list(each) for each in u], y)
    assert all(np.array_equal(a, b) for a, b in zip(nested.u, record.u, strict=True))
    with pytest.raises(ValueError, match="signals of one record are columns"):
        read(u, y[0])


def test_record_from_rows_is_one_experiment():
    rows = RNG.standard_normal((100, 3))
    record = read([list(row) for row in rows], list(rows[:, 0]))
    assert record.u[0].shape == (100, 3)
    assert len(record.u) == 1
