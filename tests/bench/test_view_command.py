"""`aerotri view` as a program: it serves on this machine alone until it is ended."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import urllib.error
import urllib.request

import pytest

from aerotri.cli.app import invoke
from aerotri.conventions import InputError

pytest.importorskip("starlette", reason="the bench takes the extra 'view'")


@pytest.mark.skipif(os.name == "nt", reason="SIGINT is sent as on Unix")
def test_serves_until_it_is_interrupted(result):
    """The address is there at once, where stdout is kept back in a pipe too."""
    kept_back = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    words = [sys.executable, "-m", "aerotri.cli", "view", str(result), "--no-browser"]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=kept_back) as process:
        try:
            line = process.stdout.readline()
            address = re.search(r"http://127\.0\.0\.1:\d+/[\w-]{30,}/", line)[0]
            with urllib.request.urlopen(address) as answer:
                assert b"aerotri bench" in answer.read()
            with pytest.raises(urllib.error.HTTPError, match="403"):
                urllib.request.urlopen(address[:-3] + "/")
            process.send_signal(signal.SIGINT)
            assert process.wait(30) == 0
            assert process.stderr.read() == ""
        finally:
            process.kill()


def test_folder_that_is_neither_and_a_taken_port_are_told(result, tmp_path):
    from aerotri.bench.serve import listening

    with pytest.raises(InputError, match="holds neither a result nor a block"):
        invoke(["view", str(tmp_path), "--no-browser"])
    with listening(0) as taken, pytest.raises(InputError, match="choose another --port"):
        invoke(["view", str(result), "--no-browser", "--port", str(taken.getsockname()[1])])


def test_missing_package_is_told_with_the_remedy(result, monkeypatch):
    monkeypatch.setitem(sys.modules, "uvicorn", None)
    with pytest.raises(InputError, match=r"uvicorn is not installed — .*aerotri\[view\]"):
        invoke(["view", str(result), "--no-browser"])
