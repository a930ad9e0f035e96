"""From a folder of photographs to a block: tie points, first orientation, control."""

from __future__ import annotations

import tempfile
import time
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aerotri.conventions import FilePath
from aerotri.execution.choice import THREADS
from aerotri.public.blocks import Axes, Sigmas, text_of_path
from aerotri.public.folders import refuse_foreign_entries, refuse_foreign_folder
from aerotri.public.progress import ProgressLike, StageReport, stage_report
from aerotri.public.projects import project_of
from aerotri.public.used_arguments import used_arguments
from aerotri.public.workplaces import workplace
from aerotri.results.head import Head
from aerotri.tie_points.settings import DEFAULTS, TiePointSettings

if TYPE_CHECKING:
    import numpy as np

    from aerotri.execution.work import Workplace
    from aerotri.formats.assembly.camera_spec import CameraSpec
    from aerotri.formats.assembly.imported import ImportRecord, ImportSource
    from aerotri.observations import Block
    from aerotri.tie_points.given import Given
    from aerotri.tie_points.photographs import PhotographSet
    from aerotri.tie_points.photographs_to_block import Options, TiedBlock
    from aerotri.tie_points.stated import GivenFiles

RECORD = "tiepoints.json"


@dataclass(frozen=True, eq=False, repr=False)
class TiedPhotographs:
    """Photographs tied to a block: what `aerotri.tie_points` returns.

    Parameters
    ----------
    record : the block and how it was found. photographs : their files and cameras. given : what was read beside them.
    seconds : that it took. settings : every argument that was used, as tiepoints.json has them.
    sources : files and folders that were read, with their formats.
    """

    record: TiedBlock
    photographs: PhotographSet
    given: Given
    seconds: float
    settings: list[dict[str, Any]] = field(default_factory=list)
    sources: tuple[ImportSource, ...] = ()

    @property
    def block(self) -> Block:
        """The block, with start values, as `aerotri.adjust` takes it."""
        return self.record.block

    @property
    def points(self) -> np.ndarray:
        """(N, 3) m, start values of its points; NaN where they are not known."""
        return self.record.points

    @property
    def left_out(self) -> tuple[str, ...]:
        """Names of photographs that could not be tied."""
        return self.record.left_out

    @property
    def unmarked(self) -> tuple[str, ...]:
        """Names of the control points that are marked in no photograph."""
        from aerotri.tie_points.given import unmarked_points

        return unmarked_points(self.given.control)

    @property
    def misplaced(self) -> str:
        """Why the place of the block cannot be trusted, with what to look at; '' where it can."""
        return "" if self.record.placed is None else self.record.placed.problem

    @property
    def doubts(self) -> tuple[str, ...]:
        """What looks wrong in the control points and the place, in sentences; they are among the messages."""
        return self.record.doubts

    @property
    def messages(self) -> tuple[str, ...]:
        """What was matched, assumed or left out, in sentences."""
        return self.record.messages

    @property
    def imported(self) -> ImportRecord:
        """What was taken, what was assumed, and what was left behind: the content of import.json."""
        from aerotri.formats.assembly.imported import ImportRecord

        return ImportRecord(self.block, self.sources, self.messages)

    def summary(self, folder: FilePath | None = None) -> dict[str, Any]:
        """The content of tiepoints.json.

        Parameters
        ----------
        folder : where it was saved, for the path of the page to mark control points in.
        """
        from aerotri.report.pages.control_marks import MARKS, PAGE
        from aerotri.tie_points.outcome_json import tie_points_json

        page = "" if folder is None or self.given.control is None else str(Path(folder) / MARKS / PAGE)
        head = Head(self.block.project, self.block.crs).as_dict()
        stated = {"settings": self.settings, "marking_page": page}
        return head | tie_points_json(self.record, self.seconds) | stated

    def save(self, out: FilePath, *, overwrite: bool = False, progress: ProgressLike = None) -> Path:
        """Write the block's folder, tiepoints.json, and a page to mark control points in.

        Parameters
        ----------
        out : folder; files of others stay.
        overwrite : replace files that aerotri has not written, or that were changed since.
        progress : see `aerotri.adjust`.

        Returns
        -------
        Path of the folder.

        Raises
        ------
        InputError
            When the folder holds files of others, or cannot be written to.
        """
        from aerotri.formats.block.writer import IMPORT, OWN_ENTRIES, write_block
        from aerotri.formats.files.atomic import atomic_folder
        from aerotri.formats.files.work_place import held
        from aerotri.formats.results.json_text import write_json
        from aerotri.report.pages.control_marks import MARKS, write_control_marks

        target, given = Path(out), self.given
        refuse_other_content(target, overwrite)
        # in one step, so that block, marks and record belong together
        own = (*OWN_ENTRIES, MARKS, RECORD)
        with held(target), stage_report(progress) as report, atomic_folder(target, own=own) as place:
            write_block(self.block, place)
            if given.control is not None:
                report.stage("control points in the photographs", None)
                write_control_marks(self.record, given.control, self.photographs, given.stated.geoid, place / MARKS)
            write_json(place / IMPORT, self.imported.as_dict())
            write_json(place / RECORD, self.summary(target))
        return target

    def __repr__(self) -> str:
        s = self.summary()
        return (
            f"<aerotri.TiedPhotographs {self.block.name!r}: {s['photographs']} photographs, {s['tie_points']} tie "
            f"points, {s['control']} control and {s['check']} check points>"
        )

    def _repr_html_(self) -> str:
        """Counts and messages, as a notebook shows them."""
        shown = ("crs", "photographs", "tie_points", "rays", "rays_per_point", "control", "check", "median_residual_px")
        values = self.summary()
        rows = "".join(
            f"<tr><th>{name.replace('_', ' ')}</th><td>{escape(_text(values[name]))}</td></tr>" for name in shown
        )
        said = "".join(f"<li>{escape(text)}</li>" for text in self.messages)
        return f"<div><table><caption>{escape(str(self.block.name))}</caption>{rows}</table><ul>{said}</ul></div>"


