"""Interior orientation of scans: exact and noisy recovery, partials, σ, and marks that do not determine it."""

import numpy as np
import pytest

from aerotri.conventions import InputError
from aerotri.functional_model import interior
from aerotri.functional_model.interior import (
    MARKS_NEEDED,
    PARAMETER_NAMES,
    fit_fiducials,
    measurement_sigma,
    mm_from_scan,
    transformation_sigma,
)

KINDS = tuple(MARKS_NEEDED)
CORNERS = np.array([[-106.0, -106.0], [106.0, -106.0], [106.0, 106.0], [-106.0, 106.0]])
EIGHT = np.concatenate([CORNERS, [[0.0, 112.0], [0.0, -112.0], [112.0, 0.0], [-112.0, 0.0]]])
PIXEL_MM = 0.014


def scan_of(xy_mm, kind):
    """Pixels of a scan whose inverse is exactly of the kind: turned, sheared and tilted as it allows."""
    matrix = {
        "similarity": [[70.1, 2.2, 8200.0], [2.2, -70.1, 8300.0], [0, 0, 1]],
        "affine": [[70.1, 2.2, 8200.0], [2.5, -70.6, 8300.0], [0, 0, 1]],
        "projective": [[70.1, 2.2, 8200.0], [2.5, -70.6, 8300.0], [2e-6, -3e-6, 1]],
    }[kind]
    homogeneous = np.column_stack([xy_mm, np.ones(len(xy_mm))]) @ np.array(matrix).T
    return homogeneous[:, :2] / homogeneous[:, 2:]


@pytest.mark.parametrize("kind", KINDS)
def test_exact_recovery(kind):
    inside = np.random.default_rng(1).uniform(-100, 100, (30, 2))
    fit = fit_fiducials(scan_of(EIGHT, kind), EIGHT, kind)
    np.testing.assert_allclose(mm_from_scan(fit, scan_of(inside, kind)), inside, atol=1e-9)
    assert np.abs(fit.residuals).max() < 1e-9
    assert fit.redundancy == 16 - len(PARAMETER_NAMES[kind])
    assert fit.redundancy_numbers.sum() == pytest.approx(fit.redundancy)
    assert fit.pixel_mm == pytest.approx(1.0 / 70.35, rel=5e-3)


def test_known_numbers_of_a_scan_without_distortion():
    """Mark by mark: 14 µm pixels, y up against the rows, the image centre at (8200, 8300)."""
    column_row = EIGHT / [PIXEL_MM, -PIXEL_MM] + [8200.0, 8300.0]
    for kind in KINDS:
        fit = fit_fiducials(column_row, EIGHT, kind)
        placed = mm_from_scan(fit, np.array([[8200.0, 8300.0], [8300.0, 8300.0], [8200.0, 8350.0]]))
        np.testing.assert_allclose(placed, [[0.0, 0.0], [1.4, 0.0], [0.0, -0.7]], atol=1e-9)
        assert fit.pixel_mm == pytest.approx(PIXEL_MM)


@pytest.mark.parametrize("kind", KINDS)
def test_partials_against_differences(kind):
    rng = np.random.default_rng(2)
    parameters = np.array([1.0, 60.0, 2.0, -3.0, 1.5, 61.0, 0.02, -0.03])[: len(PARAMETER_NAMES[kind])]
    position = rng.uniform(-1.5, 1.5, (6, 2))
    design = interior._design(kind, parameters, position)
    for j in range(len(parameters)):
        step = 1e-5 * np.eye(len(parameters))[j]
        numeric = interior._transform(kind, parameters + step, position)
        numeric = (numeric - interior._transform(kind, parameters - step, position)) / 2e-5
        np.testing.assert_allclose(design[:, j], numeric.ravel(), atol=1e-6)
    by_position = interior._by_position(kind, parameters, position)
    for j in range(2):
        step = 1e-5 * np.eye(2)[j]
        numeric = interior._transform(kind, parameters, position + step)
        numeric = (numeric - interior._transform(kind, parameters, position - step)) / 2e-5
        np.testing.assert_allclose(by_position[:, :, j], numeric, atol=1e-6)


