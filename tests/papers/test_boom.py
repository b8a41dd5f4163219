"""The reproduction of Anthonis & Ramon (2003): its numbers beside the published ones, and the laws behind its figures."""

import json

import numpy as np
import pytest

from boomctl.files import plain, write_whole
from boomctl.papers.anthonis_ramon.figures import TABLE_1, compute
from boomctl.report import Picture, Report, Section, Table, bound_reports

pytestmark = pytest.mark.xdist_group("reproduced boom")


@pytest.fixture(scope="module")
def result():
    return compute()


def order_of(convergence, first, last):
    """Return the mean order of convergence of each frequency between two sizes."""
    ratio = np.log(convergence.sizes[last] / convergence.sizes[first])
    return np.log(convergence.error[first] / convergence.error[last]) / ratio


def test_the_finite_element_column_is_met_to_the_last_printed_digit(result):
    finite = next(method for method in result.methods if method.name.startswith("finite"))
    printed = 0.5e-4
    assert np.abs(finite.computed_hz - finite.published_hz).max() <= 1e-4 + printed


def test_the_hermitian_column_is_met(result):
    hermitian = next(method for method in result.methods if "Hermitian" in method.name)
    assert np.abs(hermitian.difference_percent).max() < 0.15


def test_the_geometrical_column_is_shown_with_its_differences(result):
    geometrical = next(method for method in result.methods if "geometrical" in method.name)
    assert np.abs(geometrical.difference_percent[[0, 1, 2]]).max() < 0.5
    assert abs(geometrical.difference_percent[4]) < 1.0
    assert abs(geometrical.difference_percent[3]) > 5.0
    assert all(abs(item.computed_hz[3] / TABLE_1[geometrical.name][3] - 1) > 0.03 for item in result.readings)


def test_the_errors_fall_with_the_expected_orders(result):
    by_name = {item.name: item for item in result.convergence}
    attached = by_name["finite elements, nodes at hinge and springs"]
    assert order_of(attached, 8, 16) == pytest.approx(4.0, abs=0.25)
    geometrical = by_name["discrete elements, geometrical mass"]
    assert order_of(geometrical, 0, 5)[[0, 1, 2]] == pytest.approx(2.0, abs=1.0)
    equal = by_name["finite elements, equal"]
    assert (np.diff(equal.error[:, 0]) > 0).any()
    assert (order_of(equal, 3, len(equal.sizes) - 1) > 2.5).all()
    assert by_name["high-order elements, 4"].error[-1].max() < 1e-10


def test_the_peaks_of_figure_3_are_certified_and_agree_with_the_exact_curve(result):
    exact = result.sigma["exact beam"]
    for name, curve in result.sigma.items():
        if name != "exact beam":
            assert curve.certified
            assert curve.peak == pytest.approx(exact.peak, rel=0.01)


def test_a_report_escapes_what_it_shows_and_needs_nothing_else():
    picture = Picture("p", "caption", {"png": b"abc"})
    section = Section("a < b", ("x & y",), (Table(("head",), (("1 < 2",),)),), (picture,))
    report = Report("<title>", ("lead",), (section,), {}).html
    assert "a &lt; b" in report
    assert "x &amp; y" in report
    assert "data:image/png;base64,YWJj" in report
    assert "<title>&lt;title&gt;</title>" in report


def test_a_report_writes_its_pictures_in_all_kinds_and_shows_the_first(tmp_path):
    picture = Picture("p", "caption", {"png": b"abc", "svg": b"<svg/>"})
    report = Report("title", ("lead",), (Section("head", pictures=(picture,)),), {"x": 1.0})
    files = report.write(tmp_path / "out")
    assert {path.name for path in files} == {"p.png", "p.svg", "results.json", "report.html"}
    assert all(path.is_file() for path in files)
    assert (tmp_path / "out" / "p.svg").read_bytes() == b"<svg/>"
    assert report.html.count("<img") == 1


def test_bound_reports_stand_alone():
    bound = bound_reports("both", [("a & b", "<p title='x'>one</p>"), ("c", "<p>two</p>")])
    assert bound.count("srcdoc=") == 2
    assert "&lt;p title=&#x27;x&#x27;&gt;one&lt;/p&gt;" in bound
    assert "<p title=" not in bound


def test_a_file_is_written_whole_or_not_at_all(tmp_path, monkeypatch):
    target = tmp_path / "results.json"
    write_whole(target, "old")

    def fail(*_):
        raise OSError("disk full")

    monkeypatch.setattr("os.replace", fail)
    with pytest.raises(OSError, match="disk full"):
        write_whole(target, "new")
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


def test_numbers_that_are_not_finite_survive_json():
    assert json.dumps(plain({"a": np.array([1.0, np.inf]), "b": (np.float64(2.0), np.int64(3))})) == (
        '{"a": [1.0, "inf"], "b": [2.0, 3]}'
    )
