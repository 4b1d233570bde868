"""Whatever happens midway, the old folder is there, or none, and nothing else."""

import errno
import os
import resource
import signal
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

from slam_uwb.io.folder_swap import remove_leftovers, replace_folder

OLD = {"a.txt": b"old"}
NEW = {"a.txt": b"new", "sub/b.txt": b"more"}


def contents(folder: Path) -> dict[str, bytes]:
    files = [path for path in folder.rglob("*") if path.is_file()]
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


@pytest.fixture(params=["old", "none"])
def out(request, tmp_path):
    folder = tmp_path / "out"
    if request.param == "old":
        replace_folder(folder, OLD)
    return folder


def assert_untouched(out: Path, had_old: bool) -> None:
    assert [path.name for path in out.parent.iterdir()] == (["out"] if had_old else [])
    assert contents(out) == (OLD if had_old else {})


def test_replaces_everything(out):
    replace_folder(out, NEW)
    assert contents(out) == NEW
    assert [path.name for path in out.parent.iterdir()] == ["out"]


def test_two_names_of_one_file_do_not_overwrite_each_other(out):
    """As S1.csv and s1.csv are where case does not count."""
    had_old = out.exists()
    with pytest.raises(FileExistsError):
        replace_folder(out, {"sub/b.txt": b"1", "sub//b.txt": b"2"})
    assert_untouched(out, had_old)


def test_permissions_are_those_of_any_new_folder(out):
    replace_folder(out, NEW)
    plain = out.parent / "plain"
    plain.mkdir()
    assert out.stat().st_mode == plain.stat().st_mode


def test_parents_are_made(tmp_path):
    replace_folder(tmp_path / "a" / "b" / "out", NEW)
    assert contents(tmp_path / "a" / "b" / "out") == NEW


def test_link_to_a_folder_stays_a_link(tmp_path):
    replace_folder(tmp_path / "real", OLD)
    (tmp_path / "link").symlink_to("real")
    replace_folder(tmp_path / "link", NEW)
    assert (tmp_path / "link").is_symlink()
    assert contents(tmp_path / "real") == NEW


@pytest.mark.parametrize("name", ["../x", "/x", "a/../../x", "."])
def test_name_that_leaves(out, name):
    had_old = out.exists()
    with pytest.raises(ValueError, match="leaves the folder"):
        replace_folder(out, NEW | {name: b""})
    assert_untouched(out, had_old)


@pytest.mark.parametrize("call", [1, 2, 3, 4])
def test_disk_full_while_making_durable(out, monkeypatch, call):
    """Delayed allocation reports a full disk here: two files, then the two folders."""
    had_old = out.exists()
    calls = iter(range(1, 100))
    real = os.fsync

    def full(handle):
        if next(calls) == call:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        real(handle)

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space left"):
        replace_folder(out, NEW)
    assert_untouched(out, had_old)


@pytest.mark.parametrize(("out", "fails"), [("none", 1), ("old", 1), ("old", 2)], indirect=["out"])
def test_rename_fails(out, monkeypatch, fails):
    """With an old folder there are two renames: it out of the way, the new one into place."""
    had_old = out.exists()
    calls = iter(range(1, 100))
    real = Path.rename

    def busy(self, target):
        if next(calls) == fails:
            raise OSError(errno.EBUSY, os.strerror(errno.EBUSY))
        return real(self, target)

    monkeypatch.setattr(Path, "rename", busy)
    with pytest.raises(OSError, match="busy"):
        replace_folder(out, NEW)
    assert_untouched(out, had_old)


def run(out: Path, code: str, **options) -> subprocess.Popen:
    return subprocess.Popen(
        [sys.executable, "-c", textwrap.dedent(code), str(out)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        **options,
    )


def test_write_fails_for_real(out):
    """The kernel's own limit on the size of a file stops the second file halfway."""
    had_old = out.exists()
    code = """
        import sys
        from pathlib import Path
        from slam_uwb.io.folder_swap import replace_folder
        replace_folder(Path(sys.argv[1]), {"a.txt": b"new", "b.bin": bytes(1_000_000)})
    """
    limit = (100_000, 100_000)
    with run(
        out, code, preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, limit)
    ) as child:
        _, errors = child.communicate(timeout=60)
    assert child.returncode == 1
    assert "File too large" in errors
    assert_untouched(out, had_old)


@pytest.mark.parametrize(
    ("out", "moment"),
    [("none", "fsync"), ("old", "fsync"), ("old", "rename")],
    indirect=["out"],
)
def test_interrupted(out, moment):
    """Ctrl-C between two files, or between the two renames."""
    had_old = out.exists()
    code = f"""
        import os, signal, sys, time
        from pathlib import Path
        from slam_uwb.io.folder_swap import replace_folder
        # A test run in the background would hand on that the signal is ignored.
        signal.signal(signal.SIGINT, signal.default_int_handler)
        home, name = (os, "fsync") if "{moment}" == "fsync" else (Path, "rename")
        real = getattr(home, name)
        def slow(*arguments):
            real(*arguments)
            setattr(home, name, real)
            print("now", flush=True)
            time.sleep(60)
        setattr(home, name, slow)
        replace_folder(Path(sys.argv[1]), {{"a.txt": b"new", "b.txt": b"more"}})
    """
    with run(out, code) as child:
        assert child.stdout.readline() == "now\n"
        child.send_signal(signal.SIGINT)
        child.communicate(timeout=60)
    assert child.returncode != 0
    assert_untouched(out, had_old)


def test_leftovers_of_a_killed_process_go_once_the_folder_is_complete(tmp_path):
    out = tmp_path / "a[1]"
    left = [tmp_path / ".a[1].0123.partial", tmp_path / ".a[1].4567.former"]
    others = [tmp_path / ".a1.0123.partial", tmp_path / ".a[1].note", tmp_path / "b"]
    for folder in (*left, *others):
        folder.mkdir()
    # Without a complete folder one of them may be the only copy.
    remove_leftovers(out)
    assert all(folder.exists() for folder in left)
    replace_folder(out, {"x": b"1"})
    remove_leftovers(out)
    assert sorted(tmp_path.iterdir()) == sorted([out, *others])
