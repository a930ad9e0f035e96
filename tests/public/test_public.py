"""The Python package as its users see it."""

from __future__ import annotations

import doctest
import subprocess
import sys
from dataclasses import replace
from importlib import import_module
from importlib.util import find_spec

import numpy as np
import pytest

import aerotri
from aerotri import InputError
from aerotri.functional_model.rotation import rotation_from_angles

MODULES = (
    "adjustment",
    "block_settings",
    "blocks",
    "changes",
    "comparing",
    "converting",
    "covariance",
    "dem",
    "drawing",
    "editing",
    "geometry",
    "ideal",
    "image_errors",
    "models",
    "parameters",
    "picket_interval",
    "predict",
    "running",
    "simulating",
    "surface_comparison",
    "surfaces",
    "table",
    "tying",
    "volume",
)
HEAVY = ("numba", "scipy", "pyarrow", "matplotlib", "cv2", "pyproj", "rasterio", "pydantic")


def test_import_is_light():
    """`import aerotri` loads none of the heavy packages; they come when they are used."""
    code = f"import aerotri, sys; print([name for name in {HEAVY} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_functions_keep_their_names():
    """Packages of the same names, which do the work, are imported by their paths and hide no function."""
    code = (
        "import aerotri, aerotri.crosscheck, aerotri.tie_points.given, aerotri.terrain.dtm, importlib\n"
        "importlib.import_module('aerotri.crosscheck.start')\n"
        "from aerotri.tie_points import tracks\n"
        "from aerotri.volume import compute\n"
        "names = 'crosscheck', 'tie_points', 'simulate', 'terrain', 'volume'\n"
        "print([callable(getattr(aerotri, name)) for name in names], tracks.__name__)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[True, True, True, True, True] aerotri.tie_points.tracks"


def test_every_name_is_there():
    assert set(aerotri.__all__) <= set(dir(aerotri))
    for name in aerotri.__all__:
        assert getattr(aerotri, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        aerotri.nothing  # noqa: B018


@pytest.mark.parametrize("module", MODULES)
def test_examples(module):
    found = doctest.testmod(import_module(f"aerotri.public.{module}"), optionflags=doctest.ELLIPSIS)
    assert found.failed == 0
    assert found.attempted > 0


def test_every_public_function_has_an_example():
    """A doctest each; what needs photographs or takes long is shown in the documentation instead."""
    elsewhere = {
        "InputError",
        "AdjustmentFailedError",
        "TasksFailedError",
        "Block",
        "read",
        "crosscheck",
        "__version__",
    }
    for name in set(aerotri.__all__) - elsewhere:
        assert ">>>" in (getattr(aerotri, name).__doc__ or ""), name


def test_numbers_of_a_result(result, flight):
    assert result.status == "converged"
    assert result.verdict == "accepted"
    assert 0.9 < result.sigma0 < 1.15
    assert len(result.images) == len(flight.block.images)
    assert result.rays["status"].tolist().count("used") == len(flight.block.image_points)
    z = result.check["dZ"] / np.hypot(result.check["sZ"], 0.015)
    assert np.abs(z).max() < 4.0
    assert result.block.name == "example"


def test_tables_are_those_of_the_files(result, tmp_path):
    import pyarrow.csv
    import pyarrow.parquet

    folder = result.save(tmp_path / "result", plots=False)
    for name, table in (("images", result.images), ("points", result.points), ("parameters", result.parameters)):
        written = pyarrow.csv.read_csv(folder / f"{name}.csv")
        assert tuple(written.column_names) == table.columns
        assert written.num_rows == len(table)
    rays = pyarrow.parquet.read_table(folder / "residuals.parquet")
    assert tuple(rays.column_names) == result.rays.columns


def test_save_and_open(result, tmp_path):
    again = aerotri.open_result(result.save(tmp_path / "result", plots=False))
    np.testing.assert_allclose(again.points["sZ"], result.points["sZ"], rtol=1e-8)
    assert again.verdict == result.verdict
    with pytest.raises(InputError, match="holds no adjustment"):
        aerotri.open_result(tmp_path)


def test_covariance_agrees_with_the_tables(result):
    """σ of single unknowns from the joint covariance; the matrix is symmetric and has no negative eigenvalue."""
    point, photograph = str(result.points["point"][20]), str(result.images["image"][3])
    found = result.covariance([point, photograph, "brown.K1"])
    row, image = result.points.row(point), result.images.row(photograph)
    np.testing.assert_allclose(found.sigma[:3], [row["sX"], row["sY"], row["sZ"]], rtol=1e-7)
    np.testing.assert_allclose(found.sigma[3:6], [image["sX0"], image["sY0"], image["sZ0"]], rtol=1e-7)
    angles = np.radians([image["s_omega"], image["s_phi"], image["s_kappa"]])
    np.testing.assert_allclose(found.sigma[6:9], angles, rtol=1e-7)
    assert found.sigma[9] == pytest.approx(result.parameters.row("brown.K1")["sigma"], rel=1e-7)
    scaled = found.correlation
    np.testing.assert_allclose(scaled, scaled.T, atol=1e-12)
    assert np.linalg.eigvalsh(scaled).min() > -1e-9


def test_covariance_of_two_points_holds_in_simulations():
    """A height difference over its σ from the joint covariance, against the truth of 24 simulated flights."""
    z = []
    for seed in range(1, 25):
        flight = aerotri.simulate(aerotri.example_flight(), seed=seed)
        one = aerotri.adjust(flight.block)
        rows = [flight.block.points.tolist().index(name) for name in ("C01", "C06")]
        error = np.diff([one.points.row(str(flight.block.points[k]))["Z"] - flight.truth.points[k, 2] for k in rows])[0]
        q = one.covariance(["C01:Z", "C06:Z"]).matrix
        z.append(error / np.sqrt(q[0, 0] + q[1, 1] - 2.0 * q[0, 1]))
    # χ² of 24 degrees of freedom, 99.9 % band
    assert 7.5 < np.sum(np.square(z)) < 53.0


def test_covariance_names(result):
    with pytest.raises(InputError, match="'nobody' is no point, photograph or parameter"):
        result.covariance(["nobody"])
    assert result.covariance(["C01:Z"]).names == ("C01:Z",)


def test_settings_are_checked(flight):
    with pytest.raises(InputError, match="robust"):
        aerotri.adjust(flight.block, robust="always")
    with pytest.raises(InputError, match="unknown parameter family"):
        aerotri.adjust(flight.block, parameters="magic:1")


def test_a_failed_adjustment_is_an_error(flight):
    from dataclasses import replace

    images = replace(flight.block.images, centre=np.full((12, 3), np.nan), angles=np.full((12, 3), np.nan))
    with pytest.raises((InputError, aerotri.AdjustmentFailedError)):
        aerotri.adjust(replace(flight.block, images=images, control=replace(
            flight.block.control, xyz=np.full_like(flight.block.control.xyz, np.nan))))  # fmt: skip


def test_progress_is_told(flight):
    told = []
    aerotri.adjust(flight.block, progress=lambda stage, share: told.append(stage))
    assert any(stage.startswith("iteration 1") for stage in told)


def test_notebook_representations(result):
    for shown in (result, result.points, result.covariance(["C01"]), result.groups):
        assert "<" in shown._repr_html_()
        assert "<script" not in shown._repr_html_()
    assert "accepted" in repr(result)
    assert "rows of" in repr(result.points)
    assert result.summary().startswith("verdict: accepted")


def test_names_stay_text_in_a_notebook():
    import pyarrow as pa

    table = aerotri.Table("<b>", pa.table({"point": ["<script>alert(1)</script>"]}))
    assert "<script>" not in table._repr_html_()


def test_plots_are_figures(result):
    from matplotlib.figure import Figure

    for draw in ("systematic_errors", "averaged_residuals", "block_plan", "residuals", "correlations"):
        assert isinstance(getattr(result.plot, draw)(), Figure)


@pytest.mark.parametrize(("package", "method"), [("pandas", "to_pandas"), ("geopandas", "to_geopandas")])
def test_optional_packages(result, package, method):
    """The table where the package is installed; how to install it where it is not."""
    if find_spec(package) is None:
        with pytest.raises(InputError, match=f"pip install {package}"):
            getattr(result.points, method)()
    else:
        assert len(getattr(result.points, method)()) == len(result.points)


def test_deformation_of_a_pair(result):
    """dZ of a pair is of the size that its lens errors make: exact intersection of displaced image points."""
    names = result.images["image"][:2].tolist()
    grid = aerotri.deform(result, pair=tuple(names), spacing=10.0)
    assert grid.dZ.shape == (len(grid.y), len(grid.x))
    assert np.isfinite(grid.dZ).any()
    assert grid.summary["pair"] == names
    with pytest.raises(InputError, match="choose one of them"):
        aerotri.deform(result, pair=tuple(names), end_lap=0.7)


def test_a_result_in_a_crs_has_its_covariance_there():
    """In a CRS the joint covariance is that of the tables, too: axes of the map, not of the local frame."""
    plan = aerotri.example_flight()
    plan["crs"] = "EPSG:32632"
    plan["flight"]["centre_m"] = [500_000.0, 5_400_000.0]
    try:
        block = aerotri.simulate(plan, seed=1).block
    except InputError:
        from dataclasses import replace

        plan.pop("crs")
        block = replace(aerotri.simulate(plan, seed=1).block, crs="EPSG:32632")
    result = aerotri.adjust(block)
    photograph = str(result.images["image"][5])
    image = result.images.row(photograph)
    found = result.covariance([photograph, "C03"])
    np.testing.assert_allclose(found.sigma[:3], [image["sX0"], image["sY0"], image["sZ0"]], rtol=1e-6)
    np.testing.assert_allclose(found.sigma[3:6], np.radians([image[f"s_{a}"] for a in ("omega", "phi", "kappa")]),
                               rtol=1e-6)  # fmt: skip
    rotation = rotation_from_angles(result.adjusted.images.angles[5:6], block.rotation)[0]
    assert np.allclose(rotation @ rotation.T, np.eye(3))


def test_changes_between_results(result, flight, tmp_path):
    """Second − first of the tables, and nothing between a result and itself."""
    other = aerotri.adjust(flight.block, parameters="brown:K1")
    found = aerotri.changes(result, other)
    name = str(result.images["image"][4])
    row, one, two = found.images.row(name), result.images.row(name), other.images.row(name)
    assert row["dZ0"] == pytest.approx(two["Z0"] - one["Z0"], abs=1e-9)
    assert row["dkappa"] == pytest.approx(two["kappa"] - one["kappa"], abs=1e-9)
    assert found.summary(2)["parameters"]
    assert "Photographs that changed most" in found._repr_html_()
    assert not aerotri.changes(other, other).points["largest"].any()
    with pytest.raises(InputError, match=r"holds no adjustment\.json"):
        aerotri.changes(result, tmp_path)


def test_prediction_of_a_volume_is_told_by_the_best_way():
    """The simulated flight where there is one; the same number over the area."""
    theory = aerotri.predict.volume(1500.0, 3600.0, 1800.0, 1800.0)
    both = aerotri.predict.volume(1500.0, 3600.0, 1800.0, 1800.0, simulate=True)
    assert theory.sigma_mean_height == theory.record.joint
    assert both.sigma_mean_height == both.simulated
    # pointing at control is in the simulated flight alone, and counts most where little is bridged
    assert 1.0 < both.simulated / theory.record.joint < 2.5
    assert both.sigma_volume == pytest.approx(both.simulated * 3600.0 * 1800.0)
    assert both.table["by"].tolist()[-1] == "simulated flight, adjusted"
    for shown in (theory, aerotri.predict.attitude(1.0, 5.0)):
        assert "<table>" in shown._repr_html_()


def test_image_errors_are_parameters_times_patterns(flight):
    """d = Σ pattern · value, at the nodes of the field and anywhere else."""
    result = aerotri.adjust(flight.block, parameters="bluh:1-3+9", explain=False)
    field = result.image_errors().field
    xy = np.column_stack([field.x.ravel(), field.y.ravel()])
    names, patterns = aerotri.parameters.patterns("bluh:1-3+9", result.block.cameras[0], xy)
    value = [result.parameters.row(name)["value"] for name in names]
    assert np.allclose(patterns @ value, field.d.reshape(-1, 2), atol=1e-12)
    assert np.allclose(result.image_errors_at(xy), field.d.reshape(-1, 2), atol=1e-12)
    six = aerotri.parameters.orientation_patterns(xy, result.block.cameras[0].focal_length_mm).reshape(-1, 6)
    less = result.image_errors(without_orientation=True).field.d.ravel()
    assert np.allclose(less + six @ np.linalg.lstsq(six, field.d.ravel() - less)[0], field.d.ravel(), atol=1e-9)
    assert result.averaged_residuals().count.sum() == len(result.rays)
    with pytest.raises(InputError, match="'brown' is no function"):
        aerotri.parameters.patterns("brown:K1", result.block.cameras[0], xy)


def test_what_was_set_aside(flight):
    """A photograph whose image points are all gone, and the points that nobody else shows."""
    block, rays = flight.block, flight.block.image_points
    keep = rays.image != 0
    parts = {name: getattr(rays, name)[keep] for name in ("image", "point", "xy", "sigma")}
    result = aerotri.adjust(replace(block, image_points=aerotri.observations.ImagePoints(**parts)), explain=False)
    table = result.set_aside
    assert table.to_arrow().slice(0, 1).to_pylist() == [
        {"kind": "photograph", "name": str(block.images.names[0]), "reason": "no image points"}
    ]
    assert (table["kind"] == "point").sum() == np.isnan(result.adjusted.points.xyz[:, 0]).sum()
    assert aerotri.adjust(block, explain=False).set_aside.columns == ("kind", "name", "reason")
