"""One self-contained page about an adjustment: no network, every name escaped.

Its one script sorts and filters tables and moves the block plan; the page's policy lets nothing else run or load, and
without the script everything can still be read.
"""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import PackageLoader
from markupsafe import Markup
from matplotlib.figure import Figure

from aerotri import diagnosis
from aerotri.crosscheck import CrosscheckResult
from aerotri.diagnosis import Finding
from aerotri.diagnosis.free_verdict import in_words
from aerotri.diagnosis.purpose import beside_verdict, plus_minus
from aerotri.diagnosis.work_list import WorkList, work_list
from aerotri.image_errors import Change
from aerotri.report import quality
from aerotri.report.mark_pictures import SIZE, MarkPictures
from aerotri.report.pages.head import page_environment, page_head
from aerotri.report.pages.interactive_plan import interactive_plan
from aerotri.report.plots.crosscheck import crosscheck_table
from aerotri.report.plots.rendering import RenderedPlot, render_plots
from aerotri.report.tables import adjustment as tables
from aerotri.report.tables import parameters as parameter_tables
from aerotri.report.tables import photographs as photograph_tables
from aerotri.report.tables import precision as precision_tables
from aerotri.report.tables import rigs as rig_tables
from aerotri.report.tables import rolling_shutters as shutter_tables
from aerotri.report.tables import work as work_tables
from aerotri.report.tables.cameras_elsewhere import elsewhere_tables
from aerotri.report.tables.settings import settings_table
from aerotri.results.adjusted_block import AdjustedBlock, head_of
from aerotri.results.parameter_comparison import ParameterComparison
from aerotri.results.relative import medians
from aerotri.statistics.parameter_effects import ParameterEffects
from aerotri.statistics.photograph_residuals import photograph_residuals
from aerotri.statistics.position_differences import position_differences
from aerotri.strategies.free_stages import FreeCheck

LARGEST_SVG = 450_000
"""Bytes above which a plot is embedded as PNG: thousands of photographs as vectors weigh more than they say."""

CONTENTS = (
    ("adjusted", "What was adjusted"),
    ("good", "Is it good?"),
    ("ground", "Control and check points"),
    ("camera", "What the camera does wrong"),
    ("parameters", "Which parameters matter"),
    ("effects", "What they change"),
    ("residuals", "Residuals"),
    ("work", "Work list"),
    ("settings", "Settings"),
)

CAPTIONS = {
    "block_plan": "Projection centres, strips, footprints on the mean height of the ground, control and check points.",
    "overlap": (
        "In how many photographs the ground is seen. The darker the fewer; hatched: fewer than three, where a gross "
        "error of a tie point stays unseen. The line bounds the ground seen by three or more."
    ),
    "trajectory": (
        "Adjusted position of the antenna − given position. Jumps and slopes are errors of the positions; a constant "
        "difference is one of the datum, the lever arm or the principal distance."
    ),
    "error_ellipses": (
        "Error ellipses of object points for 95 %, thinned. The darker an ellipse, the larger the σ of the height."
    ),
    "column_row_residuals": (
        "Mean residuals along the columns and rows of the image. Filled dots are more than noise, all means tested "
        "together. A curve means that the additional parameters leave a systematic error of the camera."
    ),
    "photograph_residuals": "How large the residuals are in every photograph; filled: larger than chance makes them.",
    "change": (
        "The systematic image errors of two groups and their difference, on one scale. Dark arrows differ from zero at "
        "95 %."
    ),
    "ground_points": "Differences adjusted − given: horizontal vectors, and heights as arrows up (too high) or down.",
    "systematic_errors": (
        "Systematic image errors d of the additional parameters: measured = ideal + d. Dark arrows differ from zero at "
        "95 % (χ² with two degrees of freedom and the covariance of the parameters)."
    ),
    "averaged_residuals": (
        "All photographs laid over one another: mean of measured − adjusted by cells, what a remaining systematic "
        "image error looks like. Dark arrows exceed what noise leaves at 95 %."
    ),
    "compare_parameters": (
        "Every set of additional parameters that was compared: dots at check points with 95 % bounds, squares at "
        "control points predicted by an adjustment without them."
    ),
    "correlations": "Correlations of the shared parameters; darkness is size, a dash marks negative ones.",
    "residual_histogram": "Residuals of the image coordinates against the normal curve they should follow.",
    "ray_correlation": (
        "Whether image points near one another err alike. Above 0 they have errors in common: of matching, or of the "
        "camera where the parameters do not contain them."
    ),
    "reliability": (
        "What the tests may overlook: the height error that the largest undetected error of a ray can cause at its "
        "point, and how well the rays of every photograph control each other."
    ),
    "rig": (
        "What the cameras of a rig see of the ground at one exposure. The dot marks the upper edge of the photograph."
    ),
    "crosscheck": "How far other programs' results lie from this one, in standard deviations.",
    "rays_per_point": "In how many photographs the points were measured.",
}


