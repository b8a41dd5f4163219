"""Models chosen by accuracy: as near to the geometrically exact beam as asked for."""

import numpy as np
import pytest

import boomctl as bc

SPIN_UP = bc.spin_up(final_speed=2.8, duration=30.0)
EXACT = "geometrically-exact"


def _finer(p, maneuver, chosen, t):
    """Return the tip of a beam with more polynomials and shorter steps than any that the choice was made with."""
    finer = bc.hub_beam(p, EXACT, min(chosen.reference[1] + 3, 60))
    return finer.simulate(maneuver, t, rtol=2e-2 * chosen.accuracy, atol=1e-15 * p.length).tip_displacement


def _error(found, true):
    return float(np.abs(found - true).max() / np.abs(true).max())


_HEAVY = bc.HubBeamParameters(10.5, 2700.0, 0.261, 7e10, 4.07e-3, hub_inertia=2.59e5, hub_radius=2.14)
_STOCKY = bc.HubBeamParameters(12.7, 7800.0, 1.08, 2.1e11, 1.63e-2, hub_inertia=2.07e8, hub_radius=0.0)
_DAMPED = bc.HubBeamParameters(5.39, 7800.0, 7.44e-2, 2.1e11, 2.98e-4, 6145.0, 0.31, damping_ratio=0.0288)
_LOADED = bc.HubBeamParameters(5.96, 2700.0, 1.74e-3, 7e10, 1.9e-7, 23.3, 2.07, tip_mass=0.423, damping_ratio=2.9e-3)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("p", "maneuver", "end", "accuracy"),
    [
        (_HEAVY, bc.spin_up(0.629, 1.04), 1.42, 6.5e-4),
        (_STOCKY, bc.spin_up(0.0432, 0.741), 1.54, 1.0e-3),
        (_DAMPED, bc.spin_up(0.214, 0.0798), 0.343, 6.5e-4),
        (_LOADED, bc.spin_up(1.39e-3, 1.32), 5.31, 1.05e-5),
    ],
    ids=["heavy hub", "stocky", "damped", "tip mass"],
)
def test_chosen_model_is_as_exact_as_asked_for(p, maneuver, end, accuracy):
    """Choose, simulate as a user would, and compare with a reference of the test's own."""
    t = np.linspace(0.0, end, 500)
    beam = bc.hub_beam(p, accuracy=accuracy, maneuver=maneuver, timepts=t)
    assert beam.selection.tried
    assert beam.selection.error + beam.selection.reference[2] <= accuracy
    found = beam.simulate(maneuver, t).tip_displacement
    assert _error(found, _finer(p, maneuver, beam.selection, t)) <= accuracy, beam


@pytest.fixture(scope="module")
def spun_up():
    return bc.hub_beam(accuracy=1e-3, maneuver=SPIN_UP)


@pytest.mark.slow
def test_what_was_chosen_is_said_and_is_what_is_built(spun_up):
    chosen = spun_up.selection
    assert (spun_up.model, spun_up.modes) == (chosen.model, chosen.modes) == ("sfoam", 3)
    assert [each[:2] for each in chosen.tried] == [("sfoam", 1), ("sfoam", 2), ("sfoam", 3)]
    errors = [each[2] for each in chosen.tried]
    assert errors[2] == chosen.error <= 1e-3 < errors[1] < errors[0]
    assert "3 modes of sfoam: error 3.3e-04" in repr(spun_up)
    assert spun_up == bc.hub_beam(model="sfoam", modes=3)
    assert chosen.time == pytest.approx(30.0 + 5.0 / 0.46326, rel=1e-4)
    assert chosen.largest == pytest.approx(0.2043, abs=1e-4)  # of a geometrically exact beam, in THEORY's derivation


@pytest.mark.slow
def test_high_accuracy_selects_exact_beam():
    short = bc.HubBeamParameters(length=2.0, hub_inertia=2.0, tip_mass=0.2)
    turn = bc.spin_up(6.0, 0.6)
    beam = bc.hub_beam(short, accuracy=1e-5, maneuver=turn, timepts=0.7)
    assert isinstance(beam, bc.rotating_beam.GeometricallyExactBeam)
    least = {}
    for model, _, error in beam.selection.tried:
        least[model] = min(error, least.get(model, error))
    assert all(error > 1e-5 for model, error in least.items() if model != EXACT)
    assert {"sfoam", EXACT} == set(least)
    t = np.linspace(0.0, 0.7, 300)
    found = beam.simulate(turn, t).tip_displacement
    assert _error(found, _finer(short, turn, beam.selection, t)) <= 1e-5


@pytest.mark.slow
def test_selected_tolerances_apply_to_maneuver_only(spun_up):
    chosen, t = spun_up.selection, np.linspace(0.0, 40.0, 50)
    assert (chosen.rtol, chosen.atol) == pytest.approx((1e-5, 1e-5 * chosen.largest))
    usual, start = (1e-8, 1e-10), {"initial_state": np.zeros(8)}
    for final_speed, more, (rtol, atol) in (
        (2.8, {}, (chosen.rtol, chosen.atol)),
        (2.7, {}, usual),
        (2.8, start, usual),
    ):
        maneuver = bc.spin_up(final_speed, 30.0)  # an equal one is the same
        found, known = (spun_up.simulate(maneuver, t, **more, **given) for given in ({}, {"rtol": rtol, "atol": atol}))
        np.testing.assert_array_equal(found.tip_displacement, known.tip_displacement)


def test_those_around_are_told():
    heard = []
    with bc.progress_callback(heard.append):
        bc.hub_beam(accuracy=0.1, maneuver=bc.spin_up(1.1, 2.0), timepts=2.5)
    assert {told.task for told in heard} == {"choice of a model"}
    assert {"geometrically exact beam with 5 polynomials", "sfoam with 1 mode"} <= {told.stage for told in heard}
