"""A thousandth on any one coefficient of ours is found, however small the parameter; what is unknown is named."""

from dataclasses import replace

import numpy as np
import pytest

import aerotri
from aerotri.crosscheck import CrosscheckResult, PeerCheck, crosscheck
from aerotri.crosscheck.freed import used_rays
from aerotri.crosscheck.paper_block import paper_block
from aerotri.crosscheck.paper_check import PEER, adjusted_entries, check_with_paper
from aerotri.crosscheck.paper_families import LINEAR
from aerotri.crosscheck.pattern_check import compare_patterns, pattern_errors
from aerotri.functional_model import collinearity
from aerotri.functional_model.additional_parameters.registry import LINEAR_FAMILIES
from aerotri.observations import Prior
from aerotri.pipeline import adjust
from family_cameras import camera_for, sets_of
from small_blocks import small_block

DMC, ULTRACAM = {"dmc": {"preset": "dmc"}}, {"ucd": {"preset": "ultracam_d"}}
TWO_STRIPS = {
    "flight": {"gsd_m": 0.1, "strips": 2, "images_per_strip": 4, "end_lap": 0.6, "side_lap": 0.4},
    "tie_points": {"per_image": 40, "probability": 0.9, "sigma_um": 2.0},
    "control": {"distance_bases": 1.5, "sigma_m": [0.03, 0.03, 0.05], "check_points": 2},
}


def two_strips(parameters, camera):
    """A block of eight photographs, the smallest that determines the parameters of a camera."""
    return small_block(1, parameters, camera=camera, **TWO_STRIPS)[0]


@pytest.fixture
def falsify(monkeypatch):
    """Multiply what a linear family of ours says by (2,) factors of dx and dy."""

    def in_family(name, factor):
        true = LINEAR_FAMILIES[name]

        def evaluate(camera, x, y, partials, items):
            terms = true.terms(camera, x, y, partials, items)
            return replace(terms, value=terms.value * np.reshape(factor, (2, 1)))

        monkeypatch.setitem(LINEAR_FAMILIES, name, replace(true, evaluate=evaluate))

    return in_family


@pytest.mark.parametrize("family", LINEAR)
def test_a_thousandth_of_every_parameter(falsify, family):
    """In dx alone, then in dy alone: every parameter acts in one of them."""
    camera = camera_for(family)
    found: dict[str, float] = {}
    for factor in ([1.001, 1.0], [1.0, 1.001]):
        falsify(family, factor)
        for names in sets_of(family):
            found |= {name: max(error, found.get(name, 0.0)) for name, error in pattern_errors(camera, names).items()}
    assert set(found) == {name for names in sets_of(family) for name in names}
    assert min(found.values()) > 1e-4


@pytest.fixture(scope="module")
def with_dmc():
    return adjust(two_strips("dmc:30-41+74-77+79", DMC))


def test_a_block_with_all_parameters_of_the_dmc_agrees(with_dmc):
    result = crosscheck(with_dmc, adjust)
    paper = result.checks[1]
    assert paper.status == "agrees", paper.reason
    assert {f"dmc.{item}" for item in LINEAR_FAMILIES["dmc"].all_items} < set(paper.patterns.names)
    assert next(d for d in paper.differences if d.kind == "additional parameters").count == 17
    assert result.verdict == "agrees"
    assert result.unchecked == ()


def test_a_thousandth_in_an_adjustment_that_hides_it(falsify, with_dmc):
    """The values of the parameters are small: adjusted with the wrong pattern, points and parameters still agree."""
    falsify("dmc", [1.001, 1.001])
    check = check_with_paper(adjust(with_dmc.block), adjust)
    assert check.status == "differs"
    assert check.reason.startswith("the pattern of dmc.")
    assert check.patterns.max == pytest.approx(1e-3, rel=2e-3)


def test_a_block_with_polynomials_and_waves_agrees():
    check = check_with_paper(adjust(two_strips("legendre:3x3,fourier:xc1p1+ys2p1", ULTRACAM)), adjust)
    assert check.status == "agrees", check.reason


@pytest.mark.parametrize("errors", [{"brown": {"K1": 5e-6, "P1": 3e-6}}, {"lens": {"k1": -0.05, "p2": -2e-4}}])
def test_a_thousandth_of_every_element_of_the_ray(monkeypatch, errors):
    """Brown's, the forward lens' and the interior orientation stand in the collinearity equations themselves."""
    ((family, values),) = errors.items()
    result = adjust(two_strips(f"{family}:{'+'.join(values)}", {"p1": {"preset": "p1", "errors": errors}}))
    paper = paper_block(result.block, used_rays(result), result.rays.weight, np.zeros(3))
    entries = adjusted_entries(result, paper)
    assert compare_patterns(result, paper, entries).max < 1e-12
    true = collinearity.linearise
    for name in ("focal_length_mm", *(f"{family}.{item}" for item in values)):
        factor = np.where(np.array(collinearity.INTERIOR_COLUMNS) == name, 1.001, 1.0)

        def wrong(rotation, centre, points, interior, *rays, factor=factor):
            return true(rotation, centre, points, interior * factor, *rays)

        monkeypatch.setattr(collinearity, "linearise", wrong)
        assert not compare_patterns(result, paper, entries).agrees


def test_parameters_that_no_program_has_are_named():
    """pycolmap agrees, its image points freed by us: that is no check of what freed them."""
    pytest.importorskip("pyceres", reason="pyceres (extra 'ceres') is not installed")
    result = aerotri.crosscheck(two_strips("bluh:1-4,collocation:3x3", ULTRACAM))
    assert result.record.checks[0].status == "agrees"
    assert result.verdict == result.content["verdict"] == "parameters not checked"
    assert result.sentence.startswith("parameters not checked (collocation) — pycolmap: max |Δ|/σ")
    assert "(image points freed of our own errors); independent model not available" in result.sentence
    assert result.content["parameters_not_checked"] == ["collocation"]
    assert "freed of our own" in result.content["checks"][0]["notes"][0]


def test_parameters_stay_unchecked_whatever_the_independent_model_refuses():
    """Its reason may be another, such as observed attitudes."""
    freed = PeerCheck("pycolmap", "", "agrees")
    refused = PeerCheck(PEER, "", "not available", "observed attitudes", checks_parameters=True)
    found = CrosscheckResult("block", (freed, refused), ("bluh", "focal_length_mm"))
    assert found.verdict == "parameters not checked"
    assert found.sentence.startswith("parameters not checked (bluh, focal_length_mm) — pycolmap: ")
    assert replace(found, parameters=()).verdict == "agrees"
    assert replace(found, checks=(freed, replace(refused, status="agrees"))).verdict == "agrees"
    assert replace(found, checks=(freed, replace(refused, status="differs"))).verdict == "differs"


def test_values_that_a_camera_states_are_checked():
    """Held, observed and begun from: all three in the independent model as well, and none is freed twice."""
    block = two_strips("bluh:1-4", ULTRACAM)
    stated = {
        "bluh.9": Prior(1e-8, fixed=True), "bluh.1": Prior(1e-5, 1e-5), "bluh.2": Prior(2e-5),
        "legendre.bx3y0": Prior(2e-3),
    }  # fmt: skip
    camera = replace(block.cameras[0], parameters=stated)
    found = crosscheck(adjust(replace(block, cameras=(camera,))), adjust)
    assert found.verdict == "agrees", found.sentence
    assert {"bluh.9", "bluh.1", "legendre.bx3y0"} < set(found.checks[1].patterns.names)
