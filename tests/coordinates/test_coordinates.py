"""CRS and local frame: closed formulas written out here, a real geoid grid, and blocks that go there and back."""

import shutil
from dataclasses import replace

import numpy as np
import pytest

from aerotri.conventions import InputError
from aerotri.coordinates import local_frame
from aerotri.coordinates.blocks import frame_of_block, needs_positions, transform_block
from aerotri.functional_model.rotation import angles_from_rotation, rotation_from_angles
from aerotri.observations import GnssIns
from aerotri.pipeline import adjust
from aerotri.public.editing import edit
from aerotri.results.in_crs import transform_result
from small_blocks import small_block

A, FLATTENING = 6378137.0, 1.0 / 298.257222101
E2 = FLATTENING * (2.0 - FLATTENING)
UTM32 = "EPSG:25832"
SAARBRUECKEN = np.array([353_000.0, 5_456_000.0, 280.0])
BLOCK_100_KM = SAARBRUECKEN + np.array(
    [[-50e3, -50e3, 0.0], [50e3, -50e3, 900.0], [50e3, 50e3, 4000.0], [-50e3, 50e3, -200.0], [120.0, -80.0, 5.0]]
)


def utm32(lon_deg, lat_deg):
    """Easting, northing, convergence and point scale by Krüger's series to the fourth power of n."""
    n = FLATTENING / (2.0 - FLATTENING)
    alpha = (
        n / 2 - 2 * n**2 / 3 + 5 * n**3 / 16 + 41 * n**4 / 180,
        13 * n**2 / 48 - 3 * n**3 / 5 + 557 * n**4 / 1440,
        61 * n**3 / 240 - 103 * n**4 / 140,
        49561 * n**4 / 161280,
    )
    rectifying = A / (1 + n) * (1 + n**2 / 4 + n**4 / 64)

    def project(lon, lat):
        e = np.sqrt(E2)
        t = np.sinh(np.arctanh(np.sin(lat)) - e * np.arctanh(e * np.sin(lat)))
        xi, eta = np.arctan2(t, np.cos(lon)), np.arctanh(np.sin(lon) / np.hypot(1.0, t))
        east = eta + sum(a * np.cos(2 * j * xi) * np.sinh(2 * j * eta) for j, a in enumerate(alpha, 1))
        north = xi + sum(a * np.sin(2 * j * xi) * np.cosh(2 * j * eta) for j, a in enumerate(alpha, 1))
        return np.array([500e3 + 0.9996 * rectifying * east, 0.9996 * rectifying * north])

    lon, lat, step = np.radians(lon_deg - 9.0), np.radians(lat_deg), 1e-5
    along_meridian = (project(lon, lat + step) - project(lon, lat - step)) / (2 * step)
    meridian_radius = A * (1 - E2) / (1 - E2 * np.sin(lat) ** 2) ** 1.5
    convergence = np.arctan2(-along_meridian[0], along_meridian[1])
    return project(lon, lat), convergence, np.hypot(*along_meridian) / meridian_radius


def geocentric(lon_deg, lat_deg, h):
    lon, lat = np.radians(lon_deg), np.radians(lat_deg)
    n = A / np.sqrt(1 - E2 * np.sin(lat) ** 2)
    flat = (n + h) * np.cos(lat)
    return np.array([flat * np.cos(lon), flat * np.sin(lon), (n * (1 - E2) + h) * np.sin(lat)])


def east_north_up(lon_deg, lat_deg):
    lon, lat = np.radians(lon_deg), np.radians(lat_deg)
    east = [-np.sin(lon), np.cos(lon), 0.0]
    north = [-np.sin(lat) * np.cos(lon), -np.sin(lat) * np.sin(lon), np.cos(lat)]
    return np.column_stack([east, north, np.cross(east, north)])


def grid_axes(lon_deg, lat_deg):
    """Grid east, grid north and up in earth-centred axes; the azimuth of grid north is the convergence."""
    gamma = utm32(lon_deg, lat_deg)[1]
    c, s = np.cos(gamma), np.sin(gamma)
    return east_north_up(lon_deg, lat_deg) @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])


