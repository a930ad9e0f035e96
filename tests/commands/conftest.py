"""The result of a small block whose camera errs by physics, as the command line leaves it."""

import pytest

from aerotri.commands.adjust import run_adjust
from aerotri.commands.console import Console
from aerotri.commands.results import reopened
from aerotri.formats.block.folder import write_block
from small_blocks import ERRING, small_block, with_adjustment


def adjusted_folder(block, folder):
    """The block written and adjusted; the result folder."""
    write_block(block, folder / "block")
    assert run_adjust(folder / "block", folder / "result", None, None, None, False, True) == 0
    return folder / "result"


@pytest.fixture(scope="session")
def erring_result(tmp_path_factory):
    """Result folder of a self-calibrated UltraCamD block."""
    block, _ = small_block(3, "bluh:1-12,ultracam_d:42-73", **ERRING)
    return adjusted_folder(block, tmp_path_factory.mktemp("erring"))


@pytest.fixture(scope="session")
def erring(erring_result):
    """The same, reopened."""
    return reopened(erring_result, Console(quiet=True))


@pytest.fixture(scope="session")
def plain_result(erring, tmp_path_factory):
    """Result folder of the same observations without additional parameters."""
    block = with_adjustment(erring.result.block, additional_parameters=())
    return adjusted_folder(block, tmp_path_factory.mktemp("plain"))
