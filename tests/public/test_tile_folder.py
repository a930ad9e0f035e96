"""Files that tiles depend on."""

from __future__ import annotations

import os

import pytest

from aerotri.conventions import InputError
from aerotri.public import tile_folder
from aerotri.public.tile_folder import STATED, fingerprints, open_tiles
from aerotri.source_digest import digest_of_sources


def test_other_files_are_left_as_they_are(tmp_path):
    (tmp_path / "notes.txt").write_text("mine", encoding="utf-8")
    with pytest.raises(InputError, match="other files than tiles"):
        open_tiles(tmp_path, {})
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]


def test_a_file_that_is_not_there_is_named(tmp_path):
    (tmp_path / "dsm.tif").write_bytes(b"heights")
    assert fingerprints([tmp_path / "dsm.tif"])[0][0] == "dsm.tif"
    with pytest.raises(InputError, match=r"no_dsm.*cannot be read \(No such file or directory\) — give the path"):
        fingerprints([tmp_path / "no_dsm"])


@pytest.mark.parametrize("name", [STATED, "level0_0_0.npz"])
def test_a_folder_in_place_of_a_file_is_named(tmp_path, name):
    open_tiles(tmp_path, {"cell": 1.0})
    (tmp_path / name).unlink(missing_ok=True)
    (tmp_path / name).mkdir()
    for cell in (1.0, 2.0):
        with pytest.raises(InputError, match=f"{name}: is a folder, where files of tiles belong — remove it"):
            open_tiles(tmp_path, {"cell": cell})


@pytest.mark.skipif(os.name != "posix", reason="links of a system")
def test_links_to_what_is_not_there_are_replaced_or_told(tmp_path):
    open_tiles(tmp_path / "tiles", {"cell": 1.0})
    whole = (tmp_path / "tiles" / STATED).read_bytes()
    for name in (STATED, "level0_0_0.npz"):
        (tmp_path / "tiles" / name).unlink(missing_ok=True)
        (tmp_path / "tiles" / name).symlink_to(tmp_path / "nowhere" / "x")
    open_tiles(tmp_path / "tiles", {"cell": 1.0})
    assert (tmp_path / "tiles" / STATED).read_bytes() == whole
    assert [path.name for path in (tmp_path / "tiles").iterdir()] == [STATED]
    (tmp_path / "lost").symlink_to(tmp_path / "nowhere")
    with pytest.raises(InputError, match="lost: cannot be written: it is a link to what is not there"):
        open_tiles(tmp_path / "lost", {"cell": 1.0})


def test_tiles_of_other_code_are_measured_again(tmp_path, monkeypatch):
    open_tiles(tmp_path, {"cell": 1.0})
    (tmp_path / "level0_0_0.npz").write_bytes(b"a tile")
    open_tiles(tmp_path, {"cell": 1.0})
    assert (tmp_path / "level0_0_0.npz").exists()
    monkeypatch.setattr(tile_folder, "digest_of_sources", lambda patterns: f"other {patterns}")
    open_tiles(tmp_path, {"cell": 1.0})
    assert not (tmp_path / "level0_0_0.npz").exists()


def test_the_code_that_makes_tiles_is_looked_at():
    """Every pattern finds modules: a folder that has got another name would go unnoticed."""
    for pattern in tile_folder.SOURCES:
        assert digest_of_sources((pattern,)) != digest_of_sources(("no such module",))


@pytest.mark.parametrize("damage", [b"\xff\xfe\x80", b"{", b""])
def test_tiles_whose_run_is_not_known_are_removed(tmp_path, damage):
    open_tiles(tmp_path, {"cell": 1.0})
    whole = (tmp_path / STATED).read_bytes()
    (tmp_path / STATED).write_bytes(damage)
    (tmp_path / "level0_0_0.npz").write_bytes(b"a tile")
    open_tiles(tmp_path, {"cell": 1.0})
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
