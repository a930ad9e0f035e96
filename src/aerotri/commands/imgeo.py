"""`aerotri imgeo`: photographs without systematic image errors, their camera, and the errors for other programs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from aerotri.commands.console import Console
from aerotri.commands.results import reopened
from aerotri.conventions import InputError
from aerotri.execution.choice import THREADS, chosen
from aerotri.formats.results.json_text import json_text
from aerotri.public.folders import refuse_foreign_folder
from aerotri.rasters.photograph_settings import (
    COMPRESSION,
    COMPRESSIONS,
    RESAMPLING,
    RESAMPLINGS,
    Compression,
    Resampling,
)

if TYPE_CHECKING:
    from aerotri.public.ideal import IdealPhotographs


@dataclass(frozen=True)
class ImgeoOptions:
    """What the command line says besides the photographs.

    Parameters
    ----------
    resampling : bicubic or lanczos.
    compression : keep, deflate, lzw, zstd or none.
    group : parameter group of photographs that the block does not name.
    """

    resampling: Resampling = RESAMPLING
    compression: Compression = COMPRESSION
    group: str | None = None

    def check(self) -> None:
        """Refuse what is not known, in the words of the command line.

        Raises
        ------
        InputError
        """
        for name, value, known in (
            ("resampling", self.resampling, RESAMPLINGS), ("compression", self.compression, COMPRESSIONS)
        ):  # fmt: skip
            if value not in known:
                raise InputError(f"--{name} '{value}' is not known", f"choose one of {', '.join(known)}")


def run_imgeo(
    result: Path, photographs: list[Path], out: Path, options: ImgeoOptions, as_json: bool, overwrite: bool = False,
    executor: str = THREADS,
) -> None:  # fmt: skip
    """Resample and export; arguments as on the command line.

    Raises
    ------
    InputError
    """
    from aerotri.formats.results.image_errors import RECORD
    from aerotri.public.adjustment import Adjustment
    from aerotri.public.ideal import ideal_photographs

    console = Console(quiet=as_json)
    refuse_foreign_folder(out, RECORD)
    options.check()
    chosen(executor)
    found = ideal_photographs(
        Adjustment(reopened(result, console)), photographs, out, resampling=options.resampling,
        compression=options.compression, group=options.group, overwrite=overwrite, executor=executor,
        progress=console.stage,
    )  # fmt: skip
    if as_json:
        print(json_text(found.summary))
    else:
        text = f"Written to {out}: ideal camera in camera.toml, image errors in correction.csv"
        console.lines([*_summary(found), text])


def _summary(found: IdealPhotographs) -> list[str]:
    from aerotri.formats.results.image_errors import one_line

    lines = []
    for group in found.summary["groups"]:
        opencv, brown = (near["remaining_rms_um"] for near in group["nearest"])
        lines.append(
            f"{one_line(group['ideal_camera'])}: image errors {group['d_rms_um']:.2f} µm RMS, "
            f"{group['d_max_um']:.2f} at most; the nearest OpenCV model leaves {opencv:.2f}, Brown's {brown:.2f} µm RMS"
        )
    for photograph in found.summary["photographs"]:
        lost = f", without {', '.join(photograph['left_out'])}" if photograph["left_out"] else ""
        left = photograph.get("relief_rms_px")
        relief = "" if left is None else f", relief leaves {left:.2f} px RMS of the rolling shutter"
        lines.append(f"{one_line(photograph['written'])}: {photograph['seconds']:.1f} s{relief}{lost}")
    return lines
