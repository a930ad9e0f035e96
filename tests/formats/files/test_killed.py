"""Killed between any two operations on files: the older or the new result stands, whole; the next run tidies up.

`tools/prove/kill.py` does this to whole commands, a thousand times.
"""

from __future__ import annotations

import os
import signal
import sys

import pytest

from aerotri.formats.files import atomic
from aerotri.formats.files.atomic import atomic_file, atomic_folder

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="forks")
OPERATIONS = ("open", "os.mkdir", "os.rename", "os.remove", "os.rmdir", "os.link", "os.scandir")


def write_folder(out, text):
    with atomic_folder(out, own=("table", "plots")) as place:
        (place / "plots").mkdir()
        for name in ("table", "plots/a", "plots/b"):
            (place / name).write_text(text)


def write_file(out, text):
    with atomic_file(out / "file") as place:
        place.write_text(text)


def killed_at(number, place, work):
    """Whether a fork that does the work is killed at its operation of that number beneath a place."""
    child = os.fork()
    if child:
        return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == -signal.SIGKILL
    count = 0

    def hook(event, args):
        nonlocal count
        if event in OPERATIONS and str(place) in str(args[0]):
            count += 1
            if count == number:
                os.kill(os.getpid(), signal.SIGKILL)

    sys.addaudithook(hook)
    try:
        work()
    finally:
        os._exit(0)


@pytest.mark.parametrize("one_step", [True, False])
@pytest.mark.parametrize("write", [write_folder, write_file])
def test_killed_at_every_operation(write, one_step, tmp_path, monkeypatch):
    if not one_step:
        monkeypatch.setattr(atomic, "_exchange_in_one_step", lambda new, target: False)
    out, number, hidden = tmp_path / "out", 0, 0
    out.mkdir()
    write(out, "old")
    (out / "mine").write_text("mine")
    (out / "plots").mkdir(exist_ok=True)
    (out / "plots" / "mine").write_text("mine")
    names = sorted(p.relative_to(out) for p in out.rglob("*") if p.is_file() and p.name[0] != "." and p.name != "mine")
    alive = True
    while alive:
        number += 1
        alive = killed_at(number, tmp_path, lambda: write(out, "new"))
        hidden += any(tmp_path.rglob("*.aerotri.tmp"))
        if out.exists():
            assert {(out / name).read_text() for name in names} in ({"old"}, {"new"})
        else:
            # two renames where the system cannot swap: the next run brings the older folder back
            assert not one_step
        write(out, "old")
        assert {(out / name).read_text() for name in names} == {"old"}
        assert (out / "mine").read_text() == (out / "plots" / "mine").read_text() == "mine"
        assert not [p for p in tmp_path.rglob("*.aerotri.tmp")]
    assert number > 5
    assert hidden >= 3
