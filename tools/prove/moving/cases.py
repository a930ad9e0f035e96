"""The blocks: CU-SBR with RTK and control, the five heads of CA502, the drone flight of Brighton.

Measures by strips that are found where the track turns, as an adjustment finds them: it looks within the package on
purpose.
"""

from __future__ import annotations

from dataclasses import replace
from datetime import datetime
from pathlib import Path

import numpy as np
from PIL import Image

import aerotri
import ca502
from aerotri.adjustment.track import strips_of_track
from moving.flights import Flight, flight_of
from moving.strips import SET

FULL = "legendre:5x5"
"""A finer set, for what is constant in the camera."""

DATE_TIME = 36867
EXIF = 0x8769


def plainly(block: aerotri.Block) -> aerotri.Adjustment:
    return aerotri.adjust(block, explain=False, model_part="off")


def cu_sbr_p1(data: Path, parameters: str) -> aerotri.Adjustment:
    """581 photographs, RTK and six control points, one set of parameters for all."""
    folder = data / "cu_sbr_p1"
    block = aerotri.read(
        folder / "tp_bingo.txt",
        positions=folder / "gnss_positions.csv",
        gnss_shift="off",
        control=folder / "control_points.csv",
        control_prefix="GCP_",
        camera_name="P1",
        camera_size=(8192, 5460),
        pixel_um=4.27246,
        focal_length_mm=35.01,
        free_interior=True,
        image_sigma_px=0.5,
        crs="EPSG:32647",
    ).block
    return plainly(aerotri.with_settings(block, parameters=parameters, robust="huber"))


def corrected(flight: Flight, found: aerotri.Adjustment) -> aerotri.Block:
    """The block with image points freed of the image errors that a finer set found, started from its solution.

    What is constant and too fine for the usual set does not stand in the residuals any more.
    """
    result, points = found.adjusted, flight.adjusted.block.image_points
    images = replace(flight.adjusted.block.images, centre=result.images.centre, angles=result.images.angles)
    p, camera = result.parameters, flight.adjusted.block.cameras[0]
    interior = {
        name: replace(prior, value=float(p.value[p.names == name][0])) for name, prior in camera.interior.items()
    }
    xy = points.xy - found.image_errors_at(points.xy)
    return replace(
        flight.adjusted.block,
        cameras=(replace(camera, interior=interior),),
        images=images,
        image_points=replace(points, xy=xy),
    )


def timed(found: aerotri.Adjustment) -> Flight:
    """With the times of CU-SBR, which stand in the names of its photographs."""
    taken = [datetime.strptime(name.split("_")[1], "%Y%m%d%H%M%S") for name in found.block.images.names.tolist()]
    return flight_of("CU-SBR", found, seconds(taken))


def brighton(data: Path) -> Flight:
    """18 photographs from the files alone; the principal distance of EXIF, no control."""
    folder = data / "brighton" / "images"
    tied = aerotri.tie_points(folder)
    found = plainly(aerotri.with_settings(tied.block, parameters=SET, robust="huber"))
    taken = []
    for name in tied.block.images.names.tolist():
        with Image.open(next(path for path in sorted(folder.iterdir()) if path.stem == Path(name).stem)) as picture:
            taken.append(datetime.strptime(picture.getexif().get_ifd(EXIF)[DATE_TIME], "%Y:%m:%d %H:%M:%S"))
    return flight_of("Brighton", found, seconds(taken))


def oblique(data: Path) -> Flight:
    """1265 photographs of five heads as independent cameras; strips are those of the exposures."""
    block = ca502.oriented(ca502.unoriented(data / "ca502"))
    found = plainly(block)
    names = block.images.names.tolist()
    head = np.array(sorted(ca502.FOCAL_MM), dtype=object)
    head = np.searchsorted(head.astype(str), [name[0] for name in names])
    number = np.array([int(name[1:]) for name in names])
    exposures, exposure = np.unique(number, return_inverse=True)
    track = np.zeros((len(exposures), 3))
    assert block.gnss_ins is not None
    track[exposure[block.gnss_ins.image]] = block.gnss_ins.xyz
    strip = strips_of_track(track, np.full(len(track), ""))
    large = np.isin(strip, np.flatnonzero(np.bincount(strip) >= FEWEST_EXPOSURES))
    course = np.full(len(track), np.nan)
    for k in np.unique(strip[large]):
        own = np.flatnonzero(strip == k)
        leg = track[own[-1]] - track[own[0]]
        course[own] = np.arctan2(leg[1], leg[0])
    way = np.where(np.cos(course - course[large][0]) > 0.0, 0, 1)
    return Flight(
        "CA502",
        found,
        strip[exposure] + 1000 * head,
        np.nan_to_num(course)[exposure],
        way[exposure],
        number.astype(float),
        np.zeros(len(names), dtype=np.int64),
        number,
    )


FEWEST_EXPOSURES = 6
"""Exposures of a strip of the oblique block; what is shorter is a turn."""


def seconds(taken: list[datetime]) -> np.ndarray:
    """(n,) s from the first photograph."""
    return np.array([(one - min(taken)).total_seconds() for one in taken])
