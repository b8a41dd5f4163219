"""The suspension's benchmark puts its subjects one after another."""

import json

from boomctl.lab.benchmark.report import Row
from boomctl.lab.benchmark.suspension import run as suspension


def test_subjects_follow_one_another(monkeypatch):
    told, asked = [], []

    def lines(name):
        def rows(rounds, tell):
            asked.append(rounds)
            tell(name)
            return [Row(name, "job", 1.0, 60.0, ">= 50x", 1e-3, 1e-3, True)]

        return rows

    monkeypatch.setattr(suspension, "_SUBJECTS", (lines("first"), lines("second")))
    quick, full = suspension.run(progress=told.append), suspension.run(full=True)
    assert told == [row.section for row in quick.rows] == ["first", "second"]
    assert asked[0] < asked[-1]
    data = json.loads(json.dumps(full.as_dict(), allow_nan=False))
    assert [row["ratio"] for row in data["rows"]] == [60.0, 60.0]
    assert full.title == "boomctl benchmark suspension"
