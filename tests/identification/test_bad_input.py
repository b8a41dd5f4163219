"""What measurements cannot tell is refused in one line that names the parameter."""

from functools import cache

import numpy as np

import boomctl as bc
from boomctl.identification import MeasuredFrequencyResponse, uncertainty_weight
from boomctl.structure import SecondOrderModel
from tests.identification.chain import CHAIN, OMEGA, frequencies, three_masses
from tests.identification.rig import RIG, START, measured, rig
from tests.identification.test_identify import driven
from tests.identification.test_response import STEP
from tests.refusals import assert_refused, refusals

PORTS = {"inputs": ("actuator_left", "actuator_right"), "outputs": ("tip_left", "tip_right")}


def fit(**changed):
    """A fit of two springs of the chain to its frequencies."""
    call = {"model": frequencies, "data": frequencies(CHAIN), "free": ["k1", "k2"], "initial": CHAIN, "n_starts": 1}
    return bc.fit(**call | changed)


def fit_boom(**changed):
    """A fit of a spring of the boom to its response."""
    call = {"model": bc.spray_boom, "free": ["spring_stiffness"], "initial": bc.BoomParameters()}
    return bc.fit(**{"data": bc.spray_boom().frequency_response(OMEGA, *PORTS.values())} | call | changed)


def narrow(p):
    if abs(p["k"] - 4.0) > 1e-14:
        raise ValueError("expected four")
    return [p["k"]]


@cache
def record():
    return driven(three_masses(0.01), 5000, seed=3, errors=0.02)


def identify(part=slice(None), **changed):
    u, y = record()
    return bc.identify(u[part], y[part], STEP, intersample="bl", **changed)


def fast():
    """Identify a record with a resonance close to half the sampling rate."""
    model = SecondOrderModel([[1.0]], [[0.5]], [[(2.0 * np.pi * 24.2) ** 2]], {"f": [1.0]}, {"y": [1.0]})
    return bc.identify(*driven(model, 4000, seed=0, errors=0.01, top_hz=24.9), STEP, frequency_range_hz=(0.0, 24.8))


@cache
def rig_fit():
    return bc.fit(rig, measured(np.random.default_rng(0)), list(RIG), START, n_starts=1)


def band(**changed):
    return uncertainty_weight(**{"data": measured(np.random.default_rng(0)), "model": rig(RIG)} | changed)


EXACT = rig(RIG).frequency_response(OMEGA)
BOTH = MeasuredFrequencyResponse(OMEGA / (2 * np.pi), bc.sigma(bc.spray_boom(), OMEGA).sigma, ("upper", "lower"))
REFUSED = r"""
fit(model=lambda p: [1.0]) -> data: 3 frequencies, but the model has only 1
fit(model=lambda p: three_masses(0.01), data=[1.0, 2.0, 3.0, 4.0]) -> data: 4 frequencies, but the model has only 3
fit(model=lambda p: three_masses(0.01), modes=[1, 2, 4]) -> modes: mode 4, but the model has only 3
fit(free=["k1"], initial={"k1": 900.0}) -> model: parameter 'm1' is missing; add it to `initial`
fit(model=lambda p: [-1.0, 2.0, 3.0]) -> model: expected eigenfrequencies above zero, got -1
fit(data=[]) -> data: expected at least one
fit(data=[0.5, 0.3]) -> must be in ascending order, got
fit(data=[0.3, 0.4], modes=[1, 1]) -> `modes` must be 2 different numbers
fit(data=[EXACT, frequencies(CHAIN)]) -> `data` must be data sets of one kind, shape and signals
fit(inputs="force") -> eigenfrequencies have no signals
fit(free=[]) -> free: expected at least one
fit(free=None) -> free = None
fit(free=["k9"]) -> unknown free parameter 'k9'; did you mean .*\(`initial` has: m1, m2
fit(free=["k1", "k1"]) -> 'k1' is given twice
fit(free={"k1": (3.0, 1.0)}) -> range of k1
fit(free={"k1": (1.0, 2.0)}) -> `initial` of k1 must be in its range, 1 to 2, got 900
fit(initial={**CHAIN, "k1": 0.0}) -> `initial` of k1 must be above zero
fit(initial=None) -> initial: expected initial parameters
bc.fit(bc.boom_family(), [0.3], initial={"none": 1.0}) -> unknown parameter 'none'
fit(initial=3.0) -> initial: expected a dataclass or a mapping
fit(weights=[1.0, -1.0, 1.0]) -> `weights` must be zeros and numbers above 1e-50, got -1 to 1
fit(weights=[1.0, 1.0]) -> `weights` must have the measured shape
bc.fit(narrow, [4.0], ["k"], {"k": 4.0}, n_starts=1)
    -> ArithmeticError: raises at all values near k = 4\. Use a range that ends
# responses
fit_boom(inputs="nobody") -> unknown input 'nobody'
fit_boom(modes=[1]) -> modes: expected None
fit_boom(model=lambda p: bc.exact_frequency_response(p, [1.0, 2.0])) -> at the measured frequencies
fit_boom(model=lambda p: "boom") -> model: expected a model or its complex frequency response
fit_boom(data=control.frd([1.0, 0.0, 1.0], [1.0, 2.0, 3.0])) -> `data` has zeros, which have no relative
fit_boom(model=lambda p: bc.exact_frequency_response(p, OMEGA), data=BOTH)
    -> must return singular values \(2, 40\), got \(5, 40\)\. Set `inputs` and
fit_boom(model=lambda p: bc.spray_boom(**p), data=[0.3], free=['boom_mass'], initial={'boom_mass': 30.0})
    -> `boom_mass` must be at least that of the tube
fit_boom(data=control.frd([1.0, np.nan], [1.0, 2.0])) -> expected finite
# records
bc.identify(record()[0][:, [0, 0]], record()[1], STEP) -> linearly dependent inputs cannot be separated
identify(frequency_range_hz=(1.0, 2.0, 3.0)) -> `frequency_range_hz` must be two nonnegative numbers, ascending
identify(confidence_level=1.0) -> confidence_level = 1.0: expected a number from 0.5 to below 1
identify(slice(0, 60)) -> at least 48 frequencies in the band
identify(error_model="relative") -> error_model = 'relative': expected None for a record
bc.identify(EXACT, record()[0]) -> expected None for a measured frequency response
bc.identify(BOTH) -> inputs: expected a frequency response with its phase, got magnitudes alone; give a file
fast() -> sample_time = 0.02: expected resonances well below half .* got one at 24.2 Hz of 25
# families, and bands of what they leave
fit(error_std=0.01).family() -> model: expected a function that makes a SecondOrderModel .* makes ndarray
replace(rig_fit(), model=None).family() -> model = None: expected a function
fit(data=frequencies(CHAIN)[:2]).family()
    -> family: expected .* got k1 from 0 to inf; with dof = 0, set error_std
fit(model=lambda p: [p["k1"] / p["k2"]], data=[1.0], free=["k1", "k2"], error_std=0.01).family()
    -> family: expected parameters that the measurements bound, got k1 from 0 to inf
band(data=[1.0, 2.0]) -> data: expected a complex frequency response, got eigenfrequencies
band(data=EXACT, model=EXACT) -> model: expected one that leaves something .* from volt to motor
"""


@refusals(REFUSED)
def test_combination_that_is_impossible_refused_in_one_line(call, words):
    assert_refused(call, words, globals())
