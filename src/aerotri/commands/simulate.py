"""`aerotri simulate`: a block with its truth from a flight plan."""

from __future__ import annotations

import json
from pathlib import Path


def run_simulate(spec: Path, out: Path, seed: int, as_json: bool) -> None:
    """Simulate and write; arguments as on the command line."""
    from aerotri.simulation import read_spec, simulate, write_simulated

    block, truth = simulate(read_spec(spec), seed)
    write_simulated(out, block, truth)
    counts = {
        "block": block.name,
        "images": len(block.images),
        "image_points": len(block.image_points),
        "points": len(block.points),
        "control": int((~block.control.is_check).sum()),
        "check": int(block.control.is_check.sum()),
    }
    if as_json:
        print(json.dumps(counts, ensure_ascii=False))
        return
    print(
        f"{counts['images']} photographs, {counts['image_points']} image points of {counts['points']} points, "
        f"{counts['control']} control and {counts['check']} check points written to {out}"
    )
