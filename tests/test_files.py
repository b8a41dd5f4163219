"""Files and reports: written whole or not at all, self-contained pages, tables of numbers as programs write them."""

import json
import tempfile

import numpy as np
import pytest

from boomctl.files import plain, read_numbers, write_whole
from boomctl.report import Picture, Report, Section, Table, bound_reports, number

PICTURE = Picture("a", "", {"png": b"new", "svg": b"<svg/>"})
REPORT = Report("A title", (), (Section("One", pictures=(PICTURE,)),), {"x": 1})


@pytest.mark.parametrize(("function", "works"), [("tempfile.mkstemp", 2), ("os.replace", 0)])
def test_report_on_full_disk_leaves_files_as_they_were(function, works, tmp_path, monkeypatch):
    (tmp_path / "a.png").write_bytes(b"old")
    made = tempfile.mkstemp

    def broken(*paths, **options):
        if len(list(tmp_path.iterdir())) > works:
            raise OSError("disk full")
        return made(**options)

    with monkeypatch.context() as patch:
        patch.setattr(function, broken)
        with pytest.raises(OSError, match="disk full"):
            REPORT.write(tmp_path)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == {"a.png": b"old"}
    assert {path.name for path in REPORT.write(tmp_path)} == {"a.png", "a.svg", "results.json", "report.html"}
    assert [(tmp_path / name).read_bytes() for name in ("a.png", "a.svg")] == [b"new", b"<svg/>"]
    assert REPORT.html.count("<img") == 1  # the first kind


@pytest.mark.parametrize("taken", ["a.png", "results.json", "report.html"])
def test_report_where_a_folder_has_the_name_of_a_file_raises(taken, tmp_path):
    (tmp_path / taken).mkdir()
    with pytest.raises(ValueError, match=f"{taken}: expected a file, got a folder"):
        REPORT.write(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == [taken]


@pytest.mark.parametrize(
    ("path", "why"), [("missing/a", "No such file"), ("file/a", "Not a directory"), ("a" * 300, "too long")]
)
def test_write_whole_error_names_the_file_not_its_temporary_one(path, why, tmp_path):
    (tmp_path / "file").write_text("kept")
    with pytest.raises(OSError, match=why) as caught:
        write_whole(tmp_path / path, "text")
    assert caught.value.filename == str(tmp_path / path)
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


@pytest.mark.parametrize("mark", [",", ";", "\t"])
def test_read_numbers_of_numpy_are_values_and_names(mark, tmp_path):
    """As `numpy.savetxt` writes them: the last comment above the numbers holds the names."""
    values, path = np.array([[0.0, -1.5], [0.1, 2e-7], [0.2, 3.0]]), tmp_path / "table.csv"
    np.savetxt(path, values, delimiter=mark, header=f"measured in June\ntime{mark}place")
    table = read_numbers(path)
    assert table.header == ("time", "place")
    assert table.comments == ((1, "measured in June"),)
    np.testing.assert_array_equal(table.values, values)
    assert table.lines == (3, 4, 5)


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        (1e-3, "0.00100"),
        (-2.5, "−2.50"),
        (12.345, "12.3"),
        (0.0005, "5.00·10⁻⁴"),
        (1e4, "1.00·10⁴"),
    ],
)
def test_number_of_report_has_few_digits(value, shown):
    assert number(value) == shown


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


def test_numbers_that_are_not_finite_survive_json():
    assert json.dumps(plain({"a": np.array([1.0, np.inf]), "b": (np.float64(2.0), np.int64(3))})) == (
        '{"a": [1.0, "inf"], "b": [2.0, 3]}'
    )
