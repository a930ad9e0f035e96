"""What write_result writes: keys and columns to the letter, single values, unknown values, hostile names."""

import csv
import json
from dataclasses import replace

import numpy as np
import pyarrow.parquet as pq
import pytest

from aerotri.formats.results.adjustment import adjustment_json, outcome_json, write_result
from aerotri.results.adjusted_block import Outcome
from synthetic import make_adjusted_block

# lists of the design's "What adjust writes"
COLUMNS = {
    "images.csv": "image, camera, strip, X0, Y0, Z0, omega, phi, kappa, sX0, sY0, sZ0, s_omega, s_phi, s_kappa, rays, "
    "status, reason",
    "points.csv": "point, X, Y, Z, sX, sY, sZ, rays, max_abs_w, status, reason",
    "parameters.csv": "name, group, mark, value, sigma, t, max_correlation, max_correlation_with, total_correlation, "
    "status, reason",
    "control.csv": "point, dX, dY, dZ, sX, sY, sZ, rX, rY, rZ, wX, wY, wZ, rays",
    "check.csv": "point, dX, dY, dZ, sX, sY, sZ, rX, rY, rZ, wX, wY, wZ, rays",
}
RESIDUALS = "image, point, x, y, vx, vy, rx, ry, wx, wy, weight, status"
KEYS = (
    "aerotri, computed, project, crs, crs_name, height_system, block, status, verdict, reasons, good_for, purpose, "
    "message, iterations, "
    "sigma0, sigma0_um, vtpv, observations, "
    "unknowns, conditions, redundancy, groups, check_points, control_points, additional_parameters, cameras, blunders, "
    "deviations, model_part, gnss_errors, photograph_fields, ray_correlation, precision, settings, notes, warnings, "
    "timings_s"
)
ENTRY_KEYS = {
    "groups": "name, count, sigma_apriori, rms, redundancy, sigma_aposteriori",
    "additional_parameters": "name, group, value, sigma, t, max_correlation, max_correlation_with, total_correlation, "
    "status, reason",
    "cameras": "name, focal_length_mm, s_focal_length_mm, x0_mm, s_x0_mm, y0_mm, s_y0_mm",
    "blunders": "image, point, w, estimated_mm, action",
}


def words(text):
    return text.split(", ")


