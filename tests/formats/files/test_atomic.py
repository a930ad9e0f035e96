"""What is there before stays until the new is whole, even when the program is killed."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import threading
import time

import pytest

from aerotri.conventions import InputError
from aerotri.formats.files import atomic, work_place
from aerotri.formats.files.atomic import atomic_file, atomic_folder
from aerotri.formats.files.ownership import LEDGER, foreign_files
from aerotri.formats.files.work_place import held


def _names(folder):
    """All entries but the list of what was written."""
    return sorted(path.name for path in folder.iterdir() if path.name != LEDGER)


def test_folder_appears_whole(tmp_path):
    with atomic_folder(tmp_path / "deep" / "new") as place:
        (place / "a").write_text("1")
        assert not (tmp_path / "deep" / "new").exists()
    assert _names(tmp_path / "deep") == ["new"]
    assert (tmp_path / "deep" / "new" / "a").read_text() == "1"


def test_failure_leaves_the_old_folder(tmp_path):
    (tmp_path / "old").mkdir()
    (tmp_path / "old" / "a").write_text("old")
    with contextlib.suppress(ZeroDivisionError), atomic_folder(tmp_path / "old") as place:
        (place / "a").write_text("new")
        raise ZeroDivisionError
    assert (tmp_path / "old" / "a").read_text() == "old"
    assert _names(tmp_path) == ["old"]


@pytest.mark.parametrize("one_step", [True, False])
def test_old_folder_is_exchanged_and_foreign_entries_stay(tmp_path, monkeypatch, one_step):
    if not one_step:
        monkeypatch.setattr(atomic, "_exchange_in_one_step", lambda temporary, target: False)
    old = tmp_path / "old"
    (old / "photos").mkdir(parents=True)
    (old / "photos" / "1.jpg").write_text("photo")
    (old / "table").write_text("old")
    (old / "dropped").write_text("old")
    (old / "notes").write_text("mine")
    (old / "link").symlink_to("nowhere")
    with atomic_folder(old, own=("table", "dropped")) as place:
        (place / "table").write_text("new")
    assert _names(tmp_path) == ["old"]
    assert _names(old) == ["link", "notes", "photos", "table"]
    assert (old / "table").read_text() == "new"
    assert (old / "photos" / "1.jpg").read_text() == "photo"


def test_exchange_that_fails_brings_the_old_folder_back(tmp_path, monkeypatch):
    (tmp_path / "old").mkdir()
    (tmp_path / "old" / "a").write_text("old")
    monkeypatch.setattr(atomic, "_exchange_in_one_step", lambda temporary, target: False)
    real, calls = os.rename, []

    def failing(source, target):
        calls.append(target)
        if len(calls) == 2:
            raise OSError(28, "No space left on device")
        real(source, target)

    monkeypatch.setattr(os, "rename", failing)
    with pytest.raises(InputError, match="the disk is full"), atomic_folder(tmp_path / "old") as place:
        (place / "a").write_text("new")
    assert (tmp_path / "old" / "a").read_text() == "old"
    assert _names(tmp_path) == ["old"]


def test_file_is_replaced_when_whole(tmp_path):
    target = tmp_path / "file.txt"
    target.write_text("old")
    with contextlib.suppress(ZeroDivisionError), atomic_file(target) as place:
        place.write_text("new")
        raise ZeroDivisionError
    assert target.read_text() == "old"
    with atomic_file(target) as place:
        place.write_text("new")
    assert target.read_text() == "new"
    assert _names(tmp_path) == ["file.txt"]


def test_a_link_stays_a_link(tmp_path):
    (tmp_path / "real").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "real")
    with atomic_folder(tmp_path / "link") as place:
        (place / "a").write_text("1")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "real" / "a").exists()


def test_wrong_places(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="is a file"), atomic_folder(tmp_path / "file"):
        pass
    with pytest.raises(InputError, match="is a folder"), atomic_file(tmp_path):
        pass
    with pytest.raises(InputError, match="cannot be written"), atomic_folder(tmp_path / "file" / "below"):
        pass
    with pytest.raises(InputError, match="cannot be written"), atomic_file(tmp_path / "file" / "below"):
        pass


KILLED = """
import sys, time
from pathlib import Path
from aerotri.formats.files.atomic import atomic_folder
with atomic_folder(Path(sys.argv[1])) as place:
    (place / "a").write_text("half")
    print("writing", flush=True)
    time.sleep(60)
