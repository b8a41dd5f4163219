"""Fits of parameters: exact data give exact parameters, units do not matter, what is not seen is said, bad input refused."""

import re
from dataclasses import replace

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.figure import Figure
from scipy import signal, stats

import boomctl as bc
from boomctl.identification import MeasuredFrequencyResponse
from boomctl.structure import GROUND, Assembly, Beam, BeamSegment, FiniteElements, Output, SecondOrderModel, fixed
from tests.identification.chain import CHAIN, OMEGA, frequencies, response, response_of_record, three_masses
from tests.profiles import examples
from tests.strategies import seeds

PORTS = {"inputs": ("actuator_left", "actuator_right"), "outputs": ("tip_left", "tip_right")}
TRUTH = replace(bc.BoomParameters(), spring_stiffness=1400.0, youngs_modulus=2.1e11, cradle_damping=200.0)
DIGITS = 1e-6  # of a parameter: what differences leave of exact data


def recovered(found, truth, free, digits=DIGITS):
    """Return whether every free parameter is the true one, to the digits that there are."""
    return all(abs(found.values[name] / truth[name] - 1.0) < digits for name in free)


# -- at ends of ranges and of models ------------------------------------------------------------------------------------

_GROUPS = ("k1", "ka", "kb"), ("k2", "e", "i")  # springs side by side, and factors of one: one of each group is seen


def grouped(p):
    """Return the chain's parameters from those of the groups."""
    return {**p, "k1": p["k1"] + p["ka"] + p["kb"], "k2": p["k2"] * p["e"] * p["i"]}


def at_an_end(seed):
    """Return a model that refuses, what was measured, ranges, start and deviation: the truth near an end, or beyond it.

    Damping goes down to 1e-7, and frequencies may lie on the resonances: |G| then changes much within a millionth.
    """
    rng = np.random.default_rng(seed)
    truth = {
        k: v * np.exp(0.3 * rng.standard_normal()) for k, v in {**CHAIN, "ka": 300, "kb": 500, "e": 2, "i": 0.5}.items()
    }
    truth["c"] = 10.0 ** rng.uniform(-7.0, -1.0)
    ranges, start, refused = {}, dict(truth), {}
    for name in rng.choice(["m1", "m2", "m3", "k1", "k2", "k3", "ka", "kb", "e", "i", "c"], rng.integers(1, 4), False):
        name, true = str(name), truth[name]
        wide, near = np.exp(rng.uniform(0.1, 1.0, 2)), 1.0 + 10.0 ** rng.uniform(-16.0, -3.0)
        ends = [
            (true / wide[0], true * wide[1]),
            (true, true * wide[1]),
            (true / wide[0], true),
            (true / near, true * wide[1]),
            (true / wide[0], true * near),
            (0.3 * true, 0.97 * true),
        ][rng.integers(6)]
        if rng.random() < 0.5:  # the model ends where the range does, and rounding may step over that
            refused[name] = ends
        start[name] = (
            float(np.clip(true * np.exp(0.1 * rng.standard_normal()), *ends)) if rng.random() < 0.5 else ends[0]
        )
        ranges[name] = ends
    omega = np.geomspace(3.0, 60.0, 15)
    if rng.random() < 0.5:
        beside = 1.0 + 10.0 ** rng.uniform(-9.0, -2.0) * rng.standard_normal(3)
        omega = np.sort(np.append(omega, 2.0 * np.pi * frequencies(grouped(truth)) * beside))
    kind = ["eigenfrequencies", "response", "gain"][rng.integers(3)]

    def answer(p):
        if kind == "eigenfrequencies":
            return frequencies(grouped(p))
        return response(grouped(p), omega) if kind == "response" else np.abs(response(grouped(p), omega)[0])

    def build(p):
        for name, (low, high) in refused.items():
            if not low <= p[name] <= high:
                raise ValueError(f"{name} = {p[name]}: expected {low} to {high}")
        return answer(p)

    noise = 10.0 ** rng.uniform(-6.0, -2.0) if rng.random() < 0.5 else 0.0
    exact = answer(truth)
    measured = exact * np.exp(noise * rng.standard_normal(exact.shape))
    if kind == "response":
        measured = control.frd(measured, omega)
    elif kind == "gain":
        measured = MeasuredFrequencyResponse(omega / (2.0 * np.pi), measured, ("gain",))
    else:
        measured = np.sort(measured)
    return kind, answer, build, measured, ranges, start, noise or None


