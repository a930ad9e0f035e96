"""Blocks of strangers that once ended in an exception, or were called not converged, through the commands."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from odd_blocks import End, end_of

CAMERA = (
    "--camera-name", "drone", "--camera-size", "640x480", "--pixel-um", "7.5", "--focal-length-mm", "4.8",
    "--image-sigma-px", "0.1", "--flight-axis", "+y", "--free-interior",
)  # fmt: skip


@pytest.fixture
def copy(shared_data, tmp_path):
    """Copies a folder of real data, for commands that write beside it."""

    def copied(name: str) -> Path:
        return Path(shutil.copytree(shared_data(name), tmp_path / "given", copy_function=shutil.copyfile))

    return copied


def adjusted(block: Path, *options: str) -> End:
    return end_of(["adjust", str(block), "--no-plots", "--out", str(block.parent / "result"), *options])


def converted(folder: Path, *words: str) -> Path:
    """The block that a conversion makes."""
    made = folder.parent / "block"
    end = end_of(["convert", *words, "--out", str(made)])
    assert end.code == 0, end.text
    return made


def test_orientations_in_two_frames(copy):
    end = adjusted(copy("doors/crash_not_positive_definite"))
    assert end.code == 1
    assert "start values" in end.text
    assert "IMG_2" in end.text


@pytest.mark.parametrize("orientation", ["eo_bad.txt", "all_om180.txt"])
def test_start_orientations_turned_over(copy, orientation):
    folder = copy("doors/crash_eigenvalues")
    block = converted(
        folder, str(folder / "sim_bingo.txt"), "--orientation", str(folder / orientation), "--positions",
        str(folder / "sim_geo.txt"), "--control", str(folder / "sim_p4gcp.csv"), "--crs", "EPSG:32632", *CAMERA,
    )  # fmt: skip
    end = adjusted(block)
    assert end.code in (0, 1)
    # with wrong start values it is they that are named, not the parameters
    assert end.code == 0 or "start" in end.text
    assert "cannot be told apart" not in end.text


def test_no_errors_at_all(copy):
    folder = copy("doors/noise_free_not_converged")
    block = converted(
        folder, str(folder / "plain.xml"), "--image-points", str(folder / "pts.mes"), "--image-sigma-px", "0.5"
    )
    end = adjusted(block)
    assert end.code == 0
    assert "there are no residuals" in end.text


@pytest.mark.parametrize(("name", "axis"), [("strip_mirrored", "x"), ("rows_flipped", "y")])
def test_a_strip_reversed(copy, name, axis):
    end = adjusted(copy(f"doors/{name}"))
    assert end.code == 1
    assert f"{axis} negated" in end.text or "mirrored" in end.text or "flipped" in end.text


def test_a_facade_without_parameters(copy):
    end = adjusted(copy("stpierre"), "--parameters", "none")
    assert end.code in (0, 1)
    assert "σ" in end.text


def test_a_facade_with_parameters_chosen(copy):
    # nine areas, of which some have photographs without a point in common
    end = adjusted(copy("stpierre"), "--parameters", "auto")
    assert end.code == 0
    assert "additional parameters chosen" in end.text
