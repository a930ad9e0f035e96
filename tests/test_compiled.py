"""What is said of kernels that have to be compiled."""

from __future__ import annotations

import pytest

from aerotri import compiled


@pytest.fixture
def new_process(monkeypatch, tmp_path):
    """The state of a process that begins with an empty cache."""
    state = {"cached": True, "folders": {tmp_path / "first", tmp_path / "last"}, "said": False, "ahead": False}
    monkeypatch.setattr(compiled, "_state", state)
    return state


def test_the_notice_is_given_once(new_process):
    """A command of several steps asks before each of them."""
    assert "first run only" in compiled.compilation_notice()
    assert compiled.compilation_notice() == ""


@pytest.mark.parametrize("folder", ["first", "last"])
def test_no_notice_with_kernels_in_the_cache(new_process, tmp_path, folder):
    """Whichever kernels a command uses: those of the module that is imported last may be others."""
    (tmp_path / folder).mkdir()
    (tmp_path / folder / "kernel.nbi").touch()
    assert compiled.compilation_notice() == ""


def test_without_a_place_for_the_cache_it_is_said_once(new_process):
    new_process["cached"] = False
    assert "NUMBA_CACHE_DIR" in compiled.compilation_notice()
    assert compiled.compilation_notice() == ""


def test_kernels_that_others_have_just_kept_are_of_this_run(new_process, tmp_path):
    (tmp_path / "first").mkdir()
    (tmp_path / "first" / "kernel.nbi").touch()
    compiled.compiled_ahead()
    assert "first run only" in compiled.compilation_notice()