@dataclass(frozen=True)
class Findings:
    """What the page says beside the result itself.

    Parameters
    ----------
    work : the work list; None: made from the result, which must then be in metres.
    free_check : None where no free adjustment was asked for.
    crosscheck : the same block through other programs; None where that was not asked for. Its plot comes with the
        others, as 'crosscheck'.
    effects : what leaving parameters out changes at the check points; None where there are none, or it was not asked.
    changes : of the image errors between groups. compared : the sets of additional parameters that were compared.
    lights : what the result is judged by; None: made from the result, as the work list.
    marks : pictures of the marks of control and check points; None without photographs.
    """

    work: WorkList | None = None
    free_check: FreeCheck | None = None
    crosscheck: CrosscheckResult | None = None
    effects: ParameterEffects | None = None
    changes: tuple[Change, ...] = ()
    compared: ParameterComparison | None = None
    lights: Sequence[Finding] | None = None
    marks: MarkPictures | None = None


NOTHING_BESIDE = Findings()


def report_html(
    adjusted: AdjustedBlock, plots: Mapping[str, Figure | RenderedPlot], findings: Findings = NOTHING_BESIDE
) -> str:
    """The page as text.

    Parameters
    ----------
    plots : by the names of `all_plots`, drawn or already rendered (what `save_plots` returned need not be rendered
        twice); those missing are left out.
    """
    return filled_page(page_content(adjusted, render_plots(plots), findings))


def filled_page(content: dict[str, Any]) -> str:
    """The page with its content, that of `page_content`, and its script."""
    environment = page_environment()
    script = (environment.loader or PackageLoader("aerotri.report")).get_source(environment, "report.js")[0]
    digest = base64.b64encode(hashlib.sha256(script.encode("utf-8")).digest()).decode("ascii")
    script_of_page = {"script": Markup(script), "script_hash": Markup(f"sha256-{digest}")}
    return environment.get_template("report.html.j2").render(content | script_of_page)


def write_report(
    adjusted: AdjustedBlock,
    plots: Mapping[str, Figure | RenderedPlot],
    path: str | Path,
    findings: Findings = NOTHING_BESIDE,
) -> None:
    """Write the page; arguments as in `report_html`."""
    Path(path).write_text(report_html(adjusted, plots, findings), encoding="utf-8")


