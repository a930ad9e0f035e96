"""Good files to damage: written by the program itself, taken from the tests, or cut from the real data."""

from __future__ import annotations

import io
import json
import sqlite3
import struct
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[3]
DATA = ROOT.parent / "shared" / "data"
EPSG = "EPSG:25832"
EAST, NORTH = 500_000.0, 5_900_000.0
POLYGON = [[[EAST + x, NORTH + y] for x, y in ((5, 5), (40, 5), (40, 30), (5, 30), (5, 5))]]
PICKET_NUMBERS = ("node_X", "node_Y", "X", "Y", "Z", "sX", "sY", "sZ", "sX_matching", "sY_matching", "sZ_matching",
                  "correlation")  # fmt: skip
"""Columns of pickets.parquet."""
LINES = [
    [[EAST + 5 + 10 * k, NORTH + 5.0, 3.0 + k] for k in range(4)],
    [[EAST, NORTH, 1.0], [EAST + 9, NORTH + 9, 2.0]],
]


def of_tests(module: str) -> Any:
    """A module of the tests, whose samples are good files."""
    formats = ROOT / "tests" / "formats"
    for folder in (ROOT / "tests", formats, formats / "block", formats / "foreign"):
        if str(folder) not in sys.path:
            sys.path.insert(0, str(folder))
    return __import__(module)


def written(formats: tuple[str, ...]) -> dict[str, dict[str, bytes]]:
    """The small oriented block of the tests in these formats: content by path within a folder."""
    from dataclasses import replace

    import aerotri

    sample = of_tests("oriented_sample").oriented_sample(shift=(717000.0, 1606000.0, 0.0))
    found = {}
    for format in formats:
        local = format in ("bal", "colmap", "colmap-text", "bundler", "opensfm")
        block = sample.block if local else replace(sample.block, crs="EPSG:32647")
        with tempfile.TemporaryDirectory() as folder:
            aerotri.convert(block, Path(folder) / "x", format, points=sample.points)
            found[format] = contents(Path(folder))
    return found


def rig_project(format: str) -> dict[str, bytes]:
    """Three exposures of two cameras on a rig in a format, or as a block with a rolling shutter and given values."""
    from dataclasses import replace

    import aerotri
    from aerotri import observations

    flight = {"gsd_m": 0.1, "strips": 1, "images_per_strip": 3, "end_lap": 0.7, "speed_m_s": 10.0}
    rigs = of_tests("rig_blocks")
    changes = {"flight": flight, "tie_points": {"per_image": 8, "probability": 0.9, "sigma_um": 2.0}}
    changes["gnss"] = {"sigma_m": [0.1, 0.1, 0.1]}
    if format == "block":
        rolling = rigs.NADIR | {"rolling_shutter": {"readout_ms": 20.0}}
        changes["camera"] = {"nadir": rolling, "fore": rigs.OBLIQUE}
    block, truth = rigs.rig_block(1, cameras=("fore",), **changes)
    block = replace(block, images=replace(block.images, centre=truth.centre, angles=truth.angles))
    if format == "block":
        given = {"bluh.1": observations.Prior(1e-4, 1e-5), "legendre.bx2y0": observations.Prior(2e-4, fixed=True)}
        block = replace(block, cameras=tuple(replace(camera, parameters=given) for camera in block.cameras))
    with tempfile.TemporaryDirectory() as folder:
        aerotri.convert(block, Path(folder) / "x", format, points=truth.points)
        return contents(Path(folder))


def metashape_project(ending: str) -> dict[str, bytes]:
    """The project of the tests: content by path within a folder."""
    with tempfile.TemporaryDirectory() as folder:
        of_tests("metashape_sample").Sample().write(Path(folder), ending)
        return contents(Path(folder))


def whole_files() -> list[tuple[str, str, bytes]]:
    """Format, file name and content of blocks that are one file."""
    bentley = of_tests("blocks_exchange_sample").BlocksExchange
    found = [("blocks-exchange", "site.xml", bentley(kind).text().encode()) for kind in ("local", "enu")]
    scenes = of_tests("test_openmvg")
    found += [("openmvg", "sfm_data.json", json.dumps(scenes.openmvg()).encode())]
    found += [("alicevision", "sfm.sfm", json.dumps(scenes.alicevision(old)).encode()) for old in (True, False)]
    found += [("nvm", "site.nvm", of_tests("test_nvm").nvm().encode())]
    return [*found, ("pix4d-params", "x.txt", of_tests("test_pix4d_params").params().encode())]


