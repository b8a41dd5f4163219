"""The benchmark of the hub-beam: errors as promised, and every line there (run times are for the reader of its table)."""

from io import StringIO

import pytest
from rich.console import Console

from boomctl.lab.benchmark.rotating_beam.run import run


@pytest.mark.slow
def test_benchmark_keeps_its_errors():
    told = []
    report = run(progress=told.append)
    assert len(told) == 5
    own = [row for row in report.rows if not row.section.startswith("Against")]
    for row in own:
        assert row.error <= (1e-5 if row.job.startswith("residual") else 1e-6), row.job
    assert len([row for row in own if "ours" in row.job or row.job.startswith("residual")]) == 3
    driven = [row for row in own if row.section.endswith("IDAS") and row.target]
    assert [row.job for row in driven[:2]] == ["SFOAM, 1, 1e-06", "SFOAM, 1, 1e-08"]
    assert len(driven) == 10
    assert all(row.error <= float(row.job.split(", ")[2]) for row in driven)
    assert any(row.job == "16 torques; peer: IDAS" for row in own)
    fed_back = [row for row in own if row.section.startswith("Under feedback")]
    assert len([row for row in fed_back if row.target]) == 1
    assert all(row.error <= 1e-10 for row in fed_back)
    many = [row for row in report.rows if row.section.startswith("256 machines")]
    assert len(many) == 1
    against = [row for row in report.rows if row.section.startswith("Against") and row.job.startswith("SFOAM")]
    assert len(against) == 2
    assert [row.target.endswith("exudyn") for row in against] == [True, False]
    assert all(row.note == "absent" if row.peer is None else row.peer_error for row in against)
    console = Console(width=100, record=True, file=StringIO())
    console.print(report.render())
    text = console.export_text()
    assert "boomctl benchmark hub-beam" in text
    assert max(map(len, text.splitlines())) <= 100
