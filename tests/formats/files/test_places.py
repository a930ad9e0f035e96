"""A place that nothing can be written to is refused with the reason."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from aerotri.conventions import InputError
from aerotri.formats.files.atomic import atomic_file, atomic_folder
from aerotri.formats.files.places import refuse_impossible_place
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
