"""Whether a block needs a rolling shutter: where there is one, where there is none, where an affinity does as well."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from aerotri.formats.results.adjustment import adjustment_json, write_result
from aerotri.observations import Prior
from aerotri.pipeline import adjust
from aerotri.results.rolling_shutter import NEEDED, NOT_NEEDED, NOT_TOLD_APART, SHARED_ERRORS, ShutterTest, Variant
from aerotri.strategies.shutter_test import AFFINITY, BOTH, NONE, ROLLING, _verdict
from rolling_blocks import rolling_block

NAN3 = (float("nan"),) * 3


@pytest.fixture(scope="module")
def rolling():
    return adjust(rolling_block(3)[0])


def test_needed_where_there_is_one(rolling):
    """Read in 30 ms at 8 m/s: an affinity does not explain relief and turned photographs as well."""
    test = rolling.rolling_shutters.test
    assert test.verdict == NEEDED
    assert not test.bends_heights
    by_name = {one.name: one for one in test.variants}
    assert by_name[ROLLING].sigma0 < 1.1 < by_name[NONE].sigma0
    assert by_name[ROLLING].bic < by_name[AFFINITY].bic < by_name[NONE].bic
    assert any("need the rolling shutter" in text for text in rolling.outcome.warnings)


@pytest.mark.parametrize("seed", [3, 4, 5])
def test_not_needed_where_there_is_none(seed):
    """All rows at once: the readout time is zero within its σ, and heights stay."""
    result = adjust(rolling_block(seed, {"readout_ms": 0.0})[0])
    found = result.rolling_shutters.readouts[0]
    assert abs(found.readout_ms) < 3.3 * found.sigma_ms
    assert result.rolling_shutters.test.verdict == NOT_NEEDED
    assert result.rolling_shutters.test.height_change_m < result.rolling_shutters.test.height_sigma_m


def test_no_test_where_the_readout_time_is_held():
    """Nothing to be asked."""
    block = rolling_block(3)[0]
    shutter = replace(block.cameras[0].rolling_shutter, readout_ms=Prior(30.0, fixed=True))
    held = adjust(replace(block, cameras=(replace(block.cameras[0], rolling_shutter=shutter),)))
    assert held.rolling_shutters.test is None
    assert held.rolling_shutters.readouts[0].status == "fixed"
    assert held.outcome.sigma0 == pytest.approx(1.0, abs=0.08)


def variant(name, bic, t=float("nan"), status="converged"):
    return Variant(name, status, 1.0, bic, t, NAN3, NAN3)


@pytest.mark.parametrize(
    ("rolling", "both", "affinity", "total", "verdict"),
    [
        ((100.0, 50.0), (90.0, 20.0), 400.0, 50.0, NEEDED),
        ((100.0, 2.0), (90.0, 1.0), 100.0, 2.0, NOT_NEEDED),
        ((100.0, 50.0), (104.0, 1.5), 101.0, 50.0, NOT_TOLD_APART),
        ((300.0, 50.0), (90.0, 8.0), 290.0, 50.0, NEEDED),
        ((100.0, 50.0), (90.0, 20.0), 400.0, 0.5, SHARED_ERRORS),
    ],
)
def test_verdicts(rolling, both, affinity, total, verdict):
    """By the readout time over σ, and BIC against the affinity."""
    variants = {
        NONE: variant(NONE, 900.0), AFFINITY: variant(AFFINITY, affinity), ROLLING: variant(ROLLING, *rolling),
        BOTH: variant(BOTH, *both),
    }  # fmt: skip
    assert _verdict(variants, total) == verdict


def test_a_warning_where_heights_bend():
    """Heights that change by more than σ, and nothing that speaks for it."""
    bent = ShutterTest(NOT_TOLD_APART, (), 0.3, 0.05, float("nan"), float("nan"))
    assert bent.bends_heights
    assert "bends heights" in bent.sentence
    assert not replace(bent, height_change_m=0.02).bends_heights
    assert replace(bent, verdict=NEEDED, gain=-0.5, gain_error=0.1).bends_heights
    assert not replace(bent, verdict=NEEDED, gain=0.5, gain_error=0.1).bends_heights


def test_what_is_written(rolling, tmp_path):
    """motion.csv and the entry of adjustment.json."""
    write_result(rolling, tmp_path)
    lines = (tmp_path / "motion.csv").read_text().splitlines()
    assert lines[0] == "image,vX,vY,vZ,wx,wy,wz,source"
    assert len(lines) == 1 + len(rolling.block.images)
    speed = np.linalg.norm([[float(v) for v in line.split(",")[1:4]] for line in lines[1:]], axis=1)
    np.testing.assert_allclose(np.median(speed), rolling.rolling_shutters.readouts[0].speed_m_s)
    content = json.loads((tmp_path / "adjustment.json").read_text())["rolling_shutters"]
    assert content["test"]["verdict"] == NEEDED
    assert content == json.loads(json.dumps(adjustment_json(rolling)["rolling_shutters"]))
