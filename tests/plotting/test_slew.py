"""Pictures of slews draw what the results hold."""

import re

import numpy as np
import pytest

import boomctl as bc
from boomctl.plotting import figure_of
from boomctl.plotting.rotating_beam import Film, film_bytes
from boomctl.slew import SlewError, compare_slews, mesh_study


def test_a_film_of_a_hub_without_a_radius_shows_its_axis():
    time = np.arange(0.0, 0.2, 0.05)
    along = np.linspace(0.0, 8.0, 9) * np.exp(1j * time[:, None])
    with np.errstate(all="raise"):
        assert film_bytes(Film(time, (("rigid", along),), 0.0, "a slew")).startswith(b"GIF")


@pytest.fixture(scope="module")
def study():
    schemes = (("shooting", 1), ("collocation", 1), ("radau", 2))
    return mesh_study(bc.hub_beam(modes=1), 0.5, 100.0, 3.0, schemes, (10, 20, 40, 80))


def test_mesh_picture_draws_the_errors_and_says_their_orders(study):
    figure = figure_of(study.plot)
    drawn = figure.axes[0].get_lines()
    assert len(drawn) == len(study.lines) == 4
    for curve, line in zip(drawn, study.lines, strict=True):
        kept = line.errors > 0.0
        assert np.array_equal(curve.get_xdata(), study.intervals[kept])
        assert np.array_equal(curve.get_ydata(), line.errors[kept])
        assert curve.get_label() == f"{line.name}: order {line.order:.1f}"
    assert [text.get_text() for text in figure.legends[0].get_texts()] == [curve.get_label() for curve in drawn]


def test_orders_are_slopes_of_what_is_drawn(study):
    for curve, line in zip(figure_of(study.plot).axes[0].get_lines(), study.lines, strict=True):
        x, y = np.log(curve.get_xdata()), np.log(curve.get_ydata())
        steps = -np.diff(y) / np.diff(x)
        assert steps[1:].min() - 0.5 <= line.order <= steps[1:].max() + 0.5
        assert line.order == pytest.approx(line.theory, abs=0.6)


def test_a_mesh_without_solution_leaves_a_gap(monkeypatch):
    from boomctl.slew.nlp.programme import Programme

    solve = Programme.solve

    def fails_on_ten(self, *given):
        if self.transcription.scheme.intervals == 10:
            raise SlewError("no slew")
        return solve(self, *given)

    monkeypatch.setattr(Programme, "solve", fails_on_ten)
    study = mesh_study(bc.hub_beam(modes=1), 0.5, 100.0, 3.0, (("collocation", 1),), (10, 20, 40))
    end, held = study.lines
    assert np.isnan(end.errors).tolist() == [True, False, False]
    assert end.order == pytest.approx(2.0, abs=0.3)
    assert np.isnan(held.order)
    curves = figure_of(study.plot).axes[0].get_lines()
    assert curves[0].get_xdata().tolist() == [20, 40]
    assert curves[1].get_label().endswith("order not seen")


@pytest.mark.slow
def test_no_two_slews_share_a_look_or_a_place():
    comparison = compare_slews(bc.hub_beam(modes=1), 0.5, 100.0)
    names = ("bang-bang", "bang-bang, ZV", "bang-bang, EI")
    figure = figure_of(comparison.plot, names=names)
    right = figure.axes[-1]
    markers = {c.get_label(): c for c in right.get_lines() if not re.match("_|frequencies", str(c.get_label()))}
    assert set(markers) == {line.name for line in comparison.lines}
    looks = {(c.get_marker(), c.get_color(), c.get_markerfacecolor()) for c in markers.values()}
    assert len(looks) == len(markers)
    places = np.sort([float(c.get_xdata()[0]) for c in markers.values()])
    assert np.diff(places).min() > 0.02 * np.ptp([line.duration for line in comparison.lines])
    for line in comparison.lines:
        assert markers[line.name].get_ydata()[0] == max(line.vibration, 1e-4)
    assert len({markers[name].get_color() for name in names}) == len(names)
