"""The independent model shares no formula with ours, and yet says the same."""

import ast
from pathlib import Path

import numpy as np
import pytest

import aerotri
from aerotri.crosscheck import paper_patterns, paper_rays
from aerotri.functional_model.additional_parameters import bluh, brown, lens, parameter_set, ultracam_d
from aerotri.functional_model.rotation import angles_from_rotation, rotation_from_angles
from aerotri.observations import Camera, Prior

SOURCE = Path(aerotri.__file__).parent
INDEPENDENT = ("paper_patterns", "paper_rays", "paper_block", "paper_unknowns", "paper_system", "ceres_solver", "start")
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


def ultracam(flight_axis):
    size = (11500, 7500) if flight_axis[1] == "y" else (7500, 11500)
    return Camera("ucd", "ultracam_d", size, 9.0, {"focal_length_mm": Prior(101.4)}, flight_axis=flight_axis)


def positions(camera, rng, count=400):
    return (rng.uniform(-1, 1, (count, 2)) * camera.half_format_mm).T


@pytest.mark.parametrize("flight_axis", ["+x", "-x", "+y", "-y"])
def test_linear_patterns_are_the_same(flight_axis):
    camera, rng = ultracam(flight_axis), np.random.default_rng(1)
    x, y = positions(camera, rng)
    for module, formula in (
        (bluh, paper_patterns.bluh(x, y, camera.r_max_mm)),
        (ultracam_d, paper_patterns.ultracam_d(x, y, (2 * camera.half_format_mm[0], 2 * camera.half_format_mm[1]),
                                               flight_axis)),
    ):  # fmt: skip
        ours = parameter_set(module.FAMILY.name, module.FAMILY.items, camera).basis(x, y)
        np.testing.assert_allclose(formula, ours, rtol=1e-12, atol=1e-12 * np.abs(ours).max())


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
