"""Files that tiles depend on."""

from __future__ import annotations

import os
import subprocess
import sys
import threading

import pytest

from aerotri.conventions import InputError
from aerotri.formats.files import locked
from aerotri.public.tile_folder import STATED, fingerprints, open_tiles, remove_tiles

HOLD = """
import sys
from pathlib import Path
from aerotri.public.tile_folder import open_tiles
with open_tiles(Path(sys.argv[1]), {"cell": 1.0}):
    print("held", flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def other_run(tmp_path):
    """Another process that uses a folder of tiles, with one tile in it, until it is killed."""
    folder = tmp_path / "dsm.tiles"
    with subprocess.Popen(
        [sys.executable, "-c", HOLD, str(folder)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "held\n"
        (folder / "level0_0_0.npz").write_bytes(b"a tile")
        yield folder, process
        process.kill()


def test_two_runs_do_not_share_a_folder(other_run):
    """The second is refused while the first lives, whatever its settings; killed, the first leaves its tiles to it."""
    folder, process = other_run
    for cell in (1.0, 2.0):
        with (
            pytest.raises(InputError, match=r"another run is writing to .*dsm — wait until it ends, or choose another"),
            open_tiles(folder, {"cell": cell}),
        ):
            pass
    remove_tiles(folder)
    assert (folder / "level0_0_0.npz").is_file()
    process.kill()
    process.wait()
    with open_tiles(folder, {"cell": 1.0}):
        assert (folder / "level0_0_0.npz").is_file()
    with open_tiles(folder, {"cell": 2.0}):
        assert not (folder / "level0_0_0.npz").exists()


def test_a_run_of_the_same_program_waits_only_for_one_that_is_under_way(tmp_path):
    """A result that still reads its tiles does not keep a later run of its program out; a thread under way does."""
    with open_tiles(tmp_path / "kept", {"cell": 1.0}) as first:
        refused = []

        def second():
            try:
                with open_tiles(tmp_path / "kept", {"cell": 2.0}):
                    pass
            except InputError as error:
                refused.append(str(error))

        thread = threading.Thread(target=second)
        thread.start()
        thread.join()
        assert refused == ["kept: another run uses these tiles — wait until it ends, or give another folder"]
    with open_tiles(tmp_path / "kept", {"cell": 2.0}) as again:
        assert again is first
    remove_tiles(tmp_path / "kept")
    assert not list(tmp_path.iterdir())


def test_a_run_that_failed_lets_others_in(tmp_path):
    with pytest.raises(ValueError, match="no luck"), open_tiles(tmp_path / "kept", {}) as failed:
        raise ValueError("no luck")
    assert failed.lock.folder == tmp_path / "kept"
    done = subprocess.run([sys.executable, "-c", HOLD, str(tmp_path / "kept")], input="", text=True, check=False)
    assert done.returncode == 0


def test_a_place_that_cannot_lock_goes_on_without(tmp_path, monkeypatch):
    def cannot(file):
        raise OSError(95, "Operation not supported")

    monkeypatch.setattr(locked, "_lock_now", cannot)
    with open_tiles(tmp_path / "kept", {}) as held:
        assert (held.folder / STATED).is_file()
    remove_tiles(tmp_path / "kept")
    assert not list(tmp_path.iterdir())


def test_other_files_are_left_as_they_are(tmp_path):
    (tmp_path / "notes.txt").write_text("mine", encoding="utf-8")
    with pytest.raises(InputError, match="other files than tiles"), open_tiles(tmp_path, {}):
        pass
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]


def test_a_file_that_is_not_there_is_named(tmp_path):
    (tmp_path / "dsm.tif").write_bytes(b"heights")
    assert fingerprints([tmp_path / "dsm.tif"])[0][0] == "dsm.tif"
    with pytest.raises(InputError, match=r"no_dsm.*cannot be read \(No such file or directory\) — give the path"):
        fingerprints([tmp_path / "no_dsm"])


@pytest.mark.parametrize("damage", [b"\xff\xfe\x80", b"{", b""])
def test_tiles_whose_run_is_not_known_are_removed(tmp_path, damage):
    with open_tiles(tmp_path, {"cell": 1.0}):
        whole = (tmp_path / STATED).read_bytes()
    (tmp_path / STATED).write_bytes(damage)
    (tmp_path / "level0_0_0.npz").write_bytes(b"a tile")
    with open_tiles(tmp_path, {"cell": 1.0}):
        assert not (tmp_path / "level0_0_0.npz").exists()
        assert (tmp_path / STATED).read_bytes() == whole


@pytest.mark.parametrize("place", [0, -1])
def test_files_of_one_name_size_and_time_are_told_apart(tmp_path, place):
    """Whether they differ at their beginning or their end."""
    content, path = bytearray(300_000), tmp_path / "dsm.tif"
    found = []
    for value in (1, 2, 1):
        content[place] = value
        path.write_bytes(content)
        os.utime(path, (1e9, 1e9))
        found += fingerprints([path])
    assert found[0] != found[1]
    assert found[0] == found[2]
