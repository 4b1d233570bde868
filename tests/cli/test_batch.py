"""``slam-uwb batch``: rows, resuming, failures, interruption, and a real Dask cluster on loopback."""

import csv
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace

import psutil
import pytest

from slam_uwb.io import read_survey, write_survey

COUNT = 8


@pytest.fixture(scope="module")
def pristine_surveys(pristine_survey, tmp_path_factory):
    """Three stations each, without ranges: half a second's work; and a broken one. Not to be changed."""
    folder = tmp_path_factory.mktemp("batch") / "surveys"
    survey = read_survey(pristine_survey)
    small = replace(survey, stations=survey.stations[:3], anchors=(), ranges=(), sequence=None)
    for k in range(COUNT):
        write_survey(replace(small, name=f"n{k}"), folder / f"site/n{k}")
    broken = folder / "broken"
    broken.mkdir()
    (broken / "survey.toml").write_text("format = 1\nstations = 3\n")
    return folder


@pytest.fixture
def surveys(pristine_surveys, tmp_path):
    """A broken one and three sound ones, to spoil."""
    folder = tmp_path / "surveys"
    for name in ("broken", "site/n0", "site/n1", "site/n2"):
        shutil.copytree(pristine_surveys / name, folder / name)
    return folder


@pytest.fixture(scope="module")
def pristine_batch(run, pristine_surveys, tmp_path_factory):
    """All of them, solved in one process; not to be changed."""
    out = tmp_path_factory.mktemp("out") / "out"
    done = run("batch", pristine_surveys, "--out", out, "--workers", 1)
    return out, done


def rows(out):
    with (out / "summary.csv").open(newline="") as stream:
        return {row["survey"]: row for row in csv.DictReader(stream)}


def written(out):
    """When each solution was written."""
    return {p.parent.name: p.stat().st_mtime_ns for p in sorted(out.rglob("solution.json"))}


def hidden(folder):
    return list(folder.rglob(".*"))


def test_every_survey_has_its_row_and_its_solution(pristine_batch):
    out, done = pristine_batch
    found = rows(out)
    assert [*found] == ["broken", *(f"site/n{k}" for k in range(COUNT))]
    assert {name: row["exit_status"] for name, row in found.items()} == {
        name: "2" if name == "broken" else "0" for name in found
    }
    assert found["broken"]["reason"].startswith("survey.toml")
    assert found["site/n0"]["stations"] == "3"
    solution = json.loads((out / "site/n0/solution.json").read_text())
    assert found["site/n0"]["checksum"] == solution["checksum"]
    assert (out / "site/n0/report.html").is_file()
    # One that failed stops nothing, but is told.
    assert done.returncode == 1
    assert f"{COUNT} of {COUNT + 1} solved" in done.stdout
    assert "broken  " in done.stdout
    assert done.stderr == ""


def test_the_solution_is_that_of_solve(run, pristine_surveys, pristine_batch, tmp_path, contents):
    alone = tmp_path / "alone"
    assert run("solve", pristine_surveys / "site/n0", "--out", alone).returncode == 0
    together = contents(pristine_batch[0] / "site/n0")
    del together["batch.json"]
    assert contents(alone) == together


def test_the_table_does_not_depend_on_the_number_of_workers(
    run, pristine_surveys, pristine_batch, tmp_path, contents
):
    run("batch", pristine_surveys, "--out", tmp_path / "out", "--workers", 2)
    assert contents(tmp_path / "out") == contents(pristine_batch[0])


def test_all_solved_ends_with_0(run, surveys, tmp_path):
    done = run("batch", surveys / "site/n0", "--out", tmp_path / "out", "--json")
    assert done.returncode == 0
    summary = json.loads(done.stdout)
    assert [row["survey"] for row in summary["surveys"]] == ["n0"]
    assert [*rows(tmp_path / "out")] == ["n0"]


def test_only_what_changed_is_solved_again(run, surveys, tmp_path):
    out = tmp_path / "out"
    run("batch", surveys, "--out", out)
    before, table = written(out), (out / "summary.csv").read_bytes()
    run("batch", surveys, "--out", out)
    assert written(out) == before
    assert (out / "summary.csv").read_bytes() == table

    # A survey that changed, and a solution whose files are there but not of this survey.
    toml = surveys / "site/n0/survey.toml"
    toml.write_text(toml.read_text().replace('"n0"', '"renamed"'))
    shutil.rmtree(out / "site/n1")
    shutil.copytree(out / "site/n2", out / "site/n1")
    run("batch", surveys, "--out", out)
    after = written(out)
    assert {name for name in after if after[name] != before[name]} == {"n0", "n1"}
    solved = json.loads((out / "site/n1/solution.json").read_text())
    assert solved["checksum"] == rows(out)["site/n1"]["checksum"]

    # Other settings.
    run("batch", surveys / "site", "--out", out / "site", "--mode", "sequential")
    last = written(out)
    assert all(last[name] != after[name] for name in last)


def test_a_survey_that_no_longer_solves_says_that_the_old_solution_is_old(run, surveys, tmp_path):
    out = tmp_path / "out"
    run("batch", surveys / "site/n0", "--out", out)
    next((surveys / "site/n0/scans").iterdir()).unlink()
    done = run("batch", surveys / "site/n0", "--out", out)
    assert done.returncode == 1
    assert rows(out)["n0"]["exit_status"] == "2"
    assert "earlier state" in rows(out)["n0"]["reason"]


