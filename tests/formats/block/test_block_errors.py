"""Whatever is wrong with a block folder is said with the file, the line and a remedy."""

from __future__ import annotations

import os
from dataclasses import dataclass

import pytest
from format_samples import BLOCK_TOML, CONTROL, FILM_TOML, GNSS, IMAGE_POINTS, IMAGES

from aerotri.conventions import InputError
from aerotri.formats.block.folder import read_block


@dataclass(frozen=True)
class Case:
    """Files changed, and what the error has to name."""

    file: str
    content: str | bytes | None
    line: int | None
    says: str
    also: tuple[tuple[str, str | bytes | None], ...] = ()


def points(*rows: str) -> str:
    return "image,point,x,y\n" + "".join(f"{row}\n" for row in rows)


def images(*rows: str) -> str:
    return "image,camera,X0,Y0,Z0,omega,phi,kappa\n" + "".join(f"{row}\n" for row in rows)


def control(*rows: str) -> str:
    return "point,X,Y,Z,sX,sY,sZ,role\n" + "".join(f"{row}\n" for row in rows)


def gnss(*rows: str) -> str:
    return GNSS.splitlines()[0] + "\n" + "".join(f"{row}\n" for row in rows)


def edits(*rows: str) -> str:
    return "image,point,action,reason\n" + "".join(f"{row}\n" for row in rows)


def conditions(*rows: str) -> str:
    return "kind,points,value,sigma\n" + "".join(f"{row}\n" for row in rows)


def marks(*rows: str) -> str:
    return "image,fiducial,column,row\n" + "".join(f"{row}\n" for row in rows)


TOML_BEGIN = BLOCK_TOML.replace('robust = "off"\n', "")
LINES = TOML_BEGIN.count("\n")
P, I, C, G, T = "image_points.csv", "images.csv", "control.csv", "gnss_ins.csv", "block.toml"
E, K, F = "edits.csv", "constraints.csv", "fiducials.csv"
FOUR = ("a,F1,100,100", "a,F2,9900,110", "a,F3,9890,7900", "a,F4,110,7890")
FILM = ((T, FILM_TOML), (G, None))

