"""One self-contained page about a planned flight: the map of σ, the numbers, the control in the order of its gain."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from aerotri.planning.control import SHARE
from aerotri.planning.plan import PlanRecord, shortest_interval
from aerotri.report.pages.head import page_environment, page_head
from aerotri.report.quality import printable
from aerotri.report.tables.adjustment import Column, Table, table
from aerotri.results.head import Head

SIZE, MARGIN, CLASSES = 1000.0, 0.04, 6
"""Width of the map in its own units, its margin as a share, and the greys of σ."""
GREYS = ("#f7f7f7", "#dcdcdc", "#bdbdbd", "#969696", "#737373", "#525252")
KINDS = {
    "asprs": "errors in plan and in height (RMS)",
    "sigma-z": "σ of Z on 95 % of the area",
    "sigma-volume": "σ of the volume",
}


@dataclass(frozen=True)
class PlanMap:
    """A map in its own units, y down, north up: squares (x, y, side, grey), paths and spots."""

    height: float
    cells: tuple[tuple[float, float, float, str], ...]
    area: str
    strips: tuple[str, ...]
    exposures: tuple[tuple[float, float], ...]
    control: tuple[tuple[float, float, str], ...]
    legend: tuple[tuple[str, str], ...]
    bar: float
    bar_text: str


def plan_html(r: PlanRecord, head: Head) -> str:
    """The page as text."""
    environment = page_environment()
    return environment.get_template("plan.html.j2").render(
        name=printable(r.area.name), head=page_head(head), box=_box(r),
        conclusion=_conclusion(r), cards=_cards(r), warnings=[printable(text, 1000) for text in r.warnings],
        sigma=_map(r, r.sigma[:, 2]), shared=_map(r, r.deformation[:, 2]), flight=_flight_table(r),
        accuracy=_accuracy_table(r), control=_control_table(r), asked=_asked_table(r), piles=_piles_table(r),
        mode=f"{100.0 * r.mode_share:.0f}", first=_first(r),
    )  # fmt: skip


def _box(r: PlanRecord) -> str:
    return {None: "warnings", True: "passed", False: "banner"}[r.met]


def _conclusion(r: PlanRecord) -> str:
    if r.target is None:
        return "No target was given; the accuracy to be expected is below."
    outcome = "is met" if r.met else "is NOT met"
    control = f"with {len(r.control)} control points"
    return (
        f"The target {outcome} {control}: {KINDS[r.target.kind]} at most {r.target.value:g} {r.target.unit}, expected "
        f"{r.judged:.3g} {r.target.unit}."
    )


def _cards(r: PlanRecord) -> list[tuple[str, str, str]]:
    horizontal, vertical = r.quality.rmse
    z = float(np.quantile(r.sigma[:, 2], SHARE))
    return [
        ("photographs", f"{len(r.flight)}", f"in {len(r.flight.strips)} strips"),
        ("flight", f"{r.flight.time[-1] / 60.0:.0f} min", f"{r.flight.length / 1000.0:.2f} km"),
        ("in plan, in height", f"{100.0 * horizontal:.1f}, {100.0 * vertical:.1f} cm", "RMS expected over the area"),
        ("σ of Z", f"{100.0 * z:.1f} cm", "at most, on 95 % of the area"),
        ("control points", f"{len(r.control)}", f"{len(r.added)} added by the plan"),
    ]


def _first(r: PlanRecord) -> int:
    """Control points that only made the block stand."""
    return sum(bool(np.isnan(one.before)) for one in r.added)


def _pairs(title: str, rows: list[tuple[str, str]]) -> Table:
    return table(title, (Column(""), [name for name, _ in rows]), (Column("value"), [text for _, text in rows]))


def _flight_table(r: PlanRecord) -> Table:
    f, seen = r.flight, r.seen
    rows = [
        ("strips", f"{len(f.strips)}"), ("photographs", f"{len(f)}"),
        ("direction of the strips", f"{np.degrees(f.axis):.1f}° from grid north"),
        ("length, with turns in straight lines", f"{f.length / 1000.0:.2f} km"),
        ("time in the air over the area", f"{f.time[-1] / 60.0:.1f} min at {r.options.speed:g} m/s"),
        ("altitude", f"{f.centre[:, 2].min():.1f} to {f.centre[:, 2].max():.1f} m"),
        ("shortest time between exposures", f"{shortest_interval(f):.2f} s"),
        ("GSD on the ground of the area", f"{100.0 * seen.gsd[0]:.2f} to {100.0 * seen.gsd[1]:.2f} cm"),
        ("forward overlap on the ground, at least", f"{100.0 * seen.forward:.0f} %"),
        ("side overlap on the ground, at least", f"{100.0 * seen.side:.0f} %"),
        ("photographs of a place of the area, at least", f"{int(seen.rays.min())}"),
    ]  # fmt: skip
    return _pairs("Flight", rows)


def _piles_table(r: PlanRecord) -> Table:
    piles = r.piles
    return table(
        "Single piles", (Column("pile"), [printable(one.name) for one in piles]),
        (Column("size", "m²", ".0f"), [one.area for one in piles]),
        (Column("σ of the volume", "m³", ".3g"), [one.sigma for one in piles]),
        (Column("as a height", "mm", ".2g"), [1e3 * one.sigma / one.area for one in piles]),
    )  # fmt: skip


def _accuracy_table(r: PlanRecord) -> Table:
    parts = [("σ of a ground point", r.sigma), ("part that neighbours share", r.deformation)]
    rows = [(f"{text}, {'XYZ'[k]}", 100.0 * values[:, k]) for text, values in parts for k in range(3)]
    return table(
        "Accuracy",
        (Column(""), [name for name, _ in rows]),
        (Column("median", "cm", ".2f"), [float(np.median(values)) for _, values in rows]),
        (Column("95 % of the area below", "cm", ".2f"), [float(np.quantile(values, 0.95)) for _, values in rows]),
        (Column("largest", "cm", ".2f"), [float(values.max()) for _, values in rows]),
    )


def _control_table(r: PlanRecord) -> Table:
    given = len(r.control) - len(r.added)
    unit, factor = ("m³", 1.0) if r.target is not None and r.target.unit == "m³" else ("cm", 100.0)
    nothing = [float("nan")] * given
    order = ["given"] * given + [f"{k + 1}" for k in range(len(r.added))]
    return table(
        "Control",
        (Column("order"), order),
        (Column("point"), [printable(name) for name in r.control_names]),
        *((Column(axis, "m", ".2f"), [float(v) for v in r.control[:, k]]) for k, axis in enumerate("XYZ")),
        (Column("without it", unit, ".2f"), nothing + [factor * one.before for one in r.added]),
        (Column("with it", unit, ".2f"), nothing + [factor * one.after for one in r.added]),
    )


def _asked_table(r: PlanRecord) -> Table:
    o = r.options
    positions = (
        "none" if o.positions_sigma is None else f"{o.positions_sigma[0]:g} m, in height {o.positions_sigma[1]:g} m"
    )
    return _pairs("Assumed", [
        ("camera", f"{printable(r.camera.name)}, {r.camera.size_px[0]} × {r.camera.size_px[1]} pixels of "
         f"{r.camera.pixel_um:g} µm, f = {r.camera.interior['focal_length_mm'].value:g} mm"),
        ("ground", printable(r.ground.name)),
        ("σ of an image coordinate", f"{o.image_sigma:g} pixel"),
        ("image points in a photograph", f"{o.tie_points}; each photograph that sees a tie point measures it with "
         f"probability {o.probability:g}"),
        ("σ of camera positions", positions),
        ("σ of control", f"{o.control_sigma[0]:g} m in X and Y, {o.control_sigma[1]:g} m in Z, unless given"),
        ("additional parameters", printable(o.self_calibration)),
    ])  # fmt: skip


def _map(r: PlanRecord, sigma: np.ndarray) -> PlanMap:
    """The map of a standard deviation (g,) m of the ground points."""
    left, bottom, right, top = r.area.polygon.bounds
    low = np.minimum([left, bottom], r.flight.centre[:, :2].min(axis=0))
    high = np.maximum([right, top], r.flight.centre[:, :2].max(axis=0))
    margin = MARGIN * float((high - low).max())
    low, high = low - margin, high + margin
    scale = SIZE / float(high[0] - low[0])

    def drawn(xy: np.ndarray) -> np.ndarray:
        return np.column_stack([xy[:, 0] - low[0], high[1] - xy[:, 1]]) * scale

    limits = _limits(np.concatenate([r.sigma[:, 2], r.deformation[:, 2]]))
    shade = np.clip(np.searchsorted(limits, sigma), 0, CLASSES - 1)
    side = r.step * scale
    cells = tuple((float(x - side / 2), float(y - side / 2), side, GREYS[k])
                  for (x, y), k in zip(drawn(r.ground_points[:, :2]), shade, strict=True))  # fmt: skip
    control = tuple((float(x), float(y), printable(name))
                    for (x, y), name in zip(drawn(r.control[:, :2]), r.control_names, strict=True))  # fmt: skip
    length = _round_length(0.25 * SIZE / scale)
    return PlanMap(
        float(high[1] - low[1]) * scale, cells, _rings(r, drawn),
        tuple(_path(drawn(r.flight.centre[own, :2])) for own in r.flight.strips),
        tuple((float(x), float(y)) for x, y in drawn(r.flight.centre[:, :2])), control, _legend(limits), length * scale,
        f"{length / 1000.0:g} km" if length >= 1000.0 else f"{length:g} m",
    )  # fmt: skip


def _limits(sigma: np.ndarray) -> np.ndarray:
    """Upper limits of all greys but the last, m: even steps of a round size between the smallest and largest σ."""
    low, high = float(sigma.min()), float(sigma.max())
    step = _round_up(max(high - low, 0.02 * high) / (CLASSES - 1))
    return step * (np.floor(low / step) + np.arange(1, CLASSES))


def _legend(limits: np.ndarray) -> tuple[tuple[str, str], ...]:
    texts = [f"≤ {100.0 * limit:.3g} cm" for limit in limits] + [f"> {100.0 * limits[-1]:.3g} cm"]
    return tuple(zip(GREYS, texts, strict=True))


def _rings(r: PlanRecord, drawn: Callable[[np.ndarray], np.ndarray]) -> str:
    import shapely

    rings = [ring for one in shapely.get_parts(r.area.polygon) for ring in (one.exterior, *one.interiors)]
    return "".join(_path(drawn(np.asarray(ring.coords)[:, :2])) + "Z" for ring in rings)


def _path(places: np.ndarray) -> str:
    return "M" + " ".join(f"{x:.1f},{y:.1f}" for x, y in places)


def _round_length(most: float) -> float:
    """1, 2 or 5 times a power of ten, at most as given."""
    power = 10.0 ** np.floor(np.log10(most))
    return float(max(step for step in (1.0, 2.0, 5.0) if step * power <= most * (1.0 + 1e-9)) * power)


def _round_up(least: float) -> float:
    """1, 1.5, 2, 3, 5, 7 or 10 times a power of ten, at least as given."""
    power = 10.0 ** np.floor(np.log10(least))
    return float(min(step for step in (1.0, 1.5, 2.0, 3.0, 5.0, 7.0, 10.0) if step * power >= least) * power)
