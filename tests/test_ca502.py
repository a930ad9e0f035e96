"""Five oblique heads with weak geometry, from the files alone: the first strip; the whole runs in tools/ca502.py."""

import importlib.util
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aerotri.formats.result import image_columns, point_columns
from aerotri.pipeline import adjust

TOOL = Path(__file__).resolve().parents[1] / "tools" / "ca502.py"
STEPS_OF_A_STRIP = 120


@pytest.fixture
def tool():
    spec = importlib.util.spec_from_file_location("ca502", TOOL)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_first_strip_converges_without_what_is_weak(tool, shared_data):
    """Photograph D0627 has one ray. Some 10 s: a real block of 110 photographs with self-calibration of five heads.

    By itself a strip may turn about its line by 0.03 rad, more than steps can follow: it takes more of them than the
    whole, which is held across.
    """
    block = tool.oriented(tool.exposures(tool.unoriented(shared_data("ca502")), 0, 22))
    settings = replace(block.settings, adjustment=replace(block.settings.adjustment, max_iterations=STEPS_OF_A_STRIP))
    result = adjust(replace(block, settings=settings))
    assert result.outcome.status == "converged"
    images, points = image_columns(result), point_columns(result)
    status = dict(zip(images["image"].tolist(), images["status"].tolist(), strict=True))
    assert status["D0627"] == "set aside"
    nadir = [status[name] for name in status if name[0] == tool.NADIR]
    assert nadir == ["used"] * len(nadir)
    assert ((images["reason"] == "") == (images["status"] == "used")).all()
    assert ((points["reason"] == "") == np.isfinite(points["X"])).all()
    assert any("too weakly tied" in said for said in result.outcome.warnings)
    # no point is left that three σ reach to infinity from, nor one below the ground by more than the flying height
    used = points["status"] == "used"
    height = np.nanmedian(result.images.centre[:, 2]) - np.nanmedian(points["Z"])
    assert 100.0 < height < 250.0
    assert np.nanmin(points["Z"][used]) > np.nanmedian(points["Z"]) - height