def undetermined(kind, free):
    """Return how many combinations nothing tells of: all but one of a group, and damping of undamped frequencies."""
    return sum(max(0, len(set(free) & set(group)) - 1) for group in _GROUPS) + (
        kind == "eigenfrequencies" and "c" in free
    )


@pytest.mark.slow
@given(seeds)
@examples(200)
def test_what_is_called_undetermined_is_and_nothing_else(seed):
    kind, answer, build, measured, ranges, start, noise = at_an_end(seed)
    try:
        found = bc.fit(build, measured, ranges, start, error_std=noise, n_starts=2)
    except ArithmeticError as refusal:  # a least that lies where the model ends
        if "range that ends where the model does" not in str(refusal):
            raise
        return
    hidden = [each for each in found.unidentifiable if not each.weak]
    if (
        kind != "eigenfrequencies" or len(ranges) < 3
    ):  # three of three, not met, are least where the slopes are singular
        assert len(hidden) == undetermined(kind, ranges)
    here = answer(found.parameters)
    for each in hidden:
        factor = float(re.match(r"unidentifiable: \w+ × ([-+.e0-9]+)", each.description)[1])
        moved = {name: factor**power * found.parameters[name] for name, power in each.direction.items()}
        change = np.abs(np.log(answer({**found.parameters, **moved}) / here)).max()
        assert change < 1e-3 or "no first-order effect" in each.description
    if not hidden and np.isfinite(found.error_std):
        assert np.isfinite(found.covariance).all()


# -- exact data give exact parameters -----------------------------------------------------------------------------------


def exact_response(parameters):
    """Return the response of the exact boom from its actuators to its tips."""
    return bc.exact_frequency_response(parameters, OMEGA, *PORTS.values())


def cantilever(p):
    """Return a stepped beam, whose sections have moduli of their own."""
    sections = (BeamSegment(1.0, 2.0, p["E_root"] * 1e-8), BeamSegment(0.7, 1.0, p["E_tip"] * 2e-9))
    beam = Beam("beam", GROUND.at(0), fixed(), (0.0, 0.0), sections, FiniteElements(8))
    return Assembly(bodies=(beam,), outputs=(Output("tip", beam.at(1.7)),)).assemble()


def curve(parameters, build=exact_response):
    """Return the singular values of the exact boom or another, which the fit sorts."""
    found = bc.sigma(build(parameters), OMEGA) if build is bc.spray_boom else bc.sigma(build(parameters))
    return MeasuredFrequencyResponse(OMEGA / (2 * np.pi), found.sigma[::-1], ("lower", "upper"))


def boom_response(p):
    return bc.spray_boom(p).frequency_response(OMEGA, *PORTS.values())


def two_modes(p):
    return bc.hub_beam(p, modes=2)


def hub_beam_frequencies(p):
    return bc.hub_beam(p, modes=5).eigenfrequencies_hz()[:4]


def cantilever_frequencies(p):
    return cantilever(p).eigenfrequencies_hz(4)


def spring(p):
    return SecondOrderModel([[1.0]], [[0.1]], [[p["k"]]], {"f": [1.0]}, {"y": [1.0]}).to_statespace()


def torque_response(p):
    model, omega = two_modes(p).linearize(), np.geomspace(1.0, 30.0, 25)
    return control.frd(model(1j * omega), omega, inputs=model.input_labels, outputs=model.output_labels)


