"""Block folders: what is read, in which units, and that writing loses nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from format_samples import BLOCK_TOML, IMAGES, assert_same_block

from aerotri.conventions import InputError
from aerotri.formats.block.folder import read_block, write_block
from aerotri.observations import Block, Prior


def test_small_block_is_read(small_block):
    block = read_block(small_block())
    assert block.name == "small"
    assert block.images.names.tolist() == ["a", "b"]
    assert block.images.strip.tolist() == ["1", "1"]
    assert block.images.columns["day"].tolist() == ["mon", "tue"]
    np.testing.assert_allclose(block.images.centre, [[1, 2, 1000], [101, 2, 1000]])
    np.testing.assert_allclose(block.images.angles[0], [0, 0, np.pi / 2], rtol=1e-15)
    assert np.isnan(block.images.angles[1]).all()
    assert block.points.tolist() == ["p1", "p2", "p9"]
    assert block.image_points.image.tolist() == [0, 0, 1, 1]
    assert block.image_points.point.tolist() == [0, 1, 0, 1]
    np.testing.assert_array_equal(block.image_points.xy[0], [10.5, -3.25])
    np.testing.assert_array_equal(block.image_points.sigma, np.full((4, 2), 0.002))
    assert block.control.point.tolist() == [0, 2]
    assert block.control.is_check.tolist() == [False, True]
    np.testing.assert_array_equal(block.control.sigma, [[0.02, 0.02, 0.04], [np.nan, np.nan, 0.3]])
    assert block.gnss_ins is not None
    np.testing.assert_array_equal(block.gnss_ins.time, [17.5, 18.5])
    np.testing.assert_allclose(block.gnss_ins.angles_sigma[0], np.radians([0.01, 0.01, 0.02]))
    assert np.isnan(block.gnss_ins.angles[1]).all()


def test_the_toml_itself_may_be_named(small_block):
    folder = small_block()
    assert_same_block(read_block(folder / "block.toml"), read_block(str(folder)))


def test_interior_elements_not_named_are_fixed(small_block):
    text = BLOCK_TOML + (
        "[camera.cam.interior]\nfocal_length_mm = { sigma = 0.01 }\nx0_mm = {}\n"
        "[camera.cam.brown]\nK1 = { value = 1e-8, sigma = 1e-9 }\nP1 = { fixed = true }\n"
        "[camera.cam.lens]\nk1 = { value = -0.1 }\n"
    )
    camera = read_block(small_block({"block.toml": text})).cameras[0]
    assert camera.interior["focal_length_mm"] == Prior(100.0, 0.01)
    assert camera.interior["x0_mm"].kind == "free"
    assert camera.interior["y0_mm"] == Prior(0.0, fixed=True)
    assert camera.brown == {"K1": Prior(1e-8, 1e-9), "P1": Prior(0.0, fixed=True)}
    assert camera.lens == {"k1": Prior(-0.1)}


def test_datum_fixed_splits_at_the_last_colon(small_block):
    images = IMAGES.replace("\na,", "\nx:a,")
    points = "image,point,x,y\nx:a,p1,1,1\n"
    toml = BLOCK_TOML + 'datum = "fixed"\ndatum_fixed = ["x:a:X0", "b:kappa"]\n'
    changes = {"images.csv": images, "image_points.csv": points, "block.toml": toml, "gnss_ins.csv": None}
    block = read_block(small_block(changes))
    assert block.settings.adjustment.datum_fixed == (("x:a", "X0"), ("b", "kappa"))


@pytest.mark.parametrize(
    ("unit", "values", "expected"),
    [("mm", "1.5,-2", (1.5, -2.0)), ("um", "1500,-2000", (1.5, -2.0)), ("px", "5150,4200", (1.5, -2.0))],
)
def test_image_units(small_block, unit, values, expected):
    toml = BLOCK_TOML.replace('image_unit = "mm"', f'image_unit = "{unit}"')
    points = f"image,point,x,y,sx,sy\na,p1,{values},0.5,\n"
    block = read_block(small_block({"block.toml": toml, "image_points.csv": points}))
    np.testing.assert_allclose(block.image_points.xy[0], expected, rtol=1e-12)
    pixel_or_unit = {"mm": 0.5, "um": 0.5e-3, "px": 0.5 * 0.01}[unit]
    np.testing.assert_allclose(block.image_points.sigma[0], [pixel_or_unit, 0.002])


def test_pixels_begin_at_the_corner_and_belong_to_their_camera(small_block):
    toml = BLOCK_TOML.replace('image_unit = "mm"', 'image_unit = "px"') + (
        "[camera.other]\nsize_px = [100, 50]\npixel_um = 20.0\nfocal_length_mm = 10.0\n"
    )
    images = "image,camera\na,cam\nb,other\n"
    points = "image,point,x,y\nb,p1,0,0\na,p1,0,0\nb,p2,100,50\na,p2,5000,4000\n"
    changes = {"block.toml": toml, "images.csv": images, "image_points.csv": points}
    block = read_block(small_block(changes))
    np.testing.assert_allclose(block.image_points.xy, [[-1.0, 0.5], [-50.0, 40.0], [1.0, -0.5], [0.0, 0.0]], atol=1e-12)
    np.testing.assert_array_equal(block.image_points.sigma, np.full((4, 2), 0.002))


@pytest.mark.parametrize(("unit", "right_angle"), [("deg", 90), ("gon", 100), ("rad", np.pi / 2)])
def test_angle_units(small_block, unit, right_angle):
    toml = f'angle_unit = "{unit}"\n' + BLOCK_TOML
    images = f"image,camera,omega,phi,kappa\na,cam,0,0,{right_angle!r}\nb,cam,,,\n"
    block = read_block(small_block({"block.toml": toml, "images.csv": images}))
    np.testing.assert_allclose(block.images.angles[0, 2], np.pi / 2, rtol=1e-15)


def test_names_stay_text(small_block):
    points = 'image,point,x,y\n007,NA,1,1\n007,1e5,1,2\n007,<b>&amp;</b>,1,3\n007,"q""o,te",1,4\n 8 ,null,1,5\n'
    images = "image,camera\n007,cam\n8,cam\n"
    block = read_block(small_block({"images.csv": images, "image_points.csv": points, "gnss_ins.csv": None}))
    assert block.images.names.tolist() == ["007", "8"]
    assert block.points.tolist()[:5] == ["NA", "1e5", "<b>&amp;</b>", 'q"o,te', "null"]
    assert block.image_points.image.tolist() == [0, 0, 0, 0, 1]


def test_comments_blank_lines_bom_carriage_returns_and_own_columns(small_block):
    points = (
        b'\xef\xbb\xbf# measured by hand, "open quote\r\n\r\nimage, point ,x,y,x_note\r\na,p1,10.5,-3.25,\r\n'
        b"  # ,,,,,\r\na,p2, 1 ,+2,7\r\n#\xff\r\nb,p1,-10.5,3.25,\r\nb,p2,-3,-4,"
    )
    assert_same_block(read_block(small_block({"image_points.csv": points})), read_block(small_block()))


@pytest.mark.parametrize("control", [None, "", "# nothing\n\n", "point,X,Y,Z,role\n"])
def test_control_may_be_missing_or_empty(small_block, control):
    block = read_block(small_block({"control.csv": control}))
    assert len(block.control) == 0
    assert block.points.tolist() == ["p1", "p2"]


def test_sigma_that_stands_for_all_is_the_median_where_the_settings_give_none(small_block):
    toml = BLOCK_TOML.replace("image_sigma_um = 2.0\n", "")
    points = "image,point,x,y,sx,sy\na,p1,1,1,0.001,0.003\na,p2,1,2,0.003,0.003\n"
    block = read_block(small_block({"block.toml": toml, "image_points.csv": points}))
    assert block.settings.image_sigma_um == pytest.approx(3.0)


def test_empty_tables_of_what_is_not_built_do_no_harm(small_block):
    folder = small_block(
        {"constraints.csv": "kind,points,value,sigma\n", "edits.csv": "", "fiducials.csv": "# later\n"}
    )
    read_block(folder)


@pytest.mark.parametrize("tables", ["csv", "parquet"])
def test_round_trip(small_block, tmp_path, tables):
    text = BLOCK_TOML + (
        'additional_parameters = ["bluh:1-3+12", "brown:K1"]\nparameter_groups = "day"\ndatum = "inner"\n'
        'datum_points = ["p1", "p9"]\nmax_iterations = 7\n'
        "[camera.cam.brown]\nK1 = { value = 1.5e-9, sigma = 1e-10 }\n[camera.cam.interior]\nx0_mm = { value = 0.02 }\n"
        '[gnss]\nshift = "block"\nlever_arm_m = [0.1, 0.2, 0.3]\nlever_arm_sigma_m = [0.1, 0.1, 0.1]\n'
        '[ins]\nboresight = "off"\n[corrections]\nrefraction = "standard"\n'
    )
    block = read_block(small_block({"block.toml": text}))
    write_block(block, tmp_path / "copy", tables=tables)
    assert (tmp_path / "copy" / f"images.{tables}").exists()
    assert_same_block(read_block(tmp_path / "copy"), block)


def test_odd_names_survive_writing(small_block, tmp_path):
    block = read_block(small_block({"gnss_ins.csv": None, "control.csv": None}))
    names = np.array(['#7,"x"', "é – <b>"])
    odd = replace(
        block,
        name='quotes " and \\ back\u007fslash\n',
        images=replace(block.images, names=names, columns={'d,"ay': np.array(["", "#"])}),
        points=np.array(["'", "  inner  blanks".strip() + "\u00a0"]),
        cameras=(replace(block.cameras[0], name='Ω.[cam] "1"'),),
    )
    for tables in ("csv", "parquet"):
        write_block(odd, tmp_path / "odd", tables=tables)
        assert_same_block(read_block(tmp_path / "odd"), odd)


@pytest.mark.parametrize("name", [" a", "a\n", "a\nb", "a\x00b", "", "a" * 2000, "\ud800"])
def test_names_that_would_not_come_back_are_refused(small_block, tmp_path, name):
    block = read_block(small_block())
    bad = replace(block, points=np.array([name, *block.points[1:]]))
    with pytest.raises(InputError):
        write_block(bad, tmp_path / "bad")
    assert not (tmp_path / "bad").exists()
    assert list(tmp_path.glob(".bad*")) == []


def test_writing_keeps_foreign_files_and_drops_old_tables(small_block, tmp_path):
    block = read_block(small_block())
    write_block(block, tmp_path / "b", tables="parquet")
    (tmp_path / "b" / "notes.txt").write_text("mine")
    write_block(replace(block, gnss_ins=None), tmp_path / "b")
    names = sorted(path.name for path in (tmp_path / "b").iterdir() if path.name != ".aerotri-files")
    assert names == ["block.toml", "control.csv", "image_points.csv", "images.csv", "notes.txt"]


def test_parquet_takes_the_types_programs_write(small_block):
    folder = small_block({"image_points.csv": None, "images.csv": None})
    (folder / "images.csv").write_text("image,camera\n7,cam\n8,cam\n")
    table = pa.table(
        {
            "image": pa.array([7, 8], pa.int64()),
            "point": pa.array(["p", "p"]).dictionary_encode(),
            "x": pa.array([1, 2], pa.int32()),
            "y": pa.array([1.5, 2.5], pa.float32()),
            "sx": pa.array([None, 0.5], pa.float64()),
            "sy": pa.nulls(2),
        }
    )
    pq.write_table(table, folder / "image_points.parquet")
    (folder / "gnss_ins.csv").unlink()
    block = read_block(folder)
    assert block.image_points.image.tolist() == [0, 1]
    np.testing.assert_array_equal(block.image_points.sigma, [[0.002, 0.002], [0.5, 0.002]])


def test_many_rays_come_back(small_block, tmp_path):
    """How long that takes is measured by tools/benchmark/benchmark_reading.py."""
    block = _large(read_block(small_block()), 14_000)
    write_block(block, tmp_path / "large")
    assert_same_block(read_block(tmp_path / "large"), block)


def _large(block: Block, rays: int) -> Block:
    rng = np.random.default_rng(3)
    point = np.repeat(np.arange(rays // 4), 4)
    image = (point + np.tile(np.arange(4), rays // 4)) % 100
    images = replace(
        block.images,
        names=np.array([f"image {i:03d}" for i in range(100)]),
        camera=np.zeros(100, int),
        strip=np.full(100, "s"),
        centre=rng.normal(size=(100, 3)) * 1e6,
        angles=np.full((100, 3), np.nan),
        columns={},
    )
    measured = replace(
        block.image_points, image=image, point=point, xy=rng.normal(size=(rays, 2)), sigma=np.full((rays, 2), 0.002)
    )
    names = np.array([f"{i}" for i in range(rays // 4)])
    control = replace(block.control, point=np.array([0, 1]))
    return replace(block, images=images, image_points=measured, points=names, control=control, gnss_ins=None)
