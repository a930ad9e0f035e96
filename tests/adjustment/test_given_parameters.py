"""Values of linear additional parameters that a camera states: held, observed, or start values."""

from dataclasses import replace

import numpy as np
import pytest

from aerotri.conventions import InputError
from aerotri.formats.assembly.oriented import given_errors, oriented_from_adjusted
from aerotri.formats.block.folder import read_block, write_block
from aerotri.formats.results.adjustment import adjustment_json
from aerotri.functional_model.additional_parameters import parse_parameters
from aerotri.image_errors import image_groups, systematic_errors
from aerotri.image_errors.error_exports import ideal_camera
from aerotri.image_errors.error_function import error_function
from aerotri.observations import Prior
from aerotri.pipeline import adjust
from aerotri.report.tables.parameters import held_table
from small_blocks import ERRING, small_block, with_adjustment

PARAMETERS = "bluh:1-12"


def stating(block, priors):
    """The block with values of parameters in its camera."""
    cameras = tuple(replace(camera, parameters=priors) for camera in block.cameras)
    return replace(block, cameras=cameras)


@pytest.fixture(scope="module")
def freed():
    return adjust(small_block(4, PARAMETERS, **ERRING)[0])


@pytest.fixture(scope="module")
def values(freed):
    p = freed.parameters
    own = p.kinds == "additional"
    return dict(zip(p.names[own].tolist(), p.value[own].tolist(), strict=True))


@pytest.fixture(scope="module")
def held(freed, values):
    """The same block, all parameters held where the adjustment had them."""
    block = stating(freed.block, {name: Prior(value, fixed=True) for name, value in values.items()})
    return adjust(with_adjustment(block, additional_parameters=()))


def test_held_at_the_adjusted_values_nothing_changes(freed, held):
    """Identity: orientations, points and residuals stay; the parameters no longer cost redundancy."""
    assert held.outcome.status == "converged"
    sigma = freed.images.sigma
    assert (np.abs(held.images.centre - freed.images.centre) < 1e-3 * sigma[:, :3]).all()
    assert (np.abs(held.images.angles - freed.images.angles) < 1e-3 * sigma[:, 3:]).all()
    np.testing.assert_allclose(held.rays.v, freed.rays.v, rtol=0.0, atol=2e-6)
    assert held.outcome.redundancy == freed.outcome.redundancy + 12
    assert held.outcome.sigma0**2 * held.outcome.redundancy == pytest.approx(
        freed.outcome.sigma0**2 * freed.outcome.redundancy, rel=1e-6
    )