PLACES = [(6.98, 49.23, 300.0), (7.31, 49.47, 2500.0), (6.55, 48.99, -20.0), (5.2, 50.1, 800.0)]


def test_kruger_series_is_itself_right():
    """No convergence and scale 0.9996 on the central meridian; the meridian quadrant of GRS 80, 10 001 965.729 m."""
    (east, _), gamma, scale = utm32(9.0, 48.0)
    assert (east, gamma, scale) == pytest.approx((500e3, 0.0, 0.9996), rel=1e-9, abs=1e-9)
    assert utm32(7.0, 49.0)[1] == pytest.approx(np.radians(-2.0) * np.sin(np.radians(49.0)), rel=2e-3)
    last_piece = np.radians(0.01) * A / np.sqrt(1 - E2)
    assert utm32(9.0, 89.99)[0][1] / 0.9996 + last_piece == pytest.approx(10_001_965.729, abs=2e-3)


def test_local_coordinates_against_closed_formulas():
    """UTM → own inverse is not needed: the same places projected by Krüger and placed by geodetic → ECEF → ENU."""
    utm = np.array([[*utm32(lon, lat)[0], h] for lon, lat, h in PLACES])
    frame = local_frame(UTM32, utm[:3])
    lon0, lat0, h0 = frame.origin
    assert np.hypot(*frame.to_local(utm[:3]).mean(axis=0)[:2]) < 200.0
    expected = [(geocentric(*p) - geocentric(lon0, lat0, h0)) @ grid_axes(lon0, lat0) for p in PLACES]
    np.testing.assert_allclose(frame.to_local(utm), expected, atol=1e-5)
    np.testing.assert_allclose(frame.from_local(np.array(expected)), utm, atol=1e-5)


def test_axes_and_partials_against_closed_formulas():
    utm = np.array([[*utm32(lon, lat)[0], h] for lon, lat, h in PLACES])
    frame = local_frame(UTM32, utm)
    base = grid_axes(*frame.origin[:2])
    axes, jacobian = frame.axes_at(utm), frame.crs_per_local(frame.to_local(utm))
    for k, (lon, lat, h) in enumerate(PLACES):
        own = grid_axes(lon, lat)
        np.testing.assert_allclose(axes[k], base.T @ own, atol=1e-9)
        _, gamma, scale = utm32(lon, lat)
        sin2 = np.sin(np.radians(lat)) ** 2
        in_meridian = A * (1 - E2) / (1 - E2 * sin2) ** 1.5
        across = A / np.sqrt(1 - E2 * sin2)
        # metres at height h shrink to the ellipsoid before they are projected, a little differently in the two sections
        shrink = scale * np.diag([across / (across + h), in_meridian / (in_meridian + h), 1.0 / scale])
        c, s = np.cos(gamma), np.sin(gamma)
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        np.testing.assert_allclose(jacobian[k], turn @ shrink @ (base.T @ east_north_up(lon, lat)).T, atol=1e-8)


CRS_AND_PLACE = [
    (UTM32, SAARBRUECKEN),
    ("EPSG:31467", [3_450_000.0, 5_456_000.0, 280.0]),  # northing first in the register
    ("EPSG:2053", [20_000.0, 3_100_000.0, 1500.0]),  # westing and southing
    ("EPSG:2154", [815_000.0, 6_284_000.0, 50.0]),
    ("EPSG:3035", [4_100_000.0, 2_900_000.0, 50.0]),  # equal-area, not conformal
    ("EPSG:32632", [353_000.0, 5_456_000.0, 280.0]),
]


@pytest.mark.parametrize(("crs", "place"), CRS_AND_PLACE)
def test_there_and_back_over_100_km(crs, place):
    places = BLOCK_100_KM - SAARBRUECKEN + place
    frame = local_frame(crs, places)
    local = frame.to_local(places)
    np.testing.assert_allclose(frame.from_local(local), places, atol=1e-6)
    assert np.linalg.norm(local[0] - local[2]) == pytest.approx(np.sqrt(2) * 100e3, rel=2e-2)
    axes = frame.axes_at(places)
    np.testing.assert_allclose(np.swapaxes(axes, 1, 2) @ axes, np.tile(np.eye(3), (5, 1, 1)), atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(axes), 1.0)
    np.testing.assert_allclose(axes[4], np.eye(3), atol=2e-3)


