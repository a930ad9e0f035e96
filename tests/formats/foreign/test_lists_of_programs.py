"""Lists of control points as twelve programs write them, columns in any order, in any unit, any letters: one result."""

from __future__ import annotations

import numpy as np
import pytest

from aerotri.conventions import InputError
from aerotri.formats.assembly.kinds import ReadingOptions, read_control
from aerotri.formats.foreign.list_header import stated_columns

NAMES = ("GCP1", "Straße 2", "77")
XYZ = np.array([[679974.593, 5330000.962, 519.995], [680020.067, 5329984.429, -3.5], [679978.339, 5330007.875, 0.0]])
SIGMA = np.array([[0.011, 0.012, 0.021], [0.013, 0.014, 0.022], [0.015, 0.016, 0.023]])
FOOT, US_FOOT = 0.3048, 1200.0 / 3937.0
JUNK = "junk"
WKT = 'PROJCS["WGS 84 / UTM zone 32N",AUTHORITY["EPSG","32632"]]'

PROGRAMS = {
    # name: comment above, columns as (written, what, unit), separator, whether the header is a comment
    "Metashape markers": (
        f"# CoordinateSystem: {WKT}", ("Label", "X/Easting", "Y/Northing", "Z/Altitude",
        "Accuracy_X/Easting_(m)", "Accuracy_Y/Northing_(m)", "Accuracy_Z/Altitude_(m)", "Error_(m)", "X_error",
        "X_est", "Y_est", "Z_est"), ",", True,
    ),
    "Metashape cameras, tabs": (
        f"# CoordinateSystem: {WKT}", ("Label", "X/Easting", "Y/Northing", "Z/Altitude", "X_est", "Y_est", "Z_est"),
        "\t", True,
    ),
    "Pix4D with names": (
        "", ("imageName", "X", "Y", "Z", "accuracy horizontal [m]", "accuracy vertical [m]"), ",", False,
    ),
    "Emlid Reach": (
        "", ("Name", "Easting", "Northing", "Elevation", "Description", "Ellipsoidal height", "Easting RMS",
        "Northing RMS", "Elevation RMS", "Antenna height", "Antenna height units", "Solution status"), ",", False,
    ),
    "Trimble": ("", ("Point ID", "Northing", "Easting", "Elevation", "Feature Code"), ",", False),
    "Leica": ("", ("Point Id", "Easting [m]", "Northing [m]", "Ortho. Height [m]", "Code"), ";", False),
    "Topcon": ("", ("Name", "North", "East", "Elev", "Code"), "\t", False),
    "German office": ("", ("Punktnummer", "Rechtswert", "Hochwert", "Höhe", "Bemerkung"), ";", False),
    "French office": ("", ("Matricule", "Est", "Nord", "Altitude"), ";", False),
    "Spanish office": ("", ("Punto", "Norte", "Este", "Cota"), ",", False),
    "RealityCapture": ("", ("name", "x", "y", "alt"), ",", False),
    "QGIS": ("", ("fid", "name", "X", "Y", "Z"), ",", False),
}  # fmt: skip
UNITS = {"": 1.0, " (ft)": FOOT, " [US survey feet]": US_FOOT, " (mm)": 1e-3}


def axis_of(column):
    plain = column.lower()
    if any(word in plain for word in ("est", "error", "ellips", "antenna")) and plain not in ("est", "este", "east"):
        return None if "easting" not in plain and plain != "este" else 0
    for axis, words in enumerate((
        ("easting", "east", "rechts", "est", "este", "x"), ("north", "hoch", "nord", "norte", "y"),
        ("alt", "elev", "height", "höhe", "cota", "z"),
    )):  # fmt: skip
        if any(plain.startswith(word) or f"/{word}" in plain or f" {word}" in plain for word in words):
            return axis
    return None


def cell(column, k, unit):
    """What stands in a column for point k."""
    plain = column.lower()
    if plain in ("label", "imagename", "name", "point id", "punktnummer", "matricule", "punto"):
        return NAMES[k]
    accuracy = "accuracy" in plain or "rms" in plain
    if "horizontal" in plain:
        return f"{SIGMA[k, 0]:.9f}"
    if accuracy:
        words = plain.replace("accuracy", "").replace("rms", "")
        axis = (
            2
            if any(w in words for w in ("z", "vertical", "elev"))
            else 1
            if any(w in words for w in ("y", "north"))
            else 0
        )
        return f"{SIGMA[k, axis]:.9f}"
    axis = axis_of(column)
    if axis is None:
        return "12.5" if "est" in plain or "error" in plain or "ellips" in plain or plain == "antenna height" else JUNK
    return f"{XYZ[k, axis] / unit:.9f}"


def written(program, order, unit_text, decimal_comma):
    comment, columns, separator, is_comment = PROGRAMS[program]
    unit = UNITS[unit_text]
    columns = [columns[k] for k in order]
    lines = [comment] if comment else []
    header = [
        column + unit_text if axis_of(column) is not None and not any(part in column for part in ("[", "RMS", "_"))
        else column for column in columns
    ]  # fmt: skip
    lines.append(("#" if is_comment else "") + separator.join(header))
    for k in range(len(NAMES)):
        cells = [cell(column, k, unit if header[i] != column else 1.0) for i, column in enumerate(columns)]
        cells = [c.replace(".", ",") if decimal_comma and c[-1:].isdigit() else c for c in cells]
        lines.append(separator.join(cells))
    if comment:
        lines.append("# Total error" + separator * (len(columns) - 1) + "0.01")
    return "\n".join(lines) + "\n"


