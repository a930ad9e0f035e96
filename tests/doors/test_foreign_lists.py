"""Lists of control points and positions as other programs write them: units, axes, letters, coordinate systems."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from aerotri.conventions import InputError
from aerotri.formats.assembly.kinds import ReadingOptions, read_control
from aerotri.formats.block.folder import read_block
from places import PROJECT

CAMERA = (
    "--camera-name drone --camera-size 640x480 --pixel-um 7.5 --focal-length-mm 4.8 --image-sigma-px 0.1 "
    "--flight-axis +y --free-interior"
)
DRONE_SITE = PROJECT / "blocks" / "drone_site" / "photographs"
C01 = [679974.593452, 5330000.96234, 519.994537]


def first_point(folder, name="C01"):
    block = read_block(folder)
    return block.control.xyz[block.control.point == np.flatnonzero(block.points == name)[0]][0]


@pytest.mark.parametrize(("name", "columns"), [("gcp_ft", 1), ("gcp_all_ft", 3)])
def test_feet_in_brackets(door, run, name, columns):
    door("csv_unit_in_brackets")
    words = (
        f"convert bingo.txt --out B --positions geo.txt --control {name}.csv --crs EPSG:32632 --control-sigma-m 0.01"
    )
    found = run(f"{words} {CAMERA}")
    assert found.exit_code == 0, found.output
    assert "was brought to metres" in found.output
    notes = json.loads(Path("B/import.json").read_text(encoding="utf-8"))["taken"]["notes"]
    assert sum("was brought to metres" in note for note in notes) == columns
    np.testing.assert_allclose(first_point("B"), C01, atol=1e-4)


def test_local_feet_are_not_in_the_system_of_the_positions(door, run):
    door("csv_unit_in_brackets")
    words = "convert bingo.txt --out B --positions geo.txt --control gcp_local_ft.csv --control-sigma-m 0.01"
    with pytest.raises(InputError, match=r"gcp_local_ft\.csv: lies 53\d\d km from the photographs") as caught:
        run(f"{words} {CAMERA}")
    assert "--crs" in caught.value.remedy


def test_accuracies_and_angles_of_metashape_by_their_names(door, run):
    folder = door("metashape_reference_headers")
    for name, has_angles in (("ms_pos_acc_ypr", True), ("ms_pos_acc", False)):
        source = folder / "accuracy_as_angles"
        words = f"convert {source}/sim_bingo.txt --out {name} --positions {source}/{name}.csv"
        found = run(f"{words} --control {source}/sim_p4gcp.csv --crs EPSG:32632 {CAMERA}")
        assert found.exit_code == 0, found.output
        block = read_block(name)
        np.testing.assert_allclose(block.gnss_ins.sigma, np.tile([1.5, 1.5, 3.0], (len(block.gnss_ins.image), 1)))
        assert np.isfinite(block.images.angles).all() == has_angles
        if has_angles:
            # kappa counts the other way from grid north, which lies 1.8 degrees beside true north here
            np.testing.assert_allclose(np.degrees(block.images.angles[:, 2]), -18.2, atol=0.1)


def test_yaw_pitch_roll_are_no_omega_phi_kappa(door, run):
    folder = door("metashape_reference_headers") / "ypr_as_opk"
    words = f"convert {folder}/ypr_tab.txt --camera {folder}/cam.xml --pixel-um 4.6 --out B"
    with pytest.raises(InputError, match="gives no standard deviations"):
        run(words)
    found = run(f"{words} --positions-sigma-m 1,1,2")
    assert "yaw, pitch, roll of 3 photographs are start values" in found.output
    block = read_block("B", rays_needed=False)
    assert block.crs == "EPSG:32632"
    # looking straight down but for a degree or two, the top of the first photograph in the east
    assert np.degrees(np.abs(block.images.angles[:, :2])).max() < 2.5
    assert np.degrees(block.images.angles[0, 2]) == pytest.approx(-90.0, abs=0.1)


def test_proj_units_of_the_first_line(door, run):
    folder = door("odm_proj_header_ignored")
    with pytest.raises(InputError, match="nothing says what the heights count in") as caught:
        run(f"convert g9.txt --out g9 {CAMERA} --control-sigma-m 0.01")
    assert "+vunits=m" in caught.value.remedy
    text = (folder / "g9.txt").read_text()
    (folder / "g9.txt").write_text(text.replace("+to_meter=0.3048", "+to_meter=0.3048 +vunits=m"))
    for name, plan, height in (("g9", 0.3048, 1.0), ("g10", 1.0, 1200.0 / 3937.0)):
        found = run(f"convert {name}.txt --out {name} {CAMERA} --control-sigma-m 0.01")
        assert "brought to metres" in found.output
        given = [float(word) for word in Path(f"{name}.txt").read_text().split("\n")[1].split()[:3]]
        np.testing.assert_allclose(first_point(name), np.multiply(given, [plan, plan, height]), rtol=1e-12)
        assert read_block(name).crs == "EPSG:32632"


def test_latitude_before_longitude_is_noticed(door, run):
    door("odm_latlon_not_noticed")
    words = f"convert nb.txt --out B --positions sim_geo.txt --control-sigma-m 0.01 {CAMERA}"
    with pytest.raises(InputError, match="longitude and latitude exchanged") as caught:
        run(f"{words} --control latlon.txt")
    assert "--axes yx" in caught.value.remedy
    assert run(f"{words} --control latlon.txt --axes yx").exit_code == 0
    np.testing.assert_allclose(first_point("B"), C01, atol=2e-3)
    assert read_block("B").crs == "EPSG:32632"


def test_letters_of_windows(door, run):
    door("ansi_file_unknown_format")
    words = "convert sim_bingo.txt --out B --positions sim_p4geo.csv --control g6.csv --control-sigma-m 0.01"
    found = run(f"{words} {CAMERA} --crs EPSG:32632")
    assert found.exit_code == 0
    assert "g6.csv:11: not UTF-8, read as Windows-1252: 'Straße1,679974.0,5330000.0,519.0'" in found.output


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("m01_wrong_epsg", r"lies 44\d km from the photographs"),
        ("m02b_latlon", "longitude and latitude exchanged"),
        ("m13_mm_heights", r"the height of 'C01' would be 519995 m"),
        ("m16_vertical_header", r"the heights of EPSG:32632\+5783"),
    ],
)
def test_lists_that_do_not_belong_to_the_photographs(door, run, name, says):
    """Refused before anything is matched."""
    folder = door("gcp_list_headers")
    with pytest.raises(InputError, match=says):
        run(f"tiepoints {DRONE_SITE} --gcp {folder}/{name}_gcp_list.txt --control-sigma-m 0.02 --out OUT")


def test_markers_of_metashape(door):
    """The coordinates of the survey, never those that Metashape estimates; the line of totals is no point."""
    folder = door("metashape_markers")
    for name, sigma in (("m17_metashape_markers.csv", 0.02), ("m17b_metashape_markers.txt", np.nan)):
        found = read_control(str(folder / name), ReadingOptions())
        np.testing.assert_allclose(found.xyz[0], C01, atol=1e-6)
        np.testing.assert_array_equal(found.sigma[0], [sigma] * 3)
        assert "Total error" not in found.points
