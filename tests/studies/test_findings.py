"""What was found of a design is told the same everywhere: terminal, notebook, numbers, report."""

import json
from dataclasses import replace
from html import escape

import control
import numpy as np
import pytest

import boomctl as bc
from boomctl.analysis import NormCertificate
from boomctl.files import plain
from boomctl.structure import SecondOrderModel
from boomctl.studies.findings import Finding, finite, numbers, picked, scalars, tabled, words
from boomctl.studies.suspension.assurance import told_margins
from boomctl.studies.suspension.performance import _peak


@pytest.fixture(scope="module")
def result():
    """A damped mass on a spring, with two facts of its synthesis."""
    plant = SecondOrderModel([[1.0]], [[0.02]], [[4.0]], {"force": [1.0], "wind": [1.0]}, {"position": [1.0]})
    damper = control.ss(-20.0, 20.0, 40.0, -40.0, inputs="position", outputs="force")
    facts = {"gain": "40 N s/m <at most>", "made": "by hand"}
    return bc.studies.MachineDesign("mine", "A mass on a spring", plant, damper, facts=facts).evaluate()


def test_a_terminal_and_a_notebook_show_the_same_findings(result):
    shown = [each for each in result.findings if each.text]
    assert [each.name for each in shown] == ["gain", "made"]
    for each in shown:
        assert f"\n  {each.name}: {each.text}" in str(result)
        assert f"<td>{escape(each.name)}</td><td>{escape(each.text)}</td>" in result._repr_html_()
    assert result.verdict in str(result)
    assert escape(result.verdict) in result._repr_html_()


@pytest.mark.slow
def test_stored_numbers_are_those_of_the_findings(result):
    report = result.report()
    assert report.results == result.as_dict() == numbers(result.findings)
    assert json.loads(json.dumps(plain(report.results)))["synthesis"] == words(result.findings)
    assert set(report.files) == set(result.controller_files())
    assert escape(result.verdict) in report.html


def test_records_become_tables_and_lists_by_the_same_columns():
    found = (Finding("one", 2.0, "m", text="2 m"), Finding("other", None))
    columns = {"name": "what", "value": "value [m]"}
    assert picked(found, columns) == [{"name": "one", "value": 2.0}, {"name": "other", "value": None}]
    assert scalars(Finding("one", np.zeros(2), proved=True)) == {
        "name": "one",
        "unit": "",
        "proved": True,
        "text": "",
        "key": "",
    }
    table = tabled(found, columns)
    assert (table.heads, table.lines) == (("what", "value [m]"), (("one", "2.00"), ("other", "–")))


def test_what_is_not_finite_is_none_however_deep():
    assert finite({"a": np.array([1.0, np.nan]), "b": (np.inf, "x", True)}) == {
        "a": [1.0, None],
        "b": [None, "x", True],
    }


def test_what_is_not_certified_is_not_said_to_be():
    """Of a suspension whose peaks, and whose disk margin, could not be shown to be as large as that."""
    norm = NormCertificate(2.0, np.inf, 1.0, "not told")
    assert [_peak("certified peak", each, "peak").text for each in (norm, replace(norm, upper=2.0))] == [
        "2.000, NOT certified",
        "2.000",
    ]
    plant = SecondOrderModel([[1.0]], [[0.02]], [[4.0]], {"force": [1.0]}, {"position": [1.0]})
    damper = control.ss(-20.0, 20.0, 40.0, -40.0, inputs="position", outputs="force")
    true = bc.margins(plant, damper)
    doubted = replace(true, loops=tuple(replace(loop, disk=replace(loop.disk, certified=False)) for loop in true.loops))
    said = [told_margins(found) for found in (true, doubted)]
    assert [each.proved for each in said] == [True, None]
    assert [each.text.rpartition("(")[2] for each in said] == ["certified)", "NOT certified)"]
