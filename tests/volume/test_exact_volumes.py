"""Bodies of known volume: to machine precision where the method is exact for them, with its order elsewhere."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from aerotri.rasters.grids import Grid, RasterReader, write_raster
from aerotri.volume.bases import PlaneBase, SurfaceBase, level, plane_through, spline_through
from aerotri.volume.boundary import Boundary, boundary_of, boundary_of_grid
from aerotri.volume.sections import cross_sections, section_volume
from aerotri.volume.settings import RULES
from aerotri.volume.sums import raster_volumes
from aerotri.volume.triangles import prism_sums


class ArraySurface:
    """A surface in memory, read as a raster is."""

    def __init__(self, z, grid):
        self.z, self.grid = z, grid

    def read(self, row, column, rows, columns):
        out = np.full((rows, columns), np.nan)
        part = self.z[row : row + rows, column : column + columns]
        out[: part.shape[0], : part.shape[1]] = part
        return out

    sample = RasterReader.sample


def surface_of(function, size=100.0, cell=1.0, origin=(5000.0, 7000.0)):
    count = round(size / cell)
    grid = Grid(count, count, origin[0], origin[1] + size, cell, cell)
    x, y = np.meshgrid(grid.x(np.arange(count)) - origin[0], grid.y(np.arange(count)) - origin[1])
    return ArraySurface(function(x, y), grid)


def polygon(corners, origin=(5000.0, 7000.0)) -> Boundary:
    return boundary_of(shapely.Polygon(np.asarray(corners, dtype=float) + origin), "test")


IRREGULAR = [(12.3, 9.7), (80.2, 14.1), (91.4, 60.6), (50.5, 88.8), (33.3, 50.1), (10.9, 70.2)]


@pytest.mark.parametrize("azimuth", [0.0, 37.0, 90.0, 213.0])
def test_a_ramp_over_any_boundary_by_prisms_and_sections(azimuth):
    """∫ of a plane is its value at the centroid times the area."""
    boundary = polygon(IRREGULAR)
    surface = surface_of(lambda x, y: 300.0 + 0.13 * x - 0.21 * y)
    centroid = np.array(boundary.polygon.centroid.coords[0]) - (5000.0, 7000.0)
    truth = boundary.area * (300.0 + 0.13 * centroid[0] - 0.21 * centroid[1] - 250.0)
    found = raster_volumes(surface, level(250.0), boundary)
    assert found.prisms.net == pytest.approx(truth, rel=1e-12)
    assert found.prisms.fill == 0.0
    assert found.prisms.area == pytest.approx(boundary.area, rel=1e-12)
    assert found.cells.area == pytest.approx(boundary.area, rel=1e-12)
    assert found.cells.net == pytest.approx(truth, rel=2e-5)
    # areas of sections of a polygon are piecewise linear, of the ramp piecewise quadratic
    sections = cross_sections(surface, level(250.0), boundary, 0.25, azimuth)
    assert section_volume(sections, "trapezoidal").net == pytest.approx(truth, rel=1e-4)


@pytest.mark.parametrize("azimuth", [0.0, 90.0, 180.0])
@pytest.mark.parametrize("rule", RULES)
def test_a_ramp_over_a_rectangle_by_every_rule_exactly(rule, azimuth):
    boundary = polygon([(10, 20), (82, 20), (82, 56), (10, 56)])
    surface = surface_of(lambda x, y: 100.0 + 0.5 * x + 0.25 * y)
    truth = 72 * 36 * (0.5 * 46 + 0.25 * 38)
    for spacing in (3.0, 12.0):
        sections = cross_sections(surface, level(100.0), boundary, spacing, azimuth)
        assert section_volume(sections, rule).net == pytest.approx(truth, rel=1e-7)


def test_cut_and_fill_of_a_plane_through_the_base():
    """A ramp that crosses the level in the middle: two wedges of ½·slope·(L/2)²·width."""
    boundary = polygon([(10, 10), (90, 10), (90, 50), (10, 50)])
    surface = surface_of(lambda x, y: 0.1 * (x - 50.0))
    truth = 0.5 * 0.1 * 40.0**2 * 40.0
    found = raster_volumes(surface, level(0.0), boundary)
    assert found.prisms.cut == pytest.approx(truth, rel=1e-12)
    assert found.prisms.fill == pytest.approx(truth, rel=1e-12)
    assert found.prisms.cut_area == pytest.approx(1600.0, rel=1e-12)
    sections = cross_sections(surface, level(0.0), boundary, 10.0, 0.0)
    for rule in RULES:
        one = section_volume(sections, rule)
        assert one.cut == pytest.approx(truth, rel=1e-7)
        assert one.fill == pytest.approx(truth, rel=1e-7)


def frustum(x, y, half_foot=36.0, half_top=12.0, height=16.0):
    """A frustum of a square pyramid around (50, 50)."""
    distance = np.maximum(np.abs(x - 50.0), np.abs(y - 50.0))
    return np.clip((half_foot - distance) / (half_foot - half_top), 0.0, 1.0) * height


FRUSTUM_VOLUME = 16.0 / 3.0 * (72.0**2 + 24.0**2 + 72.0 * 24.0)


def test_frustum_as_a_tin_is_exact():
    """Twelve triangles with the edges of the body; the boundary is wider, narrower, and cuts corners off."""
    foot = np.array([(14, 14), (86, 14), (86, 86), (14, 86)], dtype=float)
    top = np.array([(38, 38), (62, 38), (62, 62), (38, 62)], dtype=float)
    xy, z = np.concatenate([foot, top]), np.array([0, 0, 0, 0, 16, 16, 16, 16], dtype=float)
    triangles = [(4, 5, 6), (4, 6, 7)]
    for k in range(4):
        n = (k + 1) % 4
        triangles += [(k, n, 4 + n), (k, 4 + n, 4 + k)]
    t = np.array(triangles)
    sums = prism_sums(shapely.box(0, 0, 100, 100), xy[t], z[t])
    assert sums[0] == pytest.approx(FRUSTUM_VOLUME, rel=1e-13)
    # within the top alone: a prism
    assert prism_sums(shapely.box(40, 40, 60, 60), xy[t], z[t])[0] == pytest.approx(400 * 16.0, rel=1e-13)
    # against a level half way up: the upper frustum is cut, the ring below it fill
    above = 8.0 / 3.0 * (48.0**2 + 24.0**2 + 48.0 * 24.0)
    half = prism_sums(shapely.box(14, 14, 86, 86), xy[t], z[t] - 8.0)
    assert half[0] == pytest.approx(above, rel=1e-12)
    assert half[1] == pytest.approx(above - (FRUSTUM_VOLUME - 8.0 * 72.0**2), rel=1e-12)
    assert half[2] == pytest.approx(48.0**2, rel=1e-12)
    # the same with a boundary that cuts the triangles: the quarter above the diagonal is a quarter
    quarter = shapely.Polygon([(50, 50), (86, 14), (86, 86)])
    cut = prism_sums(quarter, xy[t], z[t] - 8.0)
    np.testing.assert_allclose(cut[:4], half[:4] / 4.0, rtol=1e-12)


def test_frustum_by_simpson_is_exact_and_by_the_trapezoid_of_second_order():
    """Sections are exact quadratics piece by piece: stations at the edges of the body make Simpson exact.

    The raster's cells break at the edges too (nodes at whole metres), and the hips are the only place where bilinear
    cells differ from the body; across x only cells on the diagonals do.
    """
    cell = 0.5
    grid = Grid(200, 200, 5000.0 - cell / 2, 7100.0 + cell / 2, cell, cell)
    x, y = np.meshgrid(grid.x(np.arange(200)) - 5000.0, grid.y(np.arange(200)) - 7000.0)
    surface = ArraySurface(frustum(x, y), grid)
    boundary = polygon([(14, 14), (86, 14), (86, 86), (14, 86)])
    nets = {}
    for spacing in (12.0, 6.0, 3.0):
        sections = cross_sections(surface, level(0.0), boundary, spacing, 90.0)
        nets[spacing] = {rule: section_volume(sections, rule).net - FRUSTUM_VOLUME for rule in RULES}
    assert abs(nets[12.0]["simpson"]) < 1e-6 * FRUSTUM_VOLUME
    assert nets[12.0]["trapezoidal"] / nets[6.0]["trapezoidal"] == pytest.approx(4.0, rel=1e-3)
    assert nets[6.0]["trapezoidal"] / nets[3.0]["trapezoidal"] == pytest.approx(4.0, rel=1e-2)


def test_spherical_cap_converges_with_second_order():
    """V = πh²(3R − h)/3; cap of height 10 on a circle of radius 30."""
    radius = (30.0**2 + 10.0**2) / 20.0
    truth = np.pi * 100.0 * (3.0 * radius - 10.0) / 3.0
    circle = shapely.Point(5050.0, 7050.0).buffer(35.0)

    def cap(x, y):
        return np.sqrt(radius**2 - (x - 50.0) ** 2 - (y - 50.0) ** 2) - (radius - 10.0)

    errors = []
    for cell in (4.0, 2.0, 1.0):
        found = raster_volumes(surface_of(cap, cell=cell), level(0.0), boundary_of(circle, "circle"))
        errors.append((found.prisms.cut - truth, found.cells.cut - truth))
    prisms, cells = np.array(errors).T
    assert abs(prisms[-1]) < 1e-3 * truth
    assert prisms[0] / prisms[1] == pytest.approx(4.0, rel=0.05)
    assert prisms[1] / prisms[2] == pytest.approx(4.0, rel=0.05)
    assert np.all(prisms < 0.0)  # chords lie below a dome
    assert abs(cells[-1]) < 1e-3 * truth


def test_simpson_is_of_fourth_order_on_a_smooth_body():
    """A cosine hill over a square: sections along x, whose areas are known; the surface's cells are much finer."""

    def hill(x, y):
        return np.exp(0.03 * (x - 50.0)) * np.exp(0.02 * (y - 50.0))

    # centres of cells on whole tenths: no section falls between them
    surface = surface_of(lambda x, y: hill(x - 0.05, y - 0.05), cell=0.1, origin=(4999.95, 6999.95))
    boundary = polygon([(14, 14), (86, 14), (86, 86), (14, 86)])
    exact = (np.exp(0.03 * 36) - np.exp(-0.03 * 36)) / 0.03 * (np.exp(0.02 * 36) - np.exp(-0.02 * 36)) / 0.02
    fine = 1.0 + 0.1**2 / 12.0 * 0.02**2  # chords along the sections
    errors = {rule: [] for rule in RULES}
    for spacing in (12.0, 6.0):
        sections = cross_sections(surface, level(0.0), boundary, spacing, 90.0)
        for rule in RULES:
            errors[rule].append(section_volume(sections, rule).net / fine - exact)
    assert errors["trapezoidal"][0] / errors["trapezoidal"][1] == pytest.approx(4.0, rel=0.02)
    assert errors["simpson"][0] / errors["simpson"][1] == pytest.approx(16.0, rel=0.05)
    assert errors["simpson38"][0] / errors["simpson38"][1] == pytest.approx(16.0, rel=0.05)