@pytest.mark.parametrize("kind", KINDS)
def test_normalised_errors_of_noisy_fits(kind):
    """Errors of parameters, of transformed points and of residuals, each divided by its σ, are N(0, 1)."""
    rng = np.random.default_rng(3)
    sigma_px, inside = 0.4, np.array([[30.0, -70.0], [-90.0, 85.0]])
    exact = fit_fiducials(scan_of(EIGHT, kind), EIGHT, kind)
    where = scan_of(inside, kind)
    errors, points, normed_residuals, variances = [], [], [], []
    for _ in range(400):
        noisy = scan_of(EIGHT, kind) + rng.normal(0, sigma_px, EIGHT.shape)
        fit = fit_fiducials(noisy, EIGHT, kind)
        sigma_mm = sigma_px * exact.pixel_mm
        # the reduction of pixels takes shift and scale from the marks themselves: test a parameter free of both
        k = fit.names.index("c2" if kind == "projective" else "b1")
        moved = mm_from_scan(fit, where) - inside
        points.append(moved / (transformation_sigma(fit, where) / fit.sigma0_mm * sigma_mm))
        errors.append((fit.parameters - exact.parameters)[k] / (np.sqrt(fit.cofactor[k, k]) * sigma_mm))
        normed_residuals.append(fit.residuals / (sigma_mm * np.sqrt(fit.redundancy_numbers)))
        variances.append((fit.sigma0_mm / sigma_mm) ** 2)
    for sample in (np.ravel(points), np.ravel(normed_residuals)):
        assert abs(sample.mean()) < 0.1
        assert sample.std() == pytest.approx(1.0, abs=0.07)
    assert np.std(errors) == pytest.approx(1.0, abs=0.12)
    assert np.mean(variances) == pytest.approx(1.0, abs=0.06)


def test_a_wrong_mark_stands_out():
    column_row = scan_of(EIGHT, "affine")
    column_row[5, 0] += 8.0
    fit = fit_fiducials(column_row, EIGHT, "affine")
    worst = np.unravel_index(np.argmax(np.abs(fit.residuals)), fit.residuals.shape)
    assert worst == (5, 0)
    assert -fit.residuals[worst] / fit.redundancy_numbers[worst] == pytest.approx(-8.0 / 70.2, rel=0.05)


def test_sigma_of_measurement_follows_the_turn_of_the_scan():
    """A scan turned by 90°: σ of the column becomes σ of y."""
    column_row = EIGHT[:, ::-1] / PIXEL_MM + [8200.0, 8300.0]
    fit = fit_fiducials(column_row, EIGHT, "affine")
    sigma = measurement_sigma(fit, column_row[:2], np.array([0.5, 0.1]))
    np.testing.assert_allclose(sigma, np.tile([0.1 * PIXEL_MM, 0.5 * PIXEL_MM], (2, 1)), rtol=1e-9)


def test_four_marks_and_eight_parameters_leave_no_sigma():
    fit = fit_fiducials(scan_of(CORNERS, "projective"), CORNERS, "projective")
    assert fit.redundancy == 0
    assert np.isnan(fit.sigma0_mm)
    assert np.isnan(fit.sigma).all()


NEARLY_ON_A_LINE = np.array([[-110.0, 0.0], [-40.0, 0.3], [50.0, -0.2], [110.0, 0.1]])


@pytest.mark.parametrize(
    ("marks", "kind"),
    [
        (CORNERS[:1], "similarity"),
        (CORNERS[:2], "affine"),
        (CORNERS[:3], "projective"),
        (np.tile(CORNERS[0], (4, 1)), "similarity"),
        (NEARLY_ON_A_LINE, "affine"),
        (NEARLY_ON_A_LINE[:, ::-1], "affine"),
        (np.array([[-110.0, -110.0], [110.0, -110.0], [0.0, -110.0], [-110.0, 110.0]]), "projective"),
        (np.array([[-110.0, -110.0], [110.0, -110.0], [0.0, np.nan], [-110.0, 110.0]]), "affine"),
    ],
)
def test_marks_that_do_not_determine_it(marks, kind):
    column_row = marks / [PIXEL_MM, -PIXEL_MM] + [8200.0, 8300.0]
    with pytest.raises(InputError, match="photograph 0815") as caught:
        fit_fiducials(column_row, marks, kind, "0815")
    assert caught.value.remedy


def test_unknown_kind():
    with pytest.raises(InputError, match="polynomial"):
        fit_fiducials(CORNERS, CORNERS, "polynomial")
