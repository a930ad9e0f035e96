"""The whole: repeatable, of the size asked for, written with its truth."""

from __future__ import annotations

import csv

import numpy as np
import pytest

from aerotri.conventions import InputError
from aerotri.simulation import read_spec, simulate, write_simulated, write_truth
from places import PROJECT

BLOCKS = PROJECT / "blocks"
EVERYTHING = {
    "camera": {
        "cam": {
            "errors": {
                "parameters": {"bluh.1": 1e-5},
                "brown": {"K1": 1e-9},
                "physical": {"rms_um": 4.0},
                "interior": {"focal_length_mm": 0.01},
            }
        }
    },
    "flight": {"attitude_sigma_deg": [1.0, 1.0, 1.0], "position_sigma_m": [5.0, 5.0, 5.0]},
    "terrain": {"kind": "undulating", "relief_rms_m": 20.0},
    "control": {
        "distance_bases": 3.0,
        "check_points": 10,
        "blunders": [{"point": "C02", "error_m": [0.0, 5.0, 0.0]}],
    },
    "gnss": {"sigma_m": [0.05, 0.05, 0.05], "shift_sigma_m": [0.1, 0.1, 0.1]},
    "ins": {"sigma_deg": [0.01, 0.01, 0.01]},
    "gross_errors": {"fraction": 0.02},
    "start_values": {"kind": "perturbed"},
}


def arrays(record):
    """All arrays of a record and of the records in it, by place."""
    for name, value in vars(record).items():
        if isinstance(value, np.ndarray):
            yield name, value
        elif hasattr(value, "__dataclass_fields__"):
            yield from ((f"{name}.{inner}", a) for inner, a in arrays(value))


def test_the_same_seed_gives_the_same_block_bit_for_bit(small_spec):
    first, second, other = (simulate(small_spec(**EVERYTHING), seed) for seed in (6, 6, 7))
    for a, b in zip(first, second, strict=True):
        for (name, x), (_, y) in zip(arrays(a), arrays(b), strict=True):
            assert x.tobytes() == y.tobytes(), name
    assert first[0].image_points.xy[0].tobytes() != other[0].image_points.xy[0].tobytes()
    assert first[1].centre.tobytes() != other[1].centre.tobytes()


def test_a_negative_seed_is_refused(small_spec):
    with pytest.raises(InputError, match="seed"):
        simulate(small_spec(), -1)


def test_one_more_option_leaves_the_other_draws_alone(small_spec):
    plain, _ = simulate(small_spec(), 1)
    more, _ = simulate(small_spec(gnss={"sigma_m": [0.1, 0.1, 0.1]}, start_values={"kind": "perturbed"}), 1)
    np.testing.assert_array_equal(plain.image_points.xy, more.image_points.xy)


def test_points_stand_in_the_order_of_their_first_ray(small_spec):
    block, truth = simulate(small_spec(**EVERYTHING), 1)
    _, first = np.unique(block.image_points.point, return_index=True)
    assert (np.diff(first) > 0).all()
    assert (np.diff(block.image_points.image) >= 0).all()
    assert len(first) == len(block.points) == len(truth.points) == len(set(block.points))
    assert len(truth.centre) == len(truth.angles) == len(block.images)


def test_frederiksstad_has_the_size_of_the_paper():
    """[P] Spreckels et al. 5.2: 132 photographs, 13 601 image points, 1774 object points."""
    spec = read_spec(BLOCKS / "frederiksstad_ultracam" / "simulation.toml")
    block, truth = simulate(spec, 1)
    assert len(block.images) == 132
    assert len(block.image_points) == pytest.approx(13601, rel=0.02)
    assert len(block.points) == pytest.approx(1774, rel=0.02)
    assert block.control.is_check.sum() >= 30
    assert np.bincount(block.image_points.image).min() > 50
    height = truth.centre[:, 2].mean() - spec.terrain.height_m
    assert height * 0.009 / 101.4 == pytest.approx(0.17, rel=0.01)
    strip = block.images.strip == "1"
    base = np.linalg.norm(np.diff(truth.centre[strip, :2], axis=0), axis=1).mean()
    assert 1.0 - base / (7500 * 0.17) == pytest.approx(0.80, abs=0.01)
    # control about five bases of 60 % end lap apart
    control = truth.points[block.control.point[~block.control.is_check], :2]
    distance = np.linalg.norm(control[:, None] - control[None], axis=2)
    np.fill_diagonal(distance, np.inf)
    assert 4.0 < np.median(distance.min(axis=1)) / (0.4 * 7500 * 0.17) < 6.0


def rows(path):
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_truth_is_written(small_spec, tmp_path):
    block, truth = simulate(small_spec(**EVERYTHING), 1)
    write_truth(tmp_path, block, truth)
    images = rows(tmp_path / "truth" / "images.csv")
    assert [r["image"] for r in images] == block.images.names.tolist()
    assert float(images[3]["Z0"]) == round(truth.centre[3, 2], 6)
    assert np.radians(float(images[3]["kappa"])) == pytest.approx(truth.angles[3, 2], abs=1e-11)
    points = rows(tmp_path / "truth" / "points.csv")
    assert [r["point"] for r in points] == block.points.tolist()
    assert [float(points[7][k]) for k in "XYZ"] == truth.points[7].round(6).tolist()
    parameters = rows(tmp_path / "truth" / "additional_parameters.csv")
    assert [(r["name"], r["group"], float(r["value"])) for r in parameters] == [
        ("bluh.1", "cam", 1e-5),
        ("brown.K1", "cam", 1e-9),
    ]
    assert rows(tmp_path / "truth" / "cameras.csv") == [
        {"name": "cam", "focal_length_mm": repr(101.4 + 0.01), "x0_mm": "0.0", "y0_mm": "0.0"}
    ]
    errors = rows(tmp_path / "truth" / "image_errors.csv")
    assert len(errors) == 46 * 30
    assert float(errors[100]["dx"]) == round(truth.image_errors[0].d[100, 0], 9)
    gross = rows(tmp_path / "truth" / "gross_errors.csv")
    ray = truth.gross_errors[1]
    assert gross[1]["image"] == block.images.names[block.image_points.image[ray]]
    assert gross[1]["point"] == block.points[block.image_points.point[ray]]
    assert float(gross[1]["dy"]) == round(truth.gross_error_mm[1, 1], 7)
    assert rows(tmp_path / "truth" / "control_blunders.csv") == [
        {"point": "C02", "dX": "0.0", "dY": "5.0", "dZ": "0.0"}
    ]
    write_truth(tmp_path, block, truth)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["truth"]


def test_a_block_is_written_with_its_truth_and_read_again(small_spec, tmp_path):
    block_folder = pytest.importorskip("aerotri.formats.block.folder")
    block, truth = simulate(small_spec(**EVERYTHING), 1)
    (tmp_path / "small" / "truth").mkdir(parents=True)
    (tmp_path / "small" / "simulation.toml").write_text("# the spec")
    (tmp_path / "small" / "truth" / "mine.csv").write_text("of the user")
    write_simulated(tmp_path / "small", block, truth)
    again = block_folder.read_block(tmp_path / "small")
    assert again.points.tolist() == block.points.tolist()
    np.testing.assert_allclose(again.image_points.xy, block.image_points.xy, rtol=0, atol=6e-8)
    assert again.gnss_ins is not None
    assert (tmp_path / "small" / "simulation.toml").read_text() == "# the spec"
    assert (tmp_path / "small" / "truth" / "images.csv").exists()
    assert (tmp_path / "small" / "truth" / "mine.csv").read_text() == "of the user"