def test_held_errors_are_in_the_field_and_in_what_is_handed_on(freed, held):
    """Drawn fields and other programs' image points know them as they know adjusted ones."""
    x, y = (a.ravel() for a in np.meshgrid(np.linspace(-30.0, 30.0, 5), np.linspace(-45.0, 45.0, 5)))
    fields = [systematic_errors(one, image_groups(one.block)[0].name, x, y) for one in (freed, held)]
    np.testing.assert_allclose(fields[1][0], fields[0][0], rtol=0.0, atol=1e-5)
    assert np.linalg.norm(fields[0][0], axis=1).max() > 2e-3
    a, b = oriented_from_adjusted(freed), oriented_from_adjusted(held)
    np.testing.assert_allclose(b.errors, a.errors, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(given_errors(held.block)[0], b.errors, rtol=0.0, atol=1e-12)


def test_ideal_photographs_have_none_left(held):
    """What was taken out of corrected photographs is not in the camera of their block."""
    errors = error_function(held, image_groups(held.block)[0])
    assert not errors.is_zero
    assert ideal_camera(errors).parameters == {}


def test_without_the_values_the_result_is_another(freed, held):
    without = adjust(with_adjustment(freed.block, additional_parameters=()))
    assert without.outcome.sigma0 > 1.1 * held.outcome.sigma0


def test_one_held_the_others_free(freed, values):
    """A value three σ off is taken as it stands, and the others follow."""
    p = freed.parameters
    row = int(np.flatnonzero(p.names == "bluh.7")[0])
    wrong = float(p.value[row] + 3.0 * p.sigma[row])
    found = adjust(stating(freed.block, {"bluh.7": Prior(wrong, fixed=True)}))
    assert "bluh.7" not in found.parameters.names.tolist()
    assert found.outcome.redundancy == freed.outcome.redundancy + 1
    worse = found.outcome.sigma0**2 * found.outcome.redundancy - freed.outcome.sigma0**2 * freed.outcome.redundancy
    # what it costs to hold one unknown t σ off its estimate
    assert worse == pytest.approx(9.0 * freed.outcome.sigma0**2, rel=0.02)


def test_observed_value_is_weighted(freed, values):
    """With the σ of the estimate a value 2 σ off meets it halfway; a start value changes nothing."""
    p = freed.parameters
    row = int(np.flatnonzero(p.names == "bluh.7")[0])
    cofactor_root = float(p.sigma[row]) / freed.outcome.sigma0
    stated = float(p.value[row]) + 2.0 * cofactor_root
    found = adjust(stating(freed.block, {"bluh.7": Prior(stated, cofactor_root)}))
    value = float(found.parameters.value[found.parameters.names == "bluh.7"][0])
    assert value == pytest.approx(0.5 * (stated + float(p.value[row])), abs=0.02 * cofactor_root)
    started = adjust(stating(freed.block, {"bluh.7": Prior(stated)}))
    value = float(started.parameters.value[started.parameters.names == "bluh.7"][0])
    assert value == pytest.approx(float(p.value[row]), abs=1e-2 * cofactor_root)


def test_values_come_back_from_a_block_folder(freed, values, tmp_path):
    priors = {"bluh.7": Prior(1.5e-7, fixed=True), "legendre.bx2y0": Prior(2e-4, 1e-4), "bluh.9": Prior(3e-7)}
    write_block(stating(freed.block, priors), tmp_path / "block")
    assert dict(read_block(tmp_path / "block").cameras[0].parameters) == priors


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("bluh.99", "no such parameter"),
        ("nobody.1", "no such family"),
        ("brown.K1", r"\[camera.NAME.brown\]"),
        ("dmc.30", "belongs to"),
        ("collocation.13x9_x_0_0", "cannot be given"),
    ],
)
def test_values_that_mean_nothing_are_refused(freed, tmp_path, name, why):
    write_block(stating(freed.block, {"bluh.7": Prior(1.5e-7, fixed=True)}), tmp_path / "block")
    toml = tmp_path / "block" / "block.toml"
    toml.write_text(toml.read_text().replace("bluh.7", name))
    with pytest.raises(InputError, match=why):
        read_block(tmp_path / "block")


def test_cameras_that_share_parameters_state_the_same(freed):
    block = freed.block
    cameras = (
        replace(block.cameras[0], parameters={"bluh.7": Prior(1e-7, 1e-7)}),
        replace(block.cameras[0], name="other"),
    )
    camera = (np.arange(len(block.images)) % 2).astype(block.images.camera.dtype)
    block = replace(block, cameras=cameras, images=replace(block.images, camera=camera))
    with pytest.raises(InputError, match=r"another value of bluh\.7"):
        adjust(with_adjustment(block, parameter_groups="block", additional_parameters=parse_parameters(PARAMETERS)))


def test_held_values_stand_in_the_result(freed, held, values):
    """adjustment.json and the report name what was held; where nothing was, there is no such key."""
    (camera,) = adjustment_json(held)["cameras"]
    assert camera["held_parameters"] == values
    assert "held_parameters" not in adjustment_json(freed)["cameras"][0]
    assert [(name, value) for _, name, value in held_table(held).rows] == list(values.items())
    assert held_table(freed).rows == ()
