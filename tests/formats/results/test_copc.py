"""Surfaces as COPC: read by laspy and by copclib, which know nothing of our writer."""

from __future__ import annotations

import struct

import laspy
import laspy.copc
import numpy as np
import pytest

from aerotri import InputError
from aerotri.formats.results.copc import ENTRY, octree_over
from aerotri.formats.results.point_cloud import read_point_cloud, read_precise_cloud, write_surface_cloud
from aerotri.terrain.dense.points import SurfacePoints

CELL, ROWS, COLUMNS, TILE = 0.5, 700, 900, 256
LEFT, BOTTOM = 500000.25, 5700000.0


def part(row, column):
    """Cells of a tile with a hole and a wall."""
    i, j = np.meshgrid(
        np.arange(row, min(row + TILE, ROWS)), np.arange(column, min(column + TILE, COLUMNS)), indexing="ij"
    )
    known = ~((np.abs(i - 300) < 20) & (np.abs(j - 400) < 30))
    i, j = i[known], j[known]
    x, y = LEFT + (j + 0.5) * CELL, BOTTOM + (i + 0.5) * CELL
    z = 100.0 + 20.0 * np.sin(x / 60.0) * np.cos(y / 50.0) + np.where(j > 600, 80.0, 0.0)
    n = len(x)
    covariance = np.tile([1e-4, 1.1e-4, 4e-4, 1e-5, 2e-5, 3e-5], (n, 1)) * (1.0 + 0.1 * (i % 7))[:, None]
    colour = np.column_stack([i % 256, j % 256, (i + j) % 256]).astype(np.uint16) * 256
    return SurfacePoints(
        np.column_stack([x, y, z]), covariance, np.sqrt(covariance[:, 2]) / 2, np.full(n, 3, np.uint8),
        np.tile([0.0, 0.0, 1.0], (n, 1)), colour, i % 2 == 0,
    )  # fmt: skip


PARTS = [part(row, column) for row in range(0, ROWS, TILE) for column in range(0, COLUMNS, TILE)]
COUNT = sum(len(one.xyz) for one in PARTS)


def tree():
    z = np.concatenate([one.xyz[:, 2] for one in PARTS])
    low = np.array([LEFT, BOTTOM, z.min()])
    return octree_over(low, np.array([LEFT + COLUMNS * CELL, BOTTOM + ROWS * CELL, z.max()]), CELL)


@pytest.fixture(scope="module")
def cloud(tmp_path_factory):
    path = tmp_path_factory.mktemp("copc") / "dsm.laz"
    assert write_surface_cloud(path, PARTS, tree(), "EPSG:25832+7837") == COUNT
    return path


def by_place(xyz, *more):
    order = np.lexsort((xyz[:, 0].round(2), xyz[:, 1].round(2)))
    return [np.asarray(values)[order] for values in (xyz, *more)]


def test_every_point_once_with_all_it_has(cloud):
    read = read_precise_cloud(cloud)
    given = np.concatenate([one.xyz for one in PARTS])
    found, c = by_place(read.xyz, read.covariance)
    wanted, own = by_place(given, np.concatenate([one.covariance for one in PARTS]))
    np.testing.assert_allclose(found, wanted, atol=0.00051)
    np.testing.assert_allclose(c, own, rtol=1e-5)
    for values, own in ((read.matching, "matching"), (read.photographs, "photographs")):
        assert values is not None
        stated = np.concatenate([getattr(one, own) for one in PARTS])
        np.testing.assert_allclose(
            by_place(read.xyz, values[:, None])[1], by_place(given, stated[:, None])[1], rtol=1e-6
        )  # fmt: skip
    assert read.crs == "EPSG:25832+7837"
    whole = laspy.read(cloud)
    crs = whole.header.parse_crs()
    assert crs is not None
    assert crs.is_compound
    assert (np.asarray(whole.return_number) == 1).all()
    assert whole.header.number_of_points_by_return[0] == COUNT
    np.testing.assert_allclose(whole.header.mins, given.min(axis=0), atol=0.00051)
    np.testing.assert_allclose(whole.header.maxs, given.max(axis=0), atol=0.00051)


