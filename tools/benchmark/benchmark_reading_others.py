"""How long projects of other programs take to read, beside merely reading their files.

Image points are made up: every object point is seen by ten photographs. Of OpenSfM the peers are pyarrow parsing
tracks.csv and the json module parsing reconstruction.json; of COLMAP pycolmap, for binary models and for text, and the
bytes alone. `aerotri.read` also intersects points to say how the image points fit. Measures single readers: imports
inside on purpose.

Example
-------
    python tools/benchmark/benchmark_reading_others.py --observations 1000000
"""

from __future__ import annotations

import argparse
import json
import struct
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pycolmap
from pyarrow import csv

import aerotri

SEEN_BY = 10
PER_IMAGE = 2000


def main() -> None:
    """Write, read, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--observations", type=int, default=1_000_000)
    count = parser.parse_args().observations
    points, images = count // SEEN_BY, max(count // PER_IMAGE, SEEN_BY)
    point, image = np.divmod(np.arange(points * SEEN_BY), SEEN_BY)
    image = (image + point) % images
    xy = np.random.default_rng(1).uniform(-0.4, 0.4, (len(point), 2))
    with tempfile.TemporaryDirectory(prefix="aerotri_reading_") as folder:
        place = Path(folder)
        _write_opensfm(place / "opensfm", image, point, xy, images, points)
        _write_colmap(place / "colmap", image, point, xy, images, points)
        print(f"{len(point)} image points, {images} photographs, {points} object points")
        from aerotri.formats.foreign.colmap import read_colmap
        from aerotri.formats.foreign.opensfm import read_opensfm

        # what is imported or compiled at the first call does not count
        read_opensfm(place / "opensfm")
        read_colmap(place / "colmap")
        _say("OpenSfM, the reader", lambda: read_opensfm(place / "opensfm"))
        _say("OpenSfM, aerotri.read", lambda: aerotri.read(place / "opensfm"))
        tabs = csv.ParseOptions(delimiter="\t", quote_char=False)
        rows = csv.ReadOptions(skip_rows=1, autogenerate_column_names=True)
        _say("tracks.csv by pyarrow alone", lambda: len(csv.read_csv(place / "opensfm/tracks.csv", rows, tabs)))
        _say(
            "reconstruction.json by json alone", lambda: json.loads((place / "opensfm/reconstruction.json").read_text())
        )
        _say("COLMAP, the reader", lambda: read_colmap(place / "colmap"))
        _say("COLMAP, aerotri.read", lambda: aerotri.read(place / "colmap"))
        _say("the model by pycolmap alone", lambda: len(pycolmap.Reconstruction(place / "colmap").images))
        pycolmap.Reconstruction(place / "colmap").write_text(_made(place / "text"))
        _say("COLMAP as text, the reader", lambda: read_colmap(place / "text"))
        _say("the text by pycolmap alone", lambda: len(pycolmap.Reconstruction(place / "text").images))
        _say("its bytes alone", lambda: [np.fromfile(path, np.uint8) for path in (place / "colmap").iterdir()])


def _made(folder: Path) -> Path:
    folder.mkdir()
    return folder


def _say(name: str, work: Callable[[], object]) -> None:
    begin = time.perf_counter()
    work()
    print(f"{name}: {time.perf_counter() - begin:.2f} s", flush=True)


def _write_opensfm(
    folder: Path, image: np.ndarray, point: np.ndarray, xy: np.ndarray, images: int, points: int
) -> None:
    folder.mkdir()
    camera = {"projection_type": "perspective", "width": 4000, "height": 3000, "focal": 0.9, "k1": 0.0, "k2": 0.0}
    shot = {"camera": "one", "rotation": [3.1, 0.0, 0.0]}
    shots = {f"{k}.jpg": shot | {"translation": [float(k), 0.0, 100.0]} for k in range(images)}
    places = np.random.default_rng(2).uniform(0.0, 100.0, (points, 3)).tolist()
    cloud = {str(k): {"coordinates": xyz, "color": [1, 2, 3]} for k, xyz in enumerate(places)}
    content = [{"cameras": {"one": camera}, "shots": shots, "points": cloud}]
    (folder / "reconstruction.json").write_text(json.dumps(content))
    with (folder / "tracks.csv").open("w") as file:
        file.write("OPENSFM_TRACKS_VERSION_v2\n")
        rows = zip(image.tolist(), point.tolist(), xy.tolist(), strict=True)
        file.writelines(f"{i}.jpg\t{p}\t7\t{x!r}\t{y!r}\t0.004\t1\t2\t3\t-1\t-1\n" for i, p, (x, y) in rows)


def _write_colmap(folder: Path, image: np.ndarray, point: np.ndarray, xy: np.ndarray, images: int, points: int) -> None:
    folder.mkdir()
    (folder / "cameras.bin").write_bytes(struct.pack("<QIiQQddd", 1, 1, 0, 4000, 3000, 3600.0, 2000.0, 1500.0))
    order = np.argsort(image, kind="stable")
    bounds = np.searchsorted(image[order], np.arange(images + 1))
    index = np.empty(len(image), np.int64)
    index[order] = np.arange(len(image)) - bounds[image[order]]
    record = np.zeros(len(image), [("xy", "<f8", 2), ("point", "<u8")])
    record["xy"], record["point"] = xy[order] * 4000 + [2000, 1500], point[order] + 1
    with (folder / "images.bin").open("wb") as file:
        file.write(struct.pack("<Q", images))
        for k in range(images):
            own = record[bounds[k] : bounds[k + 1]]
            file.write(struct.pack("<I7dI", k + 1, 0.0, 1.0, 0.0, 0.0, -float(k), 0.0, 100.0, 1))
            file.write(f"{k}.jpg".encode() + b"\0" + struct.pack("<Q", len(own)) + own.tobytes())
    form = [("id", "<u8"), ("xyz", "<f8", 3), ("color", "u1", 3), ("error", "<f8"), ("n", "<u8"),
            ("track", "<u4", (SEEN_BY, 2))]  # fmt: skip
    table = np.zeros(points, np.dtype(form))
    table["id"], table["n"] = np.arange(points) + 1, SEEN_BY
    table["xyz"] = np.random.default_rng(2).uniform(0.0, 100.0, (points, 3))
    table["track"][:, :, 0] = image.reshape(points, SEEN_BY) + 1
    table["track"][:, :, 1] = index.reshape(points, SEEN_BY)
    (folder / "points3D.bin").write_bytes(struct.pack("<Q", points) + table.tobytes())


if __name__ == "__main__":
    main()
