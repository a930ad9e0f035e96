"""What a simulated block really is, and its files."""

from __future__ import annotations

import csv
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np

from aerotri.conventions import FilePath
from aerotri.formats.files.atomic import atomic_folder
from aerotri.observations import Block
from aerotri.simulation.projection import Motion
from aerotri.spreadsheet import plain_row


@dataclass(frozen=True, eq=False)
class ImageErrorSample:
    """The image error of a camera on a grid: xy and d, (g, 2) mm each; day '' when it is the same on all days."""

    camera: str
    day: str
    xy: np.ndarray
    d: np.ndarray


@dataclass(frozen=True, eq=False)
class Truth:
    """The true values behind a simulated block.

    Parameters
    ----------
    centre, angles : (n, 3) m and rad of the images, in the block's order and rotation order.
    points : (N, 3) m in the order of the block's points.
    parameter_names, parameter_groups, parameter_values : (p,) additional parameters in force, the group a camera name.
    interior : (c, 3) mm, focal length, x0, y0 of the cameras in the block's order.
    image_errors : sampled fields.
    gross_errors : (k,) index into the block's image points; gross_error_mm : (k, 2).
    control_blunders : (b,) index into the block's control; control_blunder_m : (b, 3).
    mountings : (6,) position, m, and angles, rad, by camera of a rig.
    motion : of the photographs while they are read, readout_ms by camera; None and empty without rolling shutters.
    """

    centre: np.ndarray
    angles: np.ndarray
    points: np.ndarray
    parameter_names: tuple[str, ...]
    parameter_groups: tuple[str, ...]
    parameter_values: np.ndarray
    interior: np.ndarray
    image_errors: tuple[ImageErrorSample, ...]
    gross_errors: np.ndarray
    gross_error_mm: np.ndarray
    control_blunders: np.ndarray
    control_blunder_m: np.ndarray
    mountings: Mapping[str, np.ndarray] = field(default_factory=dict)
    motion: Motion | None = None
    readout_ms: Mapping[str, float] = field(default_factory=dict)


TRUTH = "truth"


MARKED_CONTROL = "gcp_list.txt"


def write_simulated(
    folder: FilePath,
    block: Block,
    truth: Truth,
    gone: Collection[str] = (),
    further: Callable[[Path], None] | None = None,
    tables: Literal["csv", "parquet"] = "csv",
) -> None:
    """Write the block's folder and, under `truth/`, what is behind it; other files stay but for `gone`.

    Numbers are rounded to what they can mean, so that another processor writes the same.

    Parameters
    ----------
    further : writes into the folder what belongs to the block besides: `gcp_list.txt` and files in `truth/`.
    tables : of the block.
    """
    # imported here: those who only simulate need no file formats
    from aerotri.formats.block.folder import write_block
    from aerotri.formats.block.writer import OWN_ENTRIES

    # in one step: a block must never stand beside the truth of another one
    with atomic_folder(folder, own=(*OWN_ENTRIES, TRUTH, MARKED_CONTROL), gone=gone) as place:
        write_block(block, place, tables, rounded=True)
        write_truth(place, block, truth)
        if further is not None:
            further(place)


def write_truth(folder: FilePath, block: Block, truth: Truth) -> None:
    """Write `truth/` of a block's folder: images, points, additional_parameters, cameras, image_errors, gross_errors,
    control_blunders (.csv). Metres, millimetres in the image, degrees.
    """
    with atomic_folder(Path(folder) / TRUTH) as place:
        _write_tables(place, block, truth)


def _write_tables(place: Path, block: Block, truth: Truth) -> None:
    names = block.images.names
    orientation = np.hstack([np.round(truth.centre, 6), np.round(np.degrees(truth.angles), 9)])
    _write(place / "images.csv", ["image", "X0", "Y0", "Z0", "omega", "phi", "kappa"], _rows((names,), orientation))
    _write(place / "points.csv", ["point", "X", "Y", "Z"], _rows((block.points,), np.round(truth.points, 6)))
    parameters = (truth.parameter_names, truth.parameter_groups)
    _write(
        place / "additional_parameters.csv",
        ["name", "group", "value"],
        _rows(parameters, truth.parameter_values[:, None]),
    )
    cameras = [camera.name for camera in block.cameras]
    _write(place / "cameras.csv", ["name", "focal_length_mm", "x0_mm", "y0_mm"], _rows((cameras,), truth.interior))
    _write_image_errors(place / "image_errors.csv", truth.image_errors)
    rays = block.image_points
    wrong = (names[rays.image[truth.gross_errors]], block.points[rays.point[truth.gross_errors]])
    _write(place / "gross_errors.csv", ["image", "point", "dx", "dy"], _rows(wrong, np.round(truth.gross_error_mm, 7)))
    blundered = (block.points[block.control.point[truth.control_blunders]],)
    blunder = np.round(truth.control_blunder_m, 6)
    _write(place / "control_blunders.csv", ["point", "dX", "dY", "dZ"], _rows(blundered, blunder))
    if truth.motion is not None:
        _write_motion(place, block, truth, truth.motion)
    if truth.mountings:
        values = np.array(list(truth.mountings.values()))
        values = np.hstack([np.round(values[:, :3], 6), np.round(np.degrees(values[:, 3:]), 9)])
        header = ["camera", "x", "y", "z", "omega", "phi", "kappa"]
        _write(place / "rigs.csv", header, _rows((truth.mountings,), values))


def _write_motion(place: Path, block: Block, truth: Truth, motion: Motion) -> None:
    readouts = np.array(list(truth.readout_ms.values()))[:, None]
    _write(place / "readout.csv", ["camera", "readout_ms"], _rows((truth.readout_ms,), readouts))
    values = np.hstack([np.round(motion.velocity, 6), np.round(np.degrees(motion.spin), 6)])
    header = ["image", "vX", "vY", "vZ", "wx", "wy", "wz"]
    _write(place / "motion.csv", header, _rows((block.images.names,), values))


def _write_image_errors(path: Path, samples: Sequence[ImageErrorSample]) -> None:
    rows = []
    for sample in samples:
        count = len(sample.xy)
        rows += _rows(([sample.camera] * count, [sample.day] * count), np.round(np.hstack([sample.xy, sample.d]), 9))
    _write(path, ["camera", "day", "x", "y", "dx", "dy"], rows)


def _rows(texts: tuple[Iterable[object], ...], numbers: np.ndarray) -> list[list[str]]:
    """Rows of text columns and numbers; repr keeps every digit that a number was rounded to."""
    return [
        [*(str(t) for t in text), *(repr(v) for v in values)]
        for text, values in zip(zip(*texts, strict=True), numbers.tolist(), strict=True)
    ]


def _write(path: Path, header: list[str], rows: Iterable[list[str]]) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(header)
        writer.writerows(plain_row(row) for row in rows)