TABLES = {
    "row too short": Case(P, points("a,p1,1,2", "# c", "", "a,p2,1"), 5, "3 cells"),
    "row too long": Case(P, points("a,p1,1,2", "a,p2,1,5,5"), 3, "5 cells"),
    "decimal commas": Case(P, points("a,p1,1,5,2,5"), 2, "6 cells"),
    "semicolons": Case(P, "image;point;x;y\na;p1;1;2\n", 1, "separate the cells by commas"),
    "not a number": Case(P, points("a,p1,1,2", "a,p2,1,2", "b,p1,1x,2"), 4, "x = '1x' is not a number"),
    "hexadecimal": Case(P, points("a,p1,0x10,2"), 2, "'0x10'"),
    "underscore": Case(P, points("a,p1,1_0,2"), 2, "'1_0'"),
    "word for missing": Case(P, points("a,p1,NA,2"), 2, "x = 'NA'"),
    "nan": Case(P, points("a,p1,1,2", "a,p2,1,nan"), 3, "y = nan is not a finite number"),
    "inf": Case(P, points("a,p1,-inf,2"), 2, "x = -inf"),
    "overflow": Case(P, points("a,p1,1e999,2"), 2, "x = inf"),
    "nan beside an empty cell": Case(P, "image,point,x,y,sx,sy\na,p1,1,1,,nan\n", 2, "sy = nan"),
    "empty number": Case(P, points("a,p1,1,2", "a,p2,,2"), 3, "x is empty"),
    "blank number": Case(P, points("a,p1,1,2", "a,p2,  ,2"), 3, "x is empty"),
    "empty image": Case(P, points(",p1,1,2"), 2, "image is empty"),
    "empty point": Case(P, points("a,,1,2"), 2, "point is empty"),
    "blank point": Case(P, points("a,  ,1,2"), 2, "point is empty"),
    "image not known": Case(P, points("a,p1,1,2", "", "zz,p1,1,2"), 4, "photograph 'zz' is not in the table"),
    "measured twice": Case(P, points("a,p1,1,2", "b,p1,1,2", "#", "a,p1,3,4"), 5, "first in line 2"),
    "measured twice, blanks": Case(P, points("a,p1,1,2", "a, p1 ,3,4"), 3, "is there twice"),
    "sigma zero": Case(P, "image,point,x,y,sx,sy\na,p1,1,1,0,1\n", 2, "sx = 0 is not a standard deviation"),
    "sigma negative": Case(P, "image,point,x,y,sx,sy\na,p1,1,1,1,-0.5\n", 2, "sy = -0.5"),
    "no sigma at all": Case(
        P, points("a,p1,1,2"), 2, "image_sigma_um", ((T, BLOCK_TOML.replace("image_sigma_um = 2.0", "")),)
    ),
    "outside": Case(P, points("a,p1,49,2", "a,p2,1,46"), 3, "outside the format of camera 'cam'"),
    "no rows": Case(P, points(), None, "holds no image points"),
    "empty file": Case(P, "", None, "is empty"),
    "comments only": Case(P, "# nothing\n\n", None, "is empty"),
    "missing": Case(P, None, None, "is missing"),
    "missing column": Case(P, "# c\nimage,point,x\n", 2, "column 'y' is missing"),
    "unknown column": Case(P, "image,point,x,y,s_x\n", 1, "did you mean 'sx'"),
    "column twice": Case(P, "image,point,x,y,x\n", 1, "column 'x' is there twice"),
    "column without name": Case(P, "image,point,x,y,\n", 1, "a column has no name"),
    "not utf-8": Case(P, points("a,p1,1,2").encode() + b"a,p\xff,1,2\n", 3, "is not UTF-8"),
    "header not utf-8": Case(P, b"image,p\xf6int,x,y\n", 1, "is not UTF-8"),
    "utf-16": Case(P, points("a,p1,1,2").encode("utf-16"), 1, "is not UTF-8"),
    "line break in a name": Case(P, points("a,p1,1,2", 'a,"p\n2",1,2'), 3, "quoted cell"),
    "open quote": Case(P, points("a,p1,1,2", 'a,"p2,1,2', "b,p1,1,2"), 3, "quoted cell"),
    "control character": Case(P, points("a,p1,1,2", "a,p\x012,1,2"), 3, "control character"),
    "nul": Case(P, points("a,p\x00,1,2"), 2, "control character"),
    "name too long": Case(P, points("a,p1,1,2", f"a,{'n' * 1001},1,2"), 3, "longer than 1000"),
    "image twice": Case(I, images("a,cam,,,,,,", "b,cam,,,,,,", "a,cam,,,,,,"), 4, "photograph 'a' is there twice"),
    "camera not known": Case(I, images("a,cam,,,,,,", "b,dmc,,,,,,"), 3, "there is no camera 'dmc'"),
    "camera empty": Case(I, images("a,,,,,,,"), 2, "camera is empty"),
    "position partly": Case(I, images("a,cam,1,2,3,,,", "b,cam,1,,3,,,"), 3, "Y0 is empty"),
    "angles partly": Case(I, images("a,cam,,,,0,0,"), 2, "kappa is empty"),
    "position columns partly": Case(I, "image,camera,X0,Z0\na,cam,1,2\nb,cam,1,2\n", 1, "column 'Y0' is missing"),
    "no images": Case(I, images(), None, "holds no photographs"),
    "images missing": Case(I, None, None, "is missing"),
    "role": Case(C, control("p1,1,2,3,1,1,1,control", "p2,1,2,3,1,1,1,Check"), 3, "role = 'Check'"),
    "role empty": Case(C, control("p1,1,2,3,1,1,1,"), 2, "role is empty"),
    "role missing": Case(C, "point,X,Y,Z\n", 1, "column 'role' is missing"),
    "control twice": Case(C, control("p1,1,2,3,1,1,1,control", "p1,1,2,3,1,1,1,check"), 3, "point 'p1' is there twice"),
    "control without coordinates": Case(C, control("p1,,,,1,1,1,control"), 2, "X, Y and Z are all empty"),
    "control sigma negative": Case(C, control("p1,1,2,3,1,-1,1,control"), 2, "without error"),
    "control without sigma": Case(
        C, control("p1,1,2,3,,,,control"), 2, "default_control_sigma_m",
        ((T, BLOCK_TOML.replace("default_control_sigma_m = [0.1, 0.2, 0.3]", "")),),
    ),
    "gnss image not known": Case(G, gnss("a,1,2,3,1,1,1,,,,,,,", "c,1,2,3,1,1,1,,,,,,,"), 3, "photograph 'c'"),
    "gnss twice": Case(G, gnss("a,1,2,3,1,1,1,,,,,,,", "a,1,2,3,1,1,1,,,,,,,"), 3, "is there twice"),
    "gnss partly": Case(G, gnss("a,1,,3,1,1,1,,,,,,,"), 2, "Y is empty"),
    "gnss without sigma": Case(G, gnss("a,1,2,3,1,1,,,,,,,,"), 2, "sZ is not given"),
    "angles without sigma": Case(G, gnss("a,1,2,3,1,1,1,0,0,0,0.1,,0.1,"), 2, "s_phi is not given"),
    "gnss of nothing": Case(G, gnss("a,,,,1,1,1,,,,,,,5"), 2, "neither a position nor angles"),
    "edit action": Case(E, edits("a,p1,of,"), 2, "action = 'of'"),
    "edit image": Case(E, edits("a,p1,off,", "c,p1,off,"), 3, "photograph 'c' is not in the table"),
    "edit point": Case(E, edits("a,p7,off,"), 2, "there is no point 'p7'"),
    "edit point empty": Case(E, edits("a,,off,"), 2, "point is empty"),
    "edit of no ray": Case(E, edits("b,p9,off,"), 2, "point 'p9' is not measured in photograph 'b'"),
    "edit role of a ray": Case(E, edits("a,p1,check,"), 2, "leave image empty"),
    "edit role of no control": Case(E, edits(",p2,check,"), 2, "point 'p2' is not a control or check point"),
    "edit twice": Case(E, edits("a,p1,off,", ",p1,off,", "a,p1,off,again"), 4, "is there twice, first in line 2"),
    "edit both": Case(E, edits(",p1,off,", ",p1,check,"), 3, "a decision on point 'p1' is there twice"),
    "edit column": Case(E, "image,point,action,why\n", 1, "unknown column 'why'"),
    "constraint kind": Case(K, conditions("upright,p1 p2,,1"), 2, "kind = 'upright'"),
    "constraint point": Case(K, conditions("vertical,p1 p2,,1", "vertical,p1 p7,,1"), 3, "there is no point 'p7'"),
    "constraint points": Case(K, conditions("plane,p1 p2 p9,,1"), 2, "it needs 4 or more"),
    "constraint points, two": Case(K, conditions("distance,p1 p2 p9,5,1"), 2, "it needs 2,"),
    "constraint point twice": Case(K, conditions("line,p1 p2 p1,,1"), 2, "names a point twice"),
    "constraint value": Case(K, conditions("height_difference,p1 p2,,1"), 2, "has no value"),
    "constraint no value": Case(K, conditions("horizontal,p1 p2,5,1"), 2, "has a value"),
    "constraint distance": Case(K, conditions("distance,p1 p2,-5,1"), 2, "is not positive"),
    "constraint sigma": Case(K, conditions("vertical,p1 p2,,"), 2, "sigma is not given"),
    "constraint sigma zero": Case(K, conditions("vertical,p1 p2,,0"), 2, "sigma = 0"),
    "fiducial image": Case(F, marks("c,F1,1,2"), 2, "photograph 'c' is not in the table", FILM),
    "fiducial name": Case(F, marks("a,F1,1,2", "a,F9,1,2"), 3, "has no fiducial 'F9'", FILM),
    "fiducial twice": Case(F, marks("a,F1,1,2", "a,F2,1,2", "a,F1,1,2"), 4, "is there twice, first in line 2", FILM),
    "fiducial empty": Case(F, marks("a,F1,,2"), 2, "column is empty", FILM),
    "fiducials of no camera": Case(F, marks("a,F1,1,2"), 2, "has no calibrated fiducials"),
    "fiducials too few": Case(F, marks(*FOUR[:2]), 2, "2 fiducial marks of photograph a give no affine", FILM),
    "fiducials in a line": Case(
        F, marks("a,F1,0,0", "a,F2,100,0", "a,F3,200,0", "a,F4,300,0"), 2, "do not determine", FILM
    ),
    "fiducials of one image": Case(
        P, points("a,p1,100,200", "b,p1,100,200"), 3, "photograph 'b' has no fiducials", (*FILM, (F, marks(*FOUR)))
    ),
    "point outside of a scan": Case(
        P, points("a,p1,100,200", "a,p2,100,90000"), 3, "lies outside the format",
        (*FILM, (F, marks(*FOUR)), (I, images("a,cam,,,,,,"))),
    ),
}  # fmt: skip

