"""The logo of [project]: read and written with the block, refused with file, line and remedy."""

from __future__ import annotations

import io
from dataclasses import replace

import pytest
from PIL import Image

import aerotri
from aerotri.conventions import InputError
from aerotri.formats.block.folder import read_block, write_block
from aerotri.observations.project import Project
from rolling_blocks import rolling_block

SVG = b'<svg xmlns="http://www.w3.org/2000/svg" width="20" height="10"><rect width="20" height="10"/></svg>'


def picture(form: str) -> bytes:
    file = io.BytesIO()
    Image.new("RGB", (8, 4)).save(file, form)
    return file.getvalue()


GOOD = {"logo.png": picture("PNG"), "of us.JPG": picture("JPEG"), "logo.svg": SVG}


@pytest.fixture
def folder(tmp_path):
    write_block(rolling_block(1)[0], tmp_path / "block")
    return tmp_path / "block"


def with_logo(folder, name):
    path = folder / "block.toml"
    path.write_text(path.read_text(encoding="utf-8") + f"\n[project]\nlogo = '{name}'\n", encoding="utf-8")
    return folder


@pytest.mark.parametrize("name", GOOD)
def test_travels_with_the_block(folder, tmp_path, name):
    (folder / name).write_bytes(GOOD[name])
    block = read_block(with_logo(folder, name))
    assert block.project.logo_content == GOOD[name]
    write_block(block, tmp_path / "copy")
    assert read_block(tmp_path / "copy").project == block.project


def test_in_a_folder_of_the_block(folder, tmp_path):
    (folder / "pictures").mkdir()
    (folder / "pictures" / "logo.png").write_bytes(GOOD["logo.png"])
    write_block(read_block(with_logo(folder, "pictures/logo.png")), tmp_path / "copy")
    assert (tmp_path / "copy" / "pictures" / "logo.png").read_bytes() == GOOD["logo.png"]


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("missing.png", None, "is missing"),
        ("../outside.png", GOOD["logo.png"], "outside the block folder"),
        ("/etc/hostname", None, "outside the block folder"),
        ("C:\\logo.png", None, "outside the block folder"),
        ("logo.gif", GOOD["logo.png"], "not a PNG, JPEG or SVG"),
        ("block.toml", None, "not a PNG, JPEG or SVG"),
        ("text.png", b"not a picture", "no picture in the format PNG"),
        ("cut.png", GOOD["logo.png"][:40], "no picture in the format PNG"),
        ("other.png", GOOD["of us.JPG"], "no picture in the format PNG"),
        ("bomb.svg", b'<!DOCTYPE svg [<!ENTITY a "b">]>' + SVG, "document type"),
        ("page.svg", b"<html></html>", "no SVG drawing"),
        ("cut.svg", SVG[:60], "is not XML"),
        ("refers.svg", SVG.replace(b"<rect", b'<image href="/etc/passwd"/><rect'), "refers to other files"),
    ],
)
def test_refused_with_line_and_remedy(folder, name, content, said):
    if content is not None:
        (folder / name).write_bytes(content)
    with pytest.raises(InputError, match=said) as caught:
        read_block(with_logo(folder, name))
    error = caught.value
    line = (folder / "block.toml").read_text().splitlines().index(f"logo = '{name}'") + 1
    assert (error.file.name, error.line) == ("block.toml", line)
    assert error.remedy


def test_a_link_out_of_the_block_is_refused(folder, tmp_path):
    (tmp_path / "elsewhere.png").write_bytes(GOOD["logo.png"])
    (folder / "logo.png").symlink_to(tmp_path / "elsewhere.png")
    with pytest.raises(InputError, match="outside the block folder"):
        read_block(with_logo(folder, "logo.png"))


def test_a_name_that_leads_out_is_not_written(folder, tmp_path):
    block = replace(read_block(folder), project=Project(logo="../out.png", logo_content=GOOD["logo.png"]))
    with pytest.raises(InputError, match="outside the block folder"):
        write_block(block, tmp_path / "copy")
    assert not (tmp_path / "out.png").exists()


def test_on_the_report(folder, tmp_path):
    (folder / "logo.svg").write_bytes(SVG)
    aerotri.adjust(with_logo(folder, "logo.svg")).save(tmp_path / "result")
    page = (tmp_path / "result" / "report.html").read_text()
    assert '<img class="logo" src="data:image/svg+xml;base64,' in page
    assert (tmp_path / "result" / "block" / "logo.svg").read_bytes() == SVG
