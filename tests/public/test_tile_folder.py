"""Files that tiles depend on."""

from __future__ import annotations

import pytest

from aerotri.conventions import InputError
from aerotri.public.tile_folder import fingerprints


def test_a_file_that_is_not_there_is_named(tmp_path):
    (tmp_path / "dsm.tif").write_bytes(b"heights")
    assert fingerprints([tmp_path / "dsm.tif"])[0][:2] == ["dsm.tif", 7]
    with pytest.raises(InputError, match=r"no_dsm.*cannot be read \(No such file or directory\) — give the path"):
        fingerprints([tmp_path / "no_dsm"])