SETTINGS = {
    "not toml": Case(T, BLOCK_TOML + "x = = 1\n", LINES + 2, "is not TOML"),
    "key twice": Case(T, BLOCK_TOML + 'robust = "off"\n', LINES + 2, "is not TOML"),
    "toml not utf-8": Case(T, b'name = "a"\nx = "\xff"\n', 2, "is not UTF-8"),
    "missing": Case(T, None, None, "there is no block.toml"),
    "empty": Case(T, "", None, "key 'camera' is missing"),
    "no camera": Case(T, "[camera]\n", 1, "camera"),
    "camera no table": Case(T, "camera = 3\n", 1, "should be a table"),
    "unknown key": Case(T, TOML_BEGIN + 'robusst = "off"\n', LINES + 1, "did you mean 'robust'"),
    "key misspelt": Case(T, BLOCK_TOML.replace("focal_length_mm", "focal_lenght_mm", 1),
                         1 + BLOCK_TOML[: BLOCK_TOML.index("focal_length_mm")].count("\n"),
                         "did you mean 'focal_length_mm'"),
    "unknown section": Case(T, "[adjustmnt]\n" + BLOCK_TOML, 1, "unknown key 'adjustmnt'"),
    "unknown word": Case(T, TOML_BEGIN + 'robust = "hubert"\n', LINES + 1, "'hubert': should be 'off', 'huber'"),
    "text for number": Case(T, TOML_BEGIN + 'alpha = "0.1"\n', LINES + 1, "alpha = '0.1'"),
    "boolean for number": Case(T, TOML_BEGIN + "alpha = true\n", LINES + 1, "alpha = True"),
    "nan": Case(T, TOML_BEGIN + "t_limit = nan\n", LINES + 1, "t_limit = nan"),
    "out of range": Case(T, TOML_BEGIN + "alpha = 1.5\n", LINES + 1, "less than 1"),
    "no integer": Case(T, TOML_BEGIN + "max_iterations = 3.5\n", LINES + 1, "max_iterations = 3.5"),
    "huge": Case(T, TOML_BEGIN + f"t_limit = 1{'0' * 400}\n", LINES + 1, "t_limit"),
    "focal length": Case(T, BLOCK_TOML.replace("= 100.0", "= 0.0"), 7, "focal_length_mm = 0.0"),
    "focal length, interior": Case(
        T, BLOCK_TOML + "[camera.cam.interior]\nfocal_length_mm = { value = -5.0 }\n", None, "greater than 0"
    ),
    "pixel size": Case(T, BLOCK_TOML.replace("pixel_um = 10.0", "pixel_um = -1.0"), 6, "pixel_um = -1.0"),
    "format": Case(T, BLOCK_TOML.replace("[10000, 8000]", "[10000, 0]"), 5, "size_px.1 = 0"),
    "format, three": Case(T, BLOCK_TOML.replace("[10000, 8000]", "[1, 2, 3]"), 5, "too many entries"),
    "format missing": Case(T, BLOCK_TOML.replace("size_px = [10000, 8000]", ""), 4, "'camera.cam.size_px' is missing"),
    "flight axis": Case(T, BLOCK_TOML.replace("pixel_um", 'flight_axis = "y"\npixel_um'), 6, "'+y' or '-y'"),
    "crs": Case(T, 'crs = "UTM 32"\n' + BLOCK_TOML, 1, "EPSG:n"),
    "unit": Case(T, 'angle_unit = "degrees"\n' + BLOCK_TOML, 1, "'deg', 'gon' or 'rad'"),
    "lens in brown": Case(T, BLOCK_TOML + "[camera.cam.brown]\nk1 = {}\n", LINES + 3, "known are K1"),
    "prior": Case(T, BLOCK_TOML + "[camera.cam.brown]\nK1 = { vaule = 1.0 }\n", LINES + 3, "did you mean 'value'"),
    "prior fixed and weighted": Case(
        T, BLOCK_TOML + "[camera.cam.brown]\nK1 = { fixed = true, sigma = 1.0 }\n", LINES + 3, "exclude each other"
    ),
    "prior sigma": Case(T, BLOCK_TOML + "[camera.cam.brown]\nK1 = { sigma = 0.0 }\n", LINES + 3, "greater than 0"),
    "unit of scans": Case(
        T, FILM_TOML.replace('image_unit = "px"', 'image_unit = "mm"'), 2, "are scans", ((F, marks(*FOUR)),)
    ),
    "interior orientation": Case(T, FILM_TOML.replace('"affine"', '"afine"'), None, "'afine': should be 'affine'"),
    "fiducial position": Case(T, FILM_TOML.replace("F1 = [-49.0, 39.0]", "F1 = [-49.0]"), None, "too few entries"),
    "fiducial no number": Case(T, FILM_TOML.replace("F1 = [-49.0, 39.0]", 'F1 = ["x", 1.0]'), None, "F1.0 = 'x'"),
    "fiducial without name": Case(T, FILM_TOML.replace("F1 =", '" " ='), None, "is no name for a fiducial"),
    "family": Case(T, TOML_BEGIN + 'additional_parameters = ["blu:1"]\n', LINES + 1, "unknown parameter family 'blu'"),
    "item": Case(T, TOML_BEGIN + 'additional_parameters = ["bluh:13"]\n', LINES + 1, "no parameter '13'"),
    "grouping": Case(T, TOML_BEGIN + 'parameter_groups = "week"\n', LINES + 1, "no column 'week'"),
    "datum point": Case(T, TOML_BEGIN + 'datum_points = ["p1", "p7"]\n', LINES + 1, "no point 'p7'"),
    "datum point no text": Case(T, TOML_BEGIN + "datum_points = [1]\n", LINES + 1, "put names in quotes"),
    "datum element": Case(T, TOML_BEGIN + 'datum_fixed = ["a:X"]\n', LINES + 1, "PHOTOGRAPH:ELEMENT"),
    "datum image": Case(T, TOML_BEGIN + 'datum_fixed = ["c:X0"]\n', LINES + 1, "no photograph 'c'"),
    "deep": Case(T, "x = " + "[" * 5000, None, "is not TOML"),
}  # fmt: skip