def test_the_rest_of_a_count_that_does_not_fit_goes_by_the_trapezoid():
    surface = surface_of(lambda x, y: 1.0 + 0.0 * x)
    boundary = polygon([(10, 10), (80, 10), (80, 30), (10, 30)])
    sections = cross_sections(surface, level(0.0), boundary, 10.0, 90.0)
    assert len(sections.station) == 8
    assert "1 of 7 intervals by the trapezoid" in section_volume(sections, "simpson").note
    assert "1 of 7 intervals by the trapezoid" in section_volume(sections, "simpson38").note
    for rule in RULES:
        assert section_volume(sections, rule).net == pytest.approx(1400.0, rel=1e-7)
    odd = cross_sections(surface, level(0.0), boundary, 16.0, 90.0)
    assert odd.station[-1] == pytest.approx(70.0)
    assert section_volume(odd, "simpson").net == pytest.approx(1400.0, rel=1e-7)


def test_no_data_is_area_and_never_a_height():
    """A hole of 10 × 6 cells inside, and a boundary that reaches over the edge of the raster."""
    surface = surface_of(lambda x, y: 3.0 + 0.0 * x)
    surface.z[40:46, 30:40] = np.nan
    boundary = polygon([(10, 10), (110, 10), (110, 90), (10, 90)])
    found = raster_volumes(surface, level(0.0), boundary)
    assert found.cells.no_data_area == pytest.approx(60.0 + 800.0, rel=1e-9)
    assert found.cells.net == pytest.approx(3.0 * (8000.0 - 860.0), rel=1e-12)
    # every triangle with a corner in the hole is not known
    assert found.prisms.area + found.prisms.no_data_area == pytest.approx(8000.0, rel=1e-12)
    assert found.prisms.net == pytest.approx(3.0 * found.prisms.area, rel=1e-12)
    sections = cross_sections(surface, level(0.0), boundary, 0.5, 90.0)
    one = section_volume(sections, "trapezoidal")
    assert one.net == pytest.approx(3.0 * one.area, rel=1e-9)
    assert one.area + one.no_data_area == pytest.approx(8000.0, rel=1e-6)