BOOM = bc.BoomParameters()
STEPPED, SOFT = {"E_root": 6.5e10, "E_tip": 8.0e10}, bc.HubBeamParameters(youngs_modulus=6.0e10, tip_mass=0.2)
DAMPED = bc.HubBeamParameters(youngs_modulus=6.0e10, damping_ratio=0.02)
EXACT = {
    "hub-beam": (bc.hub_beam, hub_beam_frequencies, SOFT, bc.HubBeamParameters(tip_mass=0.1)),
    "dictionary": (cantilever, cantilever_frequencies, STEPPED, {"E_root": 7e10, "E_tip": 7e10}),
    "state space, frequencies": (spring, lambda p: [np.sqrt(p["k"] - 0.0025) / (2 * np.pi)], {"k": 5.0}, {"k": 4.0}),
}
EXACT_SLOW = {
    "hub-beam, torque": (two_modes, torque_response, DAMPED, bc.HubBeamParameters(damping_ratio=0.01)),
    "boom, response": (bc.spray_boom, boom_response, TRUTH, BOOM),
    "boom, frequencies": (bc.spray_boom, lambda p: bc.spray_boom(p).eigenfrequencies_hz(5), TRUTH, BOOM),
    "exact boom, frequencies": (bc.exact_eigenfrequencies_hz, bc.exact_eigenfrequencies_hz, TRUTH, BOOM),
    "exact boom, absolute": (exact_response, exact_response, TRUTH, BOOM, {"error_model": "absolute"}),
    "boom, singular values": (bc.spray_boom, lambda p: curve(p, bc.spray_boom), TRUTH, BOOM, PORTS),
    "exact boom, singular values": (exact_response, curve, TRUTH, BOOM, PORTS),
    "state space": (lambda p: bc.spray_boom(p).to_statespace(), lambda p: curve(p, bc.spray_boom), TRUTH, BOOM, PORTS),
}


@pytest.mark.parametrize("case", [*EXACT, *(pytest.param(case, marks=pytest.mark.slow) for case in EXACT_SLOW)])
def test_fit_exact_data_gives_the_parameters(case):
    build, answer, truth, start, *more = (EXACT | EXACT_SLOW)[case]
    true = truth if isinstance(truth, dict) else vars(truth)
    free = [name for name, value in true.items() if value != (start if isinstance(start, dict) else vars(start))[name]]
    found = bc.fit(build, answer(truth), free, start, n_starts=2, **(more[0] if more else {}))
    assert recovered(found, true, free)
    assert found.success
    assert isinstance(found.parameters, type(start))
    others = found.parameters if isinstance(start, dict) else vars(found.parameters)
    assert {**others, **found.values} == others


def test_a_family_is_fitted_within_its_box():
    family = bc.boom_family()
    measured = family.at(family.normalize({"spring_factor": 1.12, "mass_factor": 0.93})).eigenfrequencies_hz(5)
    found = bc.fit(family, measured, n_starts=2, error_std=0.01)
    assert recovered(found, {"spring_factor": 1.12, "mass_factor": 0.93}, ("spring_factor", "mass_factor"))
    delta = {"spring_factor": 1.1, "mass_factor": 0.95}
    there = [box.at(box.normalize(delta)).eigenfrequencies_hz(5) for box in (found.family(), family)]
    np.testing.assert_allclose(*there, rtol=1e-9)
    stiff = bc.fit(family, 1.5 * measured, initial={"spring_factor": 1.1}, n_starts=2)
    assert stiff.certificate.at_bounds
    assert not stiff.success
    assert "at its bound" in repr(stiff.certificate)


# -- units, weights, modes ------------------------------------------------------------------------------------------------


