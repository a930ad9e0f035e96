"""Fisheyes and wide lenses of other programs: round trips with two cameras, and fits where the formulas differ."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aerotri.conventions import InputError, mm_from_px
from aerotri.formats.assembly.oriented import OrientedBlock, oriented_block
from aerotri.formats.assembly.reprojection import ideal_tangents, residuals_at_start
from aerotri.formats.foreign.bal import write_bal
from aerotri.formats.foreign.bundler import write_bundler
from aerotri.formats.foreign.colmap import read_colmap, write_colmap
from aerotri.formats.foreign.lens_fit import nearest_lens
from aerotri.formats.foreign.opensfm import read_opensfm, write_opensfm
from aerotri.functional_model.additional_parameters import lens
from aerotri.functional_model.rotation import rotation_from_angles
from aerotri.observations import Block, Camera, ImagePoints, Images, Prior, Settings

pycolmap = pytest.importorskip("pycolmap")

ANGLES = np.array([[0.05, -0.1, 0.4], [-0.2, 0.1, -2.0], [0.1, 0.0, 1.5], [0.0, 0.2, 0.1]])
CENTRES = np.array([[0.0, 0.0, 100.0], [20.0, 5.0, 105.0], [5.0, 25.0, 95.0], [15.0, 15.0, 98.0]])


def camera(name: str, focal: float, projection: str, /, **values: float) -> Camera:
    interior = {"focal_length_mm": Prior(focal), "x0_mm": Prior(0.1, fixed=True), "y0_mm": Prior(-0.2, fixed=True)}
    priors = {key: Prior(value) for key, value in values.items()}
    return Camera(name, "frame", (4000, 3000), 5.0, interior, lens=priors, projection=projection)


FISHEYE = camera("1", 9.0, "fisheye", k1=-0.03, k2=0.004, k3=-2e-3, k4=3e-4)
PRISM = camera("1", 9.0, "fisheye", k1=-0.03, k2=0.004, p1=1e-3, p2=-2e-3, k3=-2e-3, k4=3e-4, sx=1e-3, sy=-2e-3)
WIDE = camera("2", 12.0, "perspective", k1=-0.05, k2=0.01, p1=1e-3, p2=-2e-3, k3=2e-3)
RATIONAL = camera("2", 12.0, "perspective", k1=0.3, k2=0.05, p1=1e-3, p2=-2e-3, k3=2e-3, q1=0.35, q2=0.07, q3=3e-3)


def sample(*cameras: Camera) -> tuple[Block, OrientedBlock]:
    """A block without noise that two cameras took, wide about their axes."""
    rng = np.random.default_rng(5)
    points = np.column_stack([rng.uniform(-80, 110, (60, 2)), rng.uniform(-5, 5, 60)])
    rotation, number = rotation_from_angles(ANGLES), np.array([0, 1, 0, 1])
    image, point = np.repeat(np.arange(4), len(points)), np.tile(np.arange(len(points)), 4)
    u = np.einsum("mji,mj->mi", rotation[image], points[point] - CENTRES[image])
    tangent, xy = -u[:, :2] / u[:, 2:], np.empty((len(image), 2))
    for k, one in enumerate(cameras):
        own = number[image] == k
        bent = lens.distort(*tangent[own].T, lens.vector_of(one))
        xy[own] = one.focal_length_mm * bent + np.array(one.principal_point_mm)
    names = np.array(["a.jpg", "b.jpg", "c.jpg", "d.jpg"])
    block = Block(
        "two", cameras, Images(names, number, np.full(4, ""), CENTRES.copy(), ANGLES.copy()),
        np.arange(1, 61).astype(str), ImagePoints(image, point, xy, np.full_like(xy, 5e-3)),
        settings=Settings(image_sigma_um=5.0),
    )  # fmt: skip
    return block, oriented_block(block, points)


def values(one: Camera) -> dict[str, float]:
    return {name: prior.value for name, prior in one.lens.items() if prior.value}


def assert_same(again: Block, block: Block) -> None:
    """The same cameras, image points and orientations, which meet in the same points."""
    for own, other in zip(again.cameras, block.cameras, strict=True):
        assert own.projection == other.projection
        assert own.focal_length_mm == pytest.approx(other.focal_length_mm)
        np.testing.assert_allclose(own.principal_point_mm, other.principal_point_mm, atol=1e-12)
        assert values(own) == pytest.approx(values(other))
    np.testing.assert_allclose(again.image_points.xy, block.image_points.xy, atol=1e-9)
    assert np.nanmax(residuals_at_start(again).residual_px) < 1e-6


def of_lens(lost: tuple[str, ...]) -> list[str]:
    """What is said but of pixels, names and σ, which have nothing to do with the lens."""
    others = ("size of the pixels", "the names of", "standard deviations")
    return [text for text in lost if not any(words in text for words in others)]


@pytest.mark.parametrize("cameras", [(FISHEYE, WIDE), (PRISM, WIDE)], ids=["opencv", "thin prism"])
def test_colmap_there_and_back(tmp_path, cameras):
    block, oriented = sample(*cameras)
    assert not of_lens(write_colmap(oriented, tmp_path / "model"))
    model = pycolmap.Reconstruction(tmp_path / "model")
    for image in model.images.values():
        for point in image.points2D:
            projected = image.project_point(model.points3D[point.point3D_id].xyz)
            np.testing.assert_allclose(projected, point.xy, atol=1e-8)
    again, points = read_colmap(tmp_path / "model", pixel_um=5.0)
    assert_same(again, block)
    np.testing.assert_array_equal(points, oriented.points)


def test_a_rational_lens_keeps_its_denominator_held(tmp_path):
    block, oriented = sample(FISHEYE, RATIONAL)
    write_colmap(oriented, tmp_path / "model")
    with pytest.warns(UserWarning, match="denominator k4, k5, k6 of its lens is held"):
        again, _ = read_colmap(tmp_path / "model", pixel_um=5.0)
    assert_same(again, block)
    assert again.cameras[1].lens["q2"].fixed
    assert not again.cameras[1].lens["k2"].fixed
    assert not {"q1", "q2", "q3"} & set(dict(again.settings.adjustment.additional_parameters)["lens"])


@pytest.mark.parametrize("fisheye", [FISHEYE, camera("1", 9.0, "fisheye", k1=-0.03, k2=0.004)], ids=["four", "two"])
def test_opensfm_there_and_back(tmp_path, fisheye):
    block, oriented = sample(fisheye, WIDE)
    assert not of_lens(write_opensfm(oriented, tmp_path / "model"))
    assert_same(read_opensfm(tmp_path / "model", pixel_um=5.0).block, block)


def test_opensfm_gets_the_nearest_lens_and_says_so(tmp_path):
    block, oriented = sample(FISHEYE, RATIONAL)
    (said,) = of_lens(write_opensfm(oriented, tmp_path / "model"))
    best = nearest_lens(RATIONAL, ("k1", "k2", "p1", "p2", "k3"))
    assert f"camera '2': OpenSfM has no words for its lens; the nearest lens is written, {best.text}" == said
    again = read_opensfm(tmp_path / "model", pixel_um=5.0).block
    off = (ideal_tangents(again) - ideal_tangents(block))[block.images.camera[block.image_points.image] == 1]
    inside = np.all(np.abs(block.image_points.xy) < np.array(RATIONAL.half_format_mm), axis=1)
    off = off[inside[block.images.camera[block.image_points.image] == 1]]
    assert 0 < np.hypot(*off.T).max() * 2400 < 3 * best.max_px


@pytest.mark.parametrize(
    ("model", "params", "bound_px"),
    [
        ("FOV", [2000.0, 2000.0, 2000.0, 1500.0, 0.9], 0.6),
        ("EUCM", [1800.0, 1800.0, 2000.0, 1500.0, 0.6, 1.1], 0.5),
        ("DIVISION", [2500.0, 2480.0, 2000.0, 1500.0, -0.1], 0.05),
        ("RAD_TAN_THIN_PRISM_FISHEYE", [1800.0, 1800.0, 2000.0, 1500.0, 0.02, -0.01, 1e-3, 0, 0, 0, 1e-4, 2e-4, 1e-4,
                                        0, -2e-4, 0], 0.5),
    ],
)  # fmt: skip
def test_models_of_other_formulas_are_fitted_and_the_residual_is_true(tmp_path, model, params, bound_px):
    _, oriented = sample(FISHEYE, WIDE)
    write_colmap(oriented, tmp_path / "model", binary=False)
    file = tmp_path / "model" / "cameras.txt"
    other = [line for line in file.read_text().splitlines() if line.startswith("2 ")]
    file.write_text("\n".join([" ".join(["1", model, "4000", "3000", *map(str, params)]), *other]) + "\n")
    with pytest.warns(UserWarning, match=f"of model {model} is read as a .* lens fitted") as told:
        again, _ = read_colmap(tmp_path / "model", pixel_um=5.0)
    largest = float(str(told[0].message).split("at most ")[1].split(" px")[0])
    assert largest < bound_px
    fitted = again.cameras[0]
    assert all(prior.fixed for prior in fitted.lens.values())
    px = np.random.default_rng(1).uniform([0, 0], [4000, 3000], (200, 2))
    theirs = pycolmap.Camera(model=model, width=4000, height=3000, params=params).cam_from_img(px) * [1, -1]
    xy = mm_from_px(px, (4000, 3000), 5e-3)
    ours = lens.bend(*lens.distort(*theirs.T, lens.vector({}, fitted.is_fisheye)).T, lens.vector_of(fitted))
    bar = (xy - np.array(fitted.principal_point_mm)) / fitted.focal_length_mm
    if "b1" in fitted.brown:
        bar[:, 0] *= 1.0 + fitted.brown["b1"].value
    off_px = np.hypot(*(ours - bar).T) * fitted.focal_length_mm / 5e-3
    assert off_px.max() < 1.1 * largest


def test_shear_and_scale_go_to_colmap_without_loss(tmp_path):
    """Metashape's k4, b1, b2: two focal lengths hold b1, image points are freed of b2; k4 has no counterpart."""
    metashape = replace(WIDE, lens={name: Prior(v) for name, v in (("k1", -0.05), ("b1", 2e-3), ("b2", -1e-3))})
    _, oriented = sample(FISHEYE, metashape)
    write_colmap(oriented, tmp_path / "model")
    again, _ = read_colmap(tmp_path / "model", pixel_um=5.0)
    assert np.nanmax(residuals_at_start(again).residual_px) < 1e-6
    with_k4 = replace(WIDE, lens={"k1": Prior(-0.05), "k4": Prior(0.01)})
    said = write_colmap(sample(FISHEYE, with_k4)[1], tmp_path / "other")
    assert any("COLMAP has no words for its lens" in text and "px" in text for text in said)
    assert nearest_lens(with_k4, ("k1", "k2", "p1", "p2", "k3", "q1")).max_px < 0.3


@pytest.mark.parametrize("write", [write_bal, write_bundler])
def test_programs_without_fisheye_refuse_it(tmp_path, write):
    with pytest.raises(InputError, match="is a fisheye"):
        write(sample(FISHEYE, WIDE)[1], tmp_path / "out")
