"""Frames, axes, angles and units, stated once and used everywhere; and the error that names its remedy.

Object frame
    Right-handed, metres. Inside the adjustment coordinates are reduced to a local origin.
Camera frame
    x right, y up, z backwards (towards the viewer). A point in front of the camera has a negative z.
    ``X = X0 + λ·R·(x − x0, y − y0, −c)ᵀ``; the columns of R are the camera axes in the object frame.
Rotation
    ``omega-phi-kappa``: R = Rx(ω)·Ry(φ)·Rz(κ); ``phi-omega-kappa``: R = Ry(φ)·Rx(ω)·Rz(κ). Radians in records.
Image coordinates
    Millimetres from the image centre, x right, y up, in every record. Files may hold pixels: column to the right,
    row down, (0, 0) the upper left CORNER of the upper left pixel, whose centre is therefore (0.5, 0.5).
Systematic image error
    ``measured = ideal + d``, d evaluated at the measured position; ``corrected = measured − d``.
"""

from __future__ import annotations

import contextlib
import errno
import math
import os
import stat
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    # the command line shows its help without it, in half of the time
    import numpy as np

RADIANS_PER = {"deg": math.pi / 180.0, "gon": math.pi / 200.0, "rad": 1.0}
"""Radians of one unit of an angle, by the name of the unit in files: 360° and 400 gon are 2π."""
MGON_PER_RADIAN = 200.0e3 / math.pi
"""Milligon of one radian: 200 gon are π."""
EARTH_RADIUS_M = 6371000.0
"""m, the mean radius of the earth [L: 6371.0 km]; radii of curvature of the ellipsoid differ from it by less than
0.6 %."""
SIGMA_PER_MAD = 1.4826
"""Factor from a median absolute deviation to the σ of a normal distribution, 1/Φ⁻¹(0.75) [L: Höhle & Höhle 2009]."""
SIGMAS_OF_95 = 1.959963985
"""Standard deviations of a normal distribution within which 95 % lie, Φ⁻¹(0.975)."""
LEAST_ROOM = 16384
"""Bytes below which a disk counts as full; chosen [C]: file systems keep a few blocks of 4096 bytes back."""
LONGEST_NAME = 120
"""Letters of the name of a file or folder in a message; of a longer one half of them."""
FLIGHT_AXES = ("+x", "-x", "+y", "-y")
FilePath = str | os.PathLike[str]
"""What names a file or a folder."""


class InputError(Exception):
    """Bad input: says which file, which line, what is wrong and what to do about it.

    Parameters
    ----------
    message : what is wrong, naming the offending value.
    remedy : what the user can do.
    file, line : where, when known. Lines count from 1. The message has the path as it is given, or from the current
        folder where an absolute one is below it.
    """

    def __init__(self, message: str, remedy: str = "", file: FilePath | None = None, line: int | None = None):
        self.message, self.remedy, self.file, self.line = message, remedy, file, line
        super().__init__(str(self))

    def __str__(self) -> str:
        place = "" if self.file is None else _path_in_words(Path(self.file))
        if place and self.line is not None:
            place += f":{self.line}"
        text = f"{place}: {self.message}" if place else self.message
        return _printable(f"{text} — {self.remedy}" if self.remedy else text)


def real_path(path: FilePath) -> Path:
    """The absolute path with links followed; links that form a loop stay as they are, and no reader opens them."""
    return Path(os.path.realpath(path))


def regular_file(path: FilePath) -> Path:
    """The path of a file that can be read from its beginning to its end.

    Raises
    ------
    InputError
        For what is none: a folder, a pipe or device, which may never end, a link that leads nowhere.
    """
    path = Path(path)
    try:
        mode = os.stat(path).st_mode
    except (OSError, ValueError) as error:
        raise _no_file(path, error) from error
    if not stat.S_ISREG(mode):
        kind = "a folder" if stat.S_ISDIR(mode) else "a pipe or a device"
        raise InputError(f"is {kind}, not a file", "give a file", path)
    return path


def _no_file(path: Path, error: Exception) -> InputError:
    code = getattr(error, "errno", None)
    if code == errno.ELOOP:
        return InputError("its symbolic links form a loop", "check the path", path)
    if code == errno.ENOENT and os.path.islink(path):
        return InputError("is a link to what is not there", "is a drive missing? mount it, or remove the link", path)
    if code in (errno.ENOENT, errno.ENOTDIR):
        return InputError("there is no such file", "check the path", path)
    reason = getattr(error, "strerror", None) or error
    return InputError(f"cannot be read: {reason}", "check the file and its permissions", path)


def counted(number: int, singular: str, plural: str = "") -> str:
    """'1 photograph', '3 photographs'; `plural` where it is not the singular with an s, or a verb follows."""
    return f"{number} {singular}" if number == 1 else f"{number} {plural or singular + 's'}"


LARGEST = 1e12
"""No number that a user states is larger, whatever its unit; a larger one would overflow in a square."""


MOST_DIGITS = 9
"""Of a whole number that somebody states [C]; Python refuses to read one of thousands of digits."""


def whole_number(text: str, digits: int = MOST_DIGITS) -> int | None:
    """The whole number, not negative, that a text states in ASCII digits; None where it is none."""
    return int(text) if text.isascii() and text.isdecimal() and len(text) <= digits else None


def in_digits(value: float, digits: int) -> str:
    """A number to so many digits, never as a power of ten: 302 → '300', 0.0123 → '0.012', both to two."""
    import numpy as np

    return np.format_float_positional(value, precision=digits, unique=False, fractional=False, trim="-")


def stated_number(text: str) -> float:
    """The number that a text states.

    Raises
    ------
    ValueError
        When it is none, or one that nothing measured can have.
    """
    value = float(text)
    if not abs(value) <= LARGEST:
        raise ValueError(f"{text} is not a number to compute with")
    return value


def _path_in_words(path: Path) -> str:
    """A path as it is given, or as it is seen from the current folder: several files of one name are told apart."""
    if path.is_absolute():
        with contextlib.suppress(OSError, ValueError):
            # a current folder that is gone, or a path elsewhere
            path = path.relative_to(Path.cwd())
    return os.path.join(*(_shortened(part) for part in path.parts)) if path.name else str(path)


def _shortened(name: str) -> str:
    return name if len(name) <= LONGEST_NAME else f"{name[: LONGEST_NAME // 2]}…"


def _printable(text: str) -> str:
    """Text as it may go to a terminal: what a file brought along that is not printable is escaped."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in text)


def mm_from_px(column_row: np.ndarray, size_px: tuple[int, int], pixel_mm: float) -> np.ndarray:
    """Image coordinates in mm from the image centre, y up, of pixel positions (0.5 = centre of the first pixel).

    Parameters
    ----------
    column_row : (n, 2) px.
    size_px : columns, rows of the format.
    pixel_mm : size of a pixel.

    Returns
    -------
    (n, 2) mm.
    """
    import numpy as np

    column_row = np.asarray(column_row, dtype=float)
    half = np.array(size_px, dtype=float) / 2.0
    return (column_row - half) * np.array([pixel_mm, -pixel_mm])


def px_from_mm(xy_mm: np.ndarray, size_px: tuple[int, int], pixel_mm: float) -> np.ndarray:
    """Pixel positions (column, row) of image coordinates in mm; the inverse of `mm_from_px`."""
    import numpy as np

    half = np.array(size_px, dtype=float) / 2.0
    return np.asarray(xy_mm, dtype=float) / np.array([pixel_mm, -pixel_mm]) + half
