"""What the report says of errors that strips share."""

from types import SimpleNamespace

import pytest

from aerotri.diagnosis.moving_errors import of_model_part
from aerotri.results.model_part import GROUPS, ClusterTest, ModelPart


def _finding(counts, growth):
    test = ClusterTest("strip", 7, 42, 1.5, 0.9, 1e-6, 1e-4, counts)
    part = ModelPart(level=0.001, tests=(test,))
    if counts:
        part = ModelPart("strip", 7, GROUPS, 0.001, (test,), growth, growth)
    return of_model_part(SimpleNamespace(model_part=part))[0]


@pytest.mark.parametrize(
    ("counts", "growth", "level"), [(False, 1.0, "good"), (True, 1.05, "note"), (True, 1.5, "attention")]
)
def test_light_is_that_of_the_test_and_of_its_size(counts, growth, level):
    found = _finding(counts, growth)
    assert found.level == level
    assert ("the noise explains them" in found.says) == (not counts)
    assert ("total σ" in found.says) == counts


def test_small_growth_is_told_with_its_size():
    assert "5 % larger" in _finding(True, 1.05).says
