"""Damaged files in every reader: a few of those that tools/prove/fuzz.py makes, and the corpus beside the project."""

from __future__ import annotations

import os

import pytest

from places import PROJECT

ROOT = PROJECT
INPUTS = 300
SEED = 20

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="inputs run in forked processes")


@pytest.fixture(scope="module", autouse=True)
def tools():
    """The parts of tools/prove/fuzz.py."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT / "tools" / "prove"))
        yield


@pytest.fixture(scope="module")
def targets():
    from fuzzing.readers import all_targets

    return all_targets(results=False)


def test_the_good_files_are_read(targets, tmp_path):
    """Damage to what is refused anyway would show nothing."""
    from fuzzing.worker import write_files

    for number, target in enumerate(targets):
        write_files(target.files, tmp_path / str(number))
        target.call(tmp_path / str(number))


def test_damaged_files_end_in_a_block_or_in_one_line(targets, tmp_path):
    """Neither an exception, nor a hang, nor an abort; and the message names the file and what to do."""
    from fuzzing.worker import run_inputs

    found = list(run_inputs(targets, SEED, range(INPUTS), tmp_path))
    assert len(found) == INPUTS
    assert [one for one in found if one.outcome not in ("accepted", "refused")] == []
    # the damage is such that something is left of both
    assert min(sum(one.outcome == kind for one in found) for kind in ("accepted", "refused")) > INPUTS // 10


def test_the_fuzzer_sees_what_it_looks_for(tmp_path, monkeypatch):
    """An exception, a hang, an abort and an error without its file each become a finding of their kind."""
    from aerotri.conventions import InputError
    from fuzzing import worker
    from fuzzing.worker import Target, run_inputs

    def without_file(folder):
        raise InputError("is damaged", "repair it")

    def exception(folder):
        return {}["nothing"]

    def memory(folder):
        return bytearray(4 << 30)

    def hang(folder):
        while True:
            pass

    monkeypatch.setattr(worker, "SECONDS", 0.5)
    calls = (without_file, exception, lambda folder: os.abort(), memory, hang)
    targets = [Target(str(k), {"x.txt": b"1"}, ("x.txt",), call) for k, call in enumerate(calls)]
    outcomes = [one.outcome for one in run_inputs(targets, 1, range(5), tmp_path)]
    assert outcomes == ["exception", "exception", "abort", "memory", "hang"]


def test_the_hostile_corpus_is_refused(shared_data, tmp_path):
    """Every file by the command that opens it: one line that names the file, within five seconds and one GiB."""
    folder = shared_data("hostile")
    from fuzzing.hostile import CASES, target_of
    from fuzzing.worker import run_inputs

    assert {case.name for case in CASES} == {path.name for path in folder.iterdir() if path.is_dir()}
    targets = [target_of(case) for case in CASES]
    for case, found in zip(CASES, run_inputs(targets, 0, range(len(CASES)), tmp_path), strict=True):
        assert found.outcome == "refused", (case.name, found)
        assert case.file in found.message, (case.name, found)
