"""The league of stated σ compares like with like, and reads what others wrote as they meant it."""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
import pytest

import aerotri
from aerotri import observations
from places import PROJECT

sys.path.insert(0, str(PROJECT / "tools" / "prove"))

pytest.importorskip("pyceres")

from league_programs import colmap, dbat, ours, pix4d
from real_data import into_page, share5


@pytest.fixture(scope="module")
def adjusted():
    """Control, GNSS and a free interior orientation with a lens."""
    flight = aerotri.example_flight() | {"gnss": {"sigma_m": [0.05, 0.05, 0.08]}}
    block = aerotri.simulate(flight, seed=3).block
    free = {name: observations.Prior(0.0, 0.05) for name in ("x0_mm", "y0_mm")}
    free |= {"focal_length_mm": observations.Prior(block.cameras[0].focal_length_mm)}
    block = replace(block, cameras=tuple(replace(camera, interior=free) for camera in block.cameras))
    return aerotri.adjust(block, parameters="lens:k1+k2", model_part="off", explain=False)


def ratios(peer, own):
    return np.array([peer[name] / own[name] for name in peer])


def test_same_datum_and_unknowns_give_the_same_sigma_of_photographs(adjusted):
    peer, own = colmap.stated(adjusted.record.local), ours.stated("noise", adjusted, total=False)
    assert len(peer.photographs) == len(adjusted.block.images)
    np.testing.assert_allclose(ratios(peer.photographs, own.photographs), 1.0, rtol=2e-3)


def test_points_of_pycolmap_leave_the_orientation_out(adjusted):
    """Never larger than the marginal σ, and smaller where the orientation matters."""
    peer, own = colmap.stated(adjusted.record.local), ours.stated("noise", adjusted, total=False)
    ratio = ratios(peer.points, own.points)
    assert ratio.max() < 1.001
    assert np.median(ratio) < 0.95


def test_check_points_are_no_observations(adjusted):
    """A point that edits make a check point is not held in pycolmap's problem either."""
    name = str(adjusted.block.points[adjusted.block.control.point[~adjusted.block.control.is_check][0]])
    without = aerotri.adjust(aerotri.edit(adjusted.block, check=[name]), model_part="off", explain=False)
    peer, own = colmap.stated(without.record.local), ours.held(without, "sigma")
    assert peer.held is not None
    assert own is not None
    np.testing.assert_allclose(peer.held.difference, own.difference, atol=1e-3 * own.sigma.min())
    held = colmap.stated(adjusted.record.local).points[name]
    assert (peer.held.sigma[0] > 1.2 * held).all()


def test_report_of_dbat(shared_data):
    """dbat_sxb/result/report.txt, as printed."""
    found = dbat.stated(shared_data("dbat_sxb") / "result" / "report.txt")
    assert found.photographs["8811"].tolist() == [0.465, 0.657, 0.097, 0.0209, 0.0146, 0.00234]
    assert found.control["317"].tolist() == [0.0195, 0.0189, 0.0451]
    assert found.held is not None
    assert found.interior == {}
    np.testing.assert_allclose(found.held.difference[0], [0.167, 0.008, -0.459], atol=6e-4)
    assert found.held.sigma[1].tolist() == [0.0345, 0.0356, 0.18]


def test_files_of_pix4d(shared_data):
    """share5: the first photograph, and points matched by their places."""
    found = pix4d.stated(shared_data("share5"))
    first = found.photographs["8back01053"]
    assert first.tolist() == [0.028955, 0.036815, 0.037409, 0.017858, 0.008943, 0.013527]
    assert found.nameless is not None
    some = found.nameless[1:4]
    names = np.array(["a", "b", "c"])
    matched = pix4d.matched(some, some[::-1, :3] + 0.01, names, 0.3)
    assert {name: row.tolist() for name, row in matched.items()} == {
        "a": some[2, 3:].tolist(), "b": some[1, 3:].tolist(), "c": some[0, 3:].tolist(),
    }  # fmt: skip


def test_tables_of_a_page_are_written_between_their_marks(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("before\n<!-- one -->\nold\n<!-- end of one -->\nafter\n", encoding="utf-8")
    into_page(page, "one", ["new"])
    text = page.read_text(encoding="utf-8")
    assert "old" not in text
    assert "new" in text
    assert text.startswith("before")
    assert text.endswith("after\n")
    into_page(page, "one", ["new"])
    assert page.read_text(encoding="utf-8") == text


def test_the_head_of_share5_that_looks_down_has_a_focal_length_of_its_own(shared_data, tmp_path):
    share5(shared_data("share5").parent, tmp_path / "share5")
    cameras = aerotri.read_block(tmp_path / "share5").cameras
    assert {camera.name.split("_")[-1]: camera.focal_length_mm for camera in cameras} == {
        "down": 27.0, "back": 38.0, "front": 38.0, "left": 38.0, "right": 38.0,
    }  # fmt: skip