def test_the_same_frame_from_its_origin():
    frame = local_frame(UTM32, BLOCK_100_KM)
    again = local_frame(UTM32, BLOCK_100_KM[:1], origin=frame.origin)
    np.testing.assert_array_equal(frame.to_local(BLOCK_100_KM), again.to_local(BLOCK_100_KM))


def test_geographic_coordinates_across_the_date_line():
    places = np.array([[179.9, -17.0, 30.0], [-179.9, -17.1, 40.0]])
    frame = local_frame("EPSG:4979", places)
    assert abs(frame.origin[0]) == pytest.approx(180.0, abs=0.01)
    np.testing.assert_allclose(frame.from_local(frame.to_local(places)), places, atol=1e-9)
    np.testing.assert_allclose(
        frame.crs_per_local(frame.to_local(places))[0] @ frame.axes_at(places)[0], np.eye(3), atol=1e-9
    )


def test_a_row_with_an_unknown_coordinate_stays_unknown():
    places = BLOCK_100_KM.copy()
    places[1, 2] = np.nan
    frame = local_frame(UTM32, places)
    np.testing.assert_array_equal(np.isnan(frame.to_local(places)).all(axis=1), [False, True, False, False, False])
    assert np.isnan(frame.axes_at(places)[1]).all()


# heights

FRANCE = np.array([[815601.51, 6283629.28, 54.96], [833670.94, 6281965.4, 52.63], [700123.0, 6600456.0, 812.0]])


@pytest.fixture
def raf20(shared_data):
    return shared_data("ultracam_eagle_m3") / "fr_ign_RAF20.tif"


def undulation(path, lon, lat):
    """Bilinear interpolation by hand; the georeference of a raster counts from the corner of its first cell."""
    rasterio = pytest.importorskip("rasterio")
    with rasterio.open(path) as grid:
        values, place = grid.read(1).astype(float), grid.transform
    column, row = (lon - place.c) / place.a - 0.5, (lat - place.f) / place.e - 0.5
    c, r = int(column), int(row)
    u, v = column - c, row - r
    upper = (1 - u) * values[r, c] + u * values[r, c + 1]
    return (1 - v) * upper + v * ((1 - u) * values[r + 1, c] + u * values[r + 1, c + 1])


@pytest.mark.parametrize("crs", ["EPSG:5698", "EPSG:2154+5720", "EPSG:2154"])
def test_geoid_file_against_own_interpolation(raf20, crs, tmp_path):
    """Compound by one code or two, or a plane CRS whose heights the geoid defines; a folder with a blank."""
    folder = tmp_path / "geoid grids"
    folder.mkdir()
    grid = shutil.copy(raf20, folder / "raf.tif")
    frame, plain = local_frame(crs, FRANCE, grid), local_frame("EPSG:2154", FRANCE)
    for with_geoid, without in zip(
        frame.georeference.to_geographic(FRANCE), plain.georeference.to_geographic(FRANCE), strict=True
    ):
        np.testing.assert_allclose(with_geoid[:2], without[:2], atol=1e-12)
        n = undulation(raf20, *without[:2])
        assert 40.0 < n < 56.0
        assert with_geoid[2] - without[2] == pytest.approx(n, abs=1e-4)
    np.testing.assert_allclose(frame.from_local(frame.to_local(FRANCE)), FRANCE, atol=1e-6)


def test_slope_of_the_geoid_is_in_the_partials(raf20):
    frame, plain = local_frame("EPSG:5698", FRANCE, raf20), local_frame("EPSG:2154", FRANCE)
    slope = (frame.crs_per_local(frame.to_local(FRANCE)) - plain.crs_per_local(plain.to_local(FRANCE)))[:, 2]
    lon, lat = plain.georeference.to_geographic(FRANCE)[2, :2]
    per_metre = (undulation(raf20, lon, lat + 1e-3) - undulation(raf20, lon, lat - 1e-3)) / (2e-3 * 111_180.0)
    assert slope[2, 1] == pytest.approx(-per_metre, abs=5e-6)


