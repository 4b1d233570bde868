"""The registration benchmark on a small scene, without the libraries that it compares with."""

import csv
import os
import subprocess
import sys
from pathlib import Path

SCRIPT = Path(__file__).parents[2] / "scripts" / "benchmark_registration.py"


def test_one_table_of_all_matchers_that_are_installed(tmp_path):
    # What is first on the path hides an installed library.
    for library in ("open3d", "kiss_matcher"):
        (tmp_path / f"{library}.py").write_text("raise ImportError\n")
    done = subprocess.run(
        [
            sys.executable,
            SCRIPT,
            "--scenes",
            "twin-rooms",
            "--seeds",
            "0:1",
            "--out",
            tmp_path / "t",
        ],
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": str(tmp_path)},
        timeout=120,
        check=True,
    )
    assert "Open3D FPFH + RANSAC + ICP: open3d not installed" in done.stdout
    assert "KISS-Matcher + ICP: kiss_matcher and open3d not installed" in done.stdout
    assert done.stderr.split() == ["twin-rooms", "0"]
    table = (tmp_path / "t.md").read_text()
    assert done.stdout.endswith(table)
    rows, together = (
        [[cell.strip() for cell in line.strip("|").split("|")] for line in part.splitlines()]
        for part in table.split("\n\n")
    )
    # Eight stations: 28 pairs, at once.
    assert [row[:2] for row in together[2:]] == [["twin-rooms", "28"]]
    assert 0.0 < float(together[2][2]) < 1000.0
    bands = {(row[1], row[2]): dict(zip(rows[0], row, strict=True)) for row in rows[2:]}
    ours = bands["correlative + point_to_line (ours)", "over 0.5"]
    # Stations of one room; which room it is cannot be told without ranges, so that none is used.
    assert float(ours["best right"]) == float(ours["among"]) == 1.0
    assert (ours["accepted"], ours["wrong accepted"], ours["to ICP"]) == ("0", "0", "nan")
    with (tmp_path / "t.csv").open(newline="") as stream:
        trials = list(csv.DictReader(stream))
    assert len(trials) == sum(int(band["pairs"]) for band in bands.values())
    assert {trial["matcher"] for trial in trials} == {matcher for matcher, _ in bands}
    assert all(0.0 < float(trial["milliseconds"]) < 5000.0 for trial in trials)
