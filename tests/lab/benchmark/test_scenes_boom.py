"""The scenes of run time against error: references against other references, what settings say they write, plain codes."""

import inspect
from math import inf

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

import boomctl as bc
from boomctl.boom.exact import exact_frequency_response
from boomctl.boom.model import ACTUATORS, TIPS
from boomctl.boom.parameters import BoomParameters
from boomctl.lab.benchmark.peers.plain_boom import PlainBoom
from boomctl.lab.benchmark.references.high_precision import exact_response, mesh_response, sigma_of, tip_transfer
from boomctl.lab.benchmark.scene import there
from boomctl.lab.benchmark.scenes.boom_peak import boom_peak, peak_in_many_digits
from boomctl.lab.benchmark.scenes.boom_reduction import boom_reduction
from boomctl.lab.benchmark.scenes.boom_sigma import boom_sigma
from boomctl.lab.benchmark.scenes.boom_time import boom_time, corners, exact_motion, track
from boomctl.lab.benchmark.scenes.lumped_masses import exact_frequencies, lumped_masses
from boomctl.lti.python_control import control

P = BoomParameters()


def test_the_plain_boom_is_the_mesh_in_fifty_digits():
    boom, omega = PlainBoom.of(P, 6), np.array([0.7, 3.0, 40.0])
    true = mesh_response(P, omega, 6)
    A, B, C, D = boom.statespace()
    E_A, E_B, E_C, E = boom.descriptor()
    for k, w in enumerate(omega):
        direct = boom.tips @ np.linalg.solve(
            (boom.K + 1j * w * boom.C - w * w * boom.M).toarray(), boom.F + 1j * w * boom.G
        )
        states = C @ np.linalg.solve(1j * w * np.eye(len(A)) - A, B) + D
        sparse = E_C @ np.linalg.solve(1j * w * E.toarray() - E_A.toarray(), E_B)
        for found in (direct, states, sparse):
            assert found == pytest.approx(true[:, :, k], rel=1e-9)


def test_the_transfer_of_the_tips_is_the_exact_response_by_halves():
    import mpmath as mp

    response = exact_response(P, np.array([2.0]))[:2, :2, 0]
    with mp.workdps(50):
        alike, opposite = tip_transfer(P, mp.mpc(0, 2.0))
    assert complex(alike) == pytest.approx(response[0, 0] + response[0, 1], rel=1e-14)
    assert complex(opposite) == pytest.approx(response[0, 0] - response[0, 1], rel=1e-14)


@pytest.mark.slow
def test_the_peak_is_the_largest_value_of_the_exact_response():
    found = peak_in_many_digits(P)

    def value(omega):
        response = exact_frequency_response(P, [omega], ACTUATORS, TIPS)
        return -float(np.linalg.svd(np.asarray(response.frdata)[:, :, 0], compute_uv=False)[0])

    beside = minimize_scalar(value, bounds=(1.533, 1.535), method="bounded", options={"xatol": 1e-9})
    assert -beside.fun == pytest.approx(found, rel=1e-8)


@pytest.mark.slow  # residues of forty pairs of poles in sixty digits
def test_the_exact_motion_is_that_of_a_fine_mesh_and_begins_at_rest():
    time, wheels = track()
    found = exact_motion(P, time, 40, 60)
    fine = bc.spray_boom(P, "high-order", 8, order=12).to_statespace(ACTUATORS, TIPS)
    mesh = np.asarray(control.forced_response(fine, time, wheels).outputs)
    scale = np.abs(found).max()
    assert np.abs(found - mesh).max() <= 1e-6 * scale
    few = exact_motion(P, time, 20, 40)
    assert np.abs(found - few).max() <= 1e-6 * scale
    assert not found[:, time <= corners()[0][0][0]].any()


def test_wheels_go_over_bumps_and_end_where_they_began():
    time, wheels = track()
    for wheel, (places, slopes) in zip(wheels, corners(), strict=True):
        rounding = len(places) * 60.0 * slopes.max() * np.finfo(float).eps  # of a sum of ramps of a minute
        assert wheel.min() >= -rounding
        assert wheel.max() == pytest.approx(0.1)
        assert np.abs(wheel[time > places[-1] + 0.01]).max() <= rounding
        assert slopes.sum() == pytest.approx(0.0)


@pytest.mark.parametrize("ratio", [0.0, 1.0, 1e3])
def test_frequencies_of_the_arm_are_those_known_in_closed_form(ratio):
    found = exact_frequencies(ratio)
    if ratio == 0.0:  # a clamped beam of 2 m, 0.5 kg/m and 100 N m^2: roots of cos b cosh b = -1
        rate = np.sqrt(100.0 / 0.5) / 4.0
        assert found == pytest.approx(rate * np.array([1.8751040687119611, 4.694091132974174]) ** 2, rel=1e-12)
        return
    # Rayleigh's quotient of a massless beam with the same masses is no lower than the true first frequency
    compliance = np.array([[1.0, 2.5], [2.5, 8.0]]) / 300.0  # deflections at 1 m and 2 m to forces there, m/N
    massless = np.sqrt(
        np.linalg.eigvals(np.linalg.inv(np.diag([0.6 * ratio, 0.4 * ratio])) @ np.linalg.inv(compliance))
    )
    assert found[0] < massless.min()
    assert found[0] == pytest.approx(massless.min(), rel=0.4 / ratio)


