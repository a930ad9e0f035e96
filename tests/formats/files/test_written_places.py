"""A place that nothing can be written to is refused with the reason."""

from __future__ import annotations

import errno
import os
import re
from pathlib import Path

import pytest

from aerotri.conventions import InputError
from aerotri.formats.files import places
from aerotri.formats.files.atomic import atomic_file, atomic_folder
from aerotri.formats.files.places import full_disk, not_written, refuse_impossible_place
from aerotri.formats.files.work_place import held


@pytest.fixture
def impossible(tmp_path):
    """Places that are none, and what is said of them."""
    (tmp_path / "file").write_text("")
    (tmp_path / "first").symlink_to("second")
    (tmp_path / "second").symlink_to("first")
    long = "n" * 300
    return [
        (tmp_path / "first", "its symbolic links form a loop"),
        (tmp_path / "first" / "below", "its symbolic links form a loop"),
        (tmp_path / long, "the name has 300 letters, which is too long"),
        (tmp_path / "missing" / long / "below", "the name has 300 letters, which is too long"),
        (tmp_path / "file" / "below", f"'{tmp_path / 'file'}' is no folder"),
        (tmp_path / "file" / "deep" / "below", f"'{tmp_path / 'file'}' is no folder"),
        (Path("/"), "it is the root of the file system"),
    ]


@pytest.mark.skipif(os.name != "posix", reason="links and lengths of a system")
def test_places_that_cannot_be(impossible):
    for place, said in impossible:
        for writer in (None, atomic_file, atomic_folder, held):
            with pytest.raises(InputError) as caught:
                refuse_impossible_place(place) if writer is None else writer(place).__enter__()
            assert f"cannot be written: {said} — choose another place" in str(caught.value)


@pytest.mark.skipif(not Path("/proc/self").is_dir(), reason="a folder in which nobody can make anything")
def test_a_folder_in_which_nothing_can_be_made():
    with pytest.raises(InputError, match="cannot be written: nothing can be made in '/proc'"):
        refuse_impossible_place("/proc/result")
    with pytest.raises(InputError, match="cannot be written: No such file"), atomic_folder("/proc/result"):
        pass


def test_what_can_be_written_stays_as_it_is(tmp_path):
    (tmp_path / "old").mkdir()
    (tmp_path / "link").symlink_to("nowhere")
    assert refuse_impossible_place(tmp_path / "old") == (tmp_path / "old").resolve()
    assert refuse_impossible_place(tmp_path / "link") == (tmp_path / "nowhere").resolve()
    assert refuse_impossible_place(tmp_path / "deep" / "below") == (tmp_path / "deep" / "below").resolve()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["link", "old"]
    assert not any((tmp_path / "old").iterdir())


def test_a_full_disk_is_told_with_its_folder_and_what_is_free(tmp_path):
    error = OSError(errno.ENOSPC, "No space left on device", str(tmp_path / ".out.tmp" / "images.csv"))
    said = str(full_disk(tmp_path / "missing" / "out", error))
    assert re.search(
        rf"out: the disk is full; [\d.]+ [MG]iB free in '{re.escape(str(tmp_path))}' — free some space", said
    )
    assert ".out.tmp" not in said, "the place that the user has given"
    assert "quota) is full" in str(not_written(tmp_path / "out", OSError(errno.EDQUOT, "Disk quota exceeded")))
    assert "larger than" in str(not_written(tmp_path / "out", OSError(errno.EFBIG, "File too large")))
    assert "the disk is full" in str(full_disk(tmp_path / "out", OSError(errno.ENOSPC, "No space", 7)))


def test_a_folder_that_is_there_is_enough(tmp_path, monkeypatch):
    """Files may go into it, where nothing can be made beside it, as in a container."""
    (tmp_path / "out").mkdir()

    def made(folder: Path) -> None:
        if folder == tmp_path:
            raise PermissionError(errno.EACCES, "Permission denied", str(folder))

    monkeypatch.setattr(places, "_try_folder", made)
    assert refuse_impossible_place(tmp_path / "out") == (tmp_path / "out").resolve()
    with pytest.raises(InputError, match="Permission denied"):
        refuse_impossible_place(tmp_path / "other")


def test_a_full_disk_elsewhere_is_named(tmp_path, monkeypatch):
    """A temporary folder on another disk than the target; and where nothing is named, folders that are full."""
    monkeypatch.setattr(places, "_device", lambda folder: str(folder))
    (tmp_path / "tmp").mkdir()
    error = OSError(errno.ENOSPC, "No space left on device", str(tmp_path / "tmp" / "piece.tif"))
    assert "piece.tif: the disk is full; " in str(full_disk(tmp_path / "out", error))
    assert f"free in '{tmp_path / 'tmp'}'" in str(full_disk(tmp_path / "out", error))
    monkeypatch.setenv("TMPDIR", str(tmp_path / "tmp"))
    monkeypatch.setattr(places, "is_full", lambda folder: folder == tmp_path / "tmp")
    said = str(full_disk(None, OSError(errno.ENOSPC, "No space left on device")))
    assert said.startswith("the disk is full; ")
    assert f"free in '{tmp_path / 'tmp'}'" in said
