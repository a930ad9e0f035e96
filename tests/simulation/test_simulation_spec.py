"""A bad spec is refused in one line that names file, line and key."""

from __future__ import annotations

import copy

import pytest

from aerotri.conventions import InputError
from aerotri.simulation import parse_spec, read_spec, simulate

TEXT = """name = "bad"
[camera.cam]
preset = "ultracam_d"
[flight]
gsd_m = 0.1
strips = 2
images_per_strip = 3
endlap = 0.6
[tie_points]
per_image = 50
sigma_um = 2.0
"""


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"flights": {}}, "flights"),
        ({"flight": {"endlap": 0.6}}, "flight.endlap"),
        ({"flight": {"end_lap": 1.2}}, "flight.end_lap"),
        ({"flight": {"end_lap": "0.6"}}, "flight.end_lap"),
        ({"flight": {"strips": 2.5}}, "flight.strips"),
        ({"flight": {"height_m": 1000.0}}, "gsd_m or height_m"),
        ({"flight": {"gsd_m": None}}, "gsd_m or height_m"),
        ({"flight": {"strips": None}}, "strips and images_per_strip"),
        ({"flight": {"area_m": [1000.0, 500.0]}}, "area_m"),
        ({"flight": {"cross_strips": [{"day": 2}]}}, "day 2"),
        ({"flight": {"gsd_m": float("nan")}}, "flight.gsd_m"),
        ({"camera": {"cam": {"preset": "leica"}}}, "leica"),
        ({"camera": {"cam": {"interior": {"x1_mm": {}}}}}, "x1_mm"),
        ({"camera": {"cam": {"errors": {"brown": {"K9": 1.0}}}}}, "K9"),
        ({"camera": {"cam": {"errors": {"physical": {"rms_um": -1.0}}}}}, "rms_um"),
        ({"camera": None}, "camera"),
        ({"camera": {"cam": {"preset": None}}}, "size_px"),
        ({"tie_points": {"sigma_um": 0.0}}, "stated_sigma_um"),
        ({"tie_points": {"probability": 0.0}}, "tie_points.probability"),
        ({"tie_points": {"probability": 0.5, "rays_per_point": 3.0}}, "rays_per_point or probability"),
        ({"tie_points": {"distribution": "random"}}, "tie_points.distribution"),
        ({"tie_points": None}, "tie_points"),
        ({"control": {"sigma_m": [0.0, 0.0, 0.0]}}, "stated_sigma_m"),
        ({"control": {"distance_bases": 2.0, "positions": [[0.5, 0.5]]}}, "distance_bases or positions"),
        ({"gross_errors": {"fraction": 1.5}}, "gross_errors.fraction"),
        ({"gross_errors": {"fraction": 0.1, "range_sigma": [9.0, 3.0]}}, "range_sigma"),
        ({"gnss": {}}, "gnss.sigma_m"),
        ({"rotation": "kappa-phi-omega"}, "rotation"),
        ({"start_values": {"kind": "good"}}, "start_values.kind"),
    ],
)
def test_a_bad_key_or_value_is_named(small_tables, change, named):
    with pytest.raises(InputError) as caught:
        parse_spec(small_tables(change))
    assert named in str(caught.value)
    assert "\n" not in str(caught.value)


def test_file_line_and_remedy_are_named(tmp_path):
    path = tmp_path / "simulation.toml"
    path.write_text(TEXT)
    with pytest.raises(InputError) as caught:
        read_spec(path)
    assert caught.value.line == 8
    assert str(caught.value) == f"{path}:8: unknown key 'flight.endlap' — did you mean 'end_lap'?"


def test_files_that_are_none(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        read_spec(tmp_path / "missing.toml")
    path = tmp_path / "simulation.toml"
    path.write_text("name = \n")
    with pytest.raises(InputError, match="TOML") as caught:
        read_spec(path)
    assert caught.value.line == 1
    path.write_bytes(b"name = '\xff'")
    with pytest.raises(InputError, match="is not UTF-8"):
        read_spec(path)


@pytest.mark.parametrize(
    "change", [{"adjustment": {"parameter_groups": "day"}}, {"adjustment": {"additional_parameters": ["blue:1"]}}]
)
def test_adjustment_settings_are_checked(small_tables, change):
    with pytest.raises(InputError, match=r"day|blue"):
        simulate(parse_spec(small_tables(change)), 1)


def test_settings_reach_the_block(small_spec):
    adjustment = {"additional_parameters": ["bluh:1-3"], "parameter_groups": "day"}
    block, _ = simulate(small_spec(flight={"days": 2}, adjustment=adjustment), 1)
    assert block.settings.adjustment.additional_parameters == (("bluh", ("1", "2", "3")),)
    assert block.settings.adjustment.parameter_groups == "day"
    assert set(block.images.columns["day"]) == {"1", "2"}


def test_cameras_keep_what_the_spec_says(small_spec):
    camera = {"interior": {"focal_length_mm": {"sigma": 0.01}}, "brown": {"K1": {"value": 1e-9}}}
    block, _ = simulate(small_spec(camera={"cam": camera}), 1)
    cam = block.cameras[0]
    assert (cam.model, cam.size_px, cam.pixel_um) == ("ultracam_d", (11500, 7500), 9.0)
    assert cam.interior["focal_length_mm"].kind == "weighted"
    assert cam.interior["x0_mm"].kind == "fixed"
    assert (cam.brown["K1"].value, cam.brown["K1"].kind) == (1e-9, "free")


def test_the_tables_given_are_left_as_they_are(small_tables):
    data = small_tables({})
    before = copy.deepcopy(data)
    parse_spec(data)
    assert data == before