def answers(scene, ours):
    return [(s, s.cold(0.0) if s.cold else s.hot(s.prepare())) for s in scene.settings if s.ours is ours]


@pytest.mark.parametrize("ratio", [0.0, 100.0])
def test_meshes_of_the_arm_converge_and_ours_agree_with_plain_ones(ratio):
    scene = lumped_masses(f"{ratio:g}", "quick")
    errors = {
        (s.competitor, s.label): scene.error(answer) for s, answer in [*answers(scene, True), *answers(scene, False)]
    }
    for mine, plain in (
        ("finite elements", "SciPy, eigh, consistent masses"),
        ("discrete elements, lumped", "SciPy, eigh, lumped masses"),
    ):
        assert errors[mine, "2 elements"] == pytest.approx(errors[plain, "2 elements"], rel=1e-3)
        assert errors[mine, "8 elements"] < 0.2 * errors[mine, "2 elements"]
    assert errors["exact beam", "exact"] < 1e-12
    assert errors["high-order elements", "order 6"] < errors["high-order elements", "order 4"]
    assert scene.error([np.nan, np.nan]) != scene.error([np.nan, np.nan])  # no number, which counts as infinite


def written(setting, names):
    """Return what the call that a setting says to write gives."""
    return eval(setting.call, {"bc": bc, "p": P, "actuators": ACTUATORS, "tips": TIPS, "control": control, **names})


@pytest.mark.slow  # a reference in fifty digits
def test_what_settings_of_sigma_say_to_write_gives_their_answer():
    scene = boom_sigma("quick")
    closures = dict(zip(("omega",), [scene_omega(scene)], strict=True))
    for setting, answer in answers(scene, True):
        assert written(setting, closures).sigma == pytest.approx(answer, rel=1e-9), setting.label
        assert np.isfinite(scene.error(answer))
    for setting, answer in answers(scene, False):
        assert scene.error(answer) < 1.0, setting.competitor


def scene_omega(scene):
    """Return the frequencies of the scene of sigma, which its settings close over."""

    def held(function):
        for cell in function.__closure__ or ():
            value = cell.cell_contents
            yield from [value] if isinstance(value, np.ndarray) else held(value) if inspect.isfunction(value) else ()

    return next(held(scene.settings[0].cold))


@pytest.mark.slow  # references, and others' programs
def test_what_settings_of_the_peak_and_of_reduction_say_to_write_gives_their_answer():
    scene = boom_peak("quick")
    for setting, answer in answers(scene, True):
        if "control" not in setting.call and setting.call:
            assert written(setting, {}) == pytest.approx(answer, rel=1e-9), setting.call
    scene = boom_reduction("quick")
    setting, answer = answers(scene, True)[0]
    found = written(setting, {})
    assert found.order == answer.nstates
    assert scene.error(found.system) == pytest.approx(scene.error(answer), rel=1e-3)


@pytest.mark.slow  # others' programs over a minute
def test_what_settings_of_motion_say_to_write_gives_their_answer():
    scene = boom_time("quick")
    time, wheels = track()
    given = {"time": time, "wheels": dict(zip(ACTUATORS, wheels, strict=True))}
    for setting, answer in answers(scene, True):
        found = written(setting, given)
        assert np.array([found[name] for name in TIPS]) == pytest.approx(answer, abs=1e-12)
        assert scene.error(answer) < 0.3
    for setting, answer in answers(scene, False):
        assert scene.error(answer) < 0.3, setting.competitor
    assert scene.error(np.zeros_like(answer)) == pytest.approx(1.0)
    assert scene.error(answer + inf) == inf


def test_what_is_not_installed_is_named():
    from boomctl.lab.benchmark.scene import missing

    assert missing(a_peer="no_such_module") == ("a peer: no_such_module is not installed",)
    assert missing(numpy="numpy") == ()
    assert there("numpy")
    assert not there("no_such_module")


def test_singular_values_of_a_symmetric_response_are_those_of_its_halves():
    a, b = np.array([1.0 + 2.0j, 3.0]), np.array([0.5j, -1.0])
    response = np.array([[a, b], [b, a]])
    from boomctl.lab.benchmark.peers.boom import sigma_of_response

    assert sigma_of_response(np.moveaxis(response, 2, 0)) == pytest.approx(sigma_of(response))