def test_windows_do_not_matter():
    """Every cell is counted once whatever the windows are."""
    rng = np.random.default_rng(5)
    surface = surface_of(lambda x, y: rng.normal(size=x.shape))
    boundary = polygon(IRREGULAR)
    whole, parts = (raster_volumes(surface, level(0.1), boundary, size=size) for size in (1024, 17))
    for name in ("cut", "fill", "cut_area", "fill_area"):
        assert getattr(parts.cells, name) == pytest.approx(getattr(whole.cells, name), rel=1e-12)
        assert getattr(parts.prisms, name) == pytest.approx(getattr(whole.prisms, name), rel=1e-12)


def test_a_hole_in_the_boundary_counts_as_outside():
    outer = shapely.Point(5050, 7050).buffer(40.0)
    ring = boundary_of(outer.difference(shapely.box(5040.3, 7040.3, 5060.8, 7060.8)), "ring")
    found = raster_volumes(surface_of(lambda x, y: 2.0 + 0.0 * x), level(0.0), ring)
    assert found.prisms.net == pytest.approx(2.0 * ring.area, rel=1e-12)
    assert found.cells.net == pytest.approx(2.0 * ring.area, rel=1e-12)


def test_another_surface_as_base_on_its_own_grid(tmp_path):
    """A plane minus a plane on a coarser, shifted grid in a file."""
    surface = surface_of(lambda x, y: 10.0 + 0.1 * x)
    other = surface_of(lambda x, y: 4.0 + 0.1 * x - 0.05 * y, size=120.0, cell=2.5, origin=(4993.0, 6991.0))
    # the second surface counts its coordinates from another place
    write_raster(tmp_path / "base.tif", other.z, other.grid)
    boundary = polygon(IRREGULAR)
    centroid = np.array(boundary.polygon.centroid.coords[0])
    expected = boundary.area * (
        10.0 + 0.1 * (centroid[0] - 5000.0) - (4.0 + 0.1 * (centroid[0] - 4993.0) - 0.05 * (centroid[1] - 6991.0))
    )
    with RasterReader(tmp_path / "base.tif") as reader:
        found = raster_volumes(surface, SurfaceBase("base", reader), boundary)
    assert found.prisms.net == pytest.approx(expected, rel=1e-5)  # float32 heights


