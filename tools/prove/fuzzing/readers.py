"""Every reader of the program with good files to damage.

Measures single readers, of which some stand behind commands that take long: imports inside on purpose.
"""

from __future__ import annotations

import contextlib
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np

from fuzzing import seeds
from fuzzing.worker import Target

CAMERA = b"[camera.P1]\nsize_px = [8000, 6000]\npixel_um = 5.0\nfocal_length_mm = 40.0\n"
FORMATS = (
    "bal", "colmap", "colmap-text", "bundler", "opensfm", "metashape", "pix4d-eo", "ign", "patb", "bingo", "pix4d-gcp",
    "pix4d-geo", "pix4d-offset", "odm-gcp", "odm-geo", "ign-mes", "ign-app",
)  # fmt: skip


def all_targets(results: bool = True) -> tuple[Target, ...]:
    """All readers; without those of results, whose seeds have to be adjusted first, the seeds cost a second."""
    written = seeds.written(FORMATS)
    groups = (_lists(written), _projects(written), _blocks(), _surfaces(), _photographs(), _vectors(), _settings())
    return (*(target for group in groups for target in group), *(_results() if results else ()))


def _single(name: str, content: bytes, file: str, call: Callable[[Path], object]) -> Target:
    return Target(name, {file: content}, (file,), lambda folder: call(folder / file))


def _lists(written: dict[str, dict[str, bytes]]) -> list[Target]:
    """Lists of one file, by the kinds of `aerotri convert`; recognised and read."""
    from aerotri.formats.assembly import kinds

    options = kinds.ReadingOptions()
    lists, extra = seeds.of_tests("test_point_lists"), seeds.of_tests("test_orientation_lists")
    flight, exposures = seeds.of_tests("gnss_files"), np.array([0.0, 2.1, 4.5, 6.2, 9.0, 10.7])
    samples: dict[str, list[bytes | None]] = {
        "patb-im": [written["patb"]["x/block.im"]],
        "bingo": [written["bingo"]["x"]],
        "ign-mes": [written["ign-mes"]["x"], seeds.real("ultracam_eagle_m3", "liaisons_test.mes")],
        "dji-mrk": [flight.mrk(exposures).encode()],
        "rtklib": [flight.rtklib(exposures).encode()],
        "grafnav": [flight.grafnav(exposures).encode()],
        "metashape-markers": [seeds.metashape_project(".xml")["site.xml"]],
        "opensfm-gcp": [json.dumps(seeds.of_tests("test_opensfm_gcp").GCP).encode()],
        "odm-gcp": [lists.ODM_GCP.encode(), written["odm-gcp"]["x"]],
        "pix4d-eo": [extra.EO.encode(), written["pix4d-eo"]["x"]],
        "metashape": [written["metashape"]["x"]],
        "realitycapture": [seeds.of_tests("test_realitycapture").LIST.encode()],
        "ign-opk": [written["ign"]["x"]],
        "patb-ori": [written["patb"]["x/block.ori"]],
        "opk-list": [extra.PLAIN.encode(), seeds.real("dmc_ngi", "camera_pos_ori.txt")],
        "opk-csv": [extra.NAMED.encode()],
        "odm-geo": [lists.ODM_GEO.encode(), written["odm-geo"]["x"]],
        "csv": [lists.POSITIONS_LIST.encode(), seeds.real("cu_sbr_p1", "gnss_positions.csv", lines=12)],
        "pix4d-geo": [lists.GEO.encode()],
        "pix4d-gcp": [lists.GCP.encode()],
        "ign-app": [written["ign-app"]["x"]],
        "patb-con": [written["patb"]["x/block.con"]],
    }
    targets = []
    for group, known in (("image points", kinds.RAYS), ("orientations", kinds.ORIENTATIONS),
                         ("positions", kinds.POSITIONS), ("control", kinds.CONTROL)):  # fmt: skip
        for kind, (_, read) in known.items():
            for content in [lists.NATIVE.encode()] if (group, kind) == ("control", "csv") else samples[kind]:
                if content is not None:
                    targets.append(_single(f"{group} {kind}", content, "list.txt", _recognised(known, read, options)))
    return targets