def test_what_would_destroy_something_is_refused_before_any_work(run, surveys, tmp_path, contents):
    before = contents(surveys)
    foreign = tmp_path / "out/site/n1"
    foreign.mkdir(parents=True)
    (foreign / "thesis.txt").write_text("mine")
    cases = {
        "no solution folder": [surveys, "--out", tmp_path / "out"],
        "would replace the survey": [surveys, "--out", surveys],
        "is a survey folder": [surveys, "--out", surveys / "site/n0"],
        "no survey": [tmp_path / "out", "--out", tmp_path / "new"],
        "both be solved into": [surveys / "site", surveys / "site/n0", "--out", tmp_path / "new"],
    }
    other = tmp_path / "elsewhere"
    shutil.copytree(surveys / "site/n1", other / "n0")
    cases["both be solved into"][1] = other / "n0"
    for message, arguments in cases.items():
        done = run("batch", *arguments)
        assert done.returncode == 2, message
        assert message in done.stderr
    assert contents(surveys) == before
    assert [*contents(tmp_path / "out")] == ["site/n1/thesis.txt"]
    assert not (tmp_path / "new").exists()


def ended(process):
    """Gone, or waiting to be reaped, which may take long where the parent is gone."""
    try:
        return process.status() == psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return True


def listen():
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_DFL)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_an_interrupted_batch_has_whole_surveys_and_goes_on(
    run, program, pristine_surveys, pristine_batch, tmp_path, contents, number
):
    out = tmp_path / "out"
    command = [program, "-v", "batch", str(pristine_surveys), "--out", str(out), "--workers", "2"]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, preexec_fn=listen
    ) as process:
        assert any("surveys: 2 of" in line for line in process.stderr)
        workers = psutil.Process(process.pid).children()
        assert len(workers) >= 2
        process.send_signal(number)
        _, stderr = process.communicate(timeout=60)
    assert "Traceback" not in stderr
    if number == signal.SIGINT:
        assert process.returncode == 130
        assert any(row["reason"].startswith("interrupted") for row in rows(out).values())
    deadline = time.monotonic() + 30
    while not all(map(ended, workers)):
        assert time.monotonic() < deadline, "processes are left behind"
        time.sleep(0.1)
    assert hidden(out) == []
    assert 1 <= len(written(out)) < COUNT
    before = written(out)
    run("batch", pristine_surveys, "--out", out)
    assert before.items() <= written(out).items()
    assert contents(out) == contents(pristine_batch[0])


@pytest.fixture
def cluster(tmp_path):
    """Address of a scheduler on loopback, and its two workers."""
    pytest.importorskip("distributed")
    threads = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL")}
    file = tmp_path / "scheduler.json"

    def start(what, *arguments):
        return subprocess.Popen(
            [sys.executable, "-m", f"distributed.cli.dask_{what}", "--scheduler-file", str(file)]
            + ["--host", "127.0.0.1", "--no-dashboard", *arguments],
            env={**os.environ, **threads},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )

    processes = [start("scheduler", "--port", "0")]
    try:
        deadline = time.monotonic() + 60
        while not (file.is_file() and file.read_text()):
            assert time.monotonic() < deadline, "the scheduler did not start"
            time.sleep(0.1)
        scratch = ("--local-directory", str(tmp_path / "scratch"))
        processes += [start("worker", "--nthreads", "1", "--no-nanny", *scratch) for _ in "ab"]
        yield json.loads(file.read_text())["address"], processes
    finally:
        for process in processes:
            process.kill()
            process.wait()


def test_on_a_cluster_that_loses_a_worker_every_survey_is_solved_once(
    program, cluster, pristine_surveys, pristine_batch, tmp_path, contents
):
    address, (_, victim, _) = cluster
    out = tmp_path / "out"
    command = [program, "-v", "batch", str(pristine_surveys), "--out", str(out)]
    with subprocess.Popen(
        [*command, "--scheduler", address],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        lines = iter(process.stderr.readline, "")
        assert any("surveys: 3 of" in line for line in lines)
        before = written(out)
        victim.kill()
        stdout, stderr = process.communicate(timeout=120)
    assert process.returncode == 1, stderr
    assert f"{COUNT} of {COUNT + 1} solved" in stdout
    # What was solved before stays; the rest came from the worker that is left.
    assert before.items() <= written(out).items()
    assert contents(out) == contents(pristine_batch[0])


def test_a_cluster_that_goes_away_leaves_whole_surveys(
    program, cluster, pristine_surveys, tmp_path
):
    address, (scheduler, *_) = cluster
    out = tmp_path / "out"
    command = [program, "-v", "batch", str(pristine_surveys), "--out", str(out)]
    with subprocess.Popen(
        [*command, "--scheduler", address], stderr=subprocess.PIPE, text=True
    ) as process:
        lines = iter(process.stderr.readline, "")
        assert any("surveys: 3 of" in line for line in lines)
        scheduler.kill()
        _, stderr = process.communicate(timeout=120)
    assert process.returncode == 1
    assert "the scheduler went away" in stderr.splitlines()[-1]
    assert any(row["exit_status"] == "0" for row in rows(out).values())
    assert any(row["reason"].startswith("interrupted") for row in rows(out).values())


def test_a_cluster_that_is_not_there(run, surveys, tmp_path):
    pytest.importorskip("distributed")
    for address in ("bogus://127.0.0.1:1", "nowhere"):
        done = run("batch", surveys, "--out", tmp_path / "out", "--scheduler", address)
        assert done.returncode == 2
        assert len(done.stderr.splitlines()) == 1
        assert f"--scheduler {address}" in done.stderr
    assert not (tmp_path / "out").exists()