@examples(40)
@given(st.floats(-9.0, 9.0), st.floats(-9.0, 9.0))
def test_units_do_not_change_the_fit(of_parameters, of_values):
    """Stiffness in another unit, and the response in another unit, with noise: the same fit, times the unit."""
    unit, size = 10.0**of_parameters, 10.0**of_values
    noise = np.exp(0.05 * np.random.default_rng(3).standard_normal(len(OMEGA)))
    measured = response(CHAIN, OMEGA) * noise

    def of(scaled):
        return size * response({**scaled, "k1": scaled["k1"] * unit, "k2": scaled["k2"] * unit})

    plain = bc.fit(response, control.frd(measured, OMEGA), ["k1", "k2", "c"], CHAIN, n_starts=1)
    start = {**CHAIN, "k1": CHAIN["k1"] / unit, "k2": CHAIN["k2"] / unit}
    other = bc.fit(of, control.frd(size * measured, OMEGA), ["k1", "k2", "c"], start, n_starts=1)
    factors = {"k1": unit, "k2": unit, "c": 1.0}
    for name, factor in factors.items():
        assert other.values[name] * factor == pytest.approx(plain.values[name], rel=1e-6)
        assert np.array(other.intervals[name]) * factor == pytest.approx(np.array(plain.intervals[name]), rel=1e-4)
    assert other.error_std == pytest.approx(plain.error_std, rel=1e-6)


@pytest.mark.parametrize(
    ("modes", "named", "digits"), [((1, 2, 4, 6), None, 0.05), ((6, 1, 2), (6, 1, 2), DIGITS)], ids=["missed", "named"]
)
def test_fit_some_modes_are_those_of_the_model(modes, named, digits):
    """Modes that were not measured are left out; those that are named are taken as they are."""
    measured = bc.spray_boom(TRUTH).eigenfrequencies_hz(7)[np.array(modes) - 1]
    start = bc.BoomParameters() if named is None else replace(TRUTH, youngs_modulus=1.0e11, spring_stiffness=900.0)
    found = bc.fit(bc.spray_boom, measured, ["spring_stiffness", "youngs_modulus"], start, modes=named, n_starts=1)
    assert found.mode_numbers == modes
    assert recovered(found, vars(TRUTH), ["youngs_modulus"], digits)


def test_a_weight_of_zero_leaves_a_value_out():
    measured = frequencies(CHAIN)
    wrong = np.array([measured[0], 1.3 * measured[1], measured[2]])
    found = bc.fit(frequencies, wrong, ["k1", "m1"], CHAIN, weights=[1.0, 0.0, 1.0], n_starts=1, error_std=0.01)
    assert found.mode_numbers == (1, 2, 3)
    assert recovered(found, CHAIN, ("k1", "m1"))
    values = response(CHAIN, OMEGA)
    values[0, 0, 4] = 0.0
    weights = np.ones(values.shape)
    weights[0, 0, 4] = 0.0
    found = bc.fit(response, control.frd(values, OMEGA), ["k1", "c"], CHAIN, weights=weights, n_starts=1)
    assert recovered(found, CHAIN, ("k1", "c"))


# -- what is not seen, and what is not determined -------------------------------------------------------------------------


def test_fit_product_of_two_free_factors_is_undetermined():
    measured, start = frequencies(CHAIN) * np.array([1.01, 0.99, 1.005]), {**CHAIN, "e": 1.0}

    def build(p):
        return frequencies({**p, "k2": p["k2"] * p["e"]})

    found, single = (bc.fit(build, measured, free, start, n_starts=3) for free in (["k2", "e", "m3"], ["k2", "m3"]))
    (unseen,) = found.unidentifiable
    assert found.certificate.is_minimum
    assert not unseen.weak
    powers = {name: round(power, 6) for name, power in unseen.direction.items()}
    assert powers in ({"k2": 1.0, "e": -1.0}, {"k2": -1.0, "e": 1.0})
    assert "k2 ×" in unseen.description
    assert found.intervals["k2"] == found.intervals["e"] == (0.0, np.inf)
    assert found.interval_text("e") == "not determined"
    assert np.isinf(found.standard_errors["k2"])
    assert np.isnan(found.covariance[0, 2])
    assert found.intervals["m3"] == pytest.approx(single.intervals["m3"], rel=1e-4)
    assert found.values["k2"] * found.values["e"] == pytest.approx(single.values["k2"], rel=1e-6)


