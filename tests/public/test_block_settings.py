"""Blocks with settings changed."""

import pytest

import aerotri
from aerotri import InputError
from aerotri.observations import CollocationSettings


@pytest.fixture(scope="module")
def block():
    return aerotri.simulate(aerotri.example_flight(), seed=1).block


def test_settings_by_their_names(block):
    changed = aerotri.with_settings(
        block, parameters="brown:K1+K2", correlation_limit=1.0, parameter_groups="block",
        collocation={"sigma_um": 3.0, "length_mm": 20.0}, datum_fixed=("1_001:X0",),
    )  # fmt: skip
    own = changed.settings.adjustment
    assert own.additional_parameters == (("brown", ("K1", "K2")),)
    assert (own.correlation_limit, own.parameter_groups) == (1.0, "block")
    assert own.datum_fixed == (("1_001", "X0"),)
    assert changed.settings.collocation == CollocationSettings(3.0, 20.0)
    assert changed.images is block.images


def test_what_is_not_stated_stays(block):
    assert aerotri.with_settings(block, robust=None).settings == block.settings


@pytest.mark.parametrize(
    ("settings", "text"),
    [
        ({"robbust": "huber"}, "there is no setting 'robbust' — did you mean 'robust'"),
        ({"alpha": 2.0}, "alpha = 2.0"),
        ({"gnss": {"shift": "photo"}}, "shift = 'photo'"),
        ({"datum_fixed": ["1_001"]}, "names no orientation element"),
    ],
)
def test_settings_that_are_none(block, settings, text):
    with pytest.raises(InputError, match=text):
        aerotri.with_settings(block, **settings)
