"""Five oblique heads with weak geometry, from the files alone; control left out in turn in tools/prove/ca502.py."""

import importlib.util

import numpy as np
import pytest

from aerotri.formats.results.adjustment import image_columns, point_columns
from aerotri.pipeline import adjust
from aerotri.statistics.loose_points import loose_points
from places import PROJECT

TOOL = PROJECT / "tools" / "prove" / "ca502.py"


@pytest.fixture
def tool(monkeypatch):
    monkeypatch.syspath_prepend(str(TOOL.parent))
    spec = importlib.util.spec_from_file_location("ca502", TOOL)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.slow
def test_whole_block_converges_without_what_is_weak(tool, shared_data):
    """1265 photographs of five heads with their six control points; photograph D0627 has one ray. About a minute."""
    result = adjust(tool.oriented(tool.unoriented(shared_data("ca502"))))
    assert result.outcome.status == "converged"
    # with and without the points that the whole block leaves loose, and again at the adjusted image points; 38 seen,
    # how many hangs on rounding
    assert result.outcome.iterations <= 60
    assert len(result.control) == 6
    images, points = image_columns(result), point_columns(result)
    status = dict(zip(images["image"].tolist(), images["status"].tolist(), strict=True))
    assert status["D0627"] == "set aside"
    # one photograph has a single ray, eleven have fewer than ten
    assert 1 <= sum(word == "set aside" for word in status.values()) <= 12
    assert ((images["reason"] == "") == (images["status"] == "used")).all()
    assert ((points["reason"] == "") == np.isfinite(points["X"])).all()
    assert any("too weakly tied" in said for said in result.outcome.warnings)
    # 32608 would lie 19 km below the ground. Whether the rest settles without such points hangs on rounding: either no
    # σ in the tables says that a point is not fixed, or those are named
    reason = dict(zip(points["point"].tolist(), points["reason"].tolist(), strict=True))
    named = " ".join(said for said in result.outcome.warnings if "hardly fixed in distance" in said)
    if named:
        assert 1 <= len(loose_points(result)) <= 10
    else:
        assert not len(loose_points(result))
        assert reason["32608"] == reason["24401"] == "its rays do not fix it in distance"
    # of 33 000 points hardly one lies kilometres below the ground, as many do in the data
    used = points["status"] == "used"
    height = np.nanmedian(result.images.centre[:, 2]) - np.nanmedian(points["Z"])
    assert 100.0 < height < 250.0
    assert np.mean(points["Z"][used] < np.nanmedian(points["Z"]) - height) < 1e-3
