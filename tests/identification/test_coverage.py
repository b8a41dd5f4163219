"""How often intervals hold: as often as they say, over many data sets with errors drawn anew.

Whatever their number, what is asked of the share is what chance leaves of it: bounds of the binomial distribution. The
seeds are zero, and stay as they are. Under the profile ``hunt`` there are four times as many data sets.
"""

import control
import numpy as np
import pytest
from scipy import signal, stats

import boomctl as bc
from boomctl.identification import MeasuredFrequencyResponse
from tests.identification.chain import CHAIN, OMEGA, frequencies, response
from tests.profiles import is_hunt

DAMPED = {**CHAIN, "c": 4e-3}
CHANCE = 0.05  # of honest intervals to hold less often than is asked, and more often: of 400 it leaves 93 to 97 %
SAFE = 0.995  # at most, of intervals from residuals, which may be wider


def chain_frequencies(rng):
    """Three frequencies with errors of 2 %: two parameters, one degree of freedom."""
    measured = frequencies(CHAIN) * np.exp(0.02 * rng.standard_normal(3))
    return {"model": frequencies, "data": measured, "modes": (1, 2, 3), "free": ["k1", "k2"]}


def chain_response(rng):
    """A complex response with errors of 5 % of each value."""
    noise = 0.05 * (rng.standard_normal(len(OMEGA)) + 1j * rng.standard_normal(len(OMEGA)))
    measured = control.frd(response(CHAIN, OMEGA) * (1.0 + noise), OMEGA)
    return {"model": response, "data": measured, "free": ["k1", "k3", "c"]}


def chain_noise(rng):
    """A complex response with errors of one size at all frequencies, a tenth of what it is at rest."""
    noise = rng.standard_normal(len(OMEGA)) + 1j * rng.standard_normal(len(OMEGA))
    measured = control.frd(response(CHAIN, OMEGA) + 1e-4 * noise, OMEGA)
    return {"model": response, "data": measured, "free": ["k1", "k3", "c"], "error_model": "absolute"}


def chain_gain(rng):
    """Magnitudes with errors of 5 %: nothing of the phase."""
    gain = np.abs(response(CHAIN, OMEGA)[0]) * np.exp(0.05 * rng.standard_normal(len(OMEGA)))
    curve = MeasuredFrequencyResponse(OMEGA / (2.0 * np.pi), gain, ("gain",))
    return {"model": lambda p: np.abs(response(p)[0]), "data": curve, "free": ["k1", "k3", "c"]}


def correlated(lines, width, free=("k1", "k3", "c")):
    """Return the draw of a complex response whose errors of 5 % are moving averages over so many of its lines."""
    omega = np.linspace(5.0, 50.0, lines)
    exact, weights = response(DAMPED, omega), np.full(width, width**-0.5)

    def draw(rng):
        e = signal.lfilter(weights, [1.0], rng.standard_normal((2, lines + width)), axis=1)[:, width:]
        measured = control.frd(exact * np.exp(0.05 * (e[0] + 1j * e[1])), omega)
        return {"model": lambda p: response(p, omega), "data": measured, "free": list(free)}

    return draw


def held(draw, truth, start, sets, **more):
    """Return the share of intervals that hold the truth, one a parameter, over so many data sets."""
    rng = np.random.default_rng(0)
    hits = []
    for _ in range(sets):
        found = bc.fit(**draw(rng), initial=start, n_starts=1, **more)
        hits.append([low <= truth[name] <= high for name, (low, high) in found.intervals.items()])
    return np.mean(hits, axis=0)


def as_often_as_95_per_cent(share, count, safe):
    """Return whether shares of so many intervals are those of 95 %, or, if they are on the safe side, not always held."""
    low, high = stats.binom.interval(1.0 - 2.0 * CHANCE, count, 0.95)
    hits = np.rint(share * count)
    return (hits >= low) & (share < SAFE if safe else hits <= high)


CASES = {
    "frequencies": (chain_frequencies, CHAIN),
    "response": (chain_response, CHAIN),
    "noise": (chain_noise, CHAIN),
    "gain": (chain_gain, CHAIN),
    "5 of 150 lines": (correlated(150, 5), DAMPED),
    "20 of 400 lines": (correlated(400, 20), DAMPED),
    "50 of 800 lines": (correlated(800, 50, ("k1", "k3")), DAMPED),
}


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_intervals_of_95_per_cent_hold_as_often(case):
    """Each parameter by itself; of correlated errors as well."""
    draw, truth = CASES[case]
    sets = 400 if is_hunt() else 100
    shares = held(draw, truth, truth, sets)
    assert as_often_as_95_per_cent(shares, sets, safe=case != "frequencies").all(), shares


@pytest.mark.slow
def test_intervals_as_independent_miss_correlated_errors():
    assert (held(correlated(150, 5), DAMPED, DAMPED, 100, error_std=0.05) < 0.8).all()


def drawn_chain(rng, relative):
    """Return a fit with absolute errors of one size, or with relative ones that are taken for absolute."""
    truth = {name: value * np.exp(0.3 * rng.standard_normal()) for name, value in CHAIN.items()}
    truth["c"] = 10.0 ** rng.uniform(-3.0, -1.0)
    lines, width = int(rng.choice([15, 40, 150])), int(rng.choice([1, 1, 5]))
    omega = np.geomspace(3.0, 60.0, lines)
    exact = response(truth, omega)
    e = signal.lfilter(np.full(width, width**-0.5), [1.0], rng.standard_normal((2, lines + width)), axis=1)[:, width:]
    ends = np.log([0.02 * np.median(np.abs(exact)), 0.05 * np.abs(exact).max()])
    size = 0.05 * np.abs(exact) if relative else np.exp(rng.uniform(*ends))
    data, free = control.frd(exact + size * (e[0] + 1j * e[1]), omega), [*rng.choice(["k1", "k2", "k3"], 2, False), "c"]
    return bc.fit(lambda p: response(p, omega), data, free, truth, n_starts=1, error_model="absolute")


@pytest.mark.parametrize("count", [4, pytest.param(200, marks=pytest.mark.slow)])
def test_relative_errors_fitted_as_absolute_are_stated(count):
    rng = np.random.default_rng(0)
    stated = [[drawn_chain(rng, relative).certificate.errors_grow for relative in (False, True)] for _ in range(count)]
    absolute, relative = np.mean(stated, axis=0)
    assert absolute == 0.0
    assert relative > 0.7
    assert "use error_model='relative'" in drawn_chain(np.random.default_rng(0), True).certificate.adequacy
