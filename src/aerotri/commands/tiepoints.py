"""`aerotri tiepoints`: a folder of photographs becomes a block."""

from __future__ import annotations

import json
import re
import time
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from aerotri.commands.console import Console
from aerotri.conventions import InputError
from aerotri.formats.assembly.assemble import Statements
from aerotri.formats.assembly.camera_spec import CameraSpec
from aerotri.formats.block.writer import OWN_ENTRIES
from aerotri.public.folders import refuse_foreign_entries, refuse_foreign_folder

if TYPE_CHECKING:
    from aerotri.formats.assembly.parts import PointList
    from aerotri.tie_points.photographs import PhotographSet, StatedCamera
    from aerotri.tie_points.photographs_to_block import Given, TiedBlock

RECORD, MARKS, PAGE = "tiepoints.json", "control_marks", "marking.html"
NO_CRS = "+proj=local"
"""First line of a gcp_list.txt in local coordinates: a system that has no name, taken as it is."""


@dataclass(frozen=True)
class TiePointOptions:
    """The options of the command line, under their names there."""

    gcp: str = ""
    check: tuple[str, ...] = ()
    positions: str = ""
    orientation: str = ""
    camera: CameraSpec = field(default_factory=CameraSpec)
    stated: Statements = field(default_factory=Statements)
    mark_sigma_px: float = 0.5
    points: int = 1000
    features: int = 8000
    feature_size_px: int = 2000
    neighbours: int = 20
    seed: int = 1


def run_tiepoints(folder: Path, out: Path, options: TiePointOptions, as_json: bool, overwrite: bool = False) -> None:
    """Tie and write; arguments as on the command line.

    Raises
    ------
    InputError
    """
    from aerotri.formats.files.work_place import held
    from aerotri.tie_points.photographs_to_block import CACHE

    refuse_foreign_folder(out, RECORD, CACHE)
    refuse_foreign_entries(out, (*OWN_ENTRIES, MARKS), overwrite)
    with held(out):
        content = _tied(folder, out, options, Console(quiet=as_json))
    if as_json:
        print(json.dumps(content, ensure_ascii=False))


