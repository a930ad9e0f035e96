"""PDF documents of results: their numbers, both languages, hostile names, the same bytes, what is refused."""

from __future__ import annotations

import io
import json
import sys
from dataclasses import replace

import numpy as np
import pytest
import shapely
from PIL import Image

import aerotri
from aerotri import InputError
from aerotri.cli.app import invoke
from aerotri.formats.block.folder import read_block
from aerotri.observations.project import Project
from aerotri.rasters.grids import Grid
from aerotri.rasters.surface_files import write_raster_parts, write_surface_parts
from gis_blocks import in_crs
from small_blocks import small_block

pypdf = pytest.importorskip("pypdf")
pytest.importorskip("typst")

HOSTILE = '#panic("x") *bold* $x$ <label> @ref `raw` [a] \\n "end"'


def picture() -> bytes:
    file = io.BytesIO()
    Image.new("RGB", (40, 20), (10, 90, 170)).save(file, "PNG")
    return file.getvalue()


PROJECT = Project(HOSTILE, "Kieswerk Nörd & Söhne", "A. Operator", "Survey GmbH", "2026-05-31", "first\nsecond #line",
                  "logo.png", picture())  # fmt: skip


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    """Folder of an adjustment with parameters and an unknown principal distance."""
    block, _ = small_block(5, "bluh:1-12")
    camera = replace(block.cameras[0], interior={
        name: replace(one, fixed=name != "focal_length_mm", sigma=0.02 if name == "focal_length_mm" else one.sigma)
        for name, one in block.cameras[0].interior.items()
    })  # fmt: skip
    folder = tmp_path_factory.mktemp("documents") / "result"
    block = replace(in_crs(block), cameras=(camera,), project=PROJECT)
    return aerotri.adjust(block, explain=False).save(folder, plots=False)


def text_of(path) -> str:
    """All text of a PDF, without the places at which a word may be broken."""
    pages = pypdf.PdfReader(path).pages
    text = "\n".join(page.extract_text() for page in pages)
    return " ".join(text.replace("\u200b", "").replace("\u2009", " ").replace("\xa0", " ").split())


def test_report_in_both_languages(result, tmp_path):
    found = json.loads((result / "adjustment.json").read_text())
    for language, decimal, words in (("en", ".", ("Check points", "Accepted", "2026-05-31", "Settings used")),
                                     ("de", ",", ("Kontrollpunkte", "Angenommen", "31.05.2026", "σ₀"))):  # fmt: skip
        made = aerotri.export(result, tmp_path / language, "pdf", language=language)
        assert made.files == ("adjustment.pdf",)
        text = text_of(tmp_path / language / "adjustment.pdf")
        for word in (*words, "Kieswerk Nörd & Söhne", "second #line", "EPSG:", "adjustment.max_iterations"):
            assert word in text
        assert f"{found['sigma0']:.3f}".replace(".", decimal) in text
        # every check point with its difference
        for point in found["check_points"]["points"]:
            assert point["point"] in text
        rms = found["check_points"]["rms"]["Z"]
        assert f"{rms:.3f}".replace(".", decimal) in text
        if "tZ" in found["check_points"]["points"][0]:
            assert "tZ [m]" in text


def test_names_stay_text(result, tmp_path):
    aerotri.export(result, tmp_path, "pdf")
    assert HOSTILE in text_of(tmp_path / "adjustment.pdf")


def test_the_same_bytes(result, tmp_path):
    files = [tmp_path / name / "adjustment.pdf" for name in ("a", "b")]
    for file in files:
        aerotri.export(result, file.parent, "pdf")
    assert files[0].read_bytes() == files[1].read_bytes()


def test_calibration(result, tmp_path):
    opened = aerotri.open_result(result)
    camera = opened.block.cameras[0].name
    aerotri.export(opened, tmp_path, "pdf", document="calibration", camera=camera, language="de")
    text = text_of(tmp_path / "calibration.pdf")
    parameters = opened.adjusted.parameters
    row = int(np.flatnonzero(parameters.names == "focal_length_mm")[0])
    assert f"{parameters.value[row]:.4f}".replace(".", ",") in text
    assert f"{parameters.sigma[row]:.4f}".replace(".", ",") in text
    # 24 months after the last day of May, and what is on every certificate
    for word in (
        "31.05.2028",
        "Unterschrift",
        "festgehalten",
        "bluh.12",
        "Korrelationen",
        "keine Forderung einer Norm",
    ):
        assert word in text
    additional = np.flatnonzero(parameters.kinds == "additional")
    a, b = additional[:2]
    r = parameters.covariance[a, b] / (parameters.sigma[a] * parameters.sigma[b])
    assert f"{100.0 * r:.0f}".replace("-", "−").replace("−0", "0") in text


