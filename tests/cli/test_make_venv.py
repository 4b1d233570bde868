"""scripts/make_venv.sh: which interpreter `make` takes."""

import shutil
import subprocess
from pathlib import Path

import pytest

SCRIPT = Path(__file__).resolve().parents[2] / "scripts" / "make_venv.sh"
SHIM = "#!/bin/sh\necho 'command not found' >&2\nexit 127\n"
UNSUITED = "#!/bin/sh\nexit 1\n"
# Suits, says its version, and makes an environment that answers in the same way.
SUITED = """#!/bin/sh
case "$1 $2" in
  "-m venv") mkdir -p "$4/bin" && cp "$0" "$4/bin/python" ;;
  "-c "*sep*) echo {version} ;;
esac
"""


@pytest.fixture
def make_venv(tmp_path):
    """Run the script with these programs, and nothing but the basic tools, on PATH."""
    programs = tmp_path / "bin"
    programs.mkdir()
    for tool in ("sh", "mkdir", "cp"):
        (programs / tool).symlink_to(shutil.which(tool))

    def run(found, *arguments):
        for name, text in found.items():
            path = programs / name
            path.write_text(text)
            path.chmod(0o755)
        return subprocess.run(
            [shutil.which("sh"), SCRIPT, tmp_path / "venv", *arguments],
            env={"PATH": str(programs)},
            capture_output=True,
            text=True,
            check=False,
        )

    return run


def suited(version):
    return SUITED.format(version=version)


def test_passes_over_shims_and_interpreters_without_venv(make_venv):
    done = make_venv({"python3.14": SHIM, "python3.12": UNSUITED, "python3": suited("3.11")})
    assert done.returncode == 0, done.stderr
    assert done.stdout.endswith("with python3 (3.11)\n")


def test_takes_the_newest(make_venv):
    done = make_venv({"python3.12": suited("3.12"), "python3.13": suited("3.13")})
    assert "with python3.13 (3.13)" in done.stdout


def test_says_in_one_line_what_to_install(make_venv):
    done = make_venv({"python3": UNSUITED})
    assert done.returncode == 1
    assert len(done.stderr.splitlines()) == 1
    assert "apt install python3 python3-venv" in done.stderr
    assert "brew install python" in done.stderr


def test_what_works_is_kept(make_venv):
    found = {"python3.12": suited("3.12")}
    assert "making" in make_venv(found).stdout
    assert make_venv(found).stdout == ""
    assert make_venv({"python3.13": suited("3.13")}).stdout == ""


def test_another_interpreter_on_request(make_venv):
    found = {"python3.12": suited("3.12"), "python3.13": suited("3.13")}
    assert "3.12" in make_venv(found, "python3.12").stdout
    assert "3.13" in make_venv(found, "python3.13").stdout
    assert make_venv(found, "python3.13").stdout == ""


def test_a_wish_that_fails_is_not_replaced_by_another(make_venv):
    done = make_venv({"python3.13": SHIM, "python3.12": suited("3.12")}, "python3.13")
    assert done.returncode == 1
    assert "tried: python3.13" in done.stderr
