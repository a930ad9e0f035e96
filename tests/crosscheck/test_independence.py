"""The independent model shares no formula with ours, and yet says the same."""

import ast
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import aerotri
from aerotri.crosscheck import paper_dmc, paper_patterns, paper_rays
from aerotri.crosscheck.paper_families import LINEAR
from aerotri.crosscheck.pattern_check import pattern_errors
from aerotri.functional_model.additional_parameters import brown, lens, parameter_set
from aerotri.functional_model.additional_parameters.registry import LINEAR_FAMILIES
from aerotri.functional_model.rotation import angles_from_rotation, rotation_from_angles
from aerotri.observations import Prior
from family_cameras import camera_for, sets_of

SOURCE = Path(aerotri.__file__).parent
INDEPENDENT = (
    "paper_patterns", "paper_dmc", "paper_polynomials", "paper_families", "paper_rays", "paper_block", "paper_unknowns",
    "paper_system", "ceres_solver", "start",
)  # fmt: skip
FORBIDDEN = (
    "aerotri.functional_model", "aerotri.adjustment", "aerotri.results", "aerotri.statistics", "aerotri.strategies",
    "aerotri.diagnosis", "aerotri.image_errors",
)  # fmt: skip


def imported(path: Path) -> set[str]:
    """Dotted names of everything a module imports."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path.name} has a relative import"
            names |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    return names


def modules_behind(path: Path, seen: set[Path]) -> None:
    """The module and all modules of this package that it imports, directly or not."""
    seen.add(path)
    for name in imported(path):
        parts = name.split(".")[1:] if name.startswith("aerotri.") else []
        for file in (SOURCE.joinpath(*parts).with_suffix(".py"), SOURCE.joinpath(*parts, "__init__.py")):
            # the package's own __init__ offers the whole cross-check; its modules do not read it
            if parts and parts != ["crosscheck"] and file.is_file() and file not in seen:
                modules_behind(file, seen)


@pytest.mark.parametrize("module", INDEPENDENT)
def test_imports_nothing_of_the_model_it_checks(module):
    seen: set[Path] = set()
    modules_behind(SOURCE / "crosscheck" / f"{module}.py", seen)
    for path in seen:
        wrong = [name for name in imported(path) if name.startswith(FORBIDDEN)]
        assert not wrong, f"{path} imports {wrong}"


@pytest.mark.parametrize("flight_axis", ["+x", "-x", "+y", "-y"])
@pytest.mark.parametrize("family", LINEAR)
def test_linear_patterns_are_the_same(family, flight_axis):
    camera = camera_for(family, flight_axis)
    for names in sets_of(family):
        errors = pattern_errors(camera, names)
        assert set(errors) == set(names)
        assert max(errors.values()) < 1e-12


def test_every_family_but_the_random_field_and_the_change_of_interior_has_a_second_formula():
    assert set(LINEAR_FAMILIES) - set(LINEAR) == {"collocation", "interior"}
    for family in LINEAR:
        assert all(LINEAR[family].knows(item) for item in LINEAR_FAMILIES[family].items)
        assert not LINEAR[family].knows("nonsense")


def test_heads_of_the_dmc_on_their_seams():
    """On an axis of the image a point belongs to the head to its right, and above it."""
    camera = camera_for("dmc")
    x, y = np.array([0.0, 0.0, 20.0, -20.0, 0.0]), np.array([20.0, -20.0, 0.0, 0.0, 0.0])
    ours = parameter_set("dmc", LINEAR_FAMILIES["dmc"].all_items, camera)
    np.testing.assert_allclose(paper_dmc.dmc(x, y, "+y", ours.items), ours.basis(x, y), rtol=1e-12, atol=1e-10)


def test_heads_of_a_dmc_with_other_principal_distance_and_format():
    """As calibrated: the formulas take the camera's own."""
    camera = camera_for("dmc")
    interior = {**camera.interior, "focal_length_mm": Prior(119.4)}
    other = replace(camera, interior=interior, size_px=(13000, 7900))
    for names in sets_of("dmc"):
        assert max(pattern_errors(other, names).values()) < 1e-12