def test_missing_grid_is_named():
    from pyproj import network

    if network.is_network_enabled():
        pytest.skip("PROJ fetches grids from the network here")
    with pytest.raises(InputError, match=r"fr_ign_RAF18\.tif") as caught:
        local_frame("EPSG:5698", FRANCE)
    assert "--geoid" in caught.value.remedy


def test_grid_that_proj_finds_equals_the_file(raf20, tmp_path):
    from pyproj import datadir

    known = datadir.get_data_dir()
    shutil.copy(raf20, tmp_path / "fr_ign_RAF20.tif")
    try:
        datadir.append_data_dir(str(tmp_path))
        found = local_frame("EPSG:9794+5720", FRANCE).to_local(FRANCE)
    finally:
        datadir.set_data_dir(known)
    np.testing.assert_allclose(found, local_frame("EPSG:9794+5720", FRANCE, raf20).to_local(FRANCE), atol=1e-6)


@pytest.mark.parametrize(
    ("crs", "places", "message"),
    [
        ("utm 32", SAARBRUECKEN, "not understood"),
        ("EPSG:999999", SAARBRUECKEN, "not known to PROJ"),
        ("EPSG:4978", SAARBRUECKEN, "neither projected nor geographic"),
        ("EPSG:7837", SAARBRUECKEN, "neither projected nor geographic"),
        ("EPSG:2263", SAARBRUECKEN, "US survey foot"),
        ("EPSG:27572", SAARBRUECKEN, "Paris"),
        (UTM32, [np.nan, 0.0, 0.0], "place is not known"),
    ],
)
def test_what_cannot_carry_a_block(crs, places, message):
    with pytest.raises(InputError, match=message) as caught:
        local_frame(crs, np.array([places]))
    assert caught.value.remedy


def test_geoid_files_that_do_not_do(raf20, tmp_path):
    nonsense = tmp_path / "grid.tif"
    nonsense.write_text("no grid")
    with pytest.raises(InputError, match="cannot be read"):
        local_frame("EPSG:2154", FRANCE, nonsense)
    with pytest.raises(InputError, match="is missing"):
        local_frame("EPSG:2154", FRANCE, tmp_path / "none.tif")
    with pytest.raises(InputError, match="ellipsoidal heights"):
        local_frame("EPSG:4979", np.array([[4.0, 44.0, 0.0]]), raf20)
    frame = local_frame("EPSG:2154", FRANCE, raf20)
    with pytest.raises(InputError, match=r"outside the geoid grid fr_ign_RAF20\.tif"):
        frame.to_local(np.array([[3_000_000.0, 6_600_000.0, 0.0]]))


# attitudes and blocks


def test_attitude_and_image_coordinates_in_space():
    """A photograph and a ground point in UTM: seen from ECEF with axes of its own, and through the local frame."""
    camera, ground = (7.31, 49.47, 2500.0), (7.32, 49.463, 300.0)
    angles = np.radians([1.3, -0.7, 112.0])
    in_space = grid_axes(*camera[:2]) @ rotation_from_angles(angles)
    expected = in_space.T @ (geocentric(*ground) - geocentric(*camera))
    places = np.array([[*utm32(*p[:2])[0], p[2]] for p in (camera, ground, (6.98, 49.23, 300.0))])
    frame = local_frame(UTM32, places)
    local = frame.to_local(places)
    rotation = frame.axes_at(places[:1])[0] @ rotation_from_angles(angles)
    u = rotation.T @ (local[1] - local[0])
    np.testing.assert_allclose(u[:2] / u[2], expected[:2] / expected[2], atol=1e-8)