def test_planes():
    points = np.array([[1000.0, 2000.0, 5.0], [1100.0, 2000.0, 7.0], [1000.0, 2100.0, 4.0]])
    plane = plane_through(points)
    np.testing.assert_allclose(plane.heights(points[:, 0], points[:, 1]), points[:, 2], atol=1e-9)
    assert isinstance(plane, PlaneBase)
    with pytest.raises(Exception, match="on a line"):
        plane_through(np.array([[0.0, 0, 0], [1, 1, 5], [2, 2, 7]]))


def test_the_spline_reproduces_a_plane_and_takes_a_hill_off():
    """Its integral weights give the volume of the base back, and a surface that is a plane has no volume over it."""
    boundary = boundary_of(shapely.Point(5050, 7050).buffer(35.0), "circle")
    ramp = surface_of(lambda x, y: 50.0 + 0.2 * x + 0.1 * y)
    spline = spline_through(ramp, boundary)
    found = raster_volumes(ramp, spline, boundary)
    assert abs(found.prisms.net) < 1e-6 * boundary.area
    centroid = 50.0 + 0.2 * 50 + 0.1 * 50
    assert spline.integral @ spline.z == pytest.approx(boundary.area * centroid, rel=1e-6)

    def hill(x, y):
        return 50.0 + 0.2 * x + 5.0 * np.exp(-((x - 50) ** 2 + (y - 50) ** 2) / 100.0)

    surface = surface_of(hill, cell=0.5)
    net = raster_volumes(surface, spline_through(surface, boundary), boundary).prisms.net
    assert net == pytest.approx(np.pi * 500.0 * (1 - np.exp(-12.25)), rel=2e-3)


def test_without_a_boundary_all_between_the_outermost_centres_counts():
    surface = surface_of(lambda x, y: 2.0 + 0.0 * x)
    found = raster_volumes(surface, level(0.0), boundary_of_grid(surface.grid))
    assert found.prisms.net == pytest.approx(2.0 * 99.0**2, rel=1e-12)
    assert found.cells.net == pytest.approx(2.0 * 99.0**2, rel=1e-12)
