"""`aerotri adjust --executor`: what is said of folders that are no block in parts, and of executors that are none."""

import pytest

import aerotri
from aerotri.cli import main


def said(words, capsys, monkeypatch):
    monkeypatch.setattr("sys.argv", ["aerotri", "adjust", *map(str, words)])
    with pytest.raises(SystemExit) as ended:
        main()
    return ended.value.code, capsys.readouterr().err


@pytest.mark.parametrize(
    ("folder", "executor", "text"),
    [
        ("block", "processes:2", "--executor processes:2 for a block in one piece — divide it first"),
        ("block", "processes", "is no number of processes"),
        ("nothing", "processes:x", "is no number of processes"),
        ("nothing", "processes:2", "there is no such file or folder"),
    ],
)
def test_what_is_wrong_is_said(folder, executor, text, tmp_path, capsys, monkeypatch):
    if folder == "block":
        aerotri.simulate(aerotri.example_flight(), seed=1).save(tmp_path / folder)
    code, err = said([tmp_path / folder, "--executor", executor], capsys, monkeypatch)
    assert code == 2
    assert text in err
