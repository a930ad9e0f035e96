"""Photographs of a small block, rendered and matched once for all tests of this folder."""

import pytest
from rendered_blocks import Rendered, rendered_block

from aerotri.terrain.matching import measure
from aerotri.terrain.pickets import MatchOptions, Pickets


@pytest.fixture(scope="session")
def rendered(tmp_path_factory) -> Rendered:
    return rendered_block(tmp_path_factory.mktemp("rendered") / "photographs")


@pytest.fixture(scope="session")
def pickets(rendered) -> Pickets:
    return measure(rendered.photographs(), rendered.calibration.result.points.xyz, MatchOptions(interval=12.0))