def contents(folder: Path) -> dict[str, bytes]:
    """The files below a folder by their paths in it."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


def block_folder(tables: str) -> dict[str, bytes]:
    """A block with everything a folder may hold, but scanned film."""
    import aerotri

    samples, extras = of_tests("format_samples"), of_tests("test_block_extras")
    files = samples.SMALL | {
        "edits.csv": extras.EDITS.replace("a,p2,off", "b,p1,off"),
        "constraints.csv": "kind,points,value,sigma\ndistance,p1 p2,5.5,0.01\nhorizontal,p1 p9,,0.01\n",
    }
    if tables == "csv":
        return {name: text.encode() for name, text in files.items()}
    with tempfile.TemporaryDirectory() as folder:
        for name, text in files.items():
            (Path(folder) / name).write_text(text)
        aerotri.convert(aerotri.read_block(folder), Path(folder) / "x", tables="parquet")
        return contents(Path(folder) / "x")


def film_folder() -> dict[str, bytes]:
    """A block of scanned film."""
    samples, extras = of_tests("format_samples"), of_tests("test_block_extras")
    toml = samples.FILM_TOML.replace("[10000, 8000]", "[10000, 10000]")
    files = samples.SMALL | {"block.toml": toml, "image_points.csv": extras.PIXELS, "fiducials.csv": extras.MARKS}
    return {name: text.encode() for name, text in files.items()}


def result_folder(parameters: str) -> dict[str, bytes]:
    """What an adjustment leaves of a small block: solution.npz and the block."""
    import aerotri

    small = of_tests("small_blocks")
    changes = {"flight": small.small_spec()["flight"] | {"strips": 2, "images_per_strip": 4, "cross_strips": []}}
    changes["tie_points"] = {"per_image": 14, "probability": 0.9, "sigma_um": 2.0}
    block, _ = small.small_block(3, parameters, **changes)
    block = small.with_adjustment(block, parameter_selection="on" if parameters != "none" else "off")
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        aerotri.adjust(block).save(place / "result", plots=False)
        files = contents(place / "result")
    return {name: files[name] for name in files if name.startswith("block/") or name == "solution.npz"}


def geojson(kind: str) -> bytes:
    """Polygons with the photographs of their model, or lines with heights."""
    crs = {"type": "name", "properties": {"name": f"urn:ogc:def:crs:{EPSG.replace(':', '::')}"}}
    if kind == "lines":
        geometries = [
            {"type": "LineString", "coordinates": LINES[0]},
            {"type": "MultiLineString", "coordinates": LINES},
        ]
    else:
        shifted = [[[x + 50, y] for x, y in POLYGON[0]]]
        geometries = [{"type": "Polygon", "coordinates": POLYGON}, {"type": "MultiPolygon", "coordinates": [shifted]}]
    features = [
        {"type": "Feature", "properties": {"left": f"1_00{k}", "right": f"1_00{k + 1}"}, "geometry": geometry}
        for k, geometry in enumerate(geometries, 1)
    ]
    return json.dumps({"type": "FeatureCollection", "crs": crs, "features": features}).encode()


def gpkg(kind: str) -> bytes:
    """The same as GeoPackage, as far as it is read."""
    import shapely

    shapes = [shapely.LineString(line) for line in LINES] if kind == "lines" else [shapely.Polygon(POLYGON[0])]
    database = sqlite3.connect(":memory:")
    database.execute("CREATE TABLE gpkg_geometry_columns (table_name TEXT, column_name TEXT, srs_id INTEGER)")
    database.execute("INSERT INTO gpkg_geometry_columns VALUES ('things', 'geom', 25832)")
    database.execute('CREATE TABLE things (fid INTEGER PRIMARY KEY, geom BLOB, "left" TEXT, "right" TEXT)')
    for shape in shapes:
        blob = b"GP\0\1" + struct.pack("<i", 25832) + shapely.to_wkb(shape, flavor="iso")
        database.execute('INSERT INTO things (geom, "left", "right") VALUES (?, ?, ?)', (blob, "1_001", "1_002"))
    database.commit()
    return database.serialize()


DXF = (
    "0\nSECTION\n2\nENTITIES\n0\nPOLYLINE\n8\n0\n66\n1\n70\n8\n0\nVERTEX\n8\n0\n10\n1.0\n20\n2.0\n30\n3.0\n70\n32\n0\n"
    "VERTEX\n8\n0\n10\n4.0\n20\n5.0\n30\n6.0\n70\n32\n0\nSEQEND\n0\nLINE\n8\n0\n10\n1.0\n20\n1.0\n30\n1.0\n11\n2.0\n21\n"
    "2.0\n31\n2.0\n0\nLWPOLYLINE\n5\n1F\n100\nAcDbEntity\n8\n0\n100\nAcDbPolyline\n90\n2\n38\n5.0\n10\n1.0\n20\n1.0\n10\n3.0\n20\n4.0\n0\nENDSEC\n0\nEOF\n"
)


def raster(count: int = 1, dtype: str = "float32", **options: Any) -> bytes:
    """A small GeoTIFF of heights; with two bands a surface and its σ."""
    from rasterio import Affine
    from rasterio.io import MemoryFile

    rows, columns = 40, 50
    values = (100 + np.add.outer(np.arange(rows), 0.5 * np.arange(columns))).astype(dtype)
    transform = Affine(1.0, 0.0, EAST, 0.0, -1.0, NORTH + rows)
    with MemoryFile() as memory:
        with memory.open(
            driver="GTiff", height=rows, width=columns, count=count, dtype=dtype, crs=EPSG, transform=transform,
            nodata=-9999.0 if dtype != "uint8" else None, **options,
        ) as file:  # fmt: skip
            for band in range(1, count + 1):
                file.write(values if band == 1 else np.full_like(values, 0.1), band)
                file.set_band_description(band, "Z" if band == 1 else "σ of Z")
        return memory.read()


def photograph(kind: str) -> bytes:
    """A photograph with EXIF: focal length, position, accuracy in XMP."""
    from PIL import Image

    exif_module = of_tests("test_exif")
    image = Image.fromarray((np.add.outer(np.arange(60), np.arange(80)) % 256).astype(np.uint8)).convert("RGB")
    exif = image.getexif()
    exif[271], exif[272] = "DJI", "FC"
    exif.get_ifd(exif_module.EXIF_IFD).update({37386: 8.8, 41989: 24, 41486: 1e4, 41488: 3, 40962: 80, 40963: 60})
    gps = {1: "N", 2: (46.0, 50.0, 33.3), 3: "E", 4: (11.0, 59.0, 40.4), 5: b"\x00", 6: 312.5, 31: 0.5}
    exif.get_ifd(exif_module.GPS_IFD).update(gps)
    place = io.BytesIO()
    options = {"xmp": exif_module.XMP} if kind == "JPEG" else {"compression": "tiff_lzw"}
    image.save(place, kind, exif=exif, **options)
    return place.getvalue()


def point_cloud(compressed: bool) -> bytes:
    """A LAS or LAZ file of 200 points with an extra dimension."""
    import laspy

    rng = np.random.default_rng(1)
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.offsets, header.scales = np.array([EAST, NORTH, 0.0]), np.full(3, 0.001)
    header.add_extra_dim(laspy.ExtraBytesParams("sigma_z", "f4", "sigma of Z [m]"))
    cloud = laspy.LasData(header)
    cloud.x, cloud.y, cloud.z = (np.array([EAST, NORTH, 0.0]) + rng.uniform(0, 50, (200, 3))).T
    place = io.BytesIO()
    cloud.write(place, do_compress=compressed)
    return place.getvalue()


def picket_table() -> bytes:
    """pickets.parquet of 40 pickets."""
    import pyarrow as pa
    from pyarrow import parquet

    rng = np.random.default_rng(1)
    columns: dict[str, Any] = {name: pa.array(rng.uniform(0.1, 50.0, 40)) for name in PICKET_NUMBERS}
    columns["rays"] = pa.array([2] * 40, pa.int32())
    columns["photographs"] = pa.array([["a", "b"]] * 40, pa.list_(pa.string()))
    columns["status"] = pa.array(["accepted"] * 38 + ["no match"] * 2)
    sink = pa.BufferOutputStream()
    parquet.write_table(pa.table(columns), sink)
    return sink.getvalue().to_pybytes()


def real(*parts: str, lines: int | None = None) -> bytes | None:
    """A file of the real data, or its first lines; None where it is missing."""
    path = DATA.joinpath(*parts)
    if not path.is_file():
        return None
    raw = path.read_bytes()
    return raw if lines is None else b"".join(raw.splitlines(keepends=True)[:lines])


def real_folder(*parts: str, endings: tuple[str, ...]) -> dict[str, bytes]:
    """Files of a folder of the real data, by their endings; {} where it is missing."""
    folder = DATA.joinpath(*parts)
    if not folder.is_dir():
        return {}
    found = {str(p.relative_to(folder)): p for p in sorted(folder.rglob("*")) if p.suffix.lower() in endings}
    return {name: path.read_bytes() for name, path in found.items() if path.is_file()}