def test_real_photographs_see_their_control_points(raf20, shared_data):
    """Seven rays to three points in Lambert-93, convergence 1.3°: about a pixel, from published orientations.

    Centres are in levelled heights lengthened by the scale of the map ('alt' for altération linéaire), 0.5 m over a
    flying height of 1720 m or 3 pixels; points have ellipsoidal heights. The frame must tell these apart.
    """
    folder = shared_data("ultracam_eagle_m3")

    def table(name, skip=0):
        return [line.split() for line in (folder / name).read_text().splitlines()[skip:] if line.strip()]

    photos = {row[0]: np.array(row[1:7], float) for row in table("23FD1305_alt_test.OPK", 1)}
    ground = {row[0]: np.array(row[2:5], float) for row in table("GCP_test.app")}
    levelled = local_frame("EPSG:2154+5720", np.array(list(ground.values())), raf20)
    ellipsoidal = local_frame("EPSG:2154", np.array(list(ground.values())), origin=levelled.origin)
    focal_px, principal_px, errors = 30975.0, np.array([13210.0, 8502.0]), []
    for point, photo, column, row in table("terrain_test.mes"):
        target = ellipsoidal.to_local(ground[point][None])[0]
        height = levelled.from_local(target[None])[0, 2]
        centre, angles = photos[photo][:3].copy(), np.radians(photos[photo][3:])
        rotation = levelled.axes_at(centre[None])[0] @ rotation_from_angles(angles)
        scale = np.sqrt(np.linalg.det(levelled.crs_per_local(target[None])[0, :2, :2]))
        for freed in (False, True):
            centre[2] = height + (photos[photo][2] - height) / (scale if freed else 1.0)
            u = rotation.T @ (target - levelled.to_local(centre[None])[0])
            errors.append(principal_px + focal_px * np.array([-u[0], u[1]]) / u[2] - [float(column), float(row)])
    lengthened, freed = (np.linalg.norm(errors[k::2], axis=1) for k in range(2))
    assert np.median(freed) < 0.7
    assert freed.max() < 1.5
    assert lengthened.min() > 2.0


def spread(partials, sigma):
    return np.sqrt(np.einsum("nij,nj->ni", partials**2, sigma**2))


def moved_into(frame, block, attitudes=False):
    """A local block as it would be given in the CRS of `frame`: written apart from the code under test."""
    crs_per_local = frame.crs_per_local(block.control.xyz)
    control = replace(
        block.control,
        xyz=frame.from_local(block.control.xyz),
        sigma=spread(crs_per_local, block.control.sigma),
    )
    centre = frame.from_local(block.images.centre)
    rotation = np.swapaxes(frame.axes_at(centre), 1, 2) @ rotation_from_angles(block.images.angles)
    images = replace(block.images, centre=centre, angles=angles_from_rotation(rotation))
    gnss_ins = block.gnss_ins
    if gnss_ins is not None:
        gnss_ins = replace(
            gnss_ins,
            xyz=frame.from_local(gnss_ins.xyz),
            sigma=spread(frame.crs_per_local(gnss_ins.xyz), gnss_ins.sigma),
        )
    return replace(block, crs=frame.crs, control=control, images=images, gnss_ins=gnss_ins)


def shifted(block, by):
    """The block elsewhere in its own frame, with observed projection centres."""
    images = replace(block.images, centre=block.images.centre + by)
    n = len(images)
    noise = np.random.default_rng(4).normal(0, 0.05, (n, 3))
    unknown = np.full((n, 3), np.nan)
    gnss = GnssIns(np.arange(n), images.centre + noise, np.full((n, 3), 0.5), unknown, unknown, unknown[:, 0])
    gnss_settings = replace(block.settings.gnss, shift="off")
    return replace(
        block,
        images=images,
        control=replace(block.control, xyz=block.control.xyz + by),
        gnss_ins=gnss,
        settings=replace(block.settings, gnss=gnss_settings),
    )


@pytest.fixture(scope="module")
def local_block():
    block, _ = small_block(21, control={"distance_bases": 2.0, "sigma_m": [0.03, 0.03, 0.03], "check_points": 6})
    return shifted(block, [9_000.0, -6_000.0, 150.0])


EDGE_OF_THE_ZONE = [850_000.0, 5_456_000.0, 280.0]


