"""The tables of the report as plain data: columns with units, rows of values."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from aerotri.adjustment.ray_status import RayStatus
from aerotri.conventions import MGON_PER_RADIAN, counted
from aerotri.functional_model.additional_parameters import Parameter, format_parameters
from aerotri.functional_model.additional_parameters import unit_of as unit_of_parameter
from aerotri.functional_model.additional_parameters.family import NO_UNIT
from aerotri.image_errors import interior_elements, interior_model_sigmas, largest_effects
from aerotri.observations.block import INTERIOR_ELEMENTS
from aerotri.report.quality import (
    asprs_warning,
    ground_statistics,
    metre_digits,
    printable,
    sigma0_by_group,
    sigma0_in_image,
)
from aerotri.results.adjusted_block import AdjustedBlock, GroundPointResults, Outcome

TOP_RESIDUALS = 30
"""Largest residuals that are listed; chosen [C]: read one after the other on a page, all are in residuals.parquet."""
TOP_WEAK = 15
"""Weakest points and photographs that are listed; chosen [C] likewise."""
LONGEST_CELL = 1000
"""Characters of a cell at most: as many as a name may have."""
MOST_ROWS = 3000
"""Rows of a table of photographs at most; chosen [C]: a page with more opens slowly; all are in images.csv."""
GNSS_UNITS = {"shift": "m", "drift": "m/s"}
SMALL_SIGMA0 = 0.01
"""Below which σ̂0 is written with its first digits: with three decimals it would be none."""
MOST_REASONS = 6
"""Reasons that are listed with the verdict; chosen [C]: the first are the gravest, all are in adjustment.json."""


@dataclass(frozen=True)
class Column:
    """A column: its heading, its unit ('' for none) and how numbers are written (a format such as '.3f')."""

    name: str
    unit: str = ""
    form: str = ""


@dataclass(frozen=True)
class Table:
    """Rows of str, int, float or None under their columns."""

    title: str
    columns: tuple[Column, ...]
    rows: tuple[tuple[Any, ...], ...]

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def texts(self) -> tuple[tuple[str, ...], ...]:
        """The rows as text."""
        return tuple(tuple(cell_text(v, c) for v, c in zip(row, self.columns, strict=True)) for row in self.rows)


def cell_text(value: Any, column: Column) -> str:
    """A value as its column writes it; '–' for what is not known."""
    if value is None:
        return "–"
    if isinstance(value, str):
        return printable(value, LONGEST_CELL)
    if not np.isfinite(value):
        return "–"
    text = format(value, column.form)
    return text.lstrip("+-") if float(text) == 0.0 else text


def table(title: str, *columns: tuple[Column, Any]) -> Table:
    """A table from columns with their values."""
    values = [v.tolist() if isinstance(v, np.ndarray) else list(v) for _, v in columns]
    return Table(title, tuple(c for c, _ in columns), tuple(zip(*values, strict=True)))


def summary(adjusted: AdjustedBlock) -> Table:
    """What was adjusted, and with which settings."""
    block, o, a = adjusted.block, adjusted.outcome, adjusted.block.settings.adjustment
    used = int(np.sum(adjusted.rays.status == RayStatus.USED))
    families = format_parameters(a.additional_parameters)
    cameras = ", ".join(f"{c.name} ({c.model})" for c in block.cameras)
    gnss = 0 if block.gnss_ins is None else len(block.gnss_ins)
    rows = [
        ("photographs", f"{len(block.images)}, camera {cameras}"),
        ("object points", f"{int(np.sum(np.isfinite(adjusted.points.xyz).all(axis=1)))} of {len(block.points)}"),
        ("rays", f"{used} of {len(block.image_points)}"),
        ("control and check points", f"{len(adjusted.control)} control, {len(adjusted.check)} check"),
        ("GNSS / INS", f"{gnss} photographs" if gnss else "none"),
        ("coordinates", block.crs),
        ("observations", f"{o.observations}"),
        ("unknowns", f"{o.unknowns}" + (f", {o.conditions} conditions" if o.conditions else "")),
        ("redundancy", f"{o.redundancy}"),
        ("iterations", f"{o.iterations}"),
        ("additional parameters", f"{', '.join(families)}; groups: {a.parameter_groups}" if families else "none"),
        ("datum", a.datum),
        ("robust estimation", a.robust),
        ("variance components", a.variance_components),
    ]  # fmt: skip
    return Table("What was adjusted", (Column("item"), Column("value")), tuple(rows))


def unit_of(name: str) -> str:
    """Unit of a shared parameter by its name; '–' where it has none."""
    parameter = Parameter.of(name)
    if parameter.family == "gnss":
        return GNSS_UNITS.get(parameter.item.partition("_")[0], NO_UNIT)
    if parameter.family == "rig":
        return "m" if parameter.item in ("x", "y", "z") else "rad"
    return unit_of_parameter(name)


def unit_of_group(name: str) -> tuple[str, float]:
    """Unit in which a group of observations is shown, and the factor from the unit of its record."""
    if name.startswith("image points"):
        return "µm", 1.0
    if name == "attitudes" or name.startswith(("INS", "rotations on the rig")):
        return "mgon", MGON_PER_RADIAN
    # weighted parameters of many units are recorded in units of their own σ
    together = ("weighted parameters", "collocation field", "deviations of groups", "position errors in time")
    return ("σ", 1.0) if name in together else ("m", 1.0)


def observation_groups(adjusted: AdjustedBlock) -> Table:
    """The groups of observations and their σ before and after, each in its unit."""
    groups = adjusted.groups
    units = [unit_of_group(group.name) for group in groups]
    factor = np.array([factor for _, factor in units])
    return table(
        "Groups of observations",
        (Column("group"), [g.name for g in groups]),
        (Column("unit"), [unit for unit, _ in units]),
        (Column("observations", "", "d"), [g.count for g in groups]),
        (Column("redundancy", "", ".1f"), [g.redundancy for g in groups]),
        (Column("σ a priori", "", ".4g"), factor * [g.sigma_apriori for g in groups]),
        (Column("RMS of residuals", "", ".4g"), factor * [g.rms for g in groups]),
        (Column("σ a posteriori", "", ".4g"), factor * [g.sigma_aposteriori for g in groups]),
    )


def cameras(adjusted: AdjustedBlock) -> Table:
    """Interior orientation after the adjustment and its change against what was given."""
    rows = []
    for camera in adjusted.block.cameras:
        values, sigmas = interior_elements(adjusted, camera)
        model = interior_model_sigmas(adjusted, camera)
        sigmas = sigmas if model is None else np.hypot(sigmas, model)
        given = np.array([camera.interior[name].value for name in INTERIOR_ELEMENTS])
        for symbol, value, sigma, start in zip(("c", "x0", "y0"), values, sigmas, given, strict=True):
            rows.append(
                (camera.name, symbol, float(value), float(sigma) if sigma > 0 else "held", float(value - start))
            )
    columns = (Column("camera"), Column("element"), Column("value", "mm", ".4f"),
               Column(_sigma_word(adjusted), "mm", ".4f"),
               Column("change", "mm", "+.4f"))  # fmt: skip
    return Table("Interior orientation", columns, tuple(rows))


def _sigma_word(adjusted: AdjustedBlock) -> str:
    """What σ of the tables is called: the total where groups of photographs share errors."""
    return "σ" if adjusted.points.model is None else "total σ"


def film(adjusted: AdjustedBlock) -> Table:
    """Interior orientation of scanned photographs: how well the fiducial marks fit, one row a photograph."""
    rows = []
    block = adjusted.block
    for image, fit in sorted(block.interior_fits.items()):
        length = 1e3 * np.hypot(*fit.residuals.T)
        rows.append(
            (
                printable(block.images.names[image]), fit.kind, len(length), int(fit.redundancy),
                1e3 * float(fit.sigma0_mm), float(np.sqrt(np.mean(length**2))), float(length.max()),
            )
        )  # fmt: skip
    columns = (
        Column("photograph"), Column("transformation"), Column("marks"), Column("redundancy"),
        Column("σ0", "µm", ".1f"), Column("RMS of a mark", "µm", ".1f"), Column("largest", "µm", ".1f"),
    )  # fmt: skip
    return Table("Interior orientation of the scans", columns, tuple(rows))


def parameters(adjusted: AdjustedBlock) -> Table:
    """Additional and GNSS parameters with their tests; interior elements and fields stand in their own tables."""
    p = adjusted.parameters
    rows = (p.kinds != "interior") & ~p.is_node
    reason = [(Column("reason"), p.reason[rows])] if np.any(p.reason[rows] != "") else []
    return table(
        "Additional and GNSS parameters" if "gnss" in p.kinds else "Additional parameters",
        (Column("parameter"), p.names[rows]),
        (Column("group"), p.groups[rows]),
        (Column("mark"), p.marks[rows]),
        (Column("value", "", ".4e"), p.value[rows]),
        (Column(_sigma_word(adjusted), "", ".1e"), p.total_sigma[rows]),
        (Column("unit"), [unit_of(name) for name in p.names[rows]]),
        (Column("effect", "µm", ".2f"), 1e3 * largest_effects(adjusted)[rows]),
        (Column("t", "", ".1f"), p.t[rows]),
        (Column("largest r", "", "+.2f"), p.max_correlation[rows]),
        (Column("with"), p.max_correlation_with[rows]),
        (Column("B", "", ".2f"), p.total_correlation[rows]),
        (Column("status"), p.status[rows]),
        *reason,
    )


def ground_accuracy(adjusted: AdjustedBlock, results: GroundPointResults, title: str) -> Table:
    """RMS, mean and largest difference by coordinate and in plan; of check points RMSE_H and RMSE_V besides."""
    s = ground_statistics(adjusted, results)
    d = metre_digits(results.sigma)
    largest_h = np.hypot(results.difference[:, 0], results.difference[:, 1])
    both = np.isfinite(largest_h)
    rows = [(axis, int(s.count[k]), s.rms[k], s.expected[k], s.mean[k], s.max[k]) for k, axis in enumerate("XYZ")]
    rows.append(
        ("in plan", int(both.sum()), s.fit_h, s.expected_h, None, largest_h[both].max() if both.any() else None)
    )
    if results is adjusted.check:
        rows += [
            (f"{name}, survey error included", int(n), rmse, None, None, None)
            for name, n, rmse in (("RMSE_H", both.sum(), s.rmse_h), ("RMSE_V", s.count[2], s.rmse_v))
        ]
    form, signed = f".{d}f", f"+.{d}f"
    columns = (
        Column("coordinate"),
        Column("points", "", "d"),
        Column("RMS", "m", form),
        Column("RMS expected from σ", "m", form),
        Column("mean", "m", signed),
        Column("largest", "m", form),
    )
    return Table(title, columns, tuple(rows))


def ground_points(adjusted: AdjustedBlock, results: GroundPointResults, title: str) -> Table:
    """Every control or check point: difference adjusted − given, σ, redundancy number, normalised."""
    d = metre_digits(results.sigma)
    columns = [(Column("point"), adjusted.block.points[results.point]), (Column("rays", "", "d"), results.rays)]
    for k, axis in enumerate("XYZ"):
        columns.append((Column(f"d{axis}", "m", f"+.{d}f"), results.difference[:, k]))
    for k, axis in enumerate("XYZ"):
        columns.append((Column(f"σ{axis}", "m", f".{d}f"), results.sigma[:, k]))
    for k, axis in enumerate("XYZ" if results.model_sigma is not None else ""):
        columns.append((Column(f"total σ{axis}", "m", f".{d}f"), results.total_sigma[:, k]))
    if np.isfinite(results.r).any():
        for k, axis in enumerate("XYZ"):
            columns.append((Column(f"r{axis}", "", ".2f"), results.r[:, k]))
    for k, axis in enumerate("XYZ"):
        columns.append((Column(f"w{axis}", "", "+.1f"), results.w[:, k]))
    return table(title, *columns)


def images(adjusted: AdjustedBlock, rows: np.ndarray | None = None, title: str = "Exterior orientation") -> Table:
    """Projection centres and angles with σ; all photographs unless `rows` are given."""
    block, result = adjusted.block, adjusted.images
    if rows is None:
        rows = np.arange(min(len(block.images), MOST_ROWS))
        if len(block.images) > MOST_ROWS:
            title += f", the first {MOST_ROWS} of {len(block.images)} (all: images.csv)"
    sigma, word = result.total_sigma[rows], _sigma_word(adjusted)
    d = metre_digits(sigma[:, :3])
    columns = [(Column("photograph"), block.images.names[rows]), (Column("strip"), block.images.strip[rows]),
               (Column("rays", "", "d"), result.rays[rows])]  # fmt: skip
    for k, axis in enumerate(("X0", "Y0", "Z0")):
        columns.append((Column(axis, "m", f".{d}f"), result.centre[rows, k]))
    for k, axis in enumerate("ωφκ"):
        columns.append((Column(axis, "°", ".5f"), np.degrees(result.angles[rows, k])))
    for k, axis in enumerate(("X0", "Y0", "Z0")):
        columns.append((Column(f"{word}{axis}", "m", f".{d}f"), sigma[:, k]))
    for k, axis in enumerate("ωφκ"):
        columns.append((Column(f"{word}{axis}", "mgon", ".2f"), sigma[:, 3 + k] * MGON_PER_RADIAN))
    return table(title, *columns)


def largest_residuals(adjusted: AdjustedBlock, top: int = TOP_RESIDUALS) -> Table:
    """The rays with the largest normalised residuals, and the error that would explain each."""
    rays, block = adjusted.rays, adjusted.block
    size = np.abs(np.nan_to_num(rays.w)).max(axis=1, initial=0.0)
    rows = np.argsort(-size, kind="stable")[:top]
    rows = rows[size[rows] > 0.0]
    with np.errstate(divide="ignore", invalid="ignore"):
        estimated = -rays.v[rows] / rays.r[rows]
    ray = block.image_points
    return table(
        f"The {len(rows)} largest residuals",
        (Column("photograph"), block.images.names[ray.image[rows]]),
        (Column("point"), block.points[ray.point[rows]]),
        (Column("wx", "", "+.2f"), rays.w[rows, 0]),
        (Column("wy", "", "+.2f"), rays.w[rows, 1]),
        (Column("vx", "µm", "+.2f"), 1e3 * rays.v[rows, 0]),
        (Column("vy", "µm", "+.2f"), 1e3 * rays.v[rows, 1]),
        (Column("rx", "", ".2f"), rays.r[rows, 0]),
        (Column("ry", "", ".2f"), rays.r[rows, 1]),
        (Column("error x", "µm", "+.1f"), 1e3 * estimated[:, 0]),
        (Column("error y", "µm", "+.1f"), 1e3 * estimated[:, 1]),
        (Column("weight", "", ".2f"), rays.weight[rows]),
    )


def blunders(adjusted: AdjustedBlock) -> Table:
    """Suspected gross errors."""
    found = adjusted.blunders
    return table(
        "Suspected gross errors",
        (Column("photograph"), [b.image for b in found]),
        (Column("point"), [b.point for b in found]),
        (Column("w", "", "+.1f"), [b.w for b in found]),
        (Column("estimated error", "µm", "+.1f"), [1e3 * b.estimated_mm for b in found]),
        (Column("action"), [b.action for b in found]),
    )


def weak_points(adjusted: AdjustedBlock, top: int = TOP_WEAK) -> Table:
    """Object points with the largest standard deviations."""
    points, sigma, word = adjusted.points, adjusted.points.total_sigma, _sigma_word(adjusted)
    size = np.nan_to_num(sigma, nan=-1.0, posinf=np.inf).max(axis=1, initial=-1.0)
    rows = np.argsort(-size, kind="stable")[:top]
    rows = rows[size[rows] > 0.0]
    d = metre_digits(sigma)
    columns = [(Column("point"), adjusted.block.points[rows]), (Column("rays", "", "d"), points.rays[rows])]
    for k, axis in enumerate("XYZ"):
        columns.append((Column(f"{word}{axis}", "m", f".{d}f"), sigma[rows, k]))
    columns.append((Column("largest |w|", "", ".1f"), points.max_abs_w[rows]))
    return table(f"The {len(rows)} weakest points", *columns)


def weak_images(adjusted: AdjustedBlock, top: int = TOP_WEAK) -> Table:
    """Photographs with the largest standard deviations of their projection centres."""
    sigma = np.nan_to_num(adjusted.images.total_sigma[:, :3], nan=np.inf)
    rows = np.argsort(-np.linalg.norm(sigma, axis=1), kind="stable")[:top]
    return images(adjusted, rows, f"The {len(rows)} weakest photographs")


def verdict_lines(outcome: Outcome) -> list[str]:
    """What the result is worth, and why: the first that is read."""
    first = [f"verdict: {outcome.verdict}"] if outcome.verdict else []
    first += [f"  {printable(outcome.purpose, 500)}"] if outcome.purpose and outcome.verdict != "rejected" else []
    more = len(outcome.reasons) - MOST_REASONS
    rest = [f"  and {counted(more, 'more reason')}, see adjustment.json"] if more > 0 else []
    return first + [f"  because {printable(reason, 500)}" for reason in outcome.reasons[:MOST_REASONS]] + rest


REMEDIES = {"rank deficient": "message-no-result", "not converged": "message-not-converged"}
"""Places in docs/understand/remedies.md by the status of an adjustment; a verdict has its own."""


def what_to_do(outcome: Outcome) -> list[str]:
    """Where to read on; nothing for a result that is accepted."""
    word = outcome.status if outcome.status != "converged" else outcome.verdict
    if word in ("", "accepted"):
        return []
    return [
        f"what to do: `aerotri explain {word}`, or docs/understand/remedies.md#{REMEDIES.get(word, 'message-verdict')}"
    ]


def _sigma0_line(adjusted: AdjustedBlock) -> str:
    o = adjusted.outcome
    if not np.isfinite(o.sigma0):
        return "sigma0 not known"
    if o.sigma0 < SMALL_SIGMA0:
        return f"sigma0 {o.sigma0:.2g} ({o.sigma0_um:.2g} µm)"
    return f"sigma0 {o.sigma0:.3f} ({sigma0_in_image(adjusted)})"


def summary_lines(adjusted: AdjustedBlock) -> list[str]:
    """The result in a few lines of plain text for a terminal; names may hold any printable character, also brackets."""
    o, p = adjusted.outcome, adjusted.parameters
    used = int(np.sum(adjusted.rays.status == RayStatus.USED))
    left_out = len(adjusted.rays.status) - used
    lines = [
        *verdict_lines(o),
        f"{printable(adjusted.block.name)}: {o.status} after {counted(o.iterations, 'iteration')}"
        + (f": {o.message}" * bool(o.message)),
        _sigma0_line(adjusted),
        *(f"  {line}" for line in sigma0_by_group(adjusted)),
        f"redundancy {o.redundancy} = {o.observations} observations − {o.unknowns} unknowns"
        + (f" + {counted(o.conditions, 'condition')}" if o.conditions else ""),
        f"{counted(len(adjusted.block.images), 'photograph')}, {counted(len(adjusted.block.points), 'point')}, "
        f"{counted(used, 'ray')}" + (f" ({left_out} left out)" if left_out else ""),
    ]
    for name, results in (("control point", adjusted.control), ("check point", adjusted.check)):
        if len(results):
            s = ground_statistics(adjusted, results)
            d = metre_digits(results.sigma)
            rms = ", ".join(f"{axis} {value:.{d}f}" for axis, value in zip("XYZ", s.rms, strict=True))
            accuracy = f"in plan {s.fit_h:.{d}f} m"
            if results is adjusted.check:
                accuracy = f"RMSE_H {s.rmse_h:.{d}f}, RMSE_V {s.rmse_v:.{d}f} m with the survey error"
            lines.append(f"{counted(len(results), name)}: RMS {rms} m; {accuracy}")
    additional = (p.kinds == "additional") & np.isin(p.status, ("estimated", "weighted"))
    if additional.any():
        removed = int(np.sum(p.status == "removed"))
        lines.append(
            counted(int(additional.sum()), "additional parameter") + (f", {removed} removed" if removed else "")
        )
    warnings = [*o.warnings, *([asprs_warning(adjusted)] if asprs_warning(adjusted) else [])]
    lines += [f"note: {printable(text, 500)}" for text in o.notes]
    return lines + [f"warning: {printable(text, 500)}" for text in warnings] + what_to_do(o)