def _recognised(known, read, options) -> Callable[[Path], object]:
    from aerotri.formats.assembly import kinds

    def call(path: Path) -> object:
        kinds.kind_of(path, known)
        return read(path, options)

    return call


def _projects(written: dict[str, dict[str, bytes]]) -> list[Target]:
    """Whole blocks of other programs, and blocks of several files."""
    from aerotri.formats.assembly.assemble import Statements
    from aerotri.formats.assembly.camera_spec import CameraSpec
    from aerotri.formats.assembly.project import Request, read_project

    targets = []
    flown = {f"{kind}, rig": seeds.rig_project(kind) for kind in ("colmap", "colmap-text", "opensfm")}
    single = {kind: written[kind] for kind in ("bal", "colmap", "colmap-text", "bundler", "opensfm")}
    for kind, files in (single | flown).items():
        source = f"{kind.partition(',')[0].removesuffix('-text')}:"

        def read(folder: Path, source: str = source) -> object:
            _detected(folder / "x")
            return read_project(Request(f"{source}{folder / 'x'}", "x"))

        targets.append(Target(kind, files, tuple(files), read))
    for ending in (".psx", ".psz", ".xml"):
        files = seeds.metashape_project(ending)
        source = f"site{ending}"

        def read_site(folder: Path, source: str = source) -> object:
            return read_project(Request(f"metashape-project:{folder / source}", "x"))

        targets.append(Target(f"metashape project {ending}", files, tuple(files), read_site))
    opf = seeds.of_tests("opf_sample").OpfProject
    for files in (opf().files(), opf("EPSG:3044", False, "fisheye").files()):
        read_opf = lambda folder: read_project(Request(f"opf:{folder / 'project.opf'}", "x"))  # noqa: E731
        targets.append(Target("opf", files, tuple(files), read_opf))
    files = seeds.of_tests("test_micmac").files()
    read_micmac = lambda folder: read_project(Request(f"micmac:{folder / 'Ori-Site'}", "x"))  # noqa: E731
    targets.append(Target("micmac", files, tuple(files), read_micmac))
    for kind, name, content in seeds.whole_files():

        def read_file(folder: Path, kind: str = kind, name: str = name) -> object:
            return read_project(Request(f"{kind}:{folder / name}", "x"))

        targets.append(Target(kind, {name: content}, (name,), read_file))
    dbat = seeds.of_tests("test_dbat").FILES
    files = {f"x/{name}": text.encode() for name, text in dbat.items()}
    read_dbat = lambda folder: read_project(Request(f"dbat:{folder / 'x'}", "x"))  # noqa: E731
    targets.append(Target("dbat", files, tuple(files), read_dbat))
    real = {f"x/{name}": raw for name, raw in seeds.real_folder("dbat_sxb", endings=(".xml", ".txt")).items()}
    damaged = tuple(name for name in real if "result" not in name and "LICENSE" not in name)
    if real:
        targets.append(Target("dbat", real, damaged, read_dbat))
    stated = Statements(control_sigma_m=(0.1, 0.1, 0.1), positions_sigma_m=(0.1, 0.1, 0.1))
    camera = CameraSpec(pixel_um=4.0)
    endings = (".opk", ".mes", ".app", ".txt")
    ign = {f"x/{name}": raw for name, raw in seeds.real_folder("ultracam_eagle_m3", endings=endings).items()}
    if ign:
        request = lambda folder: Request(str(folder / "x"), "x", camera=camera, stated=stated)  # noqa: E731
        targets.append(Target("ign folder", ign, tuple(ign), lambda folder: read_project(request(folder))))
    opk = {"opk.txt": written["metashape"]["x"], "camera.toml": CAMERA}
    targets.append(Target("rig by names", opk, tuple(opk), lambda folder: read_project(Request(
        str(folder / "opk.txt"), "x", camera=CameraSpec(folder / "camera.toml"),
        station_pattern="{station}{camera}"))))  # fmt: skip
    patb = {f"x/{name.removeprefix('x/')}": raw for name, raw in written["patb"].items()} | {"camera.toml": CAMERA}
    targets.append(Target("patb folder", patb, tuple(patb), lambda folder: read_project(Request(
        str(folder / "x"), "x", camera=CameraSpec(folder / "camera.toml"), stated=stated))))  # fmt: skip
    for positions in ("odm-geo", "pix4d-geo"):
        targets += [_several(written, positions, control) for control in ("ign-app", "pix4d-gcp")]
    return targets


