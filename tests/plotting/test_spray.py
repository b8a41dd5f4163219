"""Pictures of spray and excitation: one scale for all panels, figures in the titles, densities on their line."""

import numpy as np
import pytest

import boomctl as bc
from boomctl.plotting import draw_deposit, draw_motion, figure_bytes, figure_of

X = bc.nozzle_positions()


def sprayed(k):
    t = 0.005 * np.arange(4001)
    return bc.spray_deposit(t, np.ones((24, 1)) * (k * np.sin(3.0 * t)), X, 2.0)


@pytest.mark.slow
def test_fields_side_by_side_share_their_scale_and_say_their_figures():
    results = {"passive": sprayed(0.2), "active": sprayed(0.02)}
    figure = figure_of(draw_deposit, results, length=20.0)
    *panels, bar = figure.axes
    assert len(panels) == 2
    norms = [ax.collections[0].norm for ax in panels]
    assert (norms[0].boundaries == norms[1].boundaries).all()
    assert {0.8, 0.9, 1.1, 1.2} <= set(norms[0].boundaries)
    for ax, (title, result) in zip(panels, results.items(), strict=True):
        assert ax.get_title(loc="left").startswith(f"{title}: CV {100 * result.cv:.1f} %")
        assert (np.asarray(ax.collections[0].get_array()) == result.deposit).all()
        assert ax.get_xlim()[1] - ax.get_xlim()[0] == pytest.approx(20.0)
    assert bar.get_ylabel().startswith("deposit over nominal")
    assert figure_bytes(figure, "png").startswith(b"\x89PNG")
    drawn = [figure_bytes(figure_of(draw_deposit, results, length=20.0), "svg") for _ in range(2)]
    assert drawn[0] == drawn[1]  # to the last byte: reports of one design can be compared


def test_an_even_field_is_drawn_in_the_middle_colour():
    result = sprayed(0.0)
    figure = figure_of(result.plot)
    drawn = figure.axes[0].collections[0]
    colours = drawn.cmap(drawn.norm(result.judged.ravel()))
    assert np.allclose(colours, drawn.cmap(drawn.norm(1.0)))
    with pytest.raises(ValueError, match="results: expected at least one"):
        draw_deposit({})


def test_tips_are_drawn_over_the_time_of_the_platform():
    motion = bc.sine_sweep(0.2, 2.0, 10.0, 0.01, "yaw")
    tips = {"passive": np.array([motion.left, motion.right]), "active": 0.1 * np.array([motion.left, motion.right])}
    figure = figure_of(draw_motion, motion, tips, span=(2.0, 8.0))
    platform, passive, active = figure.axes
    assert platform.get_lines()[1].get_ydata() == pytest.approx(1e3 * motion.right)
    assert passive.get_ylim() == active.get_ylim()
    assert active.get_lines()[0].get_ydata() == pytest.approx(100.0 * motion.left)
    assert platform.get_xlim() == (2.0, 8.0)


def test_still_tips_and_tips_that_do_not_fit():
    motion = bc.sine_sweep(0.2, 2.0, 10.0, 0.01)
    still = np.zeros((2, len(motion.time)))
    assert len(figure_of(draw_motion, motion, {"held": still}).axes) == 2
    with pytest.raises(ValueError, match=r"tips\['held'\]: expected shape \(2, 10001\), got \(2, 5\)"):
        draw_motion(motion, {"held": still[:, :5]})
    with pytest.raises(ValueError, match=r"tips\['held'\]: expected finite numbers"):
        draw_motion(motion, {"held": still + np.nan})
    for span in ((20.0, 30.0), (8.0, 2.0)):
        with pytest.raises(ValueError, match=r"span = .*: expected times within 0 to 10 s"):
            draw_motion(motion, {"held": still}, span=span)
    with pytest.raises(ValueError, match="length = -1"):
        draw_deposit({"even": sprayed(0.0)}, length=-1.0)
    with pytest.raises(TypeError, match="results: expected a mapping"):
        draw_deposit(sprayed(0.0))
