"""A quarry with three piles, flown twice: from the photographs to the volumes, their certificates, and what changed.

    python tools/prove/quarry.py FOLDER [--dense] [--out tools/results]

A level floor between heaps of 6 m, and three piles on it. Each epoch has 15 rendered photographs of
1200 × 900 pixels, 6 cm a pixel, by a lens that bends and a wrong interior orientation, with the GNSS of a drone in
EXIF; six control and three check points are marked in them with 0.1 px. Between the epochs the first pile stays, the
second is half taken away, and the third grows. `aerotri run` makes everything but the dense surface from photographs
and the list of control points, `aerotri volume` weighs the piles, `aerotri change` compares the epochs on the ground
around the piles: moved in height alone, since control holds both flights in plan and the floor is too level to tell a
shift, and for comparison with a shift as well. The truth of a volume is that of the true ground over a base through
the same outline; what the floor does under a pile is not in it. What stands on the floor inside the outline is listed
beside it. The truth of a change is what came and went inside the outline. Also made: certificates of the volumes and
of the change, English and German.
With --out quarry.md is written there. With --dense volumes and changes are those of the dense surface, and the table
is quarry_dense.md.
"""

from __future__ import annotations

import argparse
import json
import shutil
import subprocess
import sys
import time
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from pyproj import Transformer

import aerotri

CRS, ORIGIN = "EPSG:32632", (680000.0, 5330000.0, 520.0)
BANKS, BANK = 8, (48.0, 6.0, 6.0)
"""Heaps around the floor of the quarry: number, and distance from its middle, height and radius, m."""
PLACES = {"north": (4.0, 15.0), "west": (-14.0, -8.0), "east": (13.0, -9.0)}
HEIGHTS = {1: {"north": 3.6, "west": 4.2, "east": 2.6}, 2: {"north": 3.6, "west": 2.1, "east": 3.5}}
"""m, by epoch; a pile of 3.5 m rises with 32° at most."""
RADIUS, OUTLINE, CORNERS = 3.4, 10.5, 24
DENSITY = (1.7, 0.05)
"""t/m³ and its σ."""
INTERVAL, CELL = 0.7, 0.1
"""m, of the pickets: a fifth of the radius of a pile, and of the sum that is the truth."""
SPEC = {
    "name": "quarry",
    "camera": {"drone": {"size_px": [1200, 900], "pixel_um": 4.0, "focal_length_mm": 5.6,
                         "errors": {"lens": {"k1": -0.05, "k2": 0.01},
                                    "interior": {"focal_length_mm": 0.03, "x0_mm": 0.02, "y0_mm": -0.015}}}},
    "flight": {"gsd_m": 0.06, "strips": 3, "images_per_strip": 5, "end_lap": 0.75, "side_lap": 0.65,
               "heading_deg": 20.0, "attitude_sigma_deg": [2.0, 2.0, 3.0], "position_sigma_m": [0.5, 0.5, 0.5]},
    "tie_points": {"per_image": 20, "probability": 0.9, "sigma_um": 0.4},
    "control": {"positions": [[0.1, 0.1], [0.1, 0.9], [0.5, 0.15], [0.5, 0.85], [0.9, 0.1], [0.9, 0.9]],
                "sigma_m": [0.01, 0.01, 0.02], "image_sigma_um": 0.4, "check_points": 3},
    "gnss": {"sigma_m": [1.5, 1.5, 3.0]},
    "georeference": {"crs": CRS, "origin": list(ORIGIN)},
    "photographs": {"format": "jpeg", "targets": True},
}  # fmt: skip
PROJECT = """[project]
title = "Quarry Hohenfels, stockpiles"
client = "Hohenfels Gravel Ltd"
operator = "A. Surveyor"
company = "Survey Office Example"
survey_date = "{date}"
notes = "Simulated flight: the truth is known."
"""
DATES = {1: "2026-05-04", 2: "2026-06-08"}


def site() -> list[list[float]]:
    """The heaps around the floor, and humps and hollows of a few centimetres on it, the same in both epochs."""
    distance, height, radius = BANK
    turn = 2.0 * np.pi * np.arange(BANKS) / BANKS
    banks = [[distance * x, distance * y, height, radius] for x, y in zip(np.cos(turn), np.sin(turn), strict=True)]
    rng = np.random.default_rng(7)
    xy, size, width = rng.uniform(-36, 36, (60, 2)), rng.normal(0.0, 0.06, 60), rng.uniform(1.5, 4.0, 60)
    return [*banks, *np.column_stack([xy, size, width]).tolist()]


