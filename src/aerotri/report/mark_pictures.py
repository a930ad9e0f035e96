"""What every mark of a control or check point looks like: cut-outs of the photographs, measured and adjusted places."""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image

from aerotri.adjustment.ray_status import RAY_STATUS
from aerotri.conventions import counted, px_from_mm
from aerotri.diagnosis.control_rays import ControlRays, control_rays
from aerotri.formats.files.photograph_files import match_files, photographs_in
from aerotri.rasters.images import Photograph, open_photograph
from aerotri.report.quality import printable
from aerotri.results.adjusted_block import AdjustedBlock

SIZE = 61
"""Pixels of a cut-out along a side; odd, so that the measured pixel is the middle one."""
ENDINGS = (".tif", ".tiff", ".jpg", ".jpeg")
MOST = 500
"""Cut-outs on a page at most, those of the points with the largest |w| [C]: about one megabyte."""
OPEN = 24
"""Cut-outs up to which they are all shown at once [C]."""
STRETCH = 0.5, 99.5
"""Percentiles of the values of a cut-out of more than 8 bits that become black and white."""


@dataclass(frozen=True)
class CutOut:
    """The surroundings of one mark.

    Parameters
    ----------
    photograph, status : names. picture : a data address.
    measured, adjusted : px within the cut-out, x right and y down from its corner; adjusted is None of a ray not used.
    v_px, w : of x to the right and y up; NaN of a ray not used.
    """

    photograph: str
    status: str
    picture: str
    measured: tuple[float, float]
    adjusted: tuple[float, float] | None
    v_px: tuple[float, float]
    w: tuple[float, float]


@dataclass(frozen=True)
class PointCutOuts:
    """All marks of a point. largest : |w|, NaN where it has none. cut_outs : the largest |w| first."""

    point: str
    role: str
    largest: float
    cut_outs: tuple[CutOut, ...]


@dataclass(frozen=True)
class MarkPictures:
    """The marks of all points, the point with the largest |w| first. notes : what is not shown, in sentences."""

    points: tuple[PointCutOuts, ...]
    notes: tuple[str, ...]

    @property
    def open(self) -> bool:
        """Whether they are few enough to be shown at once."""
        return sum(len(one.cut_outs) for one in self.points) <= OPEN


def mark_pictures(adjusted: AdjustedBlock, photographs: Sequence[Path]) -> MarkPictures:
    """Cut out every mark of control and check points.

    Parameters
    ----------
    photographs : files, and folders of them; the photographs as they were measured.

    Raises
    ------
    InputError
        When a photograph cannot be read, or two files are the same photograph.
    """
    block, rays = adjusted.block, control_rays(adjusted)
    files = photographs_in(photographs, ENDINGS)
    rows = match_files(files, block.images.names).tolist()
    path_of = {row: file for row, file in zip(rows, files, strict=True) if row >= 0}
    shown = np.arange(min(len(rays), MOST))
    found: dict[int, CutOut] = {}
    notes = [f"The first {MOST} of {len(rays)} marks are shown."] if len(rays) > MOST else []
    missing: list[str] = []
    of_image = block.image_points.image[rays.row]
    for image in dict.fromkeys(of_image[shown].tolist()):
        name = printable(block.images.names[image])
        if image not in path_of:
            missing.append(name)
        elif image in block.interior_fits:
            notes.append(f"{name} is scanned film: its marks are not shown.")
        else:
            with open_photograph(path_of[image]) as photograph:
                size = block.cameras[int(block.images.camera[image])].size_px
                if (photograph.columns, photograph.rows) != tuple(size):
                    notes.append(f"{name} has {photograph.columns} × {photograph.rows} pixels, its camera {size[0]} × "
                                 f"{size[1]}: its marks are not shown.")  # fmt: skip
                    continue
                for k in shown[of_image[shown] == image].tolist():
                    cut = _cut_out(adjusted, rays, k, photograph)
                    if cut is not None:
                        found[k] = cut
    if missing:
        notes.append(f"Not found: {counted(len(missing), 'photograph')} ({', '.join(missing[:5])}"
                     f"{' …' if len(missing) > 5 else ''}).")  # fmt: skip
    return MarkPictures(_by_point(adjusted, rays, found), tuple(notes))


def _by_point(adjusted: AdjustedBlock, rays: ControlRays, found: dict[int, CutOut]) -> tuple[PointCutOuts, ...]:
    block = adjusted.block
    point = block.image_points.point[rays.row]
    own: dict[int, list[int]] = {}
    for k in sorted(found):
        own.setdefault(int(point[k]), []).append(k)
    return tuple(
        PointCutOuts(printable(block.points[p]), str(rays.role[rows[0]]), _largest(rays.w[rows]),
                     tuple(found[k] for k in rows))
        for p, rows in own.items()
    )  # fmt: skip


def _largest(w: np.ndarray) -> float:
    return float(np.nanmax(np.abs(w))) if np.isfinite(w).any() else float("nan")


def _cut_out(adjusted: AdjustedBlock, rays: ControlRays, k: int, photograph: Photograph) -> CutOut | None:
    """The cut-out of a ray; None where it was measured beside the photograph."""
    block, row = adjusted.block, int(rays.row[k])
    image = int(block.image_points.image[row])
    camera = block.cameras[int(block.images.camera[image])]
    at = px_from_mm(block.image_points.xy[row : row + 1], camera.size_px, camera.pixel_mm)[0]
    if not ((at >= 0.0) & (at < (photograph.columns, photograph.rows))).all():
        return None
    left, top = (np.floor(at).astype(int) - SIZE // 2).tolist()
    measured = (float(at[0]) - left, float(at[1]) - top)
    v, w = rays.v_px[k], rays.w[k]
    known = bool(np.isfinite(v).all())
    status = RAY_STATUS[int(adjusted.rays.status[row])]
    return CutOut(
        printable(block.images.names[image]), status, _picture(photograph, left, top), measured,
        (measured[0] + float(v[0]), measured[1] - float(v[1])) if known else None,
        (float(v[0]), float(v[1])), (float(w[0]), float(w[1])),
    )  # fmt: skip


def _picture(photograph: Photograph, left: int, top: int) -> str:
    """A JPEG as a data address; what lies beside the photograph is black."""
    x, y = max(left, 0), max(top, 0)
    right, bottom = min(left + SIZE, photograph.columns), min(top + SIZE, photograph.rows)
    pixels = photograph.window(y, x, bottom - y, right - x)
    bands = pixels[:3] if len(pixels) >= 3 else pixels[[0, 0, 0]]
    whole = np.zeros((SIZE, SIZE, 3), np.uint8)
    whole[y - top : bottom - top, x - left : right - left] = np.moveaxis(_eight_bits(bands), 0, -1)
    file = io.BytesIO()
    Image.fromarray(whole).save(file, "JPEG", quality=85)
    return f"data:image/jpeg;base64,{base64.b64encode(file.getvalue()).decode('ascii')}"


def _eight_bits(bands: np.ndarray) -> np.ndarray:
    if bands.dtype == np.uint8:
        return bands
    values = np.nan_to_num(bands.astype(float))
    low, high = np.percentile(values, STRETCH)
    return np.rint(np.clip((values - low) * 255.0 / max(float(high - low), 1e-12), 0.0, 255.0)).astype(np.uint8)