def test_fit_parameters_of_any_sign_have_intervals():
    def build(p):
        return SecondOrderModel([[1.0]], [[0.1]], [[4.0 + p["a"] + p["b"]]], {"f": [1.0]}, {"y": [1.0]})

    free, start = {"a": (-1.0, 1.0), "b": (-1.0, 1.0)}, {"a": 0.1, "b": -0.1}
    both = bc.fit(build, [0.3], free, start, error_std=0.01, n_starts=1)
    assert re.search("[ab] plus .* with [ab] minus|[ab] minus .* with [ab] plus", both.unidentifiable[0].description)
    found = bc.fit(build, [0.3], {"a": (-1.0, 1.0)}, start, error_std=0.01, n_starts=1)
    low, high = found.family(range_margin=0.1).ranges["a"]
    margin = 0.1 * abs(found.values["a"])
    assert (low + margin, high - margin) == pytest.approx(found.intervals["a"], rel=1e-9)


def test_fit_without_redundancy_has_no_intervals():
    measured = frequencies(CHAIN)[:2]
    open_ends = bc.fit(frequencies, measured, ["k1", "k2"], CHAIN, n_starts=1)
    assert set(open_ends.intervals.values()) == {(0.0, np.inf)}
    assert np.isnan(open_ends.error_std)
    assert "set error_std" in str(open_ends)
    assert "not determined" not in str(open_ends)
    assert "95 % intervals" not in str(open_ends)
    assert open_ends.interval_text("k1") == "no interval"
    known = bc.fit(frequencies, measured, ["k1", "k2"], CHAIN, n_starts=1, error_std=0.01)
    assert np.isfinite(list(known.intervals.values())).all()
    for name in ("k1", "k2"):
        low, high = known.intervals[name]
        assert low < CHAIN[name] < high


def test_fit_vanishing_damping_upper_end_only():
    """The upper end is that of the model linear in the damping; the minimum at zero damping is one."""
    rng = np.random.default_rng(0)
    measured = response({**CHAIN, "c": 1e-9}, OMEGA) * np.exp(0.05 * rng.standard_normal(len(OMEGA)))
    found = bc.fit(response, control.frd(measured, OMEGA), ["k1", "c"], CHAIN, n_starts=2)
    low, high = found.intervals["c"]
    assert low == 0.0
    assert 1e-6 < high < 1e-4
    assert "or less" in found.interval_text("c")
    assert found.certificate.is_minimum


# -- the certificate ------------------------------------------------------------------------------------------------------


def test_a_solver_that_ends_elsewhere_is_not_believed(monkeypatch):
    import scipy.optimize

    honest = scipy.optimize.least_squares

    def early(*given, **named):
        found = honest(*given, **named)
        found.x = found.x + 0.01
        found.cost = 0.5 * float(np.square(given[0](found.x)).sum())
        return found

    measured = frequencies(CHAIN) * np.array([1.01, 0.99, 1.0])
    good = bc.fit(frequencies, measured, ["k1"], CHAIN, n_starts=1)
    assert good.success
    assert good.certificate.distance_to_minimum < 0.05
    monkeypatch.setattr(scipy.optimize, "least_squares", early)
    bad = bc.fit(frequencies, measured, ["k1"], CHAIN, n_starts=1)
    assert not bad.certificate.is_minimum
    assert "minimum not certified" in repr(bad)