def _tied(folder: Path, out: Path, options: TiePointOptions, console: Console) -> dict[str, Any]:
    """Tie, write and tell; returns the content of tiepoints.json."""
    begun = time.perf_counter()
    from aerotri.compiled import compilation_notice
    from aerotri.formats.block.writer import write_block
    from aerotri.formats.files.atomic import atomic_folder
    from aerotri.tie_points.features import FeatureOptions
    from aerotri.tie_points.matching import MatchOptions
    from aerotri.tie_points.photographs import find_photographs
    from aerotri.tie_points.photographs_to_block import CACHE, Options, tie_photographs

    photographs = find_photographs(folder, _stated_camera(options.camera))
    given = _given(options)
    console.progress(compilation_notice())
    tied = tie_photographs(
        photographs,
        given,
        Options(
            FeatureOptions(options.features, options.feature_size_px),
            MatchOptions(neighbours=options.neighbours, seed=options.seed),
            options.points,
        ),
        out / CACHE,
        lambda stage, done, count: console.work(stage, done / max(count, 1), f"{done} of {count}"),
    )
    # in one step, so that block, marks and record belong together
    with atomic_folder(out, own=(*OWN_ENTRIES, MARKS, RECORD)) as place:
        write_block(tied.block, place)
        if given.control is not None:
            console.progress("control points in the photographs")
            write_marks(tied, given.control, photographs, options.stated, place / MARKS)
        content = _content(tied, time.perf_counter() - begun)
        content["marking_page"] = "" if given.control is None else str(out / MARKS / PAGE)
        (place / RECORD).write_text(json.dumps(content, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
    console.lines([*content["messages"], *_lines(content), f"Written to {out}"])
    return content


def _stated_camera(spec: CameraSpec) -> StatedCamera:
    from aerotri.formats.assembly.camera_spec import cameras_of
    from aerotri.tie_points.photographs import StatedCamera

    if spec.file is None:
        return StatedCamera((), spec.focal_length_mm, spec.pixel_um)
    nothing = np.zeros(0)
    return StatedCamera(cameras_of(spec, (), nothing.astype(str), nothing))


def _given(options: TiePointOptions) -> Given:
    from aerotri.formats.assembly import kinds
    from aerotri.tie_points.photographs_to_block import Given

    reading = kinds.ReadingOptions(kinds.axes_of(options.stated.crs))
    if options.check and not options.gcp:
        raise InputError("--check names control points, and there are none", "give them: --gcp gcp_list.txt")
    control = None
    if options.gcp:
        control = _named(kinds.read_control(options.gcp, reading), options.stated.control_prefix)
    return Given(
        # the names have the prefix already
        stated=replace(options.stated, control_prefix=""),
        positions=kinds.read_position_list(options.positions, reading) if options.positions else None,
        control=control,
        check=tuple(_in_block(name, control, options.stated.control_prefix) for name in options.check),
        orientation=kinds.read_orientations(options.orientation, reading) if options.orientation else None,
        mark_sigma_px=options.mark_sigma_px,
    )


def _in_block(name: str, control: PointList | None, prefix: str) -> str:
    """The name of a check point as the block has it, whether it was given with the prefix or without."""
    known = () if control is None else control.points.tolist()
    return prefix + name if name not in known and prefix + name in known else name


def _named(control: PointList, prefix: str) -> PointList:
    """The control points under the names they have in the block."""
    if not prefix:
        return control
    rays = control.rays
    if rays is not None:
        rays = replace(rays, points=np.array([prefix + name for name in rays.points.tolist()], dtype=str))
    return replace(control, points=np.array([prefix + name for name in control.points.tolist()], dtype=str), rays=rays)


def write_marks(
    tied: TiedBlock, control: PointList, photographs: PhotographSet, stated: Statements, folder: Path
) -> None:
    """Where every control point is expected in every photograph: a table, pieces of the photographs, a page to mark in.

    Raises
    ------
    InputError
    """
    from aerotri.formats.files.atomic import atomic_folder
    from aerotri.formats.text.table_writer import write_table
    from aerotri.report.pages.marking import marking_page
    from aerotri.tie_points.control_marks import pieces, predict_marks

    marks = predict_marks(tied.block, control, tied.points, stated.geoid)
    names = tied.block.images.names
    paths = dict(zip(photographs.names.tolist(), photographs.paths, strict=True))
    with atomic_folder(folder, own=("predicted.csv", "pieces", PAGE)) as place:
        write_table(
            {
                "point": marks.points[marks.point],
                "image": names[marks.image],
                "column": marks.predicted[:, 0],
                "row": marks.predicted[:, 1],
                "marked_column": marks.marked[:, 0],
                "marked_row": marks.marked[:, 1],
            },
            place / "predicted.csv",
        )
        (place / "pieces").mkdir()
        rows = []
        for row, corner, jpeg in pieces(marks, paths, names):
            point, image = str(marks.points[marks.point[row]]), str(names[marks.image[row]])
            file = re.sub(r"[^\w.-]", "_", f"{marks.point[row] + 1}_{point}_{image}")
            (place / "pieces" / f"{file}.jpg").write_bytes(jpeg)
            predicted, marked = marks.predicted[row].tolist(), marks.marked[row].tolist()
            rows.append({"point": point, "image": image, "corner": corner, "predicted": predicted,
                         "marked": None if np.isnan(marked).any() else marked, "jpeg": jpeg})  # fmt: skip
        rows.sort(key=lambda row: (row["point"], row["image"]))
        crs = control.crs or (NO_CRS if tied.block.crs == "local" else tied.block.crs)
        given = dict(zip(control.points.tolist(), map(tuple, control.xyz.tolist()), strict=True))
        (place / PAGE).write_text(marking_page(crs, given, rows), encoding="utf-8")


def _content(tied: TiedBlock, seconds: float) -> dict[str, Any]:
    block, rays = tied.block, tied.block.image_points
    is_control = np.isin(rays.point, block.control.point)
    per_point = np.bincount(rays.point[~is_control], minlength=len(block.points))
    per_image = np.bincount(rays.image[~is_control], minlength=len(block.images))
    return {
        "block": block.name,
        "crs": block.crs,
        "photographs": len(block.images),
        "left_out": list(tied.left_out),
        "pairs": {"compared": tied.pairs[0], "tied": tied.pairs[1]},
        "tie_points": int((per_point > 0).sum()),
        "rays": int((~is_control).sum()),
        "rays_per_point": float(per_point[per_point > 0].mean()),
        "points_per_photograph": {"smallest": int(per_image.min()), "median": float(np.median(per_image))},
        "control": int((~block.control.is_check).sum()),
        "check": int(block.control.is_check.sum()),
        "median_residual_px": tied.median_px,
        "cameras": [
            {"name": camera.name, "focal_length_mm": camera.focal_length_mm, "pixel_um": camera.pixel_um}
            for camera in block.cameras
        ],
        "messages": list(tied.messages),
        "seconds": round(seconds, 1),
    }


def _lines(content: dict[str, Any]) -> list[str]:
    pairs, per = content["pairs"], content["points_per_photograph"]
    said = [
        f"{content['photographs']} photographs in {content['crs']}, {pairs['tied']} of {pairs['compared']} pairs tied: "
        f"{content['tie_points']} tie points with {content['rays_per_point']:.1f} rays, "
        f"{per['median']:.0f} in a photograph ({per['smallest']} at least)",
        f"{content['control']} control and {content['check']} check points; first orientation fits to "
        f"{content['median_residual_px']:.2f} px (median); {content['seconds']:.0f} s",
    ]
    if content["marking_page"]:
        done = "more of them can be marked" if content["control"] + content["check"] else "mark them"
        said.append(f"control points in the photographs: {done} in {content['marking_page']}")
    if content["left_out"]:
        said.append(f"could not be tied and left out: {', '.join(content['left_out'])}")
    return said
