"""What it brings to free the interior orientation that an OpenSfM or OpenDroneMap run has held.

A simulated drone flight: the camera differs from what OpenSfM was given by a calibration of another day. OpenSfM's run
with `optimize_camera_parameters: no` is that flight adjusted with focal length and lens held, written as its project.
This project is read as a user reads it, adjusted as it is held, then with focal lengths and lens free, then with the
principal point free as well, each with GNSS of an RTK drone and without any control points. Check points tell.

Example
-------
    python tools/prove/frozen_interiors.py --out tools/results/frozen_interiors.md
"""

from __future__ import annotations

import argparse
import csv
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

import aerotri

SPEC = """
name = "drone"
[camera.drone]
size_px = [5472, 3648]
pixel_um = 2.4
focal_length_mm = 8.8
[camera.drone.errors.lens]
k1 = -0.004
k2 = 0.003
[camera.drone.errors.interior]
focal_length_mm = 0.02
x0_mm = 0.02
y0_mm = -0.015
[flight]
gsd_m = 0.025
strips = {strips}
images_per_strip = {images}
end_lap = 0.75
side_lap = 0.65
heading_deg = 20.0
attitude_sigma_deg = [2.0, 2.0, 3.0]
position_sigma_m = [1.0, 1.0, 1.0]
[terrain]
kind = "undulating"
height_m = 0.0
relief_rms_m = 4.0
wavelength_m = 120.0
[tie_points]
per_image = 60
probability = 0.9
sigma_um = 1.2
[control]
distance_bases = 6.0
sigma_m = [0.01, 0.01, 0.02]
check_points = 30
[gnss]
sigma_m = [0.02, 0.02, 0.03]
[start_values]
kind = "perturbed"
position_sigma_m = 0.5
angle_sigma_deg = 0.1
"""


def main() -> None:
    """Simulate, adjust, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--strips", type=int, default=8)
    parser.add_argument("--images", type=int, default=25, help="of a strip")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path, help="table to write")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="aerotri_frozen_") as place:
        text = _run(Path(place), arguments)
    print(text)
    if arguments.out is not None:
        arguments.out.write_text(text, encoding="utf-8")


def _run(place: Path, arguments: argparse.Namespace) -> str:
    spec = place / "simulation.toml"
    spec.write_text(SPEC.format(strips=arguments.strips, images=arguments.images), encoding="utf-8")
    block = aerotri.simulate(spec, seed=arguments.seed).block
    _write_lists(block, place)
    # what OpenSfM was given is the nominal camera without its errors, and it held it
    frozen = aerotri.adjust(block, parameters="none", model_part="off")
    aerotri.convert(frozen, place / "opensfm", "opensfm")
    rows = []
    for name, free in (
        ("as OpenSfM held it", False),
        ("focal length and lens free", False),
        ("and principal point", True),
    ):
        read = aerotri.read(
            place / "opensfm", pixel_um=2.4, control=place / "control.csv", positions=place / "gnss.csv",
            check=[str(block.points[k]) for k in block.control.point], free_interior=free, image_sigma_px=0.5,
        ).block  # fmt: skip
        if not rows:
            read = _held(read)
        result = aerotri.adjust(read, parameters="none" if not rows else "lens:k1+k2", model_part="off")
        rows.append((name, result.sigma0, _errors(result), result.verdict))
    heading = (
        f"{len(block.images)} photographs, {len(block.image_points)} image points, {len(block.control)} check points"
    )
    return _table(heading, rows)


def _held(block: aerotri.Block) -> aerotri.Block:
    cameras = tuple(
        replace(camera, interior={name: replace(prior, fixed=True) for name, prior in camera.interior.items()},
                lens={name: replace(prior, fixed=True) for name, prior in camera.lens.items()})
        for camera in block.cameras
    )  # fmt: skip
    return replace(block, cameras=cameras)


def _write_lists(block: aerotri.Block, place: Path) -> None:
    control, observed = block.control, block.gnss_ins
    assert observed is not None
    lists = {
        "control.csv": ("point", block.points[control.point], control),
        "gnss.csv": ("image", block.images.names[observed.image], observed),
    }
    for name, (what, names, given) in lists.items():
        with (place / name).open("w", newline="", encoding="utf-8") as file:
            out = csv.writer(file)
            out.writerow([what, "X", "Y", "Z", "sX", "sY", "sZ"])
            out.writerows(
                [str(n), *x, *s] for n, x, s in zip(names, given.xyz.tolist(), given.sigma.tolist(), strict=True)
            )


def _errors(result: aerotri.Adjustment) -> np.ndarray:
    """(n, 3) m at the check points."""
    check = result.check
    return np.column_stack([np.asarray(check[name], dtype=float) for name in ("dX", "dY", "dZ")])


def _table(heading: str, rows: list[tuple[str, float, np.ndarray, str]]) -> str:
    lines = [
        "# Interior orientation that OpenSfM held, freed",
        "",
        f"Simulated drone flight: {heading}, RTK positions with",
        "2 cm and 3 cm, no control points. The true camera differs from the held one by 0.02 mm in focal length",
        "(8.8 mm), by (0.02, −0.015) mm in the principal point and by k1 = −0.004, k2 = 0.003. Made by",
        "`python tools/prove/frozen_interiors.py --strips 12 --images 40`.",
        "",
        "| interior orientation | σ0 | RMS X, m | RMS Y, m | RMS Z, m | mean Z, m | verdict |",
        "|---|---|---|---|---|---|---|",
    ]
    for name, sigma0, errors, verdict in rows:
        rms = " | ".join(f"{value:.3f}" for value in np.sqrt(np.mean(errors**2, axis=0)))
        lines.append(f"| {name} | {sigma0:.2f} | {rms} | {errors[:, 2].mean():+.3f} | {verdict} |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()
