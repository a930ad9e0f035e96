"""The rendered photographs of a simulated block as files, and the record of them."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Literal

import numpy as np

from aerotri.conventions import InputError, real_path
from aerotri.formats.files.atomic import atomic_file
from aerotri.formats.files.places import existing_folder
from aerotri.formats.results.json_text import write_json
from aerotri.memory import two_sizes
from aerotri.observations import Block
from aerotri.rasters.images import create_image
from aerotri.simulation.exif_tags import GnssFix, exif_of, xmp_of
from aerotri.simulation.placing import Placement
from aerotri.simulation.rendering import WHITE, Scene, rendered_rows

PHOTOGRAPHS, RECORD = "photographs", "rendered.json"
FileFormat = Literal["tiff", "jpeg"]
ENDINGS: dict[FileFormat, str] = {"tiff": ".tif", "jpeg": ".jpg"}
JPEG_QUALITY = 95
"""Of 100: what compression adds lies below the noise of a camera [C]."""
Report = Callable[[float], None]


def chosen_photographs(block: Block, only: Sequence[str] = ()) -> list[int]:
    """Numbers of the photographs to render.

    Parameters
    ----------
    only : their names; all where empty.

    Raises
    ------
    InputError
        For a name that the block does not have.
    """
    names = block.images.names.tolist()
    unknown = [name for name in only if name not in names]
    if unknown:
        raise InputError(f"there is no photograph '{unknown[0]}' to render", f"names are {names[0]} to {names[-1]}")
    return [names.index(name) for name in dict.fromkeys(only)] if only else list(range(len(names)))


def file_name(photograph: str, kind: FileFormat = "tiff") -> str:
    """Name of the file of a photograph."""
    return f"{photograph}{ENDINGS[kind]}"


def gnss_fixes(block: Block, place: Placement | None) -> list[GnssFix | None]:
    """What GNSS says of every photograph, in the order of the block; None where it says nothing.

    Parameters
    ----------
    block : in the CRS of `place`. place : None where there is none, so that nobody knows where on Earth that is.
    """
    found: list[GnssFix | None] = [None] * len(block.images)
    if place is None or block.gnss_ins is None:
        return found
    observed = block.gnss_ins
    geographic = place.geographic(observed.xyz)
    for row, image in enumerate(observed.image.tolist()):
        if np.isfinite(geographic[row]).all():
            found[image] = GnssFix(geographic[row], observed.sigma[row])
    return found


def rendered_before(folder: Path) -> list[str]:
    """The photographs that the record of an older run names, and that this program may therefore remove.

    Parameters
    ----------
    folder : of the block.

    Raises
    ------
    InputError
        When the record is damaged.
    """
    record = folder / PHOTOGRAPHS / RECORD
    if not record.is_file():
        return []
    try:
        names = [str(name) for name in json.loads(record.read_text(encoding="utf-8"))["photographs"]]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(f"cannot be read: {error}", "remove the folder, or choose another --out", record) from error
    return [name for name in names if Path(name).name == name]


def write_photographs(
    scene: Scene,
    chosen: Sequence[int],
    folder: Path,
    report: Report,
    kind: FileFormat = "tiff",
    fixes: Sequence[GnssFix | None] = (),
) -> None:
    """Write photographs, each whole or not at all; the record, written first, names them.

    Parameters
    ----------
    chosen : numbers of the photographs. folder : of the photographs. report : takes the share that is done, 0 … 1.
    kind : 'tiff' of 16 bits, or 'jpeg' of 8 bits with EXIF. fixes : of all photographs, for EXIF.

    Raises
    ------
    InputError
        When they do not fit on the disk.
    """
    _refuse_without_room(scene, chosen, folder)
    files = [file_name(str(scene.names[image]), kind) for image in chosen]
    content = {"photographs": files, "seed": scene.seed, "options": asdict(scene.options)}
    with atomic_file(folder / RECORD) as place:
        write_json(place, content)
    for number, (image, name) in enumerate(zip(chosen, files, strict=True)):
        tell: Report = lambda share, before=number: report((before + share) / len(chosen))  # noqa: E731
        if kind == "jpeg":
            _write_jpeg(scene, image, folder / name, tell, fixes[image] if fixes else None)
        else:
            _write_tiff(scene, image, folder / name, tell)


def _write_jpeg(scene: Scene, image: int, path: Path, report: Report, fix: GnssFix | None) -> None:
    """In 8 bits, with what a drone says of it."""
    from PIL import Image

    grey = np.concatenate([rows for _, rows in rendered_rows(scene, image, report)])
    pixels = np.rint(grey / (WHITE / 255.0)).astype(np.uint8)
    packet = {} if fix is None else {"xmp": xmp_of(fix)}
    with atomic_file(path) as place:
        Image.fromarray(pixels).save(
            place, "JPEG", quality=JPEG_QUALITY, exif=exif_of(scene.camera(image).nominal, fix), **packet
        )


def _write_tiff(scene: Scene, image: int, path: Path, report: Report) -> None:
    columns, rows = scene.camera(image).nominal.size_px
    with atomic_file(path) as place, create_image(place, columns, rows, 1, "uint16") as writer:
        for first, pixels in rendered_rows(scene, image, report):
            writer.write(first, pixels[None])


def _refuse_without_room(scene: Scene, chosen: Sequence[int], folder: Path) -> None:
    """Photographs are as large as their pixels, 16 bit each."""
    needed = sum(2.0 * float(np.prod(scene.camera(image).nominal.size_px, dtype=float)) for image in chosen)
    free = shutil.disk_usage(existing_folder(real_path(folder))).free
    if needed > free:
        wanted, there = two_sizes(needed, free)
        raise InputError(
            f"{len(chosen)} photographs need {wanted}, {there} of the disk are free",
            "choose another place, or some of them by --only",
        )
