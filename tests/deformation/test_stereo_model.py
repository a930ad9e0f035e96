"""The deformation of a model against exact intersection by other means, and against the normal case."""

from dataclasses import replace

import independent
import numpy as np
import pytest

from aerotri.conventions import InputError
from aerotri.deformation.absorbed import absorbed_orientation
from aerotri.deformation.model_geometry import normal_geometry, normal_model
from aerotri.deformation.model_grid import FlatGround, deform_normal_case, deform_pair, mean_ground, pair_of
from aerotri.deformation.restitution import restitution_of
from aerotri.deformation.stereo_model import deform_points, regions
from aerotri.observations import Camera, Prior
from aerotri.simulation.presets import PRESETS

PAPER = [
    # Spreckels, Schlienkamp, Jacobsen, section 6.1, captions of figures 16, 17 and 18: h/b = 4,4 2,9 9,3
    ("ultracam_d", 0.663, 22.75, 4.46, 4.4),
    ("ultracam_d", 0.495, 34.09, 2.97, 2.9),
    ("ultracam_d", 0.84, 10.80, 9.39, 9.3),
    # captions of figures 19 and 20 give the end lap only; models.md 7 has b and h/b
    ("dmc", 0.63, 34.10, 3.52, None),
    ("rmk_top_15", 0.61, 89.70, 1.71, None),
]


def camera_of(preset):
    p = PRESETS[preset]
    held = {"focal_length_mm": p["focal_length_mm"], "x0_mm": 0.0, "y0_mm": 0.0}
    interior = {name: Prior(value, fixed=True) for name, value in held.items()}
    return Camera(preset, p["model"], tuple(p["size_px"]), p["pixel_um"], interior, flight_axis=p["flight_axis"])


@pytest.mark.parametrize(("preset", "end_lap", "base", "h_over_b", "printed"), PAPER)
def test_height_over_base_of_the_paper(preset, end_lap, base, h_over_b, printed):
    camera = camera_of(preset)
    geometry = normal_geometry(camera, camera.focal_length_mm, end_lap, 1000.0)
    assert geometry.base_mm == pytest.approx(base, abs=0.0051)
    assert geometry.h_over_b == pytest.approx(h_over_b, abs=0.0051)
    if printed is not None:
        # the paper cuts off after the first decimal
        assert np.floor(10.0 * geometry.h_over_b) / 10.0 == pytest.approx(printed)
    # 1 µm of parallax, through the scale 1 : h/c
    scale = 1000.0 / (1e-3 * camera.focal_length_mm)
    assert geometry.cm_per_um == pytest.approx(100.0 * geometry.h_over_b * scale * 1e-6)


def test_what_a_parallax_does_in_the_paper():
    """Section 6.1: 0.25 px at 66 % and 9 cm GSD are "9.2 cm"; by its own h/b and flying height (1019 m) 10.1 cm.
    Section 2: models differ by some 25 cm, which is 5.6 µm.
    """
    camera = camera_of("ultracam_d")
    geometry = normal_geometry(camera, camera.focal_length_mm, 0.663, 1019.0)
    assert 0.25 * camera.pixel_um * geometry.cm_per_um == pytest.approx(10.1, abs=0.05)
    assert 25.0 / geometry.cm_per_um == pytest.approx(5.6, abs=0.05)
    assert geometry.gsd_m == pytest.approx(0.09, abs=0.005)


def test_end_lap_that_is_none():
    camera = camera_of("dmc")
    for wrong in (0.0, 1.0, 63.0):
        with pytest.raises(InputError, match="end lap"):
            normal_geometry(camera, 120.0, wrong, 1000.0)