def tie_points(
    photographs: FilePath,
    *,
    control: FilePath | None = None,
    check: tuple[str, ...] | list[str] = (),
    positions: FilePath | None = None,
    orientation: FilePath | None = None,
    camera: FilePath | None = None,
    focal_length_mm: float | None = None,
    pixel_um: float | None = None,
    free_interior: bool = False,
    crs: str = "",
    geoid: FilePath | None = None,
    control_sigma_m: Sigmas | None = None,
    control_prefix: str = "",
    axes: Axes | None = None,
    columns: str = "",
    time_stamps: FilePath | None = None,
    mark_sigma_px: float = DEFAULTS.mark_sigma_px,
    positions_sigma_m: Sigmas | None = None,
    orientation_sigma_m: Sigmas | None = None,
    orientation_sigma_deg: Sigmas | None = None,
    points: int = DEFAULTS.points,
    features: int = DEFAULTS.features,
    feature_size: int = DEFAULTS.feature_size,
    neighbours: int = DEFAULTS.neighbours,
    seed: int = DEFAULTS.seed,
    project: FilePath | None = None,
    cache: FilePath | None = None,
    executor: str = THREADS,
    progress: ProgressLike = None,
) -> TiedPhotographs:
    """From photographs to a block: tie points, first orientation, control.

    Parameters
    ----------
    photographs : folder of photographs, JPEG or TIFF; subfolders too.
    control : control points with their image points, gcp_list.txt; PATH, or kind:PATH where the kind cannot be told.
    check : names of control points that become check points.
    positions : of the photographs, in place of EXIF; or the trajectory of the antenna (RTKLIB, GrafNav), or time stamps
        with the drone's own solution (.MRK).
    orientation : of the photographs; no first one is sought.
    camera : file with the camera.
    focal_length_mm : in place of EXIF.
    pixel_um : size of a pixel, µm, in place of EXIF.
    free_interior : the interior orientation of the camera file is unknown.
    crs : coordinate system; that of the control where '', else UTM of EXIF.
    geoid : grid of geoid undulations for its heights.
    control_sigma_m : σ of X, Y, Z, m, of control points without one; 0: without error, held.
    control_prefix : what image points have before the names of control points.
    axes : 'yx' where lists that do not name their columns have Y, or the latitude, first; as their coordinate
        system has them where None. Lists with an order of their own: X and Y change places, of the control points
        alone where there are any.
    columns : of such a list of control points (of positions where there are none): letters such as 'PNEZD', or names
        separated by commas.
    time_stamps : when the photographs were taken, where `positions` is a trajectory: file .MRK of the drone, or a
        folder of them; those beside the photographs where None.
    mark_sigma_px : σ of the image points of control, pixels.
    positions_sigma_m : σ of X, Y, Z, m, of positions without one.
    orientation_sigma_m : orientations are observations: σ of X, Y, Z, m.
    orientation_sigma_deg : the same of ω, φ, κ, degrees.
    points : tie points wanted in a photograph.
    features : sought in a photograph.
    feature_size : features are sought in photographs of this size, pixels.
    neighbours : photographs that each is compared with, the nearest.
    seed : the same seed gives the same block.
    project : block, result of an adjustment, or TOML file with a table [project], which the block then has.
    cache : folder to keep features and matches in for another time; a temporary one where None.
    executor : where features and matches are found: 'threads', 'processes:N', 'dask:ADDRESS' or 'dask:local:N'. Other
        machines have to see the photographs and `cache` under the same names.
    progress : see `aerotri.adjust`.

    Returns
    -------
    TiedPhotographs

    Raises
    ------
    InputError
        When a file is damaged or contradictory, a camera is not known, or no photographs have points in common; and
        when the executor is none or cannot be reached.
    TasksFailedError
        When features or matches could not be found elsewhere; the message names the photographs.

    Examples
    --------
    >>> import aerotri
    >>> tied = aerotri.tie_points("photographs", control="gcp_list.txt", check=["GCP7"])  # doctest: +SKIP
    >>> result = aerotri.adjust(tied.block)  # doctest: +SKIP
    """
    asked = {
        "control": control, "check": check, "positions": positions, "orientation": orientation, "camera": camera,
        "focal_length_mm": focal_length_mm, "pixel_um": pixel_um, "free_interior": free_interior, "crs": crs,
        "geoid": geoid, "control_sigma_m": control_sigma_m, "control_prefix": control_prefix,
        "axes": axes, "columns": columns, "time_stamps": time_stamps,
        "mark_sigma_px": mark_sigma_px, "positions_sigma_m": positions_sigma_m,
        "orientation_sigma_m": orientation_sigma_m, "orientation_sigma_deg": orientation_sigma_deg, "points": points,
        "features": features, "feature_size": feature_size, "neighbours": neighbours, "seed": seed,
    }  # fmt: skip
    begun = time.perf_counter()
    TiePointSettings(mark_sigma_px, points, features, feature_size, neighbours, seed).check()
    from aerotri.formats.assembly.assemble import Statements
    from aerotri.formats.assembly.camera_spec import CameraSpec
    from aerotri.tie_points.features import FeatureOptions
    from aerotri.tie_points.matching import MatchOptions
    from aerotri.tie_points.photographs_to_block import Options
    from aerotri.tie_points.stated import GivenFiles

    stated = Statements(
        crs=crs, geoid=geoid, control_sigma_m=control_sigma_m, positions_sigma_m=positions_sigma_m,
        orientation_sigma_m=orientation_sigma_m, orientation_sigma_deg=orientation_sigma_deg,
        control_prefix=control_prefix, axes=axes, columns=columns,
    )  # fmt: skip
    files = GivenFiles(
        text_of_path(control), tuple(check), text_of_path(positions), text_of_path(orientation), stated,
        text_of_path(time_stamps),
    )  # fmt: skip
    spec = CameraSpec(camera, "", None, pixel_um, focal_length_mm, None, free_interior)
    found = FeatureOptions(features, feature_size)
    options = Options(found, MatchOptions(neighbours=neighbours, seed=seed), points)
    whose = None if project is None else project_of(project)
    with stage_report(progress) as report, ExitStack() as stack:
        keep = Path(stack.enter_context(tempfile.TemporaryDirectory()) if cache is None else cache)
        at = stack.enter_context(workplace(executor, keep, report.said))
        tied = _tied(Path(photographs), files, spec, mark_sigma_px, options, keep, report, begun, at)
    tied = replace(tied, settings=used_arguments(tie_points, asked, UNITS))
    if whose is None:
        return tied
    return replace(tied, record=replace(tied.record, block=replace(tied.record.block, project=whose)))


