"""Accuracy, control and check points, standard deviations and groups as tables of a document."""

from __future__ import annotations

import numpy as np

from aerotri.conventions import MGON_PER_RADIAN
from aerotri.report.documents.parts import Part, table
from aerotri.report.documents.words import Words, breakable
from aerotri.report.quality import ground_statistics, metre_digits
from aerotri.report.tables.adjustment import unit_of_group
from aerotri.results.adjusted_block import AdjustedBlock, GroundPointResults


def accuracy_table(adjusted: AdjustedBlock, words: Words) -> Part:
    """RMS, mean and largest difference at control and check points, by coordinate and in plan."""
    rows: list[tuple[str, ...]] = []
    for key, points in (("check", adjusted.check), ("control", adjusted.control)):
        if not len(points):
            continue
        s, d = ground_statistics(adjusted, points), metre_digits(points.sigma)
        name = words(f"accuracy.{key}")
        for k, axis in enumerate("XYZ"):
            rows.append((name, axis, words.whole(s.count[k]), words.number(s.rms[k], d), words.number(s.expected[k], d),
                         words.number(s.mean[k], d, signed=True), words.number(s.max[k], d)))  # fmt: skip
        rows.append((name, words("accuracy.horizontal"), words.whole(min(s.count[0], s.count[1])),
                     words.number(s.fit_h, d), words.number(s.expected_h, d), "", ""))  # fmt: skip
    keys = ("points", "coordinate", "count", "rms", "expected", "mean", "largest")
    return table([words(f"accuracy.{key}") for key in keys], rows, words=2)


def ground_table(adjusted: AdjustedBlock, points: GroundPointResults, words: Words) -> Part:
    """Every control or check point: difference adjusted − given, σ, total σ where there is one, largest w."""
    d = metre_digits(points.sigma)
    columns = [words("ground.point"), words("ground.rays")]
    blocks = [("d", points.difference, True), ("σ", points.sigma, False)]
    if points.model_sigma is not None:
        blocks += [("m", points.model_sigma, False), ("t", points.total_sigma, False)]
    for letter, _, _ in blocks:
        columns += [f"{letter}{axis} [m]" for axis in "XYZ"]
    columns.append(words("ground.w"))
    names = adjusted.block.points[points.point]
    tested = np.isfinite(points.w).any(axis=1)
    largest = np.where(tested, np.abs(np.nan_to_num(points.w)).max(axis=1, initial=0.0), np.nan)
    rows = [
        (breakable(names[i]), words.whole(points.rays[i]),
         *(words.number(values[i, k], d, signed) for _, values, signed in blocks for k in range(3)),
         words.number(largest[i], 1))
        for i in range(len(points))
    ]  # fmt: skip
    return table(columns, rows, words=1, small=True)


def sigma_table(adjusted: AdjustedBlock, words: Words) -> Part:
    """Median and largest σ of object points, projection centres and angles: noise, model part, total."""
    points, images = adjusted.points, adjusted.images
    d = metre_digits(points.total_sigma)
    with_model = points.model is not None
    kinds = ["noise", "model", "total"] if with_model else ["noise"]
    rows: list[tuple[str, ...]] = []
    centre, angles = slice(0, 3), slice(3, 6)
    of_points = _by_kind(points.sigma, points.total_sigma)
    of_images = _by_kind(images.sigma, images.total_sigma)
    for key, found, part, digits, factor, unit in (
        ("points", of_points, slice(0, 3), d, 1.0, "m"), ("centres", of_images, centre, d, 1.0, "m"),
        ("angles", of_images, angles, 2, MGON_PER_RADIAN, "mgon"),
    ):  # fmt: skip
        for kind in kinds:
            values = factor * found[kind][:, part]
            values = values[np.isfinite(values).all(axis=1)]
            if len(values):
                rows.append((f"{words(f'sigma.{key}')} [{unit}]", words(f"sigma.{kind}"),
                             *(words.number(v, digits) for v in np.median(values, axis=0)),
                             *(words.number(v, digits) for v in values.max(axis=0))))  # fmt: skip
    columns = [words("sigma.of"), words("sigma.kind")]
    columns += [
        f"{words(f'sigma.{which}')} {axis}" for which in ("median", "largest") for axis in ("X, ω", "Y, φ", "Z, κ")
    ]
    return table(columns, rows, words=2, small=True)


def _by_kind(noise: np.ndarray, total: np.ndarray) -> dict[str, np.ndarray]:
    with np.errstate(invalid="ignore"):
        return {"noise": noise, "total": total, "model": np.sqrt(np.maximum(total**2 - noise**2, 0.0))}


def group_table(adjusted: AdjustedBlock, words: Words) -> Part:
    """Groups of observations with σ before and after, each in its unit."""
    rows: list[tuple[str, ...]] = []
    for one in adjusted.groups:
        unit, factor = unit_of_group(one.name)
        rows.append((_group_name(one.name, words), unit, words.whole(one.count), words.number(one.redundancy, 1),
                     words.plain(factor * one.sigma_apriori), words.plain(factor * one.rms),
                     words.plain(factor * one.sigma_aposteriori)))  # fmt: skip
    keys = ("name", "unit", "count", "redundancy", "before", "rms", "after")
    return table([words(f"groups.{key}") for key in keys], rows, words=2)


def _group_name(name: str, words: Words) -> str:
    """A group in words; those of one camera have its name."""
    kind = "image points"
    if name.startswith(f"{kind} "):
        return f"{words.term('group', kind)} {breakable(name.removeprefix(kind).strip())}"
    return words.term("group", name)