def test_two_minima_that_fit_alike_are_both_said():
    def even(p):
        return [1.0 + np.log(p["a"] / 2.0) ** 2, 3.0 + 2.0 * np.log(p["a"] / 2.0) ** 2 + 1e-3 * np.log(p["a"] / 2.0)]

    measured = np.array([1.3, 3.55])
    found = bc.fit(even, measured, {"a": (0.5, 8.0)}, {"a": 2.5}, n_starts=12)
    assert not found.success
    (rival, *_) = found.certificate.alternatives
    assert rival["a"] * found.values["a"] == pytest.approx(4.0, rel=0.05)
    assert "other parameters fit" in repr(found.certificate)


def test_a_better_start_than_the_one_given_is_taken():
    def waves(p):
        x = np.log(p["a"])
        return [2.0 + np.sin(3.0 * x) + 0.05 * x**2, 5.0 + 0.4 * (x - 2.0) ** 2]

    measured = waves({"a": np.exp(2.1)})
    found = bc.fit(waves, measured, {"a": (0.05, 50.0)}, {"a": 0.1}, n_starts=20, modes=[1, 2])
    assert found.values["a"] == pytest.approx(np.exp(2.1), rel=1e-6)
    assert found.certificate.n_agreeing_starts < found.certificate.n_starts


# -- pictures ---------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["response", "singular values"])
def test_fit_plot_shows_data_and_model(kind):
    def answer(p):
        return response(p) if kind == "response" else np.abs(response(p)[0])

    exact = response(CHAIN)
    data = MeasuredFrequencyResponse(
        OMEGA / (2 * np.pi), np.abs(exact[0]), ("gain",), exact if kind == "response" else None
    )
    ax = bc.fit(answer, data, ["k1"], CHAIN, n_starts=1).plot(ax=Figure().add_subplot())
    labels = ax.get_legend_handles_labels()[1]
    assert {"start", "fitted"} <= set(labels)
    assert any(label.startswith("measured") for label in labels)


def test_a_file_of_complex_responses_is_fitted_with_its_phase(tmp_path):
    """A delay changes the phase alone: complex data tell it, their singular values do not."""
    late = np.exp(-0.02j * OMEGA) * response(CHAIN, OMEGA)[0, 0]
    rows = [f"{w / (2.0 * np.pi)!r},{y.real!r},{y.imag!r}" for w, y in zip(OMEGA.tolist(), late.tolist(), strict=True)]
    file = tmp_path / "shaker.csv"
    file.write_text("\n".join(["freq_hz,re_1_1,im_1_1", *rows]))
    curve = bc.read_frequency_response(file)

    def build(p):
        return np.exp(-1j * p["delay"] * OMEGA) * response(CHAIN)[:1, :1]

    found = bc.fit(build, curve, {"delay": (0.0, 0.05)}, {"delay": 0.01}, n_starts=1)
    assert found.values["delay"] == pytest.approx(0.02, rel=1e-9)
    assert found.data.kind == "complex frequency response"
    assert "values (complex frequency response)" in str(found)
    lost, start = replace(curve, frdata=None), {"delay": 0.01}
    without = bc.fit(lambda p: np.abs(build(p)[0]), lost, {"delay": (0.0, 0.05)}, start, n_starts=1)
    assert without.data.kind == "singular values"
    assert without.unidentifiable


# -- several data sets, and errors that are no independent numbers -------------------------------------------------------

DENSE = np.linspace(5.0, 50.0, 100)


def dense(p):
    """Return the response of the chain at as many frequencies."""
    return response(p, DENSE)


def day(rng, stiffness, model_error=0.0):
    """Return the response of a day: errors of a percent, and what no parameter explains, the same each day."""
    noise = 0.01 * (rng.standard_normal(len(DENSE)) + 1j * rng.standard_normal(len(DENSE)))
    wrong = model_error * np.sin(np.arange(len(DENSE)) / 3.0)
    return control.frd(response({**CHAIN, "c": 4e-3, "k1": stiffness}, DENSE) * np.exp(noise + wrong), DENSE)


