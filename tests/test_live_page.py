"""The interactive page: its cells run, and the numbers follow its sliders."""

import importlib.util
from pathlib import Path
from types import SimpleNamespace

import pytest

PAGE = Path(__file__).parents[1] / "notebooks" / "live" / "suspension.py"


@pytest.fixture(scope="module")
def app():
    """The page, whose cells have run once to load what they need."""
    pytest.importorskip("marimo")
    pytest.importorskip("plotly")
    spec = importlib.util.spec_from_file_location("suspension", PAGE)
    page = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(page)
    page.app.run()
    return page.app


@pytest.mark.slow
def test_page_with_more_weight_on_tips_has_larger_norm(app):
    """A slider is a variable of the page: what weighs more costs more."""
    at = {"springs": 1100, "stroke": 2.0, "effort": 2.0}
    sliders = [{name: SimpleNamespace(value=x) for name, x in {**at, "tips": tips}.items()} for tips in (1.0, 2.0)]
    before, after = (app.run(defs={"slider": None, **each})[1] for each in sliders)
    assert after["design"].gamma > 1.2 * before["design"].gamma
    assert abs(after["spray"].cv / before["spray"].cv - 1.0) > 0.1
    assert abs(after["margins"].multiloop_input.alpha / before["margins"].multiloop_input.alpha - 1.0) > 0.1


@pytest.mark.slow
def test_the_page_computes_again_and_draws_what_it_says(app):
    shown, found = app.run()
    assert found["active"].certified
    assert found["spray"].cv < found["passive_spray"].cv
    first = next(each for each in shown if each is not None)
    assert first.text.startswith("<span"), "the page begins with its words"
    assert "live" in first.text
    figure = shown[-1]
    curves = {trace.name: trace.y.max() for trace in figure.data if trace.name}
    assert curves["passive"] == pytest.approx(found["passive"].peak, rel=1e-6)  # the curve reaches the peak beside it
    assert curves["controlled"] == pytest.approx(found["active"].peak, rel=1e-6)
    titles = [figure.layout[key].title.text for key in figure.layout if key.startswith(("xaxis", "yaxis"))]
    assert len(titles) == 8
    assert all(title.endswith("]") for title in titles), titles