@pytest.mark.parametrize("case", [pytest.param(c, id=f"{c.file}: {n}") for n, c in (TABLES | SETTINGS).items()])
def test_error_names_file_line_and_remedy(small_block, case):
    changes = dict(case.also) | {case.file: case.content}
    if case.file == "block.toml" and case.content is not None:
        changes["gnss_ins.csv"] = None
    with pytest.raises(InputError) as caught:
        read_block(small_block(changes))
    error = caught.value
    assert error.file is not None
    assert os.path.basename(error.file) in (case.file, "small")
    assert case.says in str(error)
    assert error.remedy
    if case.line is not None:
        assert error.line == case.line
    assert "\n" not in str(error)


def test_both_kinds_of_one_table(small_block):
    folder = small_block()
    (folder / "images.parquet").write_bytes(b"")
    with pytest.raises(InputError, match=r"images\.csv and images\.parquet are both there"):
        read_block(folder)


def test_no_such_folder(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        read_block(tmp_path / "nothing")


def test_a_table_is_no_block(small_block):
    with pytest.raises(InputError, match="is no block"):
        read_block(small_block() / "images.csv")


def test_table_that_is_a_folder(small_block):
    folder = small_block({"images.csv": None})
    (folder / "images.csv").mkdir()
    with pytest.raises(InputError, match="is a folder, not a file"):
        read_block(folder)


@pytest.mark.parametrize("content", [b"", b"PAR1", b"PAR1" + b"\x00" * 50 + b"PAR1", b"\xff" * 100])
def test_broken_parquet(small_block, content):
    folder = small_block({"images.csv": None})
    (folder / "images.parquet").write_bytes(content)
    with pytest.raises(InputError, match="cannot be read as Parquet"):
        read_block(folder)


def test_parquet_rows_are_numbered(small_block):
    import pyarrow as pa
    import pyarrow.parquet as pq

    folder = small_block({"image_points.csv": None})
    table = {"image": ["a", "a"], "point": ["p", "q"], "x": [1.0, float("nan")], "y": [1.0, 2.0]}
    pq.write_table(pa.table(table), folder / "image_points.parquet")
    with pytest.raises(InputError, match="row 2: x = nan"):
        read_block(folder)
    pq.write_table(pa.table(table | {"x": ["1", "2"]}), folder / "image_points.parquet")
    with pytest.raises(InputError, match="column 'x' holds string"):
        read_block(folder)
    pq.write_table(pa.table(table | {"x": [1.0, 2.0], "image": [1.5, 2.5]}), folder / "image_points.parquet")
    with pytest.raises(InputError, match="column 'image' holds double"):
        read_block(folder)


def test_the_samples_are_good(small_block):
    read_block(small_block({"images.csv": IMAGES, "image_points.csv": IMAGE_POINTS, "control.csv": CONTROL}))


def test_what_a_file_brought_along_is_escaped():
    """An error cannot steer the terminal it is printed on, nor run over several lines."""
    error = InputError("odd \x1b[2J\nname \u202e\x9b ÄΩ", "rename\r it", "fi\x07le.csv", 3)
    assert str(error) == r"fi\x07le.csv:3: odd \x1b[2J\nname \u202e\x9b ÄΩ — rename\r it"
    assert str(error).isprintable()