def test_calibration_of_a_camera_that_was_held(tmp_path):
    """Its principal distance stands in the table alone, as value and as given; it is said to be no calibration."""
    block, _ = small_block(5)
    camera = block.cameras[0]
    assert all(one.fixed for one in camera.interior.values())
    aerotri.export(aerotri.adjust(block, explain=False), tmp_path, "pdf", document="calibration")
    text = text_of(tmp_path / "calibration.pdf")
    assert text.count(f"{camera.interior['focal_length_mm'].value:.4f}") == 2
    assert "This is no calibration" in text
    assert "Parameters held" not in text


@pytest.fixture(scope="module")
def measured(result, tmp_path_factory):
    """Folders of a volume of three piles and of a change of one of them, beside the result."""
    place = result.parent
    cell, count, half = 2.0, 110, 110.0
    middle = np.round(np.median(aerotri.open_result(result).adjusted.images.centre[:, :2], axis=0))
    grid = Grid(count, count, middle[0] - half, middle[1] + half, cell, cell)
    x, y = np.meshgrid(grid.x(np.arange(count)) - middle[0], grid.y(np.arange(count)) - middle[1])
    z, piles = 100.0 + 0.02 * x, {}
    for name, at, high in (("A", -70.0, 12.0), ("#B", 0.0, 8.0), ("C", 70.0, 6.0)):
        z = z + np.maximum(high * (1.0 - np.hypot(x - at, y) / 30.0), 0.0)
        piles[name] = shapely.Point(middle[0] + at, middle[1]).buffer(33.0)
    epsg = int(read_block(result / "block").crs.partition(":")[2].partition("+")[0])
    noise = np.random.default_rng(1).normal(0.0, 0.04, (2, *z.shape))
    for k, name in enumerate(("first", "second")):
        (place / name).mkdir()
        surface = z + k * np.maximum(3.0 * (1.0 - np.hypot(x - 70.0, y) / 25.0), 0.0) + noise[k]
        parts = [(0, 0, surface, np.full_like(z, 0.2))]
        write_surface_parts(place / name / "dsm.tif", parts, grid, epsg, "DSM Z, m", {"NOISE_LENGTH_M": "4"})
        write_raster_parts(place / name / "matching.tif", [(0, 0, np.full_like(z, 0.04))], grid, epsg,
                           "σ of Z of matching alone, m", np.dtype("f4"), -9999.0)  # fmt: skip
    aerotri.volume(place / "first", piles, base="plane", adjustment=result, density=1.8, density_sigma=0.09).save(
        place / "volume"
    )
    stable = shapely.box(middle[0] - 100.0, middle[1] - 105.0, middle[0] + 100.0, middle[1] - 40.0)
    aerotri.change(place / "first", place / "second", stable=stable, align="height").save(place / "change")
    return place


def test_volume_certificate(measured, tmp_path):
    content = json.loads((measured / "volume" / "volume.json").read_text())
    for language, words in (("en", ("Volume certificate", "matching", "Signature")),
                            ("de", ("Volumenbescheinigung", "Bildzuordnung", "Unterschrift"))):  # fmt: skip
        made = aerotri.export(measured / "volume", tmp_path / language, "pdf", language=language)
        assert "the head is that of" in made.notes[0]
        text = text_of(tmp_path / language / "volume.pdf")
        for word in (*words, "#B", "Survey GmbH", HOSTILE):
            assert word in text
        assert f"{content['net_m3']:,.0f}".replace(",", " ") in text
        assert f"± {1.96 * content['sigma']['sigma_m3']:.0f} m³ (95 %)" in text
        for pile in content["piles"]:
            assert f"{pile['mass']['net_t']:,.0f}".replace(",", " ") in text


def test_change_certificate(measured, tmp_path):
    content = json.loads((measured / "change" / "change.json").read_text())
    made = aerotri.export(measured / "change", tmp_path, "pdf", language="de", project=measured / "result")
    assert made.files == ("change.pdf",)
    text = text_of(tmp_path / "change.pdf")
    whole = content["volumes"][-1]
    for word in (
        "Änderungsbescheinigung",
        "Nachweisgrenze",
        "Survey GmbH",
        f"{whole['gained_m3']:,.0f}".replace(",", " "),
    ):
        assert word in text
    # the heap grew by the cone that was put on it
    assert abs(whole["net_m3"] - np.pi * 25.0**2) < 3.0 * whole["sigma_net_m3"]


@pytest.fixture(scope="module")
def clouds(result, tmp_path_factory):
    """Folder of a change of two clouds, a third of which was raised, with stable ground on the rest."""
    place = tmp_path_factory.mktemp("clouds")
    rng = np.random.default_rng(3)
    before, after = (
        np.column_stack([rng.uniform(0.0, 60.0, (20000, 2)), rng.normal(0.0, 0.02, 20000)]) for _ in range(2)
    )
    after[:, 2] += np.where(after[:, 0] < 20.0, 0.5, 0.0)
    stable = shapely.box(25.0, 0.0, 60.0, 60.0)
    return aerotri.cloud_change(before, after, stable=stable, project=result).save(place / "change")


