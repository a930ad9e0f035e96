"""A disk that is full, seen behind what GDAL says."""

from __future__ import annotations

import errno
import os
import shutil
from pathlib import Path

from aerotri.conventions import LEAST_ROOM


def is_full(folder: Path) -> bool:
    """Whether nothing more can be written there."""
    try:
        usage = shutil.disk_usage(folder)
    except OSError:
        return False
    # what the system itself shows as files has no size
    return usage.total > 0 and usage.free < LEAST_ROOM


def raise_full_disk(path: Path, error: BaseException) -> None:
    """Raise the error of a full disk in place of another one, where the disk of a file is full.

    GDAL closes a file that found no room without a word, and fails when it reads it again.

    Raises
    ------
    OSError
    """
    if is_full(path.parent):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path)) from error