def plan(epoch: int | None) -> dict[str, Any]:
    """The plan of an epoch; of the empty quarry where None."""
    piles = [] if epoch is None else [[*PLACES[name], h, RADIUS] for name, h in HEIGHTS[epoch].items()]
    return SPEC | {"terrain": {"kind": "flat", "hills": [*site(), *piles]}}


def outline(name: str) -> shapely.Polygon:
    """Around a pile, in the coordinates of the block."""
    angle = 0.2 + 2.0 * np.pi * np.arange(CORNERS) / CORNERS
    middle = np.array(PLACES[name]) + ORIGIN[:2]
    return shapely.Polygon(middle + OUTLINE * np.column_stack([np.cos(angle), np.sin(angle)]))


def stable() -> shapely.Geometry:
    """The floor of the quarry, away from the piles."""
    middle = shapely.Point(*ORIGIN[:2])
    return shapely.difference(middle.buffer(30.0), shapely.union_all([outline(name).buffer(2.0) for name in PLACES]))


def write_geojson(path: Path, polygons: dict[str, shapely.Geometry]) -> Path:
    """Polygons with names in longitude and latitude, as GeoJSON has it."""
    to_degrees = Transformer.from_crs(CRS, "EPSG:4326", always_xy=True)

    def placed(xy: np.ndarray) -> np.ndarray:
        return np.column_stack(to_degrees.transform(xy[:, 0], xy[:, 1]))

    features = [
        {"type": "Feature", "properties": {"name": name},
         "geometry": json.loads(shapely.to_geojson(shapely.transform(polygon, placed)))}
        for name, polygon in polygons.items()
    ]  # fmt: skip
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features}), encoding="utf-8")
    return path


def command(*words: object) -> None:
    """A command of aerotri, as a user gives it."""
    subprocess.run([sys.executable, "-m", "aerotri.cli", *map(str, words)], check=True)


def measured(folder: Path, epoch: int, dense: bool) -> tuple[dict[str, Any], float]:
    """volume.json of an epoch from its photographs, and the seconds of `aerotri run`."""
    flight, flown = aerotri.simulate(plan(epoch), seed=epoch), folder / f"flown_{epoch}"
    if not (flown / "gcp_list.txt").is_file():
        flight.save(flown, photographs=True)
    control = flight.block.control
    check = flight.block.points[control.point[control.is_check]].tolist()
    named = folder / f"project_{epoch}.toml"
    named.write_text(PROJECT.format(date=DATES[epoch]), encoding="utf-8")
    project, piles = folder / f"epoch_{epoch}", folder / "piles.geojson"
    begun = time.perf_counter()
    if not (project / "run.json").is_file():
        command("run", flown / "photographs", "--out", project, "--gcp", flown / "gcp_list.txt", "--control-sigma-m",
                "0.01,0.01,0.02", *(word for name in check for word in ("--check", name)), "--boundary", piles,
                "--interval", INTERVAL, *([] if dense else ["--no-dense"]), "--project", named)  # fmt: skip
    seconds = time.perf_counter() - begun
    out = folder / f"volume_{epoch}"
    surface = [project / "dsm"] if dense else [project / "dtm", "--layer", "dsm"]
    command("volume", *surface, "--boundary", piles, "--adjustment", project / "result",
            "--boundary-sigma", "0.05", "--density", DENSITY[0], "--density-sigma", DENSITY[1], "--project", named,
            "--out", out)  # fmt: skip
    return json.loads((out / "volume.json").read_text(encoding="utf-8")), seconds


def standing(epoch: int) -> dict[str, float]:
    """m³ that truly stand inside every outline."""
    full, empty = (aerotri.simulate(plan(one), seed=1) for one in (epoch, None))
    found = {}
    for name in PLACES:
        polygon = outline(name)
        left, bottom, right, top = polygon.bounds
        x, y = np.meshgrid(np.arange(left, right, CELL) + 0.5 * CELL, np.arange(bottom, top, CELL) + 0.5 * CELL)
        xy = np.column_stack([x.ravel(), y.ravel()])
        xy = xy[shapely.contains_xy(polygon, xy)]
        found[name] = float((full.true_heights(xy) - empty.true_heights(xy)).mean()) * polygon.area
    return found


def over_outline(epoch: int) -> dict[str, float]:
    """m³ of the true ground over a base through the outline of every pile."""
    flight, outlines = aerotri.simulate(plan(epoch), seed=1), {name: outline(name) for name in PLACES}
    whole = shapely.union_all(list(outlines.values())).buffer(8.0).bounds
    found = aerotri.volume(flight.true_surface(CELL, whole), outlines)
    return {one["name"]: one["net_m3"] for one in found.summary["piles"]}