def test_certificate_of_a_change_of_clouds(clouds, tmp_path):
    content = json.loads((clouds / "cloud_change.json").read_text())
    for language, decimal, words in (
        ("en", ".", ("Change certificate", "Gained", "cylinder", "stable ground")),
        ("de", ",", ("Änderungsbescheinigung", "Zugang", "Zylinder", "Gelände")),
    ):
        made = aerotri.export(clouds, tmp_path / language, "pdf", language=language)
        assert made.files == ("change.pdf",)
        text = text_of(tmp_path / language / "change.pdf")
        for word in (*words, "Survey GmbH", HOSTILE):
            assert word in text
        # a third was raised
        assert f"{content['gained_percent']:.1f}".replace(".", decimal) + " % " in text
        assert content["gained_percent"] == pytest.approx(100.0 / 3.0, abs=4.0)
        # the caption of the histogram
        assert "logarith" in text
    assert (clouds / "plots" / "histogram.de.svg").is_file()


def test_damaged_change_of_clouds_is_refused(tmp_path):
    (tmp_path / "cloud_change.json").write_text("{}")
    with pytest.raises(InputError, match="is damaged"):
        aerotri.export(tmp_path, tmp_path / "out", "pdf")


def test_change_of_an_older_version_is_to_be_computed_again(clouds, tmp_path):
    content = json.loads((clouds / "cloud_change.json").read_text())
    del content["gained_percent"]
    (tmp_path / "cloud_change.json").write_text(json.dumps(content))
    with pytest.raises(InputError, match=r"written by another version .* compute the result again"):
        aerotri.export(tmp_path, tmp_path / "out", "pdf")


def test_command_keeps_other_exports(result, tmp_path, capsys):
    out = tmp_path / "out"
    for words in ([], ["--document", "calibration"], ["--language", "de"]):
        assert not invoke(["export", str(result), "--to", "pdf", *words, "--out", str(out)])
    assert {path.name for path in out.iterdir() if not path.name.startswith(".")} == {
        "adjustment.pdf",
        "calibration.pdf",
    }
    assert "Written to" in capsys.readouterr().out


def test_refused(result, measured, tmp_path):
    for source, words, said in (
        (result, {"language": "xx"}, "no texts in 'xx'.*de, en"),
        (result, {"document": "poem"}, "no document 'poem'"),
        (result, {"document": "calibration", "camera": "none"}, "no photograph was taken with a camera 'none'"),
        (result, {"camera": "ucd"}, "belongs to a calibration"),
        (measured / "volume", {"document": "calibration"}, "has no calibration"),
        (measured / "volume", {"project": tmp_path}, "holds no block.toml"),
        (tmp_path, {}, "holds no adjustment"),
    ):
        with pytest.raises(InputError, match=said):
            aerotri.export(source, tmp_path / "out", "pdf", **words)
    with pytest.raises(InputError, match="is not written as gpkg"):
        aerotri.export(measured / "volume", tmp_path / "out", "gpkg")
    with pytest.raises(InputError, match="belong to documents"):
        aerotri.export(result, tmp_path / "out", "gpkg", language="de")
    assert not (tmp_path / "out").exists()


def test_without_typst(result, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "typst", None)
    with pytest.raises(InputError, match=r"typst is not installed.*pip install 'aerotri\[pdf\]'"):
        aerotri.export(result, tmp_path / "out", "pdf")


def test_logo_travels_with_the_block(result, tmp_path):
    kept = read_block(result / "block").project
    assert kept == PROJECT
    assert (result / "block" / "logo.png").read_bytes() == PROJECT.logo_content
    images = pypdf.PdfReader(_exported(result, tmp_path)).pages[0].images
    assert [image.image.size for image in images] == [(40, 20)]


def _exported(result, out):
    aerotri.export(result, out, "pdf")
    return out / "adjustment.pdf"


def _changed(folder, rise):
    flat = np.full((30, 30), 100.0)
    first, second = (
        aerotri.Surface.of_array(z, left=500.0, top=530.0, cell=1.0, sigma=np.full(flat.shape, 0.02))
        for z in (flat, flat + rise)
    )
    aerotri.change(first, second).save(folder, plots=False)
    return folder


def test_a_document_of_another_result_is_not_replaced(tmp_path):
    first, second = _changed(tmp_path / "first", 1.0), _changed(tmp_path / "second", 2.0)
    out = tmp_path / "documents"
    aerotri.export(first, out, to="pdf")
    kept = (out / "change.pdf").read_bytes()
    with pytest.raises(InputError, match=r"is the document of another result, .*first") as refused:
        aerotri.export(second, out, to="pdf")
    assert "another folder" in refused.value.remedy
    assert (out / "change.pdf").read_bytes() == kept
    aerotri.export(_changed(first, 3.0), out, to="pdf", language="de")
    assert (out / "change.pdf").read_bytes() != kept
    (out / "change.pdf").unlink()
    aerotri.export(second, out, to="pdf")
    with pytest.raises(InputError, match=r"another result, .*second"):
        aerotri.export(first, out, to="pdf")