def rows_of(path):
    with open(path, newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


@pytest.fixture(scope="module")
def adjusted():
    return make_adjusted_block(2, 5, 80, n_control=8, n_check=6)


@pytest.fixture(scope="module")
def folder(adjusted, tmp_path_factory):
    folder = tmp_path_factory.mktemp("result")
    write_result(adjusted, folder)
    return folder


def test_files(folder):
    names = {*COLUMNS, "residuals.parquet", "adjustment.json"}
    assert {path.name for path in folder.iterdir()} == names


@pytest.mark.parametrize("name", COLUMNS)
def test_columns(folder, name):
    header = (folder / name).read_text(encoding="utf-8").splitlines()[0].split(",")
    ours = [column for column in header if not column.startswith("x_")]
    assert ours == words(COLUMNS[name])
    assert header[: len(ours)] == ours


def test_json_keys(folder):
    content = json.loads((folder / "adjustment.json").read_text(encoding="utf-8"))
    assert list(content) == words(KEYS)
    for key, entry_keys in ENTRY_KEYS.items():
        assert all(list(entry) == words(entry_keys) for entry in content[key])
        assert content[key]
    for key in ("check_points", "control_points"):
        assert list(content[key]) == ["count", "rms", "mean", "max", "points"]
        assert list(content[key]["points"][0]) == words("point, dX, dY, dZ, sX, sY, sZ")
        for statistic in ("rms", "mean", "max"):
            assert list(content[key][statistic]) == ["X", "Y", "Z"]
    assert list(content["timings_s"]) == words("read, start_values, solve, statistics, plots, write")
    assert content["timings_s"]["write"] > 0.0
    assert content["timings_s"]["solve"] == 0.8


def test_image_rows(adjusted, folder):
    rows = rows_of(folder / "images.csv")
    assert [row["image"] for row in rows] == adjusted.block.images.names.tolist()
    row = rows[6]
    assert (row["camera"], row["strip"]) == ("ucd2", "strip 2")
    assert int(row["rays"]) == adjusted.images.rays[6]
    assert float(row["Y0"]) == adjusted.images.centre[6, 1]
    assert float(row["phi"]) == np.degrees(adjusted.images.angles[6, 1])
    assert float(row["sZ0"]) == pytest.approx(0.06)
    assert float(row["s_kappa"]) == pytest.approx(0.0006)
    assert float(row["x_s_kappa_mgon"]) == pytest.approx(0.0006 / 0.9 * 1000)


def test_point_rows(adjusted, folder):
    rows = rows_of(folder / "points.csv")
    assert rows[33]["point"] == "1034"
    assert float(rows[33]["Z"]) == adjusted.points.xyz[33, 2]
    assert float(rows[33]["sX"]) == pytest.approx(adjusted.points.sigma[33, 0])
    assert float(rows[33]["max_abs_w"]) == adjusted.points.max_abs_w[33]


def test_residuals(adjusted, folder):
    table = pq.read_table(folder / "residuals.parquet")
    ours = [column for column in table.column_names if not column.startswith("x_")]
    assert ours == words(RESIDUALS) == table.column_names[: len(ours)]
    columns = table.to_pydict()
    points, rays = adjusted.block.image_points, adjusted.rays
    k = int(np.flatnonzero(rays.status == 0)[17])
    assert columns["image"][k] == adjusted.block.images.names[points.image[k]]
    assert columns["point"][k] == adjusted.block.points[points.point[k]]
    for name, values in (("x", points.xy), ("v", rays.v), ("r", rays.r), ("w", rays.w)):
        names = ("x", "y") if name == "x" else (f"{name}x", f"{name}y")
        assert [columns[n][k] for n in names] == values[k].tolist()
    assert columns["weight"][k] == 1.0
    assert columns["status"][k] == "used"


def test_rays_left_out_have_no_residual(adjusted, tmp_path):
    status = adjusted.rays.status.copy()
    status[3], status[5] = 2, 4
    # whatever stands in the record for such a ray must not get out
    left_out = replace(adjusted, rays=replace(adjusted.rays, status=status))
    write_result(left_out, tmp_path)
    columns = pq.read_table(tmp_path / "residuals.parquet").to_pydict()
    assert [columns["status"][i] for i in (3, 5)] == ["off", "not finite"]
    for name in ("vx", "vy", "rx", "ry", "wx", "wy"):
        assert columns[name][3] is None
        assert columns[name][5] is None
        assert columns[name][4] is not None
    assert columns["x"][3] == adjusted.block.image_points.xy[3, 0]


def test_parameters(adjusted, folder):
    rows = rows_of(folder / "parameters.csv")
    p = adjusted.parameters
    assert [row["name"] for row in rows] == p.names.tolist()
    assert rows[0]["x_kind"] == "interior"
    assert (rows[4]["name"], rows[4]["group"], rows[4]["mark"], rows[4]["status"]) == (
        "bluh.4",
        "ucd2",
        "P",
        "estimated",
    )
    assert float(rows[4]["value"]) == p.value[4]
    assert float(rows[4]["t"]) == pytest.approx(abs(p.value[4]) / p.sigma[4])
    entries = adjustment_json(adjusted)["additional_parameters"]
    assert [entry["name"] for entry in entries] == p.names[1:].tolist()
    assert entries[3]["max_correlation_with"] == p.max_correlation_with[4]
    assert entries[3]["total_correlation"] == p.total_correlation[4]


def test_ground_points_by_hand(adjusted):
    """Two check points, one without height: statistics over what is given, max without sign."""
    check = replace(
        adjusted.check, point=np.array([4, 9]), difference=np.array([[0.3, -0.1, -0.2], [-0.5, 0.1, np.nan]]),
        sigma=np.full((2, 3), 0.05), r=np.full((2, 3), np.nan), w=np.ones((2, 3)), rays=np.array([5, 6]),
    )  # fmt: skip
    content = adjustment_json(replace(adjusted, check=check))["check_points"]
    assert content["count"] == 2
    assert content["rms"]["X"] == pytest.approx(np.sqrt((0.09 + 0.25) / 2))
    assert content["mean"]["X"] == pytest.approx(-0.1)
    assert content["max"] == pytest.approx({"X": 0.5, "Y": 0.1, "Z": 0.2})
    assert content["rms"]["Z"] == pytest.approx(0.2)
    assert content["points"][1] == {
        "point": "1010",
        "dX": -0.5,
        "dY": 0.1,
        "dZ": None,
        "sX": 0.05,
        "sY": 0.05,
        "sZ": 0.05,
    }


def test_unknown_values_are_empty_or_null(adjusted, tmp_path):
    xyz = adjusted.points.xyz.copy()
    xyz[2] = np.nan
    points = replace(adjusted.points, xyz=xyz)
    images = replace(adjusted.images, covariance=adjusted.images.covariance * np.nan)
    p = adjusted.parameters
    fixed = replace(p, covariance=np.zeros_like(p.covariance), status=np.full(len(p), "fixed"))
    outcome = replace(adjusted.outcome, sigma0=float("nan"), status="not converged", message="still moving")
    odd = replace(adjusted, points=points, images=images, parameters=fixed, outcome=outcome)
    write_result(odd, tmp_path)
    assert rows_of(tmp_path / "points.csv")[2]["X"] == ""
    assert rows_of(tmp_path / "images.csv")[0]["s_omega"] == ""
    assert rows_of(tmp_path / "parameters.csv")[1]["t"] == ""
    text = (tmp_path / "adjustment.json").read_text(encoding="utf-8")

    def refuse(name):
        raise ValueError(name)

    content = json.loads(text, parse_constant=refuse)
    assert content["sigma0"] is None
    assert content["additional_parameters"][0]["t"] is None
    assert content["cameras"][0]["s_focal_length_mm"] == 0.0


def test_without_control_and_check_points(adjusted, tmp_path):
    empty = replace(
        adjusted.check, point=np.zeros(0, np.int64), difference=np.zeros((0, 3)), sigma=np.zeros((0, 3)),
        r=np.zeros((0, 3)), w=np.zeros((0, 3)), rays=np.zeros(0, np.int64),
    )  # fmt: skip
    write_result(replace(adjusted, control=empty, check=empty), tmp_path)
    assert rows_of(tmp_path / "check.csv") == []
    content = json.loads((tmp_path / "adjustment.json").read_text(encoding="utf-8"))
    nothing = {"X": None, "Y": None, "Z": None}
    assert content["check_points"] == {"count": 0, "rms": nothing, "mean": nothing, "max": nothing, "points": []}


@pytest.mark.parametrize(
    "name", ['comma, "quote"', "# comment", "two\nlines", "<script>alert(1)</script>", "Straße 点"]
)
def test_names_survive(adjusted, tmp_path, name):
    images = replace(adjusted.block.images, names=adjusted.block.images.names.astype(object))
    images.names[2] = name
    write_result(replace(adjusted, block=replace(adjusted.block, images=images)), tmp_path)
    assert rows_of(tmp_path / "images.csv")[2]["image"] == name
    rays = pq.read_table(tmp_path / "residuals.parquet").to_pydict()
    assert rays["image"][int(np.flatnonzero(adjusted.block.image_points.image == 2)[0])] == name


def test_plain_tables_have_no_quotes(folder):
    assert '"' not in (folder / "images.csv").read_text(encoding="utf-8")


def test_failed_adjustment_has_the_same_keys(adjusted):
    failed = Outcome("rank deficient", "no control", 0, np.nan, np.nan, np.nan, 10, 12, 0, -2)
    content = outcome_json(adjusted.block, failed)
    assert list(content) == list(adjustment_json(adjusted))
    assert content["status"] == "rank deficient"
    assert content["sigma0"] is None
    assert content["cameras"] == []
    json.dumps(content, allow_nan=False)