def test_days_that_differ_make_the_interval_as_wide_as_they_do():
    """The values of each day alone, and the interval of a normal value to be drawn anew, by the textbook."""
    rng, stiffness = np.random.default_rng(1), np.array([880.0, 905.0, 893.0, 921.0])
    days = [day(rng, value) for value in stiffness]
    found = bc.fit(dense, days, ["k1"], {**CHAIN, "c": 4e-3}, n_starts=1)
    each = np.array([values["k1"] for values in found.per_dataset])
    np.testing.assert_allclose(each, stiffness, rtol=2e-3)
    half = 3.182 * np.log(each).std(ddof=1) * np.sqrt(1.0 + 1.0 / 4.0)  # Student's t of three degrees of freedom
    low, high = found.intervals["k1"]
    np.testing.assert_allclose([np.log(found.values["k1"] / low), np.log(high / found.values["k1"])], half, rtol=0.05)
    alone = bc.fit(dense, days[0], ["k1"], {**CHAIN, "c": 4e-3}, n_starts=1)
    assert not alone.intervals["k1"][0] < 921.0 < alone.intervals["k1"][1]
    assert "scatter of 4 data sets" in found.uncertainty_source
    assert "data set 4: k1 = 92" in str(found)
    labels = found.plot(ax=Figure().add_subplot()).get_legend_handles_labels()[1]
    assert [f"measured, data set {k + 1}" in labels for k in range(4)] == [True] * 4


def test_fit_pairs_modes_per_dataset():
    exact = frequencies(CHAIN)
    found = bc.fit(frequencies, [exact * 1.001, exact[:2], exact * 0.999], ["k1", "k2", "k3"], CHAIN, n_starts=1)
    assert found.mode_numbers == (1, 2, 3, 1, 2, 1, 2, 3)
    np.testing.assert_allclose(found.per_dataset[0]["k1"], CHAIN["k1"] * 1.001**2, rtol=1e-5)


def test_fit_datasets_at_different_frequencies_reveal_no_errors():
    days = [control.frd(response(CHAIN, part), part) for part in (OMEGA[::2], OMEGA[1::2])]
    found = bc.fit(response, days, ["k1", "k3"], {**CHAIN, "k1": 800.0}, n_starts=1)
    assert recovered(found, CHAIN, ("k1", "k3"))
    assert np.isnan(found.certificate.residual_ratio)


def test_what_an_estimated_response_says_of_its_errors_weighs():
    """Lines that are said to be bad, and are, do not matter."""
    rng = np.random.default_rng(3)
    H = day(rng, 900.0)
    H.frdata[0, 0, ::2] *= 3.0
    H.deviation = np.where(np.arange(len(DENSE)) % 2 == 0, 100.0, 0.01) * np.abs(H.frdata)
    found = bc.fit(dense, H, ["k1"], {**CHAIN, "c": 4e-3}, n_starts=1)
    assert abs(found.values["k1"] / 900.0 - 1.0) < 2e-3
    assert found.certificate.residual_ratio < 1.2


@pytest.mark.parametrize("errors", [0.001, 0.1])
def test_fit_relative_errors_use_coherent_frequencies(errors):
    """A right model is adequate over the default band, most of which is noise; the data count as independent numbers."""
    model, rng = three_masses(0.01), np.random.default_rng(0)
    u = signal.lfilter(*signal.butter(8, 0.8), rng.standard_normal((8000, 2)), axis=0)
    y = response_of_record(model, u, 0.02)[4000:]
    y += errors * y.std(axis=0) * rng.standard_normal(y.shape)
    inputs, outputs = ({f"{name}{k + 1}": x for k, x in enumerate(X.T)} for name, X in (("f", u[4000:]), ("y", y)))
    H = bc.estimate_frequency_response(inputs, outputs, 0.02, intersample="bl")
    found = bc.fit(three_masses, H, {"damping": (0.001, 0.1)}, n_starts=1)
    assert found.certificate.residual_ratio**2 < 1.5
    assert found.values["damping"] == pytest.approx(0.01, rel=0.02)
    assert found.certificate.ndata < 0.9 * H.frdata.size * 2
    assert f"({found.certificate.ndata:,} values, correlation neglected)" in str(found)


