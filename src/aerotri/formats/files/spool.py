"""Large files of a result between its computing and its saving."""

from __future__ import annotations

import errno
import os
import shutil
import tempfile
import weakref
from pathlib import Path

from aerotri.conventions import FilePath
from aerotri.formats.files.places import full_disk
from aerotri.rasters.room import is_full


class Spool:
    """Files that are too large for memory, written while a result is computed and given away when it is saved.

    Parameters
    ----------
    folder : that somebody else removes; None: a temporary one of the system (TMPDIR), removed with this object.
    """

    def __init__(self, folder: FilePath | None = None):
        self._is_own = folder is None
        self.folder = Path(tempfile.mkdtemp(prefix="aerotri-")) if folder is None else Path(folder)
        if self._is_own:
            weakref.finalize(self, shutil.rmtree, self.folder, ignore_errors=True)

    def refuse_full(self) -> None:
        """GDAL closes a file that found no room without a word: nothing written with so little left is trusted.

        Raises
        ------
        InputError
        """
        if is_full(self.folder):
            raise full_disk(self.folder, remedy="free some space, or let TMPDIR name another place")

    def give(self, name: str, target: Path) -> None:
        """Put a file where it is wanted.

        In a folder of somebody else the target becomes a second name of it; a file of our own is copied, so that the
        result can be saved again, whatever becomes of the target.

        Raises
        ------
        OSError
        """
        if not self._is_own:
            try:
                os.link(self.folder / name, target)
                return
            except OSError as error:
                if error.errno in (errno.ENOSPC, errno.EDQUOT):
                    raise
        shutil.copyfile(self.folder / name, target)
