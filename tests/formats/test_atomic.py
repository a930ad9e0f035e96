"""What is there before stays until the new is whole, even when the program is killed."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time

import pytest

from aerotri.conventions import InputError
from aerotri.formats import atomic
from aerotri.formats.atomic import atomic_file, atomic_folder


def _names(folder):
    return sorted(path.name for path in folder.iterdir())


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
    with pytest.raises(InputError, match="No space left"), atomic_folder(tmp_path / "old") as place:
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
from aerotri.formats.atomic import atomic_folder
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
    left = [path for path in tmp_path.iterdir() if path.name != "old"]
    assert all(path.name.startswith(".old.") for path in left)


def test_folders_get_ordinary_permissions(tmp_path):
    (tmp_path / "plain").mkdir()
    with atomic_folder(tmp_path / "new"):
        time.sleep(0)
    assert (tmp_path / "new").stat().st_mode == (tmp_path / "plain").stat().st_mode
