"""A boundary drawn on the surface: what moves the whole block leaves the volume, what bends it stays."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from aerotri.rasters.grids import Grid
from aerotri.rasters.held import HeldRaster
from aerotri.volume.bases import level, nodes_of, parse_base, plane_through
from aerotri.volume.boundary import boundary_of
from aerotri.volume.functionals import cell_volume, tin_volume, triangulated

REACH = 60.0
OUTLINE = shapely.Point(1.0, -2.0).buffer(40.0, quad_segs=64)


class Tin:
    """A TIN, sampled."""

    grid = Grid(121, 121, -60.5, 60.5, 1.0, 1.0)

    def __init__(self, xyz):
        from scipy.interpolate import LinearNDInterpolator

        self._of = LinearNDInterpolator(xyz[:, :2], xyz[:, 2])

    def sample(self, x, y):
        return self._of(x, y)


@pytest.fixture(scope="module")
def pickets():
    rng = np.random.default_rng(3)
    xy = rng.uniform(-REACH, REACH, (900, 2))
    z = 100.0 + 0.05 * xy[:, 0] + 9.0 * np.exp(-np.sum(xy**2, axis=1) / (2.0 * 18.0**2))
    return np.column_stack([xy, z])


def motions(xyz):
    """Shift, turn, tilt, scale, and two that bend, as (k, 3) m for a size of 1."""
    x, y, z = xyz[:, 0], xyz[:, 1], xyz[:, 2] - 100.0
    nothing = np.zeros(len(xyz))
    return {
        "shift": np.column_stack([nothing + 1.0, nothing - 2.0, nothing + 3.0]),
        "turn": np.column_stack([-y, x, nothing]) / REACH,
        "tilt": np.column_stack([-z, nothing, x]) / REACH,
        "scale": np.column_stack([x, y, z]) / REACH,
        "bend": np.column_stack([x * y, y**2, x**2]) / REACH**2,
    }


def moved_outline(move):
    """The outline with every place moved."""
    return shapely.transform(shapely.segmentize(OUTLINE, 0.5), move)


@pytest.mark.parametrize("name", ["shift", "turn", "tilt", "scale", "bend"])
@pytest.mark.parametrize("base", ["level", "tilted", "plane", "boundary"])
def test_gradient_by_moving_surface_and_boundary(pickets, name, base):
    from scipy.interpolate import LinearNDInterpolator

    triangles, motion, size = triangulated(pickets), motions(pickets)[name], 1e-2
    in_space = {"level": level(97.0), "tilted": plane_through(np.array([[0, 0, 97.0], [9, 0, 98.0], [0, 9, 97.5]]))}

    def of(sign):
        xyz = pickets + sign * size * motion
        shift = LinearNDInterpolator(pickets[:, :2], sign * size * motion[:, :2])
        boundary = boundary_of(moved_outline(lambda xy: xy + shift(xy)), "moved")
        below = in_space.get(base) or parse_base(base, Tin(xyz), boundary)
        value = tin_volume(xyz, triangles, boundary, below)[0]
        if nodes_of(below) is None:
            value -= boundary.area * float(below.heights(*np.array(boundary.polygon.centroid.coords).T)[0])
        return value

    boundary = boundary_of(moved_outline(lambda xy: xy), "as it is")
    below = in_space.get(base) or parse_base(base, Tin(pickets), boundary)
    gradient = tin_volume(pickets, triangles, boundary, below, drawn=True)[1].gradient
    found = float(np.sum(gradient * motion))
    wanted = (of(1.0) - of(-1.0)) / (2.0 * size)
    # a bent outline also changes how a base is laid through it, which is left out
    share = 2e-3 if name != "bend" else 3e-2
    fixed = tin_volume(pickets, triangles, boundary, below)[1].gradient
    assert found == pytest.approx(wanted, rel=share, abs=share * max(abs(float(np.sum(fixed * motion))), 50.0))


@pytest.mark.parametrize("name", ["shift", "turn", "tilt"])
def test_a_motion_of_the_whole_leaves_a_pile_its_volume(pickets, name):
    """On a base through its boundary; a scale s makes it 3s larger; a boundary fixed in space sees all of it."""
    triangles, boundary = triangulated(pickets), boundary_of(OUTLINE, "pile")
    base = parse_base("boundary", Tin(pickets), boundary)
    drawn, fixed = (tin_volume(pickets, triangles, boundary, base, d)[1].gradient for d in (True, False))
    volume = tin_volume(pickets, triangles, boundary, base)[0]
    of = motions(pickets)
    assert abs(np.sum(drawn * of[name])) < 2e-3 * volume
    assert np.sum(drawn * of["scale"]) == pytest.approx(3.0 * volume / REACH, rel=0.03)
    assert abs(np.sum(fixed * of["shift"])) > 20.0 * abs(np.sum(drawn * of["shift"]))


def test_cells_as_a_tin():
    """The same surface as cells and as a TIN of their centres."""
    grid = Grid(121, 121, -60.5, 60.5, 1.0, 1.0)
    x, y = np.meshgrid(grid.x(np.arange(121)), grid.y(np.arange(121)))
    z = 100.0 + 0.05 * x + 9.0 * np.exp(-(x**2 + y**2) / (2.0 * 18.0**2))
    surface, boundary = HeldRaster(z, grid, None, "hill"), boundary_of(OUTLINE, "pile")
    xyz = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    for base in (level(95.0), plane_through(np.array([[0, 0, 97.0], [9, 0, 98.0], [0, 9, 97.5]])),
                 parse_base("boundary", surface, boundary), parse_base("plane", surface, boundary)):  # fmt: skip
        cells = cell_volume(surface, boundary, base, drawn=True)
        tin = tin_volume(xyz, triangulated(xyz), boundary, base, drawn=True)[1]
        of_cells, of_tin = motions(cells.xyz), motions(tin.xyz)
        for name in of_cells:
            found, wanted = np.sum(cells.gradient * of_cells[name]), np.sum(tin.gradient * of_tin[name])
            assert found == pytest.approx(wanted, rel=5e-3, abs=20.0), (base.name, name)
