"""Reports and files: what stands in them, and that they are whole."""

import json

import numpy as np
import pytest

from boomctl.files import plain, write_whole
from boomctl.report import Picture, Report, Section, Table, bound_reports


def test_a_report_escapes_what_it_shows_and_needs_nothing_else():
    picture = Picture("p", "caption", {"png": b"abc"})
    section = Section("a < b", ("x & y",), (Table(("head",), (("1 < 2",),)),), (picture,))
    page = Report("<title>", ("lead",), (section,), {}).html
    for text in ("a &lt; b", "x &amp; y", "data:image/png;base64,YWJj", "<title>&lt;title&gt;</title>"):
        assert text in page


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
