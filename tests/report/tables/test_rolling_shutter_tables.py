"""Rolling shutters in the report: every camera, the test, and times that are whole seconds."""

from dataclasses import replace

import numpy as np
import pytest

from aerotri.pipeline import adjust
from aerotri.report.pages.adjustment import report_html
from aerotri.report.tables import rolling_shutters as tables
from rolling_blocks import rolling_block
from synthetic import make_adjusted_block


@pytest.fixture(scope="module")
def block():
    return rolling_block(3)[0]


@pytest.fixture(scope="module")
def adjusted(block):
    return adjust(block)


def test_readout_of_every_camera(adjusted):
    table = tables.readouts_table(adjusted)
    one = adjusted.rolling_shutters.readouts[0]
    cells = dict(zip((c.name for c in table.columns), table.texts[0], strict=True))
    assert cells["camera"] == "cam"
    assert cells["readout"] == f"{one.readout_ms:.2f}"
    assert cells["photographs"] == str(one.photographs)
    assert cells["velocities from"] == f"times {one.photographs}"


def test_every_model_of_the_test_is_a_row(adjusted):
    table = tables.shutter_test_table(adjusted)
    assert len(table) == len(adjusted.rolling_shutters.test.variants) > 2
    assert table.texts[0][0] == "no rolling shutter"
    # a model without a readout time has no |T|/σ
    assert table.texts[0][4] in ("", "–")


def test_the_page_has_both(adjusted):
    page = report_html(adjusted, {})
    assert "Rolling shutters" in page
    assert "Is the rolling shutter needed?" in page
    assert adjusted.rolling_shutters.test.sentence[1:40] in page


def test_nothing_without_a_rolling_shutter():
    plain = make_adjusted_block(2, 5, 80, n_control=6, n_check=5)
    assert len(tables.readouts_table(plain)) == len(tables.shutter_test_table(plain)) == 0
    assert tables.verdict(plain) is None
    assert "Rolling shutters" not in report_html(plain, {})


def test_whole_seconds_are_said(block, adjusted):
    assert adjusted.rolling_shutters.readouts[0].time_rounding_s == 0.0
    assert not any("whole seconds" in said for said in adjusted.outcome.warnings)
    positions = replace(block.gnss_ins, time=np.round(block.gnss_ins.time))
    found = adjust(replace(block, gnss_ins=positions))
    assert found.rolling_shutters.readouts[0].time_rounding_s == 1.0
    said = [one for one in found.outcome.warnings if "whole seconds" in one]
    assert len(said) == 1
    assert "fractions of a second" in said[0]
    assert tables.readouts_table(found).texts[0][-1].endswith("(whole seconds)")