def documents(folder: Path) -> None:
    """The certificates in both languages."""
    for language in ("en", "de"):
        for name in ("volume_1", "volume_2", "change"):
            command("export", folder / name, "--to", "pdf", "--language", language,
                    "--out", folder / "documents" / language / name)  # fmt: skip


def row(words: Sequence[str], truth: float, value: float, sigma: float) -> str:
    """A line of a table."""
    numbers = (
        f"{truth:.1f}",
        f"{value:.1f}",
        f"{value - truth:+.1f}",
        f"{sigma:.1f}",
        f"{(value - truth) / sigma:+.2f}",
    )
    return "| " + " | ".join([*words, *numbers]) + " |"


def volume_rows(
    epoch: int, content: dict[str, Any], truth: dict[str, float], stands: dict[str, float]
) -> Iterable[str]:
    """Every pile and all together."""
    for one in content["piles"]:
        found = row([str(epoch), one["name"]], truth[one["name"]], one["net_m3"], one["sigma_m3"])
        yield f"{found} {stands[one['name']]:.1f} |"
    whole = row([str(epoch), "all together"], sum(truth.values()), content["net_m3"], content["sigma"]["sigma_m3"])
    yield f"{whole} {sum(stands.values()):.1f} |"


def change_rows(content: dict[str, Any], truth: dict[int, dict[str, float]]) -> Iterable[str]:
    """Net change of every pile and all together."""
    moved = content["alignment"]["how"]
    for one in content["volumes"]:
        names = [one["name"]] if one["name"] in PLACES else list(PLACES)
        true = sum(truth[2][name] - truth[1][name] for name in names)
        yield row([moved, one["name"]], true, one["net_m3"], one["sigma_net_m3"])


def changed(folder: Path, align: str) -> dict[str, Any]:
    """change.json of both epochs, the second moved in one way."""
    out = folder / ("change" if align == "height" else f"change_{align}")
    command("change", folder / "epoch_1", folder / "epoch_2", "--align", align, "--stable", folder / "stable.geojson",
            "--area", folder / "piles.geojson", "--project", folder / "project_2.toml", "--out", out)  # fmt: skip
    return json.loads((out / "change.json").read_text(encoding="utf-8"))


def moved_row(content: dict[str, Any]) -> str:
    """Level of detection of single cells, and what the second surface was moved by."""
    moved = [f"{one['name']} {one['value']:+.3f} ± {one['sigma']:.3f} m" for one in content["alignment"]["unknowns"]]
    return f"| {content['alignment']['how']} | {content['level_of_detection_m']:.2f} | {', '.join(moved)} |"


def main() -> None:
    """Run, print, write where asked."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("folder", type=Path, help="to work in")
    parser.add_argument("--out", type=Path)
    parser.add_argument("--keep", action="store_true", help="go on with photographs and runs that are there")
    parser.add_argument("--dense", action="store_true", help="volumes and changes of the dense surface")
    options = parser.parse_args()
    folder = options.folder
    if not options.keep:
        shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True, exist_ok=True)
    write_geojson(folder / "piles.geojson", {name: outline(name) for name in PLACES})
    write_geojson(folder / "stable.geojson", {"stable": stable()})
    truth = {epoch: standing(epoch) for epoch in HEIGHTS}
    heads = "| epoch | pile | true, m³ | computed | error | σ | error/σ | standing, m³ |"
    called = "tools/prove/quarry.py --dense" if options.dense else "tools/prove/quarry.py"
    lines = [f"# A quarry with three piles, from photographs ({called})", "", heads, "|" + "---|" * 8]
    for epoch in HEIGHTS:
        content, seconds = measured(folder, epoch, options.dense)
        print(f"epoch {epoch}: aerotri run took {seconds:.0f} s", flush=True)
        lines += volume_rows(epoch, content, over_outline(epoch), truth[epoch])
    found = [changed(folder, align) for align in ("height", "shift")]
    lines += ["", "| moved in | change of | true, m³ | computed | error | σ | error/σ |", "|" + "---|" * 7]
    lines += [line for one in found for line in change_rows(one, truth)]
    lines += ["", "| moved in | level of detection, m | by |", "|---|---|---|", *map(moved_row, found)]
    documents(folder)
    print("\n".join(lines))
    if options.out:
        name = "quarry_dense.md" if options.dense else "quarry.md"
        options.out.mkdir(parents=True, exist_ok=True)
        (options.out / name).write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
