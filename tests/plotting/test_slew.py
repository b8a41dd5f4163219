"""Pictures of slews draw what the results hold."""

import numpy as np
import pytest

import boomctl as bc
from boomctl.plotting import figure_of
from boomctl.plotting.canvas import film
from boomctl.plotting.slew import animate_slew
from tests import handed_out


@pytest.mark.parametrize("radius", [0.5, pytest.param(0.0, marks=pytest.mark.slow)])
def test_animate_slew_draws_each_motion(radius):
    beam = bc.hub_beam(bc.HubBeamParameters(hub_radius=radius), modes=1)
    t = np.linspace(0.0, 1.0, 21)
    motions = {
        f"{torque:g} N m": beam.simulate(bc.maneuvers.applied_torque(lambda t, u=torque: u + 0.0 * t), t)
        for torque in (50.0, 100.0)
    }
    shown = animate_slew(beam, motions, title="pushed", time_step=0.25)
    figure = shown._fig
    shown._func(3)  # at 0.75 s
    (spoke, *lines), ax = figure.axes[0].get_lines(), figure.axes[0]
    for line, (name, motion) in zip(lines, motions.items(), strict=True):
        shape = beam.deformed_shape(motion.states[15:16])[0]
        assert line.get_label() == name
        assert np.allclose(line.get_xdata() + 1j * line.get_ydata(), shape, atol=1e-12)
    first = motions["50 N m"].hub_angle[15]
    assert np.angle(complex(spoke.get_xdata()[1], spoke.get_ydata()[1])) == pytest.approx(first)
    assert ax.get_title(loc="left") == "pushed, t = 0.8 s"
    assert film("slew", shown, "two slews").files["gif"].startswith(b"GIF")


def test_slew_comparison_plot_has_vibration_of_each_slew():
    comparison = handed_out.comparison()
    vibrations = figure_of(comparison.plot).axes[-2].get_lines()
    drawn = {line.get_label(): line.get_ydata() for line in vibrations}
    for line in comparison.rows:
        assert drawn[line.name] == pytest.approx([line.residual_vibration])
