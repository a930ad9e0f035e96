"""Lists in which something is easily lost: comments, units, heights, names; used, refused or named."""

from __future__ import annotations

import numpy as np
import pytest

from aerotri.conventions import InputError
from aerotri.formats.assembly.kinds import (
    CONTROL,
    ORIENTATIONS,
    ReadingOptions,
    kind_of,
    read_control,
    read_orientations,
    read_position_list,
)

US_FOOT = 1200.0 / 3937.0
GEOGRAPHIC = 'GEOGCS["WGS 84",AUTHORITY["EPSG","4326"]]'
LOCAL_FEET = 'LOCAL_CS["Local Coordinates (ft)",LOCAL_DATUM["Local",0],UNIT["US survey foot",0.304800609601219]]'


@pytest.fixture
def control(tmp_path):
    """A function that reads text as a list of control points."""

    def read(text, **options):
        (tmp_path / "list.csv").write_text(text)
        return read_control(str(tmp_path / "list.csv"), ReadingOptions(**options))

    return read


def test_feet_of_local_coordinates(control):
    found = control(f"# CoordinateSystem: {LOCAL_FEET}\n#Label,X/East,Y/North,Z/Altitude\nA,100,200,300\n")
    np.testing.assert_allclose(found.xyz, [[100 * US_FOOT, 200 * US_FOOT, 300 * US_FOOT]], rtol=1e-9)
    assert any("brought to metres" in text for text in found.messages)
    with pytest.raises(InputError, match="is not known"):
        control("# CRS: local grid EPSG:2263\nname,X,Y,Z\nA,1,2,3\n")


SYSTEM_LINES = (
    "# CoordinateSystem: EPSG:2263", "# EPSG:2263", "# Coordinate system EPSG:2263", "# Horizontal CRS: EPSG:2263",
    "#EPSG,2263", "#CRS:EPSG:2263", "# crs=EPSG:2263", "# Coordinate system,EPSG:2263", "# SRS, EPSG:2263",
)  # fmt: skip


@pytest.mark.parametrize("line", SYSTEM_LINES)
@pytest.mark.parametrize("header", ["name,X,Y,Z\n", ""])
def test_comments_that_name_a_system(control, line, header):
    rows = "A,1000,2000,30\nB,1100,2100,30\n"
    with pytest.raises(InputError, match="nothing says what the heights count in"):
        control(f"{line}\n{header}{rows}")
    found = control(f"{line}+6360\n{header}{rows}")
    assert found.crs == "EPSG:32118+5703"
    np.testing.assert_allclose(found.xyz[0], np.multiply([1000, 2000, 30], US_FOOT), rtol=1e-9)


@pytest.mark.parametrize(("unit", "factor"), [("m", 1.0), ("ft", 0.3048)])
def test_the_column_of_heights_says_what_it_counts_in(control, unit, factor):
    found = control(f"# CRS: EPSG:2263\nname,X,Y,Z ({unit})\nA,1000,2000,30\n")
    np.testing.assert_allclose(found.xyz, [[1000 * US_FOOT, 2000 * US_FOOT, 30 * factor]], rtol=1e-9)


@pytest.mark.parametrize(
    "prose",
    [
        "Projection centres of the photographs", "Coordinate system is unknown", "projection method: manual",
        "CRS, as the office has it",
    ],
)  # fmt: skip
def test_prose_names_no_system(control, prose):
    found = control(f"# {prose}\nname,X,Y,Z\nA,1,2,3\n")
    assert (found.crs, found.messages) == ("", (f"list.csv:1: '# {prose}' is not used",))
    with pytest.raises(InputError, match="'WGS 99' is not known"):
        control("# CRS: WGS 99\nname,X,Y,Z\nA,1,2,3\n")


OPK_ROW = "P1 500000 5600000 1000 1 2 3\n"


@pytest.mark.parametrize(
    ("comment", "row", "kinds", "kind"),
    [
        ("coordinates X Y Z in metres", "P1,500000,5600000,100,0.02,0.03\n", CONTROL, "pix4d-gcp"),
        ("coordinates X Y Z in metres", "P1, 500000, 5600000, 100, 0.02, 0.03\n", CONTROL, "pix4d-gcp"),
        ("points X Y and Z", "P1,500000,5600000,100\n", CONTROL, "pix4d-gcp"),
        ("X, Y, Z in metres, then omega, phi, kappa", OPK_ROW, ORIENTATIONS, "opk-list"),
        ("name, X, Y, Z, omega, phi, kappa", OPK_ROW, ORIENTATIONS, "opk-csv"),
        ("name X Y Z omega phi kappa", OPK_ROW, ORIENTATIONS, "opk-csv"),
        ("name, X, Y, Z", "P1\t500000\t5600000\t100\t\n", CONTROL, "csv"),
        ("name X Y Z", "P1 500000,5 5600000,5 100,5\n", CONTROL, "csv"),
    ],
)
def test_comments_name_the_columns_where_they_are_as_many(tmp_path, comment, row, kinds, kind):
    (tmp_path / "list.txt").write_text(f"# {comment}\n{row}")
    assert kind_of(tmp_path / "list.txt", kinds) == kind
    read = read_control if kinds is CONTROL else read_orientations
    found = read(str(tmp_path / "list.txt"), ReadingOptions())
    np.testing.assert_allclose(
        getattr(found, "xyz" if kinds is CONTROL else "centre")[0, :2], [500000, 5600000], atol=1
    )