# -- adequacy of the model ---------------------------------------------------------------------------------------------

SHIFT = np.array([1.0, 2.2, 1.0])  # of frequencies, which no k1 explains
MODEL_ERROR = 0.45  # of the logarithm of responses


def cases(rng, wrong):
    """Return a model, measurements with errors of 1 % and options, by what is known of the errors."""
    hz = [frequencies(CHAIN) * SHIFT**wrong * np.exp(0.01 * rng.standard_normal(3)) for _ in range(4)]
    days = [day(rng, 900.0, MODEL_ERROR * wrong) for _ in range(3)]
    said = day(rng, 900.0, MODEL_ERROR * wrong)
    said.deviation = 0.01 * np.abs(said.frdata)
    return {
        "deviation": (frequencies, hz[0], {"modes": (1, 2, 3), "error_std": 0.01}),
        "unknown": (frequencies, hz[0], {"modes": (1, 2, 3)}),
        "frequency sets": (frequencies, hz, {"modes": (1, 2, 3)}),
        "response sets": (dense, days, {}),
        "absolute response sets": (dense, days, {"error_model": "absolute"}),
        "measured response": (dense, said, {}),
    }


def left(found):
    """Return the residuals in percent of the data by the textbook: each value counts by its own size, or as it is."""
    data, fitted = found.data.values, found.best_fit
    unit = np.abs(data) if found.data.errors == "relative" else 1.0
    return 100.0 * np.sqrt(np.sum(np.abs((data - fitted) / unit) ** 2) / np.sum(np.abs(data / unit) ** 2))


@pytest.mark.parametrize("wrong", [True, False])
@pytest.mark.parametrize("case", cases(np.random.default_rng(0), False))
def test_fit_adequacy_is_headline(case, wrong):
    """A wrong model leaves 25 to 45 % at a certified minimum, a right one at most 3 %; each is written before the minimum."""
    build, measured, more = cases(np.random.default_rng(0), wrong)[case]
    found = bc.fit(build, measured, ["k1"], {**CHAIN, "c": 4e-3}, n_starts=1, **more)
    certificate = found.certificate
    assert found.success
    assert certificate.residual_percent == pytest.approx(left(found), rel=1e-6)
    assert 25.0 < certificate.residual_percent < 45.0 if wrong else certificate.residual_percent < 3.0
    assert np.isnan(certificate.residual_ratio) == (case == "unknown")
    assert certificate.fit_adequate == (case == "unknown" or not wrong)
    for shown in (repr(found), str(found), repr(certificate)):
        text = " ".join(shown.split())
        assert (
            0 < text.index(f"weighted residual {certificate.residual_percent:.2g} %") < text.index("minimum certified")
        )
        assert ("model inadequate" in text) == (not certificate.fit_adequate)


@pytest.mark.slow
def test_fit_adequacy_p_values_are_uniform():
    """p-values of chi-square and of the F test for lack of fit, over 100 data sets of a right model."""
    rng = np.random.default_rng(0)
    found = {"known": [], "sets": []}
    for _ in range(100):
        rows = frequencies(CHAIN) * np.exp(0.01 * rng.standard_normal((4, 3)))
        for name, measured, more in (("known", rows[0], {"error_std": 0.01}), ("sets", list(rows), {})):
            fit = bc.fit(frequencies, measured, ["k1"], CHAIN, modes=(1, 2, 3), n_starts=1, **more)
            found[name].append(fit.certificate.p_value)
    for chances in found.values():
        assert stats.kstest(chances, "uniform").pvalue > 0.01
