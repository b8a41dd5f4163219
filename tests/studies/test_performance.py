"""What a suspension is judged by: each number is computed once, and is what asking for it alone would give."""

import control
import numpy as np
import pytest

from boomctl.analysis.sigma import sigma
from boomctl.boom.parameters import BoomParameters
from boomctl.plotting.suspension import draw_suspension_sigma
from boomctl.studies.suspension.performance import _FREQUENCIES, InField, _loop_sigma, evaluate_suspension
from boomctl.studies.suspension.scenario import CONTROLS, STROKES, FieldScenario, suspension_model


def test_loop_curve_includes_peak():
    loop = InField(BoomParameters(), None, FieldScenario()).to_tips(suspension_model(BoomParameters(), 6, 20.0))
    found, alone = _loop_sigma(loop), sigma(loop)
    whole = sigma(loop, np.union1d(alone.omega, _FREQUENCIES))
    np.testing.assert_array_equal(found.omega, whole.omega)
    np.testing.assert_array_equal(found.sigma, whole.sigma)
    assert found.certificate == alone.certificate


def test_plot_of_infinite_peak():
    drawn = [sigma(control.ss(-decay, 1.0, 1.0, 0.0)) for decay in (0.0, 0.01, 1.0)]
    for passive, active, top in ((0, 1, 160.0), (1, 0, 160.0), (2, 1, 160.0), (1, 2, 160.0), (2, 2, 1.6)):
        figure = draw_suspension_sigma(drawn[passive], drawn[active], ("passive", "active"))
        assert figure.axes[0].get_ylim() == pytest.approx((1e-3, top))
    draw_suspension_sigma(drawn[0], drawn[0], ("passive", "active"))


def test_force_rate_independent_of_sampling():
    scenario = FieldScenario(warmup_time=1.0, duration=4.0, elements=4)
    gain, rates = np.eye(2), []
    for step in (0.002, 0.0005):  # the second one four times in each step of the track's motion
        left = np.exp(-30.0 * step)
        damper = control.ss(left * gain, gain, 900.0 * (1.0 - left) * gain, -900.0 * gain, step)
        damper.input_labels, damper.output_labels = list(STROKES), list(CONTROLS)
        found = evaluate_suspension("damper", scenario, BoomParameters(), damper)
        rates.append(found.force_rate)
        late = [found.run.controls[name][found.run.time >= 1.0] for name in CONTROLS]
        assert found.force_rate == pytest.approx(abs(np.diff(late)).max() / 0.002)
    assert rates[1] == pytest.approx(rates[0], rel=0.2)