CASES = [(program, seed) for seed in range(4) for program in PROGRAMS]


@pytest.mark.parametrize(("program", "seed"), CASES, ids=[f"{p} {s}" for p, s in CASES])
def test_one_result(tmp_path, program, seed):
    rng = np.random.default_rng([seed, sorted(PROGRAMS).index(program)])
    count, separator = len(PROGRAMS[program][1]), PROGRAMS[program][2]
    order = rng.permutation(count) if seed else np.arange(count)
    unit = list(UNITS)[rng.integers(len(UNITS))] if seed else ""
    text = written(program, order, unit, decimal_comma=separator != "," and seed % 2 == 1)
    letters = ("utf-8", "utf-8-sig", "utf-16", "cp1252")[seed]
    (tmp_path / "list.csv").write_bytes(text.encode(letters))
    found = read_control(str(tmp_path / "list.csv"), ReadingOptions())
    assert found.points.tolist() == list(NAMES)
    np.testing.assert_allclose(found.xyz, XYZ, rtol=0, atol=2e-6)
    assert found.crs == ("EPSG:32632" if program.startswith("Metashape") else "")
    wanted = {
        "Pix4D with names": SIGMA[:, [0, 0, 2]],
        "Emlid Reach": SIGMA * UNITS[unit],
        "Metashape markers": SIGMA,
    }.get(program)
    if wanted is None:
        assert np.isnan(found.sigma).all()
    else:
        np.testing.assert_allclose(found.sigma, wanted, rtol=0, atol=1e-9)
    assert any("Windows-1252" in text for text in found.messages) == (letters == "cp1252")
    left = [column for column in PROGRAMS[program][1] if cell(column, 0, 1.0) in (JUNK, "12.5")]
    assert all(any(column in text for text in found.messages) for column in left)


@pytest.mark.parametrize("columns", ["PNEZD", "name,northing,easting,height,-", "name,Y,X,Z,-"])
def test_stated_columns(tmp_path, columns):
    rows = "".join(f"{n},{y:.3f},{x:.3f},{z:.3f},nail\n" for n, (x, y, z) in zip(NAMES, XYZ, strict=True))
    (tmp_path / "list.txt").write_text(rows)
    with pytest.raises(InputError, match="not in a known format") as caught:
        read_control(str(tmp_path / "list.txt"), ReadingOptions())
    assert "--columns" in caught.value.remedy
    found = read_control(str(tmp_path / "list.txt"), ReadingOptions(columns=columns))
    np.testing.assert_allclose(found.xyz, XYZ, rtol=0, atol=1e-9)
    (tmp_path / "list.txt").write_text("Pkt,Hoch,Rechts,H,Text\n" + rows)
    np.testing.assert_allclose(
        read_control(str(tmp_path / "list.txt"), ReadingOptions(columns=columns)).xyz, XYZ, rtol=0, atol=1e-9
    )


@pytest.mark.parametrize("columns", ["NEZD", "PXQ", "name,varas,X,Y", "P", "name,-,-"])
def test_stated_columns_that_will_not_do(columns):
    with pytest.raises(InputError, match="--columns"):
        stated_columns(columns)


def test_columns_by_their_number_are_told(tmp_path):
    (tmp_path / "gcp.csv").write_text("A,1.0,2.0,3.0\nB,4.0,5.0,6.0\n")
    found = read_control(str(tmp_path / "gcp.csv"), ReadingOptions())
    assert found.messages == (
        "gcp.csv: no line names the columns; taken as name, X, Y, Z: state others with --columns",
    )


@pytest.mark.parametrize(
    ("header", "says"),
    [
        ("name,X (deg),Y,Z", "are both"), ("name,Latitude (m),Longitude (m),Z", "cannot be in 'm'"),
        ("name,X,Easting,Z", "are both X"),
    ],
)  # fmt: skip
def test_headers_that_contradict_themselves(tmp_path, header, says):
    (tmp_path / "gcp.csv").write_text(f"{header}\nA,1.0,2.0,3.0\n")
    if says == "are both":
        header = header.replace("Y,Z", "Y,lon")
        (tmp_path / "gcp.csv").write_text(f"{header}\nA,1.0,2.0,3.0\n")
    with pytest.raises(InputError, match=says):
        read_control(str(tmp_path / "gcp.csv"), ReadingOptions())


def test_what_is_in_brackets_and_no_unit_is_told(tmp_path):
    (tmp_path / "gcp.csv").write_text("name,X,Y,Höhe (NHN)\nA,1.0,2.0,3.0\n")
    found = read_control(str(tmp_path / "gcp.csv"), ReadingOptions())
    assert found.messages == ("gcp.csv: what stands in brackets in 'Höhe (NHN)' is not used",)