def test_laspy_reads_levels_and_pieces(cloud):
    with laspy.copc.CopcReader.open(str(cloud)) as reader:
        info = reader.copc_info
        assert info.spacing == pytest.approx(2.0 * info.halfsize / 256)
        levels = [reader.query(level=k) for k in range(tree().deepest + 1)]
        assert sum(map(len, levels)) == COUNT
        # a level together with those above it is a raster of twice the spacing of the next
        for k in range(1, len(levels)):
            above = sum(len(one) for one in levels[: k + 1])
            assert above == pytest.approx(COUNT / 4.0 ** (tree().deepest - k), rel=0.05)
        low, high = np.array([LEFT + 50.0, BOTTOM + 60.0]), np.array([LEFT + 90.0, BOTTOM + 80.0])
        piece = reader.query(bounds=laspy.copc.Bounds(low, high))
    given = np.concatenate([one.xyz for one in PARTS])
    inside = ((given[:, :2] >= low) & (given[:, :2] <= high)).all(axis=1)
    assert len(piece) == inside.sum()


def test_copclib_finds_every_point_in_its_node(cloud):
    copclib = pytest.importorskip("copclib")
    file = copclib.FileReader(str(cloud))
    nodes = file.GetAllNodes()
    assert sum(node.point_count for node in nodes) == COUNT == file.copc_config.las_header.point_count
    assert max(node.point_count for node in nodes) <= 256 * 256
    config = file.copc_config
    root = config.copc_info
    low = np.array([root.center_x, root.center_y, root.center_z]) - root.halfsize
    for node in nodes:
        points = file.GetPoints(node)
        xyz = np.column_stack([points.x, points.y, points.z])
        width = 2.0 * root.halfsize / 2.0**node.key.d
        corner = low + width * np.array([node.key.x, node.key.y, node.key.z])
        assert (xyz >= corner - 0.001).all()
        assert (xyz <= corner + width + 0.001).all()


def test_the_info_stands_where_readers_look_for_it(cloud):
    raw = cloud.read_bytes()
    assert raw[377:381] == b"copc"
    assert raw[377 + 16 : 377 + 18] == struct.pack("<H", 1)
    at, size = struct.unpack_from("<2Q", raw, 375 + 54 + 40)
    assert size % ENTRY.size == 0
    entries = [ENTRY.unpack_from(raw, at + k) for k in range(0, size, ENTRY.size)]
    assert sum(entry[6] for entry in entries) == COUNT
    keys = {entry[:4] for entry in entries}
    assert (0, 0, 0, 0) in keys
    # no node hangs in the air
    for level, x, y, z in keys - {(0, 0, 0, 0)}:
        assert (level - 1, x >> 1, y >> 1, z >> 1) in keys


def test_the_order_of_parts_does_not_matter(cloud, tmp_path):
    write_surface_cloud(tmp_path / "other.laz", PARTS[::-1], tree(), "EPSG:25832+7837")
    assert (tmp_path / "other.laz").read_bytes() == cloud.read_bytes()


def test_a_few_cells_and_a_single_one(tmp_path):
    for count in (1, 5):
        one = PARTS[0]
        few = SurfacePoints(*(getattr(one, name)[:count] for name in (
            "xyz", "covariance", "matching", "photographs", "normal", "colour", "ground")))  # fmt: skip
        low = few.xyz.min(axis=0) - [CELL / 2, CELL / 2, 0.0]
        high = few.xyz.max(axis=0) + [CELL / 2, CELL / 2, 0.0]
        write_surface_cloud(tmp_path / "few.laz", [few], octree_over(low, high, CELL), None)
        assert len(read_point_cloud(tmp_path / "few.laz").xyz) == count
        with laspy.copc.CopcReader.open(str(tmp_path / "few.laz")) as reader:
            assert len(reader.query()) == count


def test_a_damaged_file_is_refused(cloud, tmp_path):
    raw = cloud.read_bytes()
    path = tmp_path / "cut.laz"
    for end in (100, 500, len(raw) // 2, len(raw) - 40):
        path.write_bytes(raw[:end])
        with pytest.raises(InputError, match=r"LAS or LAZ|cut off|holds fewer|outside"):
            read_point_cloud(path)


def test_a_raster_of_heights_keeps_its_vertical_system(tmp_path):
    """A compound CRS goes into the file and comes back, and readers still know the code of the plane part."""
    from aerotri.rasters.grids import Grid, RasterReader, crs_of_heights
    from aerotri.rasters.surface_files import write_surface

    z = np.full((20, 30), 100.0)
    write_surface(tmp_path / "dsm.tif", z, z * 1e-3, Grid(20, 30, LEFT, BOTTOM, 1.0, 1.0),
                  crs_of_heights("EPSG:25832+7837"), "DSM Z, m")  # fmt: skip
    with RasterReader(tmp_path / "dsm.tif") as reader:
        assert reader.plan == "EPSG:25832"
        assert "DHHN2016" in reader.crs.to_wkt()
    assert crs_of_heights("local") is None
