"""Transfer functions handed in: the system is that of their polynomials, or it is refused."""

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import boomctl as bc
from boomctl.lti.system import of
from tests.profiles import examples


def table(seed, dt=0.0):
    """Return a stable transfer matrix, entry by entry with poles of its own or shared ones."""
    rng = np.random.default_rng(seed)
    shape = rng.integers(1, 3, 2)
    shared = rng.random() < 0.5

    def polynomial():
        if dt:
            return np.real(
                np.poly(
                    np.concatenate(
                        [
                            rng.uniform(-0.9, 0.9, 1),
                            *[[p, p.conj()] for p in 0.9 * np.exp(1j * rng.uniform(0.1, 3.0, 1))],
                        ]
                    )
                )
            )
        w, z = np.exp(rng.uniform(-1.0, 2.0)), rng.uniform(0.01, 0.8)
        return np.polymul([1.0, 2.0 * z * w, w * w], [1.0, np.exp(rng.uniform(-1.0, 1.0))])

    one = polynomial()
    den = [[one if shared else polynomial() for _ in range(shape[1])] for _ in range(shape[0])]
    num = [[rng.standard_normal(rng.integers(1, 5)) for _ in range(shape[1])] for _ in range(shape[0])]
    names = {"inputs": [f"u{i}" for i in range(shape[1])], "outputs": [f"y{i}" for i in range(shape[0])]}
    return control.tf(num, den, dt, **names)


@pytest.mark.parametrize("dt", [0.0, 0.1])
@given(st.integers(0, 10**6))
@examples(40)
def test_a_transfer_function_has_its_own_response_names_and_time(dt, seed):
    G = table(seed, dt)
    system = of(G, sampled=True)
    assert (list(system.inputs), list(system.outputs), system.dt) == (G.input_labels, G.output_labels, dt)
    omega = np.geomspace(0.01, 30.0, 40)
    expected = np.asarray(control.frequency_response(G, omega).frdata)
    assert system.response(omega) == pytest.approx(expected, rel=1e-7, abs=1e-9 * np.abs(expected).max())
    assert bc.hinf_norm(G).lower >= np.linalg.norm(expected, 2, axis=(0, 1)).max() * (1.0 - 1e-6)
    assert bc.sigma(G).peak == pytest.approx(bc.hinf_norm(G).lower, rel=1e-6)  # what either certifies


def test_all_who_analyse_take_transfer_functions():
    G = control.tf([2.0], [1.0, 0.4, 4.0], inputs="force", outputs="place")
    K = control.tf([-1.0, 0.0], [0.01, 1.0], inputs="place", outputs="force")
    assert bc.hinf_norm(G).lower == pytest.approx(2.0 / (2.0 * 0.1 * 4.0 * np.sqrt(1.0 - 0.01)), rel=1e-6)
    assert bc.h2_norm(control.tf([2.0], [1.0, 2.0])).value == pytest.approx(1.0)
    assert bc.mode_table(G).rows[0].damping == pytest.approx(0.1)
    assert bc.reduce(control.tf([51.0, 101.0], [1.0, 51.0, 50.0]), order=1).order == 1
    loop = bc.feedback_loop(G, K, "force")
    poles = np.roots(np.polyadd(np.polymul([1.0, 0.4, 4.0], [0.01, 1.0]), [2.0, 0.0]))
    assert np.sort_complex(loop.poles()) == pytest.approx(np.sort_complex(poles))
    assert bc.margins(G, K)["force"].gain_high == np.inf
    time = np.linspace(0.0, 1.0, 101)
    run = bc.simulate_loop(G, K, {}, time, sample_time=0.01, feedforward={"force": np.ones(101)}, anti_windup=False)
    assert run["place"][-1] > 0.0
    shared = control.tf([[[1.0], [1.0]], [[1.0], [2.0]]], [[[1.0, 0.0]] * 2] * 2)
    assert len(of(shared).A) == 2  # as many integrators as the response has, not one an entry


def test_what_has_no_realisation_is_refused():
    with pytest.raises(ValueError, match="proper"):
        bc.hinf_norm(control.tf([1.0, 0.0, 0.0], [1.0, 1.0]))
    with pytest.raises(ValueError, match="finite"):
        bc.hinf_norm(control.tf([float("nan")], [1.0, 1.0]))
    with pytest.raises(ValueError, match="expected continuous time or a sampling time"):
        bc.hinf_norm(control.tf([1.0], [1.0, 0.5], True))
    modes = np.array([1.0])  # six decades of hardly damped modes: what each does is below the digits of the others
    for w in np.geomspace(1e-3, 1e3, 12):
        modes = np.polymul(modes, [1.0, 2e-3 * w, w * w])
    with pytest.raises(ValueError, match=r"too few digits.*expected a StateSpace"):
        bc.hinf_norm(control.tf(np.random.default_rng(1).standard_normal(24), modes))


def test_hardly_damped_modes_keep_their_digits():
    """A companion form, balanced, where a staircase form is off by the whole response."""
    modes, peaks = np.array([1.0]), np.geomspace(1.0, 1e5, 8)
    for w in peaks:
        modes = np.polymul(modes, [1.0, 2e-3 * w, w * w])
    system = of(control.tf([modes[-1]], modes))
    omega = np.outer(peaks, [0.9, 0.9999, 1.0001, 1.1]).ravel()
    exact = np.prod([w * w / (w * w - omega**2 + 2e-3j * w * omega) for w in peaks], axis=0)
    assert system.response(omega)[0, 0] == pytest.approx(exact, rel=1e-8)


def test_poles_that_a_zero_cancels_stay_those_of_the_entry():
    cancelled = control.tf([1.0, -1.0], [1.0, 1.0, -2.0])  # (s - 1)/((s - 1)(s + 2))
    assert np.sort(of(cancelled).poles.real) == pytest.approx([-2.0, 1.0])


def test_data_are_taken_where_they_tell_something_and_refused_where_not():
    omega = np.geomspace(0.1, 10.0, 50)
    lag = control.tf([1.0], [1.0, 0.1, 1.0], inputs="u", outputs="y")
    data = control.frequency_response(lag, omega)
    data = control.frd(data.frdata, omega, inputs="u", outputs="y")
    found = bc.hinf_norm(data)
    assert found.lower == pytest.approx(bc.sigma(data).peak, rel=1e-12)
    assert found.lower == pytest.approx(np.abs(data.frdata).max())
    assert (found.upper, found.certified) == (np.inf, False)
    spring = control.ss([], [], [], [[-1.0]], inputs="y", outputs="u")
    for refuse in (
        lambda: bc.margins(data, spring),  # type: ignore[arg-type]
        lambda: bc.feedback_loop(data, spring, "u"),  # type: ignore[arg-type]
        lambda: bc.h2_norm(data),  # type: ignore[arg-type]
        lambda: bc.mode_table(data),  # type: ignore[arg-type]
        lambda: bc.reduce(data, order=1),  # type: ignore[arg-type]
    ):
        with pytest.raises(TypeError, match=r"FrequencyResponseData, which does not tell its poles: boomctl.fit"):
            refuse()
