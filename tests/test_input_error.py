"""The message of an input error names the file so that it can be found."""

from __future__ import annotations

import os
from pathlib import Path

from aerotri.conventions import InputError


def said_of(file, line=None):
    return str(InputError("is wrong", "mend it", file, line))


def test_files_of_one_name_are_told_apart(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert said_of(Path("old", "dsm.tif")) == f"{Path('old', 'dsm.tif')}: is wrong — mend it"
    assert said_of(tmp_path / "new" / "dsm.tif", 3) == f"{Path('new', 'dsm.tif')}:3: is wrong — mend it"
    assert said_of("dsm.tif") == "dsm.tif: is wrong — mend it"
    elsewhere = tmp_path.parent / "elsewhere" / "dsm.tif"
    assert said_of(elsewhere) == f"{elsewhere}: is wrong — mend it"
    assert said_of(None) == "is wrong — mend it"
    assert said_of(Path("/")) == "/: is wrong — mend it".replace("/", os.sep, 1)


def test_a_very_long_name_is_cut():
    said = said_of(Path("out", "n" * 300))
    assert said == f"{Path('out', 'n' * 60)}…: is wrong — mend it"