UNITS = {
    "focal_length_mm": "mm", "pixel_um": "µm", "control_sigma_m": "m", "mark_sigma_px": "px", "positions_sigma_m": "m",
    "orientation_sigma_m": "m", "orientation_sigma_deg": "°", "feature_size": "px",
}  # fmt: skip


def _tied(
    folder: Path, files: GivenFiles, camera: CameraSpec, mark_sigma_px: float, options: Options, cache: Path,
    report: StageReport, begun: float, at: Workplace | None,
) -> TiedPhotographs:  # fmt: skip
    from aerotri.compiled import compilation_notice
    from aerotri.tie_points.photographs import find_photographs
    from aerotri.tie_points.photographs_to_block import tie_photographs
    from aerotri.tie_points.stated import read_given, sources_of_photographs, stated_camera

    photographs = find_photographs(folder, stated_camera(camera))
    given = read_given(files, mark_sigma_px, photographs)
    report.stage(compilation_notice() or "features of photographs", None)
    tied = tie_photographs(photographs, given, options, cache, report.counted, at)
    sources = sources_of_photographs(photographs, folder, files, camera.file)
    return TiedPhotographs(tied, photographs, given, time.perf_counter() - begun, sources=sources)


def refuse_other_content(folder: Path, overwrite: bool) -> None:
    """A block goes into an empty folder, or where one of this command is.

    Raises
    ------
    InputError
    """
    from aerotri.formats.block.writer import OWN_ENTRIES
    from aerotri.report.pages.control_marks import MARKS
    from aerotri.tie_points.photographs_to_block import CACHE

    refuse_foreign_folder(folder, RECORD, CACHE)
    refuse_foreign_entries(folder, (*OWN_ENTRIES, MARKS), overwrite)


def _text(value: Any) -> str:
    return f"{value:.3g}" if isinstance(value, float) else str(value)
