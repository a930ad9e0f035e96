"""What an import took, what it assumed and what it left behind: import.json, and four lines on the screen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from aerotri.conventions import counted, real_path
from aerotri.coordinates.crs_names import crs_names, heights_in_words
from aerotri.formats.assembly import kinds
from aerotri.formats.assembly.kinds import ReadingOptions
from aerotri.formats.assembly.project import Request, kind_of_source, reading_options
from aerotri.formats.block.writer import IMPORT
from aerotri.formats.foreign.ign import is_ign
from aerotri.formats.text.notes import Kind, Note, kind_of_note, without_beginning
from aerotri.observations import Block
from aerotri.results.head import Head

SHOWN = 3
"""Sources and notes of a kind on the screen [C]: a line of more is not read."""
WHOLE, RAYS, ORIENTATIONS, POSITIONS, CONTROL, CAMERA = (
    "block", "image points", "orientations", "positions", "control points", "camera",
)  # fmt: skip
PHOTOGRAPHS, TIMES = "photographs", "time stamps"
NOUNS = {
    "check_points": "check point", "gnss_positions": "GNSS position", "ins_attitudes": "INS attitude",
    "start_orientations": "start orientation",
}  # fmt: skip
PROGRAMS = {
    "block": "aerotri", "blocks": "ContextCapture, iTwin Capture",
    "colmap": "COLMAP", "dbat": "DBAT", "bal": "Bundle Adjustment in the Large",
    "bundler": "Bundler", "opensfm": "OpenSfM", "metashape": "Metashape", "pix4d": "Pix4D", "odm": "OpenDroneMap",
    "ign": "IGN", "patb": "PAT-B", "bingo": "BINGO", "dji": "DJI", "rtklib": "RTKLIB, Emlid Studio",
    "grafnav": "NovAtel GrafNav", "opf": "PIX4Dmatic", "nvm": "VisualSFM", "micmac": "MicMac",
    "openmvg": "OpenMVG", "alicevision": "AliceVision, Meshroom", "realitycapture": "RealityCapture, RealityScan",
}  # fmt: skip
"""The program behind a format, by the beginning of its name; none of lists that many write."""


@dataclass(frozen=True)
class ImportSource:
    """A file or folder that was read.

    Parameters
    ----------
    path : as the user wrote it. holds : what was taken from it. format : as it was recognised, '' where it has no name.
    program : that writes the format, '' of those that many write.
    """

    path: str
    holds: str
    format: str = ""
    program: str = ""

    def in_words(self) -> str:
        """'gcp_list.txt (odm-gcp, OpenDroneMap)', the file without its folder."""
        known = ", ".join(text for text in (self.format, self.program) if text)
        name = real_path(Path(self.path)).name
        return f"{name} ({known})" if known else name


@dataclass(frozen=True, eq=False)
class ImportRecord:
    """An import.

    Parameters
    ----------
    block : as it was read. sources : files and folders.
    notes : sentences; of those without a kind, remarks.
    """

    block: Block
    sources: tuple[ImportSource, ...]
    notes: tuple[str, ...]

    @property
    def taken(self) -> tuple[str, ...]:
        """What was used in another way than it stands in the files."""
        return self._of("taken")

    @property
    def assumed(self) -> tuple[str, ...]:
        """What no file and no option said."""
        return self._of("assumed")

    @property
    def left_behind(self) -> tuple[str, ...]:
        """What stands in the files and not in the block."""
        return self._of("left behind")

    @property
    def remarks(self) -> tuple[str, ...]:
        """What else is to be known: how well things fit, what looks wrong."""
        return self._of("")

    @property
    def counts(self) -> dict[str, int]:
        """How much of everything the block has."""
        block, images, control = self.block, self.block.images, self.block.control
        start = np.isfinite(np.hstack([images.centre, images.angles])).all(axis=1)
        observed = block.gnss_ins
        return {
            "photographs": len(images),
            "cameras": len(block.cameras),
            "image_points": len(block.image_points),
            "points": len(np.unique(block.image_points.point)),
            "control_points": int((~control.is_check).sum()),
            "check_points": int(control.is_check.sum()),
            "gnss_positions": 0 if observed is None else int(np.isfinite(observed.xyz).any(axis=1).sum()),
            "ins_attitudes": 0 if observed is None else int(np.isfinite(observed.angles).any(axis=1).sum()),
            "start_orientations": int(start.sum()),
        }

    def as_dict(self) -> dict[str, Any]:
        """The content of import.json."""
        return Head(self.block.project, self.block.crs).as_dict() | {
            "block": self.block.name,
            "sources": [
                {"path": s.path, "holds": s.holds, "format": s.format, "program": s.program} for s in self.sources
            ],
            "taken": self.counts | {"heights": heights_in_words(self.block.crs), "notes": list(self.taken)},
            "assumed": list(self.assumed),
            "left_behind": list(self.left_behind),
            "remarks": list(self.remarks),
        }

    def lines(self) -> tuple[str, ...]:
        """Four lines for the screen; what is not shown is counted."""
        return (
            f"Read: {_shown([source.in_words() for source in self.sources])}",
            f"Taken: {_shown([self._counts_in_words(), *self.taken])}",
            f"Assumed: {_shown(self.assumed)}",
            f"Left behind: {_shown([without_beginning(text) for text in self.left_behind])}",
        )

    def _of(self, kind: Kind | str) -> tuple[str, ...]:
        found = [str(note) if isinstance(note, Note) else note for note in self.notes if kind_of_note(note) == kind]
        return tuple(dict.fromkeys(found))

    def _counts_in_words(self) -> str:
        """'12 photographs, 1 camera, … in EPSG:25832 (ETRS89 / UTM zone 32N), heights: …'."""
        n = self.counts
        parts = [
            counted(n["photographs"], "photograph"),
            counted(n["cameras"], "camera"),
            f"{counted(n['image_points'], 'image point')} of {counted(n['points'], 'point')}",
            counted(n["control_points"], "control point"),
        ]
        for key in ("check_points", "gnss_positions", "ins_attitudes", "start_orientations"):
            if n[key]:
                parts.append(counted(n[key], NOUNS[key]))
        return f"{', '.join(parts)}; {_system_in_words(self.block.crs)}"


def _system_in_words(crs: str) -> str:
    names = crs_names(crs)
    if crs == "local" or not names.name:
        return "local coordinates in metres"
    plan = f"{names.name} ({names.code})" if names.code else names.name
    return f"{plan}, heights: {heights_in_words(crs)}"


def _shown(texts: Sequence[str]) -> str:
    more = f"; and {len(texts) - SHOWN} more, see {IMPORT}" if len(texts) > SHOWN else ""
    return ("; ".join(texts[:SHOWN]) + more) or "nothing"


def program_of(format: str | None) -> str:
    """The program behind a format, '' where many write it."""
    return PROGRAMS.get((format or "").partition("-")[0], "")


def source_of_list(text: str, known: kinds.Kinds, holds: str, options: ReadingOptions) -> ImportSource:
    """A file of a kind, ``PATH`` or ``kind:PATH``, as it was read."""
    kind, path = kinds.stated_or_told(text, known, options)
    return ImportSource(str(path), holds, kind or "", program_of(kind))


class ListFiles(Protocol):
    """What names the lists of an import: `kind:PATH` or PATH each, '' where there is none."""

    @property
    def control(self) -> str: ...
    @property
    def positions(self) -> str: ...
    @property
    def orientation(self) -> str: ...
    @property
    def time_stamps(self) -> str: ...


def sources_of_lists(files: ListFiles, options: ReadingOptions, photographs: Path | None = None) -> list[ImportSource]:
    """Orientations, positions and control points, and the time stamps that a trajectory was read at.

    Parameters
    ----------
    photographs : their folder, where time stamps are looked for too; see `kinds.read_position_list`.
    """
    of_positions = options.beside_control() if files.control else options
    lists = (
        (files.orientation, kinds.ORIENTATIONS, ORIENTATIONS, options),
        (files.positions, kinds.POSITIONS, POSITIONS, of_positions),
        (files.control, kinds.CONTROL, CONTROL, options),
    )
    sources = [source_of_list(text, known, holds, how) for text, known, holds, how in lists if text]
    stamps = kinds.files_of_stamps(files.positions, files.time_stamps, photographs)
    return sources + [ImportSource(str(path), TIMES, kinds.DJI_MRK, program_of(kinds.DJI_MRK)) for path in stamps]


def sources_of(request: Request) -> tuple[ImportSource, ...]:
    """The files of a request that was read, in the order in which they are given.

    Raises
    ------
    InputError
        When one is no longer there.
    """
    options = reading_options(request)
    kind, path = kind_of_source(request)
    found = [_main_source(kind, path, options)]
    found += [source_of_list(text, kinds.RAYS, RAYS, options) for text in request.image_points]
    found += sources_of_lists(request, options)
    if request.camera.file is not None:
        found.append(ImportSource(str(request.camera.file), CAMERA))
    return tuple(found)


def _main_source(kind: str | None, path: Path, options: ReadingOptions) -> ImportSource:
    """The source of a request: a whole block, a folder of parts, or a list."""
    if kind is not None and kind in kinds.RAYS:
        return ImportSource(str(path), RAYS, kind, program_of(kind))
    if kind is not None and kind in kinds.ORIENTATIONS:
        return ImportSource(str(path), ORIENTATIONS, kind, program_of(kind))
    if kind is None and path.is_dir():
        kind = "ign" if is_ign(path) else "patb"
    if kind is not None:
        return ImportSource(str(path), WHOLE, kind, program_of(kind))
    for known, holds in ((kinds.RAYS, RAYS), (kinds.ORIENTATIONS, ORIENTATIONS)):
        told = kinds.kind_of(path, known)
        if told is not None:
            return ImportSource(str(path), holds, told, program_of(told))
    return source_of_list(str(path), kinds.POSITIONS, POSITIONS, options)
