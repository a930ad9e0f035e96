"""Tables of precision and of what parameters change: their numbers are those of the records."""

from dataclasses import replace

import numpy as np
import pytest

from aerotri.report.pages.adjustment import Findings, report_html
from aerotri.report.tables import precision as precision_tables
from aerotri.results.model_part import CommonPart, ControlEvidence, ModelPart
from aerotri.statistics.common_modes import HEIGHT, PLAN
from aerotri.statistics.parameter_effects import LeftOut, ParameterEffects
from aerotri.statistics.precision import practical_precision, theoretical_precision
from synthetic import make_adjusted_block


@pytest.fixture(scope="module")
def adjusted():
    return make_adjusted_block(3, 6, 150)


def test_precision(adjusted):
    table = precision_tables.precision(adjusted)
    whole = theoretical_precision(adjusted)
    assert table.rows[0][1:] == (whole.count, whole.x, whole.y, whole.z, whole.mean)
    assert table.rows[2][1] == len(adjusted.check)
    found = practical_precision(adjusted)
    assert table.rows[3][1:] == (found.count, found.x, found.y, found.z, found.mean)
    assert found.x == pytest.approx(np.sqrt(np.mean(adjusted.check.difference[:, 0] ** 2)))


def test_ellipsoids_by_hand(adjusted):
    """Covariances diag(1, 4, 9) mm²: a = 3 mm and upright; one point of 50 mm lies flat and is named."""
    covariance = np.tile(np.diag([1.0, 4.0, 9.0]) * 1e-6, (len(adjusted.points.xyz), 1, 1))
    covariance[7] = np.diag([2500.0, 1.0, 1.0]) * 1e-6
    points = replace(adjusted.points, covariance=covariance)
    row = precision_tables.ellipsoids(replace(adjusted, points=points)).rows[0]
    assert row[2:6] == pytest.approx((0.003, 0.002, 0.001, 90.0))
    assert row[6:8] == pytest.approx((0.003, 0.05))
    assert row[8] == str(adjusted.block.points[7])


def test_common_and_local_parts(adjusted):
    """.3 and .4 m make .5 m: 36 and 64 % of the variance; no column of the noise where that is all.

    Whatever adds to it: groups of photographs, or another set of parameters.
    """
    assert precision_tables.common(adjusted).rows == ()
    parts = (
        CommonPart("height: tilt", 0.1, 0.3),
        CommonPart("height: local", 0.2, 0.4),
        CommonPart("plan: local", 0, 0),
    )
    found = precision_tables.common(replace(adjusted, model_part=ModelPart(common=parts)))
    assert [row[2:4] for row in found.rows] == [(0.1, 0.3), (0.2, 0.4), (0, 0)]
    assert [row[4] for row in found.rows[:2]] == pytest.approx([36.0, 64.0])
    noise = tuple(replace(part, sigma_m=part.total_m) for part in parts)
    plain = precision_tables.common(replace(adjusted, model_part=ModelPart(common=noise)))
    assert [column.name for column in plain.columns] == ["part", "what it is", "total σ", "share of the variance"]


def test_every_common_part_has_its_words():
    assert set(precision_tables.ERRORS_IN_COMMON) == {
        f"{kind}: {mode}" for kind, modes in (("height", HEIGHT), ("plan", PLAN)) for mode in (*modes, "local")
    }


def test_what_control_says_of_sigma(adjusted):
    found = ControlEvidence(12, 5, 2.0, 0.001, 1.1, 0.4, 1.9, 1.05)
    made = replace(adjusted, model_part=ModelPart(control=found))
    assert [row[1:] for row in precision_tables.control_evidence(made).rows] == [
        (2.0, 0.001), (1.1, 0.4), (1.9, None), (1.05, None),
    ]  # fmt: skip
    few = replace(adjusted, model_part=ModelPart(control=ControlEvidence(3)))
    assert precision_tables.control_evidence(few).rows == ()


def test_correlations_are_named_above_the_threshold(adjusted):
    p = adjusted.parameters
    sigma = p.sigma
    r = np.eye(len(p))
    r[2, 5] = r[5, 2] = -0.9
    r[1, 3] = r[3, 1] = 0.69
    changed = replace(adjusted, parameters=replace(p, covariance=r * np.outer(sigma, sigma)))
    assert precision_tables.correlations(changed).texts == ((str(p.names[2]), str(p.names[5]), "-0.900"),)


def effects(k=6):
    d = np.tile([0.03, 0.04, 0.12], (k, 1))
    left = (
        LeftOut("all", "", 2.0 * d, np.nan, 5.0, 4.0, 3.0),
        LeftOut("bluh.1", "<b>cam</b>", d, 0.5, 0.1, 4.0, 0.0),
        LeftOut("bluh.2", "cam", 0.5 * d, 9.0, -5.0, 4.0, -0.75),
    )
    return ParameterEffects(d, left)


def test_effects_at_check_points():
    table = precision_tables.check_effects(effects(), 3)
    assert table.texts == (
        ("as adjusted", "", "–", "0.030", "0.040", "0.120", "–", ""),
        ("without any", "", "–", "0.060", "0.080", "0.240", "+100.0", "helps"),
        ("without bluh.1", "<b>cam</b>", "0.5", "0.030", "0.040", "0.120", "0.0", "no difference"),
        ("without bluh.2", "cam", "9.0", "0.015", "0.020", "0.060", "-50.0", "does harm"),
    )


def test_effects_stand_in_the_page(adjusted):
    page = report_html(adjusted, {}, Findings(effects=effects(len(adjusted.check))))
    after = page[page.index('id="effects"') :]
    section = after[: after.index('id="residuals"')]
    assert section.index("without bluh.2") < section.rindex("does harm")
    assert "&lt;b&gt;cam" in after
    assert "<b>cam" not in after
    assert "Not computed." in report_html(adjusted, {})