def page_content(adjusted: AdjustedBlock, plots: Mapping[str, RenderedPlot], beside: Findings) -> dict[str, Any]:
    """What the page says, by the names of its template."""
    work = work_list(adjusted) if beside.work is None else beside.work
    elsewhere, elsewhere_notes = elsewhere_tables(adjusted)
    return {
        "name": quality.printable(adjusted.block.name),
        "head": page_head(head_of(adjusted)),
        "outcome": adjusted.outcome,
        "reasons": [quality.printable(reason, 1000) for reason in adjusted.outcome.reasons],
        "but": beside_verdict(adjusted.outcome.verdict, adjusted.outcome.good_for),
        "purpose": quality.printable(adjusted.outcome.purpose, 1000),
        "similarity": precision_tables.similarity_in_words(adjusted),
        "what_to_do": [
            text.replace("what", "What", 1).replace("`", "") for text in tables.what_to_do(adjusted.outcome)
        ],
        "cards": _cards(adjusted),
        "findings": diagnosis.findings(adjusted) if beside.lights is None else beside.lights,
        "notes": [quality.printable(text, 1000) for text in adjusted.outcome.notes],
        "warnings": [quality.printable(text, 1000) for text in adjusted.outcome.warnings],
        "asprs": quality.asprs_warning(adjusted),
        "plots": {name: _embedded(name, plot) for name, plot in plots.items()},
        "contents": CONTENTS,
        "plan": interactive_plan(adjusted),
        "tables": _tables(adjusted)
        | {"work": work_tables.work_table(work), "effects": _effects(adjusted, beside), "parts": None}
        | _parameter_tables(adjusted, beside),
        "rig_verdicts": rig_tables.verdicts(adjusted),
        "shutter_verdict": shutter_tables.verdict(adjusted),
        "effects_missing": _why_no_effects(adjusted),
        "selection": adjusted.block.settings.adjustment.parameter_selection == "on",
        "changes": [_change(change) for change in beside.changes],
        "work_counts": work_tables.work_counts(work),
        "settings": settings_table(adjusted.block),
        "marks": beside.marks,
        "mark_size": SIZE,
        "elsewhere": elsewhere,
        "elsewhere_notes": elsewhere_notes,
        "free": None if beside.free_check is None else _free_check(beside.free_check),
        "crosscheck": None if beside.crosscheck is None else _crosscheck(beside.crosscheck),
        "sampled": "",
    }


def _effects(adjusted: AdjustedBlock, beside: Findings) -> tables.Table | None:
    if beside.effects is None:
        return None
    return precision_tables.check_effects(beside.effects, quality.metre_digits(adjusted.check.sigma))


def _why_no_effects(adjusted: AdjustedBlock) -> str:
    if not len(adjusted.check):
        return "There are no check points: what the parameters do to the ground cannot be seen."
    return "Not computed." if "additional" in adjusted.parameters.kinds else "No parameters were estimated."


def _change(change: Change) -> dict[str, str]:
    return {"level": "note" if change.changed else "good", "sentence": quality.printable(change.sentence, 1000)}


def _parameter_tables(adjusted: AdjustedBlock, beside: Findings) -> dict[str, tables.Table]:
    none = tables.Table("", (), ())
    return {
        "held": parameter_tables.held_table(adjusted),
        "fields": parameter_tables.fields_table(adjusted),
        "removals": parameter_tables.removals_table(adjusted),
        "changes": parameter_tables.changes_table(beside.changes),
        "compared": none if beside.compared is None else parameter_tables.comparison_table(beside.compared),
    }


def _free_check(check: FreeCheck) -> dict[str, Any]:
    return {
        "verdict": check.verdict,
        "fits": check.verdict == "fits",
        "sentence": quality.printable(in_words(check), 4000),
        "stages": work_tables.stages_table(check),
        "suspects": work_tables.suspects_table(check),
        "similarity": work_tables.similarity_table(check),
        "similarity_text": work_tables.similarity_text(check),
    }


def _crosscheck(result: CrosscheckResult) -> dict[str, Any]:
    """The section on the cross-check."""
    return {
        "agrees": result.verdict == "agrees",
        "sentence": quality.printable(result.sentence, 2000),
        "table": crosscheck_table(result),
        "notes": [f"{check.peer}: {quality.printable(note, 600)}" for check in result.checks for note in check.notes],
    }


