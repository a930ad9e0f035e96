"""`aerotri export` on the command line."""

from __future__ import annotations

import json

import pytest

import aerotri
from aerotri.cli.app import invoke
from gis_blocks import in_crs, plain_block


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    folder = tmp_path_factory.mktemp("export") / "small_result"
    return aerotri.adjust(in_crs(plain_block()), explain=False).save(folder, plots=False)


def test_command(result, tmp_path, monkeypatch, capsys):
    """All formats into one folder, named after the result; files of the user stay."""
    monkeypatch.chdir(tmp_path)
    for to, names in (("gpkg", ["result.gpkg"]), ("geoparquet", ["points.parquet", "rays.parquet"]),
                      ("stac", ["item.json"])):  # fmt: skip
        assert not invoke(["export", str(result), "--to", to])
        printed = capsys.readouterr().out
        for name in names:
            assert f"Written to small_export/{name}" in printed
    (tmp_path / "small_export" / "notes.txt").write_text("mine")
    assert not invoke(["export", str(result), "--json"])
    content = json.loads(capsys.readouterr().out)
    assert content["files"] == ["result.gpkg"]
    # twice in a row, and after another format: the file of the program is replaced, it is not one of the user
    assert not invoke(["export", str(result), "--to", "stac", "--json"])
    names = {path.name for path in (tmp_path / "small_export").iterdir() if not path.name.startswith(".")}
    assert names == {"result.gpkg", "points.parquet", "rays.parquet", "item.json", "notes.txt"}


def test_refused(result, tmp_path):
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "a.txt").write_text("a")
    refused = (
        (result, ["--to", "shp"], "out", "'shp' is not a format.*gpkg, geoparquet, stac, pdf"),
        (result, [], "full", "holds other files"),
        (tmp_path / "full", [], "out", "holds no adjustment"),
        (result, ["--to", "stac", "--flown", "yesterday"], "out", "no date"),
    )
    for folder, words, out, said in refused:
        with pytest.raises(aerotri.InputError, match=said):
            invoke(["export", str(folder), *words, "--out", str(tmp_path / out)])
    assert not (tmp_path / "out").exists()
    assert [path.name for path in (tmp_path / "full").iterdir()] == ["a.txt"]