@pytest.mark.parametrize("place", [SAARBRUECKEN, EDGE_OF_THE_ZONE])
def test_a_block_in_a_crs_equals_the_local_block(local_block, place):
    """Adjusted through a frame of its own and brought back, to 0.1 mm and 1e-9 rad; scale 1.0011 stays outside."""
    first = local_frame(UTM32, np.array([place]))
    block = moved_into(first, local_block)
    frame = frame_of_block(block)
    assert np.linalg.norm(frame.origin_geocentric - first.origin_geocentric) > 9_000.0
    expected = transform_result(adjust(local_block), block, first)
    result = transform_result(adjust(transform_block(block, frame)), block, frame)
    assert result.block is block
    assert result.outcome.sigma0 == pytest.approx(expected.outcome.sigma0, rel=1e-6)
    np.testing.assert_allclose(result.images.centre, expected.images.centre, atol=1e-4)
    np.testing.assert_allclose(result.images.angles, expected.images.angles, atol=1e-9)
    np.testing.assert_allclose(result.points.xyz, expected.points.xyz, atol=1e-4)
    np.testing.assert_allclose(result.images.sigma, expected.images.sigma, rtol=1e-5)
    np.testing.assert_allclose(result.points.covariance, expected.points.covariance, rtol=1e-4, atol=1e-9)
    np.testing.assert_allclose(result.rays.v, expected.rays.v, atol=1e-8)
    for ours, theirs in ((result.control, expected.control), (result.check, expected.check)):
        np.testing.assert_allclose(ours.difference, theirs.difference, atol=1e-5)
        np.testing.assert_allclose(ours.sigma, theirs.sigma, rtol=1e-4)
        np.testing.assert_allclose(ours.w, theirs.w, atol=1e-3)
    given = block.control.xyz[~block.control.is_check]
    np.testing.assert_allclose(result.points.xyz[result.control.point] - given, result.control.difference, atol=1e-12)


def test_decisions_about_control_count_in_the_crs(local_block):
    """A point made a check point, or control, by the operator differs from its own coordinates, not from another's."""
    frame = local_frame(UTM32, np.array([SAARBRUECKEN]))
    block = moved_into(frame, local_block)
    control = block.control
    names = block.points[control.point]
    rows = [int(np.flatnonzero(~control.is_check)[1]), int(np.flatnonzero(control.is_check)[0])]
    decided = edit(block, check=[str(names[rows[0]])], control=[str(names[rows[1]])])
    is_check, xyz = control.is_check.copy(), control.xyz.copy()
    is_check[rows] = [True, False]
    stated = replace(block, control=replace(control, is_check=is_check))
    found, expected = (transform_result(adjust(transform_block(b, frame)), b, frame) for b in (decided, stated))
    for ours, theirs in ((found.control, expected.control), (found.check, expected.check)):
        assert ours.point.tolist() == theirs.point.tolist()
        np.testing.assert_allclose(ours.difference, theirs.difference, atol=1e-6)
        np.testing.assert_allclose(ours.w, theirs.w, atol=1e-3)
        assert np.abs(ours.difference).max() < 1.0
    out = int(np.flatnonzero(~control.is_check)[2])
    xyz[out] = np.nan
    off = edit(block, off=[str(names[out])])
    without = replace(block, control=replace(control, xyz=xyz))
    found, expected = (transform_result(adjust(transform_block(b, frame)), b, frame) for b in (off, without))
    np.testing.assert_allclose(found.control.difference, expected.control.difference, atol=1e-6)


def test_covariance_of_the_orientation_by_simulation(local_block):
    """σ of angles and centres in the CRS against the spread of transformed draws, element by element."""
    frame = local_frame(UTM32, np.array([SAARBRUECKEN]))
    block = moved_into(frame, local_block)
    adjusted = adjust(local_block)
    result = transform_result(adjusted, block, frame)
    rng, k = np.random.default_rng(5), 3
    draws = rng.multivariate_normal(np.zeros(6), adjusted.images.covariance[k], size=4000)
    centre = frame.from_local(adjusted.images.centre[k] + draws[:, :3])
    # the axes move by some 1e-8 rad with these centres, which the partials leave out
    axes = np.swapaxes(frame.axes_at(centre), 1, 2)
    angles = angles_from_rotation(axes @ rotation_from_angles(adjusted.images.angles[k] + draws[:, 3:]))
    sample = np.cov(np.column_stack([centre, angles]).T)
    sigma = np.sqrt(np.diag(sample))
    np.testing.assert_allclose(result.images.sigma[k], sigma, rtol=0.05)
    correlation = result.images.covariance[k] / np.outer(result.images.sigma[k], result.images.sigma[k])
    np.testing.assert_allclose(correlation, sample / np.outer(sigma, sigma), atol=0.07)