@pytest.mark.parametrize("options", [{}, {"crs": "EPSG:32632"}])
@pytest.mark.parametrize("read", [read_control, read_position_list])
def test_order_of_axes_of_the_system_that_a_comment_names(tmp_path, read, options):
    (tmp_path / "list.csv").write_text("# CRS: EPSG:4326\nP1,50.1,8.6,100\n")
    assert read(str(tmp_path / "list.csv"), ReadingOptions(**options)).xyz.tolist() == [[8.6, 50.1, 100]]
    assert read(str(tmp_path / "list.csv"), ReadingOptions(axes="xy")).xyz.tolist() == [[50.1, 8.6, 100]]


@pytest.mark.parametrize("kind", ["pix4d-gcp", "odm-gcp", "patb-con"])
def test_columns_of_a_format_are_not_stated(tmp_path, kind):
    (tmp_path / "list.csv").write_text("P1,1,2,3\n")
    with pytest.raises(InputError, match=f"the columns of {kind} are known") as caught:
        read_control(f"{kind}:{tmp_path / 'list.csv'}", ReadingOptions(columns="PNEZ"))
    assert "csv:list.csv" in caught.value.remedy


def test_titles_above_the_names_of_the_columns(control):
    found = control("Survey of Monday\n\nname;X;Y;Z\nA;1;2,5;3\n")
    assert found.xyz.tolist() == [[1, 2.5, 3]]
    assert found.messages == ("list.csv: 'Survey of Monday' above the names of the columns is not used",)


def test_five_numbers_are_no_app_of_ign(control):
    with pytest.raises(InputError, match="not in a known format"):
        control("1 691000 5331000 520 3\n2 691010 5331010 520 3\n")


def test_comments_that_may_be_about_the_system_are_named(control):
    found = control("# Vertical datum: NAVD88\n# drawn by hand\nname,X,Y,Z\nA,1,2,3\n")
    assert found.messages == ("list.csv:1: '# Vertical datum: NAVD88' is not used",)


def test_orientations_are_not_in_another_system_without_a_word(tmp_path):
    (tmp_path / "opk.txt").write_text(
        f"# CoordinateSystem: {GEOGRAPHIC}\n# PhotoID, X, Y, Z, Omega, Phi, Kappa\nA\t11.4\t48.1\t556\t0\t0\t0\n"
    )
    assert read_orientations(str(tmp_path / "opk.txt"), ReadingOptions()).crs == "EPSG:4326"


def test_a_point_whose_name_begins_like_a_comment(control):
    with pytest.raises(InputError, match="'#1' begins with #"):
        control("name,X,Y,Z\n#1,2,54,500\n2,1,1,1\n")


def test_ellipsoidal_heights_are_told(tmp_path, control):
    text = "name,Easting,Northing,Ellipsoidal height\nA,691000,5331000,520\n"
    (tmp_path / "list.csv").write_text(text)
    assert read_position_list(str(tmp_path / "list.csv"), ReadingOptions()).heights == "ellipsoidal"
    found = control("# CRS: EPSG:25832+7837\n" + text)
    # heights above the ellipsoid are not those of the system of heights
    assert (found.crs, found.heights) == ("EPSG:25832", "ellipsoidal")


def test_longitudes_are_on_the_datum_that_is_named(control):
    found = control("name,lon,lat,h,crs\nA,-100,40,500,NAD27 / UTM zone 14N\n")
    assert found.crs == "EPSG:4267"
    found = control("name,lon,lat,h,crs\nA,9,48,500,ETRS89 / UTM zone 32N + DHHN2016 height\n")
    assert found.crs == "EPSG:4258+7837"


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("# CRS: EPSG:25832\n# CRS: EPSG:2263\nname,X,Y,Z\nA,1,2,3\n", "several coordinate systems"),
        ("# CRS: EPSG:25832\nname,X,Y,Z,epsg\nA,1,2,3,32632\n", "several coordinate systems"),
        ("name,Longitude West,Latitude,h\nA,9,48,1\n", "no longitude, or no latitude"),
        ("name,X (in feet),Y,Z\nA,1,2,3\n", "cannot be in 'in feet'"),
        ("name,X,Y,Z [yd]\nA,1,2,3\n", "cannot be in 'yd'"),
        ("name,lon (dms),lat,Z\nA,1,2,3\n", "cannot be in 'dms'"),
        ("name,X,Y,Z,sX (95%)\nA,1,2,3,1\n", "cannot be in '95%'"),
        ('name,X,Y,Z\n"' + 200_000 * "a" + '",1,2,3\n', "the row has 1 cells"),
    ],
)
def test_refused(control, text, says):
    with pytest.raises(InputError, match=says):
        control(text)


