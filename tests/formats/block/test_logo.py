"""The logo of [project]: read and written with the block, refused with file, line and remedy."""

from __future__ import annotations

import io
from dataclasses import replace
from functools import cache

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


@cache
def plain():
    return rolling_block(1)[0]


@pytest.fixture
def folder(tmp_path):
    write_block(plain(), tmp_path / "block")
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


NESTED = b"".join(
    b'<g id="n%d"><use href="#n%d"/><use href="#n%d"/></g>' % (k, k + 1, k + 1) for k in range(30)
) + b'<g id="n30"><path/></g>'  # fmt: skip
HOSTILE = {
    "script": b"<script>alert(1)</script>",
    "script in capitals": b"<SCRIPT>alert(1)</SCRIPT>",
    "script of pages": b'<x:script xmlns:x="http://www.w3.org/1999/xhtml">alert(1)</x:script>',
    "script of a namespace of its own": b'<x:script xmlns:x="urn:x">alert(1)</x:script>',
    "page": b"<foreignObject><p/></foreignObject>",
    "frame": b'<iframe src="#a"/>',
    "event": b'<rect onload="alert(1)"/>',
    "event in capitals": b'<rect OnClick="alert(1)"/>',
    "animation": b'<a id="a"><set attributeName="href" to="javascript:alert(1)"/></a>',
    "program as address": b'<image href="java\tscript:alert(1)"/>',
    "address": b'<image href="https://example.org/a.png"/>',
    "address after a blank": b'<image xlink:href=" //example.org/a" xmlns:xlink="http://www.w3.org/1999/xlink"/>',
    "drawing in a drawing": b'<image href="data:image/svg+xml;base64,AAAA"/>',
    "page as data": b'<image href="data:text/html,x"/>',
    "base": b'<g xml:base="https://example.org/"/>',
    "fill": b'<rect fill="url(https://example.org/a.svg#b)"/>',
    "style of an element": b"<rect style=\"fill: URL( 'file:///etc/passwd' )\"/>",
    "style": b"<style>@import 'https://example.org/a.css';</style>",
    "style with escapes": b"<style>rect { fill: \\75rl(https://example.org) }</style>",
    "uses itself": b'<g id="a"><use href="#a"/></g>',
    "uses without bound": NESTED,
    "deep": b"<g>" * 200 + b"</g>" * 200,
}


@pytest.mark.parametrize("inside", HOSTILE.values(), ids=HOSTILE)
def test_drawings_that_are_more_than_drawings(folder, tmp_path, inside):
    content = SVG.replace(b"<rect", inside + b"<rect")
    (folder / "logo.svg").write_bytes(content)
    with pytest.raises(InputError, match=r"project\.logo = 'logo\.svg' (contains|has|refers|uses|draws)") as caught:
        read_block(with_logo(folder, "logo.svg"))
    assert caught.value.file.name == "block.toml"
    block = replace(plain(), project=Project(logo="logo.svg", logo_content=content))
    with pytest.raises(InputError, match=r"project\.logo = 'logo\.svg'"):
        write_block(block, tmp_path / "copy")


def test_style_sheets_are_refused(folder):
    (folder / "logo.svg").write_bytes(b'<?xml-stylesheet href="https://example.org/a.css"?>' + SVG)
    with pytest.raises(InputError, match="style sheet"):
        aerotri.check(with_logo(folder, "logo.svg"))


def test_usual_drawings_are_taken(folder):
    """As Inkscape writes them: its own elements, gradients, styles, a picture inside."""
    inside = (
        b'<sodipodi:namedview xmlns:sodipodi="http://sodipodi.sourceforge.net/DTD/sodipodi-0.dtd" id="base"/>'
        b'<metadata><rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#"><rdf:li rdf:resource="x"/>'
        b'</rdf:RDF></metadata><defs><linearGradient id="a"><stop offset="0" style="stop-color:#fff"/></linearGradient>'
        b'<linearGradient id="b" xlink:href="#a" xmlns:xlink="http://www.w3.org/1999/xlink"/></defs>'
        b"<style>.c { fill: url(#b) }</style><g><use href='#d'/>"
        b"<path id='d' class='c' style='fill:url(#a);stroke:none'/>"
        b'<image href="data:image/png;base64,AAAA"/><text>once\\twice</text></g>'
    )
    (folder / "logo.svg").write_bytes(SVG.replace(b"<rect", inside + b"<rect"))
    assert read_block(with_logo(folder, "logo.svg")).project.logo_content


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