def _tables(adjusted: AdjustedBlock) -> dict[str, tables.Table]:
    control, check = adjusted.control, adjusted.check
    return {
        "summary": tables.summary(adjusted),
        "groups": tables.observation_groups(adjusted),
        "control_accuracy": tables.ground_accuracy(adjusted, control, f"Control points ({len(control)})"),
        "check_accuracy": tables.ground_accuracy(adjusted, check, f"Check points ({len(check)})"),
        "control": tables.ground_points(adjusted, control, "Control points, one by one"),
        "check": tables.ground_points(adjusted, check, "Check points, one by one"),
        "control_rays": work_tables.control_rays_table(adjusted),
        "cameras": tables.cameras(adjusted),
        "film": tables.film(adjusted),
        "rigs": rig_tables.rigs_table(adjusted),
        "rig_movements": rig_tables.movements_table(adjusted),
        "rigidity": rig_tables.rigidity_table(adjusted),
        "rig_photographs": rig_tables.photographs_table(adjusted),
        "rig_stations": rig_tables.stations_table(adjusted),
        "readouts": shutter_tables.readouts_table(adjusted),
        "shutter_test": shutter_tables.shutter_test_table(adjusted),
        "parameters": tables.parameters(adjusted),
        "correlations": precision_tables.correlations(adjusted),
        "relative": precision_tables.relative(adjusted),
        "common": precision_tables.common(adjusted),
        "control_evidence": precision_tables.control_evidence(adjusted),
        "precision": precision_tables.precision(adjusted),
        "ellipsoids": precision_tables.ellipsoids(adjusted),
        "orientation_correlations": precision_tables.orientation_correlations(adjusted),
        "largest": tables.largest_residuals(adjusted),
        "blunders": tables.blunders(adjusted),
        "weak_points": tables.weak_points(adjusted),
        "weak_images": tables.weak_images(adjusted),
        "images": tables.images(adjusted),
        "photograph_residuals": photograph_tables.photograph_residuals_table(photograph_residuals(adjusted), adjusted),
        "positions": photograph_tables.positions_table(position_differences(adjusted), adjusted),
    }


def _cards(adjusted: AdjustedBlock) -> list[tuple[str, str, str]]:
    """Heading, number and small print of the boxes at the top."""
    o = adjusted.outcome
    cards = [
        ("σ₀", f"{o.sigma0:.3f}", "; ".join([quality.sigma0_in_image(adjusted), *quality.sigma0_by_group(adjusted)]))
    ]
    for heading, results in (("Check points", adjusted.check), ("Control points", adjusted.control)):
        if len(results):
            s, d = quality.ground_statistics(adjusted, results), quality.metre_digits(results.sigma)
            of = (s.rmse_h, s.rmse_v) if results is adjusted.check else (s.fit_h, s.rms[2])
            what = "RMSE_H / RMSE_V, survey included" if results is adjusted.check else "RMS in plan / in height"
            cards.append((f"{heading} ({len(results)})", f"{of[0]:.{d}f} / {of[1]:.{d}f} m", what))
    cards += _sigma_card(adjusted)
    cards.append(("Redundancy", f"{o.redundancy}", f"of {o.observations} observations"))
    return cards


def _sigma_card(adjusted: AdjustedBlock) -> list[tuple[str, str, str]]:
    """σ of heights in the coordinate system, and of the shape."""
    found = adjusted.relative
    if found is None or not np.isfinite(found.medians).all():
        return []
    left = plus_minus(found.medians[2]).removeprefix("± ")
    if not np.isfinite(found.position).all():
        return [("σ of heights, relative", left, "of the shape, median of the points")]
    place = plus_minus(medians(adjusted.points.total_sigma)[2]).removeprefix("± ")
    return [("σ of heights (median)", f"{place} / {left}", "in the coordinate system / relative")]


def _embedded(name: str, plot: RenderedPlot) -> dict[str, str]:
    """Source and description of an image."""
    caption = next(text for start, text in CAPTIONS.items() if name.startswith(start))
    return {"source": data_address(plot), "caption": caption}


def data_address(plot: RenderedPlot) -> str:
    """An image inside a page; as a data address it can neither load nor run anything."""
    small = len(plot.svg) <= LARGEST_SVG
    kind, content = ("svg+xml", plot.svg) if small else ("png", plot.png)
    return f"data:image/{kind};base64,{base64.b64encode(content).decode('ascii')}"