def _several(written: dict[str, dict[str, bytes]], positions: str, control: str) -> Target:
    """Image points, orientations, positions, control and camera from a file each."""
    from aerotri.formats.assembly.assemble import Statements
    from aerotri.formats.assembly.camera_spec import CameraSpec
    from aerotri.formats.assembly.project import Request, read_project

    files = {"rays.txt": written["bingo"]["x"], "eo.txt": written["pix4d-eo"]["x"], "camera.toml": CAMERA,
             "positions.txt": written[positions]["x"], "control.txt": written[control]["x"]}  # fmt: skip
    stated = Statements(crs="EPSG:32647", control_sigma_m=(0.1, 0.1, 0.1), positions_sigma_m=(0.1, 0.1, 0.1))

    def read(folder: Path) -> object:
        return read_project(Request(
            f"bingo:{folder / 'rays.txt'}", "x", camera=CameraSpec(folder / "camera.toml"), stated=stated,
            orientation=f"pix4d-eo:{folder / 'eo.txt'}", positions=f"{positions}:{folder / 'positions.txt'}",
            control=f"{control}:{folder / 'control.txt'}",
        ))  # fmt: skip

    return Target("several files", files, tuple(files), read)


def _detected(path: Path) -> None:
    from aerotri.conventions import InputError
    from aerotri.formats.convert import detect_format

    with contextlib.suppress(InputError):
        detect_format(path)


def _blocks() -> list[Target]:
    import aerotri

    targets = []
    for name, files in (("block", seeds.block_folder("csv")), ("block, film", seeds.film_folder()),
                        ("block, parquet", seeds.block_folder("parquet"))):  # fmt: skip
        targets += [Target(name, files, tuple(files), aerotri.read_block)] * 2
    files = {name.removeprefix("x/"): raw for name, raw in seeds.rig_project("block").items()}
    return [*targets, Target("block, rig and rolling shutter", files, tuple(files), aerotri.read_block)]


def _results() -> list[Target]:
    """solution.npz with its block, reopened; the adjustment is not run again."""
    import aerotri

    targets = []
    for parameters in ("none", "bluh:1-4"):
        files = seeds.result_folder(parameters)
        call = aerotri.open_result
        targets += [Target("result", files, ("solution.npz",), call)] * 2
        targets.append(Target("result, its block", files, tuple(n for n in files if n != "solution.npz"), call))
    return targets


def _surfaces() -> list[Target]:
    """Rasters, point clouds, pickets; as `compare`, `volume` and `demcor` open them."""
    from aerotri.deformation.model_map import read_number_table
    from aerotri.formats.results.pickets import read_pickets
    from aerotri.formats.results.point_cloud import read_point_cloud, refuse_cloud_units
    from aerotri.rasters.grids import RasterReader

    def window(path: Path) -> object:
        with RasterReader(path) as reader:
            reader.sample(reader.grid.x([1, 2]), reader.grid.y([1, 2]))
            return reader.read(0, 0, min(reader.grid.rows, 64), min(reader.grid.columns, 64)), reader.system

    def cloud(path: Path) -> object:
        refuse_cloud_units(path)
        return read_point_cloud(path, parallel=False)

    rasters = {
        "plain": seeds.raster(), "tiled": seeds.raster(tiled=True, blockxsize=16, blockysize=16, compress="deflate"),
        "surface": seeds.raster(2), "lzw": seeds.raster(dtype="int16", compress="lzw", predictor=2),
        "big": seeds.raster(bigtiff="YES", compress="zstd"),
    }  # fmt: skip
    targets = [_single("raster", raw, "dem.tif", window) for raw in rasters.values()]
    targets += [_single("las", seeds.point_cloud(False), "c.las", cloud)] * 2
    targets += [_single("laz", seeds.point_cloud(True), "c.laz", cloud)] * 2
    targets += [_single("pickets", seeds.picket_table(), "pickets.parquet", read_pickets)] * 2
    table = b"number,left,right\n1,a,b\n2,b,c\n"
    return [*targets, _single("model table", table, "models.csv", read_number_table)]


