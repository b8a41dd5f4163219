"""Pictures of the field and of tracks: one scale for all deposits, and its steps."""

import matplotlib as mpl
import numpy as np
import pytest

import boomctl as bc
from boomctl.plotting import figure_bytes, figure_of

X = bc.nozzle_positions()


def sprayed(k):
    t = 0.005 * np.arange(4001)
    return bc.spray_deposit(t, np.ones((24, 1)) * (k * np.sin(3.0 * t)), X, 2.0)


@pytest.mark.slow
def test_spray_plot_shows_a_length_on_the_scale_of_all():
    passive, active = sprayed(0.2), sprayed(0.02)
    figure = figure_of(passive.plot, label="passive", length=20.0)
    ax, bar = figure.axes
    drawn = ax.collections[0]
    assert {0.8, 0.9, 1.1, 1.2} <= set(drawn.norm.boundaries)
    assert (drawn.norm.boundaries == figure_of(active.plot).axes[0].collections[0].norm.boundaries).all()
    assert ax.get_title(loc="left").startswith(f"passive\nCV {100 * passive.cv:.1f} %")
    assert (np.asarray(drawn.get_array()) == passive.deposit).all()
    assert ax.get_xlim() == pytest.approx(passive.y_edges[passive.y_slice.start] + np.array([0.0, 20.0]))
    assert bar.get_ylabel().startswith("deposit over nominal")
    files = [figure_bytes(figure_of(passive.plot, label="passive", length=20.0), "svg") for _ in range(2)]
    assert files[0] == files[1]  # to the last byte: reports of one design can be compared


def test_spray_plot_of_an_even_field_has_the_middle_color():
    result = sprayed(0.0)
    drawn = figure_of(result.plot).axes[0].collections[0]
    colors = drawn.cmap(drawn.norm(result.evaluated_deposit.ravel()))
    assert np.allclose(colors, drawn.cmap(drawn.norm(1.0)))
    assert mpl.colors.to_hex(colors[0]) == "#f7f7f7"
    with pytest.raises(ValueError, match="length = -1"):
        result.plot(length=-1.0)
