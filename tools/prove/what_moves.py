"""What moves in the image errors of real blocks that positions and control hold: by strip, direction, time and place.

CU-SBR with RTK and control: parameters and interior orientation of every strip against direction of flight, time and a
landing; averaged residuals of groups; parameters of single photographs against crab, tilts and place; correlation of
residuals within photographs, between photographs and on the ground.
`--blocks` adds residuals and correlations of CA502 and Brighton.
Everything is done once more with the same block and white noise: what is found there is chance. Prints Markdown and
draws the pictures of docs/validation/what_moves.md.

Example: python tools/prove/what_moves.py ../shared/data > tools/results/what_moves.md
"""

from __future__ import annotations

import argparse
import pickle
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))

import aerotri
from aerotri import observations
from moving import cases, crab, figures, shadows, strips, tables
from moving.flights import Flight, noise_alone

P1_PLACE, P1_DAY = (14.52, 101.02), 358
"""Latitude and longitude of CU-SBR in degrees, and the 24th of December."""
P1_HOURS_UTC = 2 + 23.2 / 60, 2 + 50.0 / 60
"""First and last photograph; the names have UTC + 7 h."""
DRAWN = [f"legendre.{name}" for name in ("ax4y1", "ax2y1", "ax3y1", "bx4y1", "ax1y2", "bx0y3")]
PICTURES = Path(__file__).resolve().parents[2] / "docs" / "validation" / "figures"


class Kept:
    """Adjustments kept in a folder, so that a table can be changed without adjusting again."""

    def __init__(self, folder: Path | None) -> None:
        self.folder = folder

    def __call__(self, name: str, make: Callable[..., Any], *given: Any) -> Any:
        path = None if self.folder is None else self.folder / f"{name}.pickle"
        if path is not None and path.exists():
            return pickle.loads(path.read_bytes())
        begun = time.perf_counter()
        found = make(*given)
        print(f"{name}: {time.perf_counter() - begun:.0f} s", file=sys.stderr, flush=True)
        if path is not None:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(pickle.dumps(found))
        return found


def cu_sbr_p1(data: Path, kept: Kept) -> None:
    flight = kept("p1", lambda: cases.timed(cases.cu_sbr_p1(data, strips.SET)))
    finer = kept("p1_lens", lambda: cases.cu_sbr_p1(data, cases.FULL))
    group = strips.groups_of(flight)
    sun = [shadows.sun(*P1_PLACE, P1_DAY, hour) for hour in P1_HOURS_UTC]
    moved = shadows.simulated_shift(flight, sun, np.random.default_rng(6))
    noise = kept("p1_noise", lambda: noise_alone(flight, cases.plainly, 1))
    shaded = kept("p1_shadows", lambda: noise_alone(flight, cases.plainly, 2, moved))
    blocks, found = {"p1": flight, "p1_noise": noise, "p1_shadows": shaded}, {}
    for name, one in blocks.items():
        start = strips.as_adjusted(one)
        found[one.name] = kept(f"{name}_values", lambda *given: values_of(kept, *given), name, start, one, group)
    start = cases.corrected(flight, finer)
    fine = kept("p1_fine_values", lambda *given: values_of(kept, *given), "p1_fine", start, flight, group)
    values = found[flight.name]
    print(f"## {flight.name}, RTK and control\n")
    print(f"σ0 with one set ({strips.SET}) and with one for each of {len(values.time)} groups:\n")
    for one in blocks.values():
        print(f"- {one.name}: {one.adjusted.sigma0_um:.3f} and {found[one.name].sigma0_um:.3f} µm")
    print(
        f"- {flight.name}, image points corrected by {cases.FULL} before: {fine.sigma0_um:.3f} µm with one for each\n"
    )
    tables.of_strips({**found, f"{flight.name}, corrected by {cases.FULL} before": fine})
    tables.of_crab(crab.crab_effect(flight, finer, values, group), crab.crab_effect(flight, finer, fine, group), values)
    tables.explained(values, "all groups")
    tables.explained(strips.inner_groups(values, 2), "without two groups at each border of the block")
    tables.explained(fine, f"corrected by {cases.FULL} before")
    for name, one in {**found, f"{flight.name}, corrected by {cases.FULL} before": fine}.items():
        tables.interior(one, name)
    tables.residuals(flight, [noise, shaded])
    tables.of_photographs(flight, noise, group, values)
    within, same = tables.of_pairs([flight, noise, shaded])
    rose = tables.of_shadows([flight, shaded, noise], sun)
    effect = crab.crab_effect(flight, finer, values, group)
    draw(values, fine, effect, flight.adjusted.block.cameras[0])
    figures.save(figures.draw_correlations(within, same), PICTURES / "moves_correlation.png")
    marks = {"towards the sun": rose["sun"], "shadows of tops, computed": rose["tip"], "strips": rose["course"]}
    figure = figures.draw_rose(rose["shares"], shadows.AZIMUTHS, marks, rose["limit"])
    figures.save(figure, PICTURES / "moves_places.png")