@pytest.mark.parametrize("variant", ["free", "absorbed"])
def test_against_exact_intersection(few_parameters, pair, variant):
    """0.1 mm is asked for; what is left is how well the other solver converges."""
    a = few_parameters
    restitution = restitution_of(a, variant)
    model = pair_of(restitution, a, *pair)
    p = {str(n): v for n, v in zip(a.local.parameters.names, a.local.parameters.value, strict=True)}
    rows = [list(a.local.block.images.names).index(name) for name in pair]
    rotations = [independent.rotation(*a.local.images.angles[row]) for row in rows]
    centres = [a.local.images.centre[row] for row in rows]
    used = None
    if variant == "absorbed":
        swallowed = absorbed_orientation(a).orientation
        used = (swallowed.centre[rows], swallowed.rotation[rows])
    rng = np.random.default_rng(4)
    middle = np.mean(centres, axis=0)
    points = np.column_stack(
        [middle[:2] + rng.uniform(-450.0, 450.0, (60, 2)), mean_ground(a) + rng.uniform(-80.0, 80.0, 60)]
    )
    found = deform_points(model, points).d
    seen = np.flatnonzero(np.isfinite(found[:, 2]))
    assert len(seen) > 20
    upper_left = [independent.in_upper_left(independent.projected(centres[0], rotations[0], points[k])) for k in seen]
    assert 0 < sum(upper_left) < len(seen)
    for k in seen:
        expected = independent.deformation(centres, rotations, points[k], p, used)
        np.testing.assert_allclose(found[k], expected, rtol=0.0, atol=1e-5)
    assert np.abs(found[seen]).max() > 0.02


def test_outside_the_overlap_there_is_nothing(calibration, pair):
    model = pair_of(restitution_of(calibration), calibration, *pair)
    centre = model.true.centre.mean(axis=0)
    below = [centre[0], centre[1], mean_ground(calibration)]
    points = np.array([below, [centre[0] + 3000.0, *below[1:]], [centre[0], centre[1], centre[2] + 500.0]])
    found = deform_points(model, points)
    assert np.isfinite(found.d[0]).all()
    assert np.isnan(found.d[1:]).all()
    assert np.isnan(found.parallax[1:]).all()


def test_no_parameters_no_deformation(calibration, pair):
    from aerotri.pipeline import adjust_keeping_system
    from small_blocks import with_adjustment

    plain = adjust_keeping_system(with_adjustment(calibration.result.block, additional_parameters=()))
    for variant in ("free", "absorbed"):
        d = deform_pair(plain, restitution_of(plain, variant), pair, FlatGround(mean_ground(plain)), 50.0)
        assert np.nanmax(np.abs(d.d)) < 1e-6
        assert np.nanmax(d.sigma) == 0.0


def scaled(calibration, factor):
    """The block with all additional parameters made smaller."""
    local = calibration.local
    p = local.parameters
    value = np.where(p.kinds == "additional", factor * p.value, p.value)
    return replace(calibration, local=replace(local, parameters=replace(p, value=value)))


def normal_case_formulas(model, geometry, points):
    """models.md 7: dp = dx' − dx'', dZ = h/b·dp, dX = m·dx' − (x'/f)·dZ, dY = m·(dy' + dy'')/2 − (y'/f)·dZ."""
    c, h = float(model.true.interior[0, 0]), geometry.height_m
    d, xy = [], []
    for k, errors in enumerate(model.errors):
        # camera y points along the base, camera x to its right
        image = np.column_stack([-points[:, 1], points[:, 0] - model.true.centre[k, 0]]) * c / h
        error = errors.function.of_measured(image)
        d.append(np.column_stack([error[:, 1], -error[:, 0]]))
        xy.append(np.column_stack([image[:, 1], -image[:, 0]]))
    dz = h / geometry.base_mm * (d[0][:, 0] - d[1][:, 0])
    dx = h / c * d[0][:, 0] - xy[0][:, 0] / c * dz
    dy = h / c * (d[0][:, 1] + d[1][:, 1]) / 2.0 - xy[0][:, 1] / c * dz
    return np.column_stack([dx, dy, dz])