def _photographs() -> list[Target]:
    from aerotri.formats.foreign.exif import read_exif
    from aerotri.rasters.images import open_photograph

    def pixels(path: Path) -> object:
        with open_photograph(path) as one:
            one.left_out()
            return one.read(0, min(one.rows, 100))

    targets = []
    for kind, ending in (("JPEG", "jpg"), ("TIFF", "tif")):
        raw = seeds.photograph(kind)
        targets += [_single(f"exif {ending}", raw, f"p.{ending}", read_exif)] * 2
        targets.append(_single(f"photograph {ending}", raw, f"p.{ending}", pixels))
    return targets


def _vectors() -> list[Target]:
    from aerotri.deformation.model_map import read_polygons
    from aerotri.formats.foreign.breaklines import read_breaklines
    from aerotri.volume.boundary import read_boundary

    wkt = f"SRID=25832;POLYGON (({', '.join(f'{x} {y}' for x, y in seeds.POLYGON[0])}))".encode()
    boundary = lambda path: read_boundary(str(path), "EPSG:25832")  # noqa: E731
    models = lambda path: read_polygons(path, "EPSG:25832")  # noqa: E731
    breaklines = lambda path: read_breaklines(path, seeds.EPSG)  # noqa: E731
    return [
        _single("boundary geojson", seeds.geojson("polygons"), "b.geojson", boundary),
        _single("boundary gpkg", seeds.gpkg("polygons"), "b.gpkg", boundary),
        _single("boundary wkt", wkt, "b.wkt", boundary),
        _single("models geojson", seeds.geojson("polygons"), "m.geojson", models),
        _single("models gpkg", seeds.gpkg("polygons"), "m.gpkg", models),
        _single("breaklines geojson", seeds.geojson("lines"), "l.geojson", breaklines),
        _single("breaklines gpkg", seeds.gpkg("lines"), "l.gpkg", breaklines),
        _single("breaklines dxf", seeds.DXF.encode(), "l.dxf", breaklines),
    ]


def _settings() -> list[Target]:
    from aerotri.formats.block.settings import read_cameras_toml
    from aerotri.formats.foreign.ign import read_ign_camera
    from aerotri.formats.foreign.orientation_list import read_ortho_camera
    from aerotri.formats.foreign.pix4d import read_pix4d_offset
    from aerotri.formats.text.name_list import read_point_names
    from aerotri.simulation.reading import read_spec

    spec = (seeds.ROOT / "blocks" / "frederiksstad_ultracam" / "simulation.toml").read_bytes()
    ign = seeds.of_tests("test_ign").CAMERA.encode()
    yaml = seeds.of_tests("test_orientation_lists").YAML.encode()
    return [
        _single("simulation.toml", spec, "simulation.toml", read_spec),
        _single("cameras.toml", CAMERA, "camera.toml", read_cameras_toml),
        _single("ign camera", ign, "c.txt", lambda path: read_ign_camera(path, 4.0)),
        _single("ortho camera", yaml, "c.yaml", read_ortho_camera),
        _single("point names", b"point\n# in vegetation\nK01\nK02\n", "names.txt",
                lambda path: read_point_names(path, {"K01", "K02", "K03"}, "check point")),
        _single("pix4d offset", b"1.5 2.5 3\n", "o.xyz", read_pix4d_offset),
    ]  # fmt: skip
