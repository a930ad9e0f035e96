"""A flight at a place on Earth: the block in its CRS, EXIF as a drone writes it, and the true ground as a raster."""

from __future__ import annotations

import numpy as np
import pytest

import aerotri
from aerotri import InputError
from aerotri.coordinates.georeference import georeference
from aerotri.formats.foreign.exif import read_exif
from aerotri.formats.foreign.odm import read_odm_gcp
from aerotri.pipeline import adjust
from aerotri.simulation import parse_spec, simulate
from aerotri.simulation.placing import placement
from aerotri.simulation.random_streams import stream
from aerotri.simulation.terrain import make_terrain

PLAN = {
    "name": "south",
    "camera": {"cam": {"size_px": [160, 120], "pixel_um": 30.0, "focal_length_mm": 4.8}},
    "flight": {"gsd_m": 0.25, "strips": 2, "images_per_strip": 4, "end_lap": 0.7, "side_lap": 0.5, "heading_deg": 40.0,
               "attitude_sigma_deg": [2.0, 2.0, 3.0], "position_sigma_m": [1.0, 1.0, 1.0]},
    "terrain": {"kind": "undulating", "relief_rms_m": 1.0, "wavelength_m": 40.0, "hill_height_m": 4.0,
                "hill_radius_m": 6.0},
    "tie_points": {"per_image": 40, "probability": 0.9, "sigma_um": 3.0, "margin_px": 2.0},
    "control": {"distance_bases": 2.0, "sigma_m": [0.01, 0.01, 0.02], "check_points": 6},
    "gnss": {"sigma_m": [0.02, 0.03, 0.05]},
    "ins": {"sigma_deg": [0.01, 0.01, 0.02]},
    "photographs": {"format": "jpeg", "targets": True},
}  # fmt: skip
PLACE = {"crs": "EPSG:32756", "origin": [520000.0, 6.2e6, -40.0]}
"""Below the ellipsoid, and where UTM shrinks all lengths by 4e-4."""


def flown(**changes):
    return aerotri.simulate(PLAN | {"georeference": PLACE} | changes, seed=3)


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    """The flight, and its folder with photographs."""
    flight = flown()
    return flight, flight.save(tmp_path_factory.mktemp("placed") / "block", photographs=True)


def test_placed_block_adjusts_to_its_truth(saved):
    """Image points, control, GNSS and INS agree in the CRS as they did in the plane: σ0 near 1, truth within σ."""
    flight, folder = saved
    block = aerotri.read_block(folder)
    assert block.crs == "EPSG:32756"
    found = adjust(block)
    assert found.outcome.status == "converged"
    assert 0.9 < found.outcome.sigma0 < 1.1
    z = (found.images.centre - flight.truth.centre) / found.images.sigma[:, :3]
    assert np.abs(z).max() < 4.0
    turned = np.angle(np.exp(1j * (found.images.angles - flight.truth.angles)))
    assert np.abs(turned / found.images.sigma[:, 3:]).max() < 4.0


def test_exif_says_what_gnss_measured(saved):
    """Camera, focal length, pixel, and the position with its σ: those of gnss_ins.csv."""
    flight, folder = saved
    observed, names = flight.block.gnss_ins, flight.block.images.names
    geographic = georeference("EPSG:32756", observed.xyz).to_geographic(observed.xyz)
    for row in (0, 5):
        tags = read_exif(folder / "photographs" / f"{names[observed.image[row]]}.jpg")
        assert (tags.model, tags.size_px, tags.ellipsoidal) == ("cam", (160, 120), True)
        assert tags.focal_length_mm == pytest.approx(4.8)
        assert tags.pixel_um == pytest.approx(30.0, rel=1e-5)
        np.testing.assert_allclose(tags.lon_lat_height, geographic[row], atol=1e-3, rtol=0.0)
        np.testing.assert_allclose(tags.lon_lat_height[:2], geographic[row, :2], atol=2e-9, rtol=0.0)
        np.testing.assert_allclose(tags.sigma_m, [0.02, 0.03, 0.05])


def test_control_is_listed_with_its_image_points(saved):
    flight, folder = saved
    given, block = read_odm_gcp(folder / "gcp_list.txt"), flight.block
    assert given.crs == "EPSG:32756"
    assert given.rays is not None
    assert set(given.rays.images.tolist()) <= {path.name for path in (folder / "photographs").iterdir()}
    rows = [given.points.tolist().index(name) for name in block.points[block.control.point]]
    np.testing.assert_allclose(given.xyz[rows], block.control.xyz, atol=1e-6)


def test_true_surface_has_the_volume_of_the_ground(saved):
    """Over a level inside a polygon: the raster in UTM against the ground integrated in the plane of the simulation."""
    flight, folder = saved
    corners = np.array([[-9.0, -8.0, 0.0], [10.0, -7.0, 0.0], [8.0, 9.0, 0.0], [-7.0, 8.0, 0.0]])
    place = placement(flight.plan.georeference)
    ring = place.to_crs(corners)[:, :2]
    text = ", ".join(f"{x!r} {y!r}" for x, y in [*ring.tolist(), ring[0].tolist()])
    level = -42.0
    found = aerotri.volume(folder / "truth" / "surface.tif", f"POLYGON (({text}))", base=level)
    assert found.net == pytest.approx(_integrated(flight.plan, place, corners[:, :2], level), rel=5e-4)


def _integrated(plan, place, corners: np.ndarray, level: float) -> float:
    """m³ in the CRS, by cells of 5 cm of the plane: their heights and their size in the CRS."""
    terrain = make_terrain(plan.terrain, plan.flight.centre_m, stream(3, "terrain"))
    cell = 0.05
    axis = np.arange(-12.0, 12.0, cell) + cell / 2.0
    xy = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    edges = np.roll(corners, -1, axis=0) - corners
    inside = np.all([e[0] * (xy[:, 1] - c[1]) - e[1] * (xy[:, 0] - c[0]) > 0.0
                     for e, c in zip(edges, corners, strict=True)], axis=0)  # fmt: skip
    plane = np.column_stack([xy[inside], terrain.height(xy[inside])])
    height = place.to_crs(plane)[:, 2] - level
    unit = place.to_crs(np.array([[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [0.0, 10.0, 0.0]]))[:, :2]
    scale = float(np.linalg.det((unit[1:] - unit[0]) / 10.0))
    assert scale == pytest.approx((1.0 - 4e-4) ** 2, abs=3e-5)
    return float(height.sum() * cell**2 * scale)


def test_not_placed_nothing_changes():
    """Without a georeference the block is the one of before, bit for bit."""
    block, truth = simulate(parse_spec(PLAN), 3)
    flight = aerotri.simulate(PLAN, seed=3)
    assert flight.block.crs == "local"
    assert (flight.truth.centre == truth.centre).all()
    assert (flight.block.control.xyz == block.control.xyz).all()


def test_places_that_are_none_are_refused():
    for crs, remedy in (("EPSG:25832+7837", "ellipsoidal"), ("EPSG:1", "EPSG")):
        with pytest.raises(InputError, match=remedy):
            flown(georeference={"crs": crs, "origin": [5e5, 5e6, 0.0]})
    with pytest.raises(InputError, match=r"georeference\.origin"):
        flown(georeference={"crs": "EPSG:32632"})
