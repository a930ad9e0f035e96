"""Files of parts: what a full disk is told by."""

import errno

import numpy as np
import pytest

from aerotri.partition.part_files import WorkFiles

resource = pytest.importorskip("resource", reason="limits of POSIX")


def test_a_disk_that_takes_no_more_is_told_by_its_number(tmp_path):
    """Numpy writes into a file by itself and then says how many elements were written, but not why no more."""
    files, limits = WorkFiles(tmp_path / "work"), resource.getrlimit(resource.RLIMIT_FSIZE)
    values = np.arange(200_000.0)
    files.keep_array("first", values)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, limits[1]))
    try:
        with pytest.raises(OSError, match="File too large") as caught:
            files.keep_array("second", values)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert caught.value.errno == errno.EFBIG
    assert [path.name for path in (tmp_path / "work").iterdir()] == ["first"]
    assert np.array_equal(files.array("first"), values)