def test_against_the_normal_case_to_its_order(calibration):
    """The difference is of second order: a quarter when the image errors are halved."""
    differences = []
    for factor in (1.0, 0.5, 0.25):
        a = scaled(calibration, factor)
        model, geometry = normal_model(a, restitution_of(a), 0.663)
        grid = np.stack(np.meshgrid(np.linspace(-180, 180, 19), np.linspace(-500, 500, 41)), axis=-1).reshape(-1, 2)
        points = np.column_stack([grid, np.zeros(len(grid))])
        found = deform_points(model, points).d
        # a node whose image errors carry it over a seam belongs to the other tile in the formula
        inside = regions(model, points)
        apart = [regions(model, points + np.array([sx, sy, 0.0])) == inside for sx in (-1, 1) for sy in (-1, 1)]
        use = np.all(apart, axis=0) & np.isfinite(found[:, 2])
        assert use.sum() > 300
        off = found[use] - normal_case_formulas(model, geometry, points[use])
        differences.append(np.abs(off).max(axis=0))
        assert np.abs(found[use, 2]).max() > 0.1 * factor
    assert (differences[0] < 2e-3).all()
    ratio = differences[0] / differences[1], differences[1] / differences[2]
    assert np.all(np.array(ratio) > 3.0), (differences, ratio)


def test_normal_case_looks_the_same_for_any_flight_axis(calibration):
    """A camera mounted the other way round, its image errors turned with it, deforms the model alike."""
    d = deform_normal_case(calibration, restitution_of(calibration), 0.6, 20.0)
    turned_camera = replace(calibration.local.block.cameras[0], flight_axis="-y")
    block = replace(calibration.local.block, cameras=(turned_camera,))
    p = calibration.local.parameters
    # of a half turn, BLUH's 5 to 8 change sign and the tiles turn with the native frame
    odd = np.isin(p.names, ["bluh.5", "bluh.6", "bluh.7", "bluh.8"])
    parameters = replace(p, value=np.where(odd, -p.value, p.value))
    other = replace(calibration, local=replace(calibration.local, block=block, parameters=parameters))
    turned = deform_normal_case(other, restitution_of(other), 0.6, 20.0)
    np.testing.assert_allclose(turned.d, d.d, atol=1e-9)


def test_nodes_are_where_they_say(calibration, pair):
    """Single nodes recomputed one by one: a shifted index would be caught."""
    restitution = restitution_of(calibration, "absorbed")
    d = deform_pair(calibration, restitution, pair, FlatGround(mean_ground(calibration)), 20.0)
    model = pair_of(restitution, calibration, *pair)
    rows, columns = np.nonzero(np.isfinite(d.d[..., 2]))
    for k in np.random.default_rng(1).choice(len(rows), 12, replace=False):
        i, j = rows[k], columns[k]
        point = np.array([[d.x[j], d.y[i], d.z[i, j]]])
        np.testing.assert_allclose(d.d[i, j], deform_points(model, point).d[0], atol=1e-9)
    assert d.x[1] - d.x[0] == pytest.approx(d.y[0] - d.y[1])


def test_heights_matter(calibration, pair):
    """Over a slope the deformation of a node is that of its own height."""

    class Slope:
        text = "slope"

        def heights(self, x, y):
            return mean_ground(calibration) + 0.1 * (x - x.mean())

    restitution = restitution_of(calibration)
    flat = deform_pair(calibration, restitution, pair, FlatGround(mean_ground(calibration)), 40.0)
    sloping = deform_pair(calibration, restitution, pair, Slope(), 40.0)
    np.testing.assert_array_equal(flat.x, sloping.x)
    assert np.nanmax(np.abs(flat.d - sloping.d)) > 0.005
    model = pair_of(restitution, calibration, *pair)
    i, j = np.argwhere(np.isfinite(sloping.d[..., 2]))[7]
    point = np.array([[sloping.x[j], sloping.y[i], sloping.z[i, j]]])
    np.testing.assert_allclose(sloping.d[i, j], deform_points(model, point).d[0], atol=1e-9)
