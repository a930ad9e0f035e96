"""Sums are the same to the last bit, whether chunks run in threads or one after another."""

import numpy as np
import pytest

from aerotri.adjustment import parallel
from aerotri.adjustment.prepare import prepare
from aerotri.adjustment.robust import LEAST_SQUARES
from small_blocks import small_block


@pytest.mark.parametrize("threads", ["1", "2", "3"])
def test_threads_do_not_change_a_bit(threads, monkeypatch):
    block, _ = small_block(5)
    prepared = prepare(block)
    alone = prepared.system.assemble(prepared.state, 0.0, LEAST_SQUARES)
    monkeypatch.setattr(parallel, "FEW_RAYS", 0)
    monkeypatch.setenv("AEROTRI_THREADS", threads)
    again = prepared.system.assemble(prepared.state, 0.0, LEAST_SQUARES)
    np.testing.assert_array_equal(again.matrix.blocks, alone.matrix.blocks)
    np.testing.assert_array_equal(again.matrix.corner, alone.matrix.corner)
    np.testing.assert_array_equal(again.right, alone.right)
    assert again.cost == alone.cost


def test_threads_are_used_for_many_rays(monkeypatch):
    """Two chunks that wait for each other end only where both run at once."""
    import threading

    monkeypatch.setenv("AEROTRI_THREADS", "2")
    meeting = threading.Barrier(2, timeout=20.0)
    assert len(parallel.run_chunks(lambda k: meeting.wait(), 2, parallel.FEW_RAYS)) == 2
    here = threading.get_ident()
    assert parallel.run_chunks(lambda k: threading.get_ident(), 2, parallel.FEW_RAYS - 1) == [here, here]