def values_of(kept: Kept, name: str, block: aerotri.Block, flight: Flight, group: np.ndarray) -> strips.StripValues:
    """Parameters and interior orientation of the groups of a block."""
    own, inner = strips.with_own_parameters(block, group), strips.with_own_interior(block, group)
    parameters = kept(f"{name}_parameters", lambda: cases.plainly(own))
    return strips.strip_values(flight, parameters, kept(f"{name}_interior", lambda: cases.plainly(inner)), group)


def draw(
    values: strips.StripValues, fine: strips.StripValues, effect: crab.CrabEffect, camera: observations.Camera
) -> None:
    """Parameters over time, against crab, the interior orientation, and the fields."""
    figures.save(figures.draw_crab(values, effect, DRAWN[0]), PICTURES / "moves_crab.png")
    figures.save(figures.draw_strips(values, DRAWN, "Parameters of the strips"), PICTURES / "moves_strips.png")
    figures.save(figures.draw_interior(fine), PICTURES / "moves_interior.png")
    fields = {}
    for name, one in {f"with {strips.SET}": values, f"after correction by {cases.FULL}": fine}.items():
        inner = strips.inner_groups(one, 2)
        by_cause = np.linalg.lstsq(strips.columns(inner, ("direction", "landing")), inner.value, rcond=None)[0]
        fields[name] = 2.0 * by_cause[1]
    title = "Image errors of strips flown to the SE less those flown to the NW"
    figure = figures.draw_fields(values, camera, fields, title, "without the two outermost strips on each side")
    figures.save(figure, PICTURES / "moves_fields.png")


def other_blocks(data: Path, kept: Kept, names: list[str]) -> None:
    if "ca502" in names:
        flight = kept("ca502", lambda: cases.oblique(data))
        print(f"## {flight.name}, five heads as independent cameras\n\nσ0 {flight.adjusted.sigma0_um:.3f} µm\n")
        tables.residuals(flight, [], cameras=True)
        tables.of_pairs([flight])
    if "brighton" in names:
        flight = kept("brighton", lambda: cases.brighton(data))
        noise = kept("brighton_noise", lambda: noise_alone(flight, cases.plainly, 1))
        print(f"## {flight.name}, no control\n\nσ0 {flight.adjusted.sigma0_um:.3f} µm\n")
        tables.residuals(flight, [noise])
        tables.of_pairs([flight, noise])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path, help="folder with the data sets")
    parser.add_argument("--blocks", nargs="+", choices=["cu_sbr_p1", "ca502", "brighton"], default=["cu_sbr_p1"])
    parser.add_argument("--keep", type=Path, help="folder in which the adjustments are kept")
    options = parser.parse_args()
    kept = Kept(options.keep)
    print("# What moves in the image errors of real blocks (tools/prove/what_moves.py)\n")
    if "cu_sbr_p1" in options.blocks:
        cu_sbr_p1(options.data, kept)
    other_blocks(options.data, kept, options.blocks)


if __name__ == "__main__":
    main()