def test_the_butterfly_closes_the_seams():
    """Turns of a head as models.md prints them, to its digits; signs of the first and third by another rotation."""
    image = paper_dmc.Composed()
    np.testing.assert_allclose(np.abs(paper_dmc.stitching(image)), [0.1887, 0.2704, 0.0264], atol=5e-5)
    up, out, zero = np.linspace(0.0, image.half_along, 41), np.linspace(0.0, image.half_across, 41), np.zeros(41)
    gap_across, _ = paper_dmc.stitched(zero, up, (zero + 1.0, zero + 1.0), image)
    _, gap_along = paper_dmc.stitched(out, zero, (zero + 1.0, zero + 1.0), image)
    assert np.sqrt(np.mean(np.concatenate([gap_across, gap_along]) ** 2)) == pytest.approx(0.87, abs=0.01)


def test_patterns_at_the_image_centre_are_zero():
    assert not paper_patterns.bluh(np.zeros(1), np.zeros(1), 61.8).any()


def test_brown_and_lens_are_the_same():
    rng = np.random.default_rng(2)
    x, y = rng.uniform(-20, 20, (2, 50))
    values = rng.normal(size=7) * [1e-5, 1e-8, 1e-11, 1e-5, 1e-5, 1e-4, 1e-4]
    np.testing.assert_allclose(np.stack(paper_patterns.brown(x, y, *values), 1), brown.image_error(x, y, values))
    values = np.abs(rng.normal(size=13)) * 0.1
    np.testing.assert_allclose(
        np.stack(paper_patterns.forward_lens(x / 30, y / 30, *values), 1),
        lens.bend(x / 30, y / 30, values),
    )
    ideal = np.stack(paper_patterns.equidistant(x / 30, y / 30, np.full(50, -1.0)), 1)
    np.testing.assert_allclose(ideal, lens.distort(x / 30, y / 30, lens.vector({}, True)))


@pytest.mark.parametrize("order", ["omega-phi-kappa", "phi-omega-kappa"])
def test_rotations_are_the_same(order):
    angles = np.random.default_rng(3).uniform(-1.5, 1.5, (20, 3))
    rotation = paper_rays.rotation_matrix(angles, order)
    np.testing.assert_allclose(rotation, rotation_from_angles(angles, order), atol=1e-15)
    np.testing.assert_allclose(paper_rays.angles_of(rotation, order), angles_from_rotation(rotation, order), atol=1e-13)


@pytest.mark.parametrize("order", ["omega-phi-kappa", "phi-omega-kappa"])
def test_complex_step_against_differences(order):
    rng = np.random.default_rng(4)
    pose = np.column_stack([rng.normal(size=(5, 2)), np.full(5, 100.0), 0.2 * rng.normal(size=(5, 3))])
    mount = rotation_from_angles(rng.normal(size=(5, 3)) * 0.1)
    point, xy = np.column_stack([30 * rng.normal(size=(5, 2)), np.zeros(5)]), 10 * rng.normal(size=(5, 2))
    elements = np.zeros((5, 24))
    elements[:, :3] = 35.0, 0.1, -0.2
    elements[:, 3:-1] = 1e-6 * rng.normal(size=20)
    elements[:2, -1] = 1.0  # the first two are fisheyes
    active = np.arange(23)
    _, by_pose, by_elements = paper_rays.linearise(pose, mount, point, elements, xy, order, active)
    for column in range(6):
        step = np.zeros(6)
        step[column] = 1e-5
        ahead, behind = (
            np.stack(paper_rays.predict(pose + s * step, mount, point, elements, xy, order), 1) for s in (1, -1)
        )
        np.testing.assert_allclose(by_pose[:, :, column], (ahead - behind) / 2e-5, rtol=1e-6, atol=1e-7)
    for column in range(23):
        step = np.zeros(24)
        step[column] = 1e-6
        ahead, behind = (
            np.stack(paper_rays.predict(pose, mount, point, elements + s * step, xy, order), 1) for s in (1, -1)
        )
        size = np.abs(by_elements[:, :, column]).max()
        np.testing.assert_allclose(by_elements[:, :, column], (ahead - behind) / 2e-6, rtol=1e-5, atol=1e-6 * size)
