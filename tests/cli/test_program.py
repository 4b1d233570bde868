"""The program as a whole: help, version, usage errors, bugs."""

import subprocess
import sys

import pytest

from slam_uwb._version import __version__

COMMANDS = (
    "solve", "evaluate", "compare", "batch", "position", "check", "simulate", "settings", "record", "ports",
    "emulate", "report", "export", "plan", "import",
)  # fmt: skip
HEAVY = ("gtsam", "numpy", "scipy", "matplotlib", "tomlkit", "PIL", "rich", "serial")


def python(code):
    return subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False
    )


def test_version(run):
    done = run("--version")
    assert (done.returncode, done.stdout) == (0, f"slam-uwb {__version__}\n")


def test_runs_as_a_module():
    done = subprocess.run(
        [sys.executable, "-m", "slam_uwb", "--version"], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout) == (0, f"slam-uwb {__version__}\n")


def test_help_lists_every_command(run):
    done = run("--help")
    assert done.returncode == 0
    listed = [line.split()[0] for line in done.stdout.split("Commands:\n")[1].splitlines() if line]
    assert listed == list(COMMANDS)
    # Whole sentences: on 80 columns nothing is cut off.
    assert "..." not in done.stdout.split("Commands:\n")[1]


@pytest.mark.parametrize("command", COMMANDS)
def test_help_of_a_command_describes_every_option(run, command):
    done = run(command, "--help")
    assert done.returncode == 0
    options = [line for line in done.stdout.splitlines() if line.lstrip().startswith("-")]
    # Name and text stand in columns with two blanks between.
    assert all("  " in line.strip() for line in options)
    assert len(options) >= 2


@pytest.mark.parametrize("arguments", [["--help"], ["solve", "--help"], ["--version"], ["solve"]])
def test_no_heavy_module_is_loaded_before_there_is_work(arguments):
    done = python(
        "import sys\n"
        "from slam_uwb.cli import main\n"
        f"sys.argv = ['slam-uwb', *{arguments!r}]\n"
        "try:\n    main()\nexcept SystemExit:\n    pass\n"
        f"print('loaded:', *(name for name in {HEAVY!r} if name in sys.modules))"
    )
    assert done.stdout.splitlines()[-1].strip() == "loaded:"


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["bogus"], "bogus"),
        (["solve"], "SURVEY"),
        (["solve", "somewhere"], "--out"),
        (["solve", "somewhere", "--out", "x", "--mode", "magic"], "magic"),
        (["solve", "somewhere", "--out", "x", "--pairs", "some"], "some"),
        (["solve", "somewhere", "--out", "x", "--workers", "0"], "--workers"),
        (["evaluate", "somewhere"], "--reference"),
        (["simulate", "flat", "--out", "x"], "--seed"),
        (["simulate", "flat", "--out", "x", "--seed", "-1"], "--seed"),
        (["simulate", "flat", "--out", "x", "--seed", "1", "--duration-s", "nan"], "--duration-s"),
        (["check"], "SURVEY"),
        (["record", "x"], "--lidar"),
        (["record", "x", "--lidar", "bogus"], "bogus"),
        (["record", "x", "--lidar", "sweep", "--seconds", "nan"], "--seconds"),
        (["import", "csv"], "FILES"),
        (["import", "csv", "a.csv"], "--out"),
        (["emulate", "x"], "--ports"),
    ],
)
def test_wrong_arguments_end_with_2_and_are_named(run, tmp_path, arguments, named):
    done = run(*arguments, cwd=tmp_path)
    assert done.returncode == 2
    assert done.stdout == ""
    errors = [line for line in done.stderr.splitlines() if line.startswith("Error: ")]
    assert len(errors) == 1
    assert named in errors[0]
    assert list(tmp_path.iterdir()) == []


BUG = (
    "import sys, slam_uwb.io\n"
    "from slam_uwb.cli import main\n"
    "def broken(folder):\n    raise RuntimeError('the impossible happened')\n"
    "slam_uwb.io.check_survey = broken\n"
    "sys.argv = ['slam-uwb', *{arguments!r}]\n"
    "main()\n"
)


def test_a_bug_is_one_line_and_1():
    done = python(BUG.format(arguments=["check", "x"]))
    assert done.returncode == 1
    assert len(done.stderr.splitlines()) == 1
    assert "RuntimeError: the impossible happened" in done.stderr


@pytest.mark.parametrize("arguments", [["-v", "check", "x"], ["check", "x", "--verbose"]])
def test_verbose_shows_where_the_bug_is(arguments):
    done = python(BUG.format(arguments=arguments))
    assert done.returncode == 1
    assert "in broken" in done.stderr
    assert done.stderr.count("Traceback") == 1


def test_a_reader_that_leaves_early_is_no_bug():
    # As in `slam-uwb settings | head -1`.
    done = subprocess.run(
        ["sh", "-c", '"$0" -m slam_uwb settings | true', sys.executable],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stderr == ""