"""


@pytest.mark.skipif(os.name != "posix", reason="kills a process by signal")
def test_a_killed_program_leaves_the_old_folder(tmp_path):
    (tmp_path / "old").mkdir()
    (tmp_path / "old" / "a").write_text("whole")
    process = subprocess.Popen([sys.executable, "-c", KILLED, str(tmp_path / "old")], stdout=subprocess.PIPE)
    assert process.stdout is not None
    assert process.stdout.readline().strip() == b"writing"
    process.send_signal(signal.SIGKILL)
    process.wait()
    process.stdout.close()
    assert (tmp_path / "old" / "a").read_text() == "whole"
    assert _names(tmp_path) == [".old.aerotri.tmp", "old"]
    with atomic_folder(tmp_path / "old") as place:
        (place / "a").write_text("next")
    assert _names(tmp_path) == ["old"]
    assert (tmp_path / "old" / "a").read_text() == "next"


@pytest.mark.skipif(os.name != "posix", reason="locks of files")
def test_the_work_of_a_living_run_is_left_alone(tmp_path, monkeypatch):
    monkeypatch.setattr(work_place, "WAIT_S", 0.2)
    process = subprocess.Popen([sys.executable, "-c", KILLED, str(tmp_path / "new")], stdout=subprocess.PIPE)
    assert process.stdout is not None
    assert process.stdout.readline().strip() == b"writing"
    growing = tmp_path / ".new.aerotri.tmp" / "new" / "a"
    with pytest.raises(InputError, match="another run is writing here"), held(tmp_path / "new"):
        pass
    assert growing.read_text() == "half"
    process.kill()
    process.wait()
    process.stdout.close()
    with held(tmp_path / "new"):
        assert not growing.exists()
    assert _names(tmp_path) == []


def test_two_writers_take_turns(tmp_path):
    """Each folder is of one writer, whichever comes last."""

    def write(text):
        with atomic_folder(tmp_path / "out", own=("a", "b")) as place:
            for name in "ab":
                (place / name).write_text(text)
        done.append(text)

    done = []
    threads = [threading.Thread(target=write, args=(str(k),)) for k in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(done) == 8
    assert (tmp_path / "out" / "a").read_text() == (tmp_path / "out" / "b").read_text()
    assert _names(tmp_path) == ["out"]


def test_a_killed_exchange_brings_the_old_folder_back(tmp_path):
    """Where two names cannot be swapped in one step, the older result waits in the hidden folder for a moment."""
    aside = tmp_path / ".out.aerotri.tmp" / ".older-result"
    aside.mkdir(parents=True)
    (aside / "a").write_text("old")
    (tmp_path / ".out.aerotri.tmp" / "lock").touch()
    with held(tmp_path / "out"):
        assert (tmp_path / "out" / "a").read_text() == "old"
    assert _names(tmp_path) == ["out"]


def test_files_of_the_user_inside_our_folders_stay(tmp_path):
    out = tmp_path / "out"

    def write(names):
        with atomic_folder(out, own=("plots", "report.html")) as place:
            (place / "plots").mkdir()
            for name in names:
                (place / name).write_text("ours")

    write(["plots/a.png", "plots/b.png", "report.html"])
    (out / "plots" / "mine.png").write_text("mine")
    (out / "plots" / "deep").mkdir()
    (out / "plots" / "deep" / "mine.txt").write_text("mine")
    (out / "plots" / "c.png").write_text("mine")
    write(["plots/a.png", "plots/c.png"])
    assert _names(out / "plots") == ["a.png", "c.png", "c.yours1.png", "deep", "mine.png"]
    assert (out / "plots" / "c.yours1.png").read_text() == "mine"
    assert (out / "plots" / "deep" / "mine.txt").read_text() == "mine"
    assert not (out / "report.html").exists()


def test_changed_files_are_known(tmp_path):
    with atomic_folder(tmp_path / "out", own=("a", "b")) as place:
        (place / "a").write_text("ours")
        (place / "b").write_text("ours")
    assert foreign_files(tmp_path / "out", ("a", "b", "c")) == []
    (tmp_path / "out" / "b").write_text("mine")
    (tmp_path / "out" / "c").write_text("mine")
    assert foreign_files(tmp_path / "out", ("a", "b", "c")) == ["b", "c"]


def test_a_foreign_folder_of_the_hidden_name_stays(tmp_path):
    foreign = tmp_path / ".out.aerotri.tmp"
    foreign.mkdir()
    (foreign / "mine").write_text("mine")
    with atomic_file(tmp_path / "out") as place:
        place.write_text("new")
    assert (foreign / "mine").read_text() == "mine"
    assert _names(tmp_path) == [".out.aerotri.tmp", "out"]


def test_folders_get_ordinary_permissions(tmp_path):
    (tmp_path / "plain").mkdir()
    with atomic_folder(tmp_path / "new"):
        time.sleep(0)
    assert (tmp_path / "new").stat().st_mode == (tmp_path / "plain").stat().st_mode


def test_files_of_another_command_stay_ours(tmp_path):
    """Two formats in one folder: neither takes the files of the other for the user's, unless somebody changed them."""
    out = tmp_path / "out"

    def write(*names):
        with atomic_folder(out, own=names) as place:
            for name in names:
                (place / name).write_text(f"ours {name}")

    write("bundle.out")
    write("tracks.csv")
    assert foreign_files(out, ["bundle.out", "tracks.csv"]) == []
    write("bundle.out")
    assert _names(out) == ["bundle.out", "tracks.csv"]
    (out / "bundle.out").write_text("mine")
    write("tracks.csv")
    assert foreign_files(out, ["bundle.out", "tracks.csv"]) == ["bundle.out"]
    assert (out / "bundle.out").read_text() == "mine"
    write("bundle.out")
    assert (out / "bundle.yours1.out").read_text() == "mine"
    (out / "bundle.yours1.out").unlink()
    (out / "new.txt").write_text("mine")
    write("new.txt")
    assert _names(out) == ["bundle.out", "new.txt", "new.yours1.txt", "tracks.csv"]


def test_the_same_content_is_no_copy(tmp_path):
    """A folder that was copied without its list holds what is written again."""
    out = tmp_path / "out"
    with atomic_folder(out, own=("a.csv",)) as place:
        (place / "a.csv").write_text("ours")
    (out / ".aerotri-files").write_text("{}")
    with atomic_folder(out, own=("a.csv",)) as place:
        (place / "a.csv").write_text("ours")
    assert _names(out) == ["a.csv"]
