"""decisions.csv as a person writes it: copied from matches.csv and links.csv, obeyed, and told of."""

from __future__ import annotations

import csv
import json


def rows(path):
    with path.open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


def test_decisions_are_obeyed_and_reported(run, survey, pristine_solution, tmp_path):
    match = next(row for row in rows(pristine_solution / "matches.csv") if row["used"] == "true")
    link = next(row for row in rows(pristine_solution / "links.csv") if row["used"] == "true")
    (survey / "decisions.csv").write_text(
        "kind,a,b,decision,dx_m,dy_m,dyaw_deg\n"
        f"pair,{match['station_m']},{match['station_n']},drop,,,\n"
        f"link,{link['station']},{link['anchor']},drop,,,\n",
        encoding="utf-8",
    )
    done = run("solve", survey, "--out", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    assert "warning: decisions.csv: pair" in done.stderr
    pair = [
        row for row in rows(tmp_path / "out" / "matches.csv")
        if (row["station_m"], row["station_n"]) == (match["station_m"], match["station_n"])
    ]  # fmt: skip
    assert pair
    assert {(row["used"], row["reason"]) for row in pair} == {("false", "dropped by decisions.csv")}
    dropped = next(
        row for row in rows(tmp_path / "out" / "links.csv")
        if (row["station"], row["anchor"]) == (link["station"], link["anchor"])
    )  # fmt: skip
    assert (dropped["used"], dropped["reason"]) == ("false", "dropped by decisions.csv")
    told = json.loads((tmp_path / "out" / "solution.json").read_text())["decisions"]
    assert [(item["kind"], item["decision"], item["effect"]) for item in told] == [
        ("pair", "drop", "not used"),
        ("link", "drop", "not used"),
    ]
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert '<section id="decisions">' in page


def test_the_report_is_drawn_again_from_the_folder_alone(run, solution, tmp_path):
    first = (solution / "report.html").read_text(encoding="utf-8")
    (solution / "report.html").unlink()
    done = run("report", solution)
    assert done.returncode == 0, done.stderr
    again = (solution / "report.html").read_text(encoding="utf-8")
    assert again[: again.index("<svg")] == first[: first.index("<svg")]
    done = run("report", solution, "--to", tmp_path / "elsewhere.html")
    assert (tmp_path / "elsewhere.html").read_text(encoding="utf-8") == again
    missing = run("report", tmp_path / "nothing")
    assert missing.returncode == 2
    assert "no such folder" in missing.stderr