def test_stated_columns_take_the_units_of_the_list(control):
    found = control("Point,Northing (ft),Easting (ft),Elev (ft),Desc\nA,200,100,30,nail\n", columns="PNEZD")
    np.testing.assert_allclose(found.xyz, [[30.48, 60.96, 9.144]])
    with pytest.raises(InputError, match="column 'Easting' is stated as Y"):
        control("Point,Easting,Northing,Elev,Desc\nA,200,100,30,nail\n", columns="PNEZD")


def test_tabs_without_cells_and_names_beside_numbers(control):
    found = control("Name\tX\tY\tZ\tDesc\nA\t1\t2\t\t\n\t\t\t\t\nB\t3\t4\t5\tnail\t\t\n")
    np.testing.assert_array_equal(found.xyz, [[1, 2, np.nan], [3, 4, 5]])
    assert control("id,name,X,Y,Z\n1,A,1,2,3\n").points.tolist() == ["A"]
    assert control("Camera,Label,POINT_X,POINT_Y,Ortho Ht\nc,A,1,2,\u22123\n").xyz.tolist() == [[1, 2, -3]]


def test_axes_of_named_lists(control):
    """Never without a word."""
    found = control("name,Easting,Northing,Z\nA,1,2,3\n", exchanged=True)
    assert found.xyz.tolist() == [[2, 1, 3]]
    assert found.messages == ("list.csv: 'Easting' and 'Northing' change places, as --axes yx states",)
    found = control("EPSG:4326\n48 11 500 1 2 a.jpg A\n", exchanged=True)
    assert "list.csv: X and Y change places, as --axes yx states" in found.messages


def test_sigma_counts_as_its_coordinate(control):
    found = control("# CRS: EPSG:2263+6360\nname,X,Y,Z,sX,sY,sZ\nA,1,2,3,1,1,1\n")
    np.testing.assert_allclose(found.sigma, US_FOOT)
    found = control("# CRS: EPSG:2263+6360\nname,X,Y,Z,accuracy (m)\nA,1,2,3,1\n")
    np.testing.assert_allclose(found.sigma, 1.0)
    for plan, height in (("lon,lat", "Altitude"), ("X (ft),Y (ft)", "Ellipsoidal Height"), ("lon,lat", "hae")):
        found = control(f"name,{plan},{height} (ft),sX,sY,sZ\nA,8,50,3,1,1,1\n")
        np.testing.assert_allclose(found.sigma, [[1.0, 1.0, 0.3048] if "lon" in plan else [0.3048] * 3])


def test_accuracies_of_lists_without_names_count_as_coordinates(control):
    found = control("# CRS: EPSG:2263+6360\nA,1000,2000,30,1,2\n")
    np.testing.assert_allclose(found.sigma, [np.multiply([1, 1, 2], US_FOOT)])
    np.testing.assert_allclose(control("# CRS: EPSG:4326\nA,50,8,30,1,2\n").sigma, [[1, 1, 2]])


def test_plain_orientations_have_the_system_of_the_comment(tmp_path):
    (tmp_path / "opk.txt").write_text("# CRS: EPSG:2263+6360\nA 1000 2000 30 1 2 3\n")
    found = read_orientations(str(tmp_path / "opk.txt"), ReadingOptions())
    assert found.crs == "EPSG:32118+5703"
    np.testing.assert_allclose(found.centre, [np.multiply([1000, 2000, 30], US_FOOT)])


def test_names_stay_as_they_are(control):
    """Neither a decimal comma nor a minus of theirs is one of a number."""
    for separator, name in ((";", "1,5"), (";", "A\u22121"), (",", "A\u22121")):
        row = separator.join([name, "8.1", "\u221250", "1000"])
        found = control(f"{separator.join(('name', 'X', 'Y', 'Z'))}\n{row}\n")
        assert (found.points.tolist(), found.xyz.tolist()) == ([name], [[8.1, -50, 1000]])


def test_many_columns_are_counted(control):
    names = ",".join(f"note {k}" for k in range(50))
    found = control(f"name,X,Y,Z,{names}\nA,1,2,3{50 * ',x'}\n")
    assert found.messages[0].endswith("and 20 more")