def test_height_only_control_far_from_the_origin(local_block):
    """Height-only and plan-only points need the adjusted positions: two more rounds bring the heights."""
    first = local_frame(UTM32, np.array([SAARBRUECKEN]))
    block = moved_into(first, local_block)
    control = block.control
    xyz, sigma = control.xyz.copy(), control.sigma.copy()
    own = np.flatnonzero(~control.is_check)
    xyz[own[::2], :2], sigma[own[::2], :2] = np.nan, np.nan
    xyz[own[1], 2], sigma[own[1], 2] = np.nan, np.nan
    block = replace(block, control=replace(control, xyz=xyz, sigma=sigma))
    assert needs_positions(block)
    assert not needs_positions(moved_into(first, local_block))
    # with the frame's origin 11 km away the vertical leans by 1.7 mrad
    rounds, points, centres = [], None, None
    for _ in range(4):
        local = transform_block(block, first, points, centres)
        np.testing.assert_array_equal(np.isnan(local.control.xyz), np.isnan(xyz))
        adjusted = adjust(local)
        points, centres = adjusted.points.xyz, adjusted.images.centre
        rounds.append(transform_result(adjusted, block, first))
    np.testing.assert_allclose(rounds[2].points.xyz, rounds[3].points.xyz, atol=1e-4)
    last = rounds[3].control
    np.testing.assert_array_equal(np.isnan(last.difference), np.isnan(xyz[own]))
    assert np.nanmax(np.abs(last.difference)) < 0.15
    assert rounds[3].outcome.sigma0 == pytest.approx(adjust(local_block).outcome.sigma0, rel=0.03)


def test_observed_attitudes_turn_with_the_axes(local_block):
    frame = local_frame(UTM32, np.array([SAARBRUECKEN]))
    block = moved_into(frame, local_block)
    observed = block.gnss_ins
    angles = block.images.angles.copy()
    angles[2] = np.nan
    block = replace(block, gnss_ins=replace(observed, angles=angles, xyz=block.images.centre))
    local = transform_block(block, frame).gnss_ins
    assert local is not None
    expected = local_block.images.angles.copy()
    expected[2] = np.nan
    np.testing.assert_allclose(local.angles, expected, atol=1e-12)
    np.testing.assert_allclose(local.xyz, local_block.images.centre, atol=1e-6)
    np.testing.assert_allclose(local.sigma, 0.5, rtol=1e-5)


def test_differences_in_a_geographic_crs_are_metres(local_block):
    frame = local_frame("EPSG:4979", np.array([[7.0, 49.2, 0.0]]))
    block = moved_into(frame, local_block)
    adjusted = adjust(local_block)
    result = transform_result(adjusted, block, frame)
    assert np.abs(result.points.xyz[:, :2] - [7.0, 49.2]).max() < 0.5
    np.testing.assert_allclose(
        np.linalg.norm(result.check.difference, axis=1), np.linalg.norm(adjusted.check.difference, axis=1), rtol=1e-6
    )
    np.testing.assert_allclose(result.check.difference, adjusted.check.difference, atol=1e-3)


def test_blocks_that_are_refused(local_block):
    frame = local_frame(UTM32, np.array([SAARBRUECKEN]))
    block = moved_into(frame, local_block)
    curved = replace(block, settings=replace(block.settings, earth_curvature="on"))
    with pytest.raises(InputError, match="earth_curvature"):
        transform_block(curved, frame)
    with pytest.raises(ValueError, match="frame for"):
        transform_block(local_block, frame)
