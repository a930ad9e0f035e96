"""Files made to mislead: other encodings of XML, archives that unpack to gigabytes, counts beyond the file."""

from __future__ import annotations

import io
import json
import sqlite3
import struct
import time
import zipfile

import numpy as np
import pytest

from aerotri.conventions import InputError
from aerotri.formats.files.npz import Archive
from aerotri.formats.text.text_lines import is_number
from aerotri.formats.text.toml_text import read_toml
from aerotri.formats.text.xml_text import read_xml
from aerotri.vectors.geojson import read_geojson
from aerotri.vectors.geopackage import read_geopackage

DOCTYPE = '<?xml version="1.0" encoding="{}"?><!DOCTYPE a [<!ENTITY b "c">]><a>&b;</a>'


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16", "utf-16-le", "utf-16-be", "utf-32", "utf-7", "cp037", "none"])
def test_no_encoding_hides_a_document_type(tmp_path, encoding):
    path = tmp_path / "script.xml"
    text = DOCTYPE.format(encoding)
    path.write_bytes(text.encode("utf-8" if encoding == "none" else encoding))
    with pytest.raises(InputError) as caught:
        read_xml(path)
    assert caught.value.file == path
    assert caught.value.remedy


def test_a_declared_latin_text_is_read(tmp_path):
    path = tmp_path / "script.xml"
    path.write_bytes('<?xml version="1.0" encoding="ISO-8859-1"?>\n<a>Küste</a>'.encode("latin-1"))
    assert read_xml(path).text == "Küste"


def _npy(header: str, content: bytes = b"") -> bytes:
    text = header.ljust(117).encode() + b"\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text + content


@pytest.mark.parametrize(
    ("member", "says"),
    [
        (_npy("{'descr': '<f8', 'fortran_order': False, 'shape': (100000000000,), }"), "as large as it announces"),
        (_npy("{'descr': '|O', 'fortran_order': False, 'shape': (1,), }", b"cos\nsystem\n(S'true'\ntR."), "objects"),
        (_npy("{'descr': '<f8', 'fortran_order': False, 'shape': (-1,), }"), "cannot be read"),
        (_npy("{'descr': '<f8', 'fortran_order': False, 'shape': (2,", b"\0" * 16), "cannot be read"),
        (_npy("{'descr': '<f8', 'fortran_order': False, 'shape': (2, 1), }", b"\0" * 16), "has the size 2 × 1, not n"),
        (_npy("{'descr': '<U4', 'fortran_order': False, 'shape': (1,), }", b"\0" * 16), "is of type <U4"),
    ],
)
def test_arrays_are_not_taken_on_trust(tmp_path, member, says):
    path = tmp_path / "solution.npz"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("a.npy", member)
    with pytest.raises(InputError, match=says):
        Archive(path).array("a", "f", (None,))


def test_a_bomb_is_not_unpacked(tmp_path):
    """A member of many zeros behind the header of two numbers: refused from the directory alone."""
    path = tmp_path / "solution.npz"
    head = _npy("{'descr': '<f8', 'fortran_order': False, 'shape': (2,), }")
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        archive.writestr("a.npy", head + bytes(1 << 25))
    with pytest.raises(InputError, match="not as large as it announces"):
        Archive(path).array("a", "f", (None,))


def test_a_pickle_in_an_archive_is_never_loaded(tmp_path):
    path = tmp_path / "solution.npz"
    place = io.BytesIO()
    np.save(place, np.array([{"a": 1}], dtype=object), allow_pickle=True)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("a.npy", place.getvalue())
    with pytest.raises(InputError, match="objects"):
        Archive(path).array("a", "f", (None,))


def _seconds(call, *arguments) -> float:
    begun = time.process_time()
    call(*arguments)
    return time.process_time() - begun


def test_the_number_test_grows_with_the_length_only():
    """Ten times as long may take ten times as long, not a hundred times."""
    words = ["9" * n + "x" for n in (100_000, 1_000_000)]
    short = max(_seconds(is_number, words[0]), 1e-3)
    assert _seconds(is_number, words[1]) < 40 * short


def test_keys_of_many_parts_are_refused(tmp_path):
    path = tmp_path / "block.toml"
    path.write_text('a = 1\nname = "3.5 and 1.2.3"\n' + "a." * 20_000 + "b = 1\n")
    with pytest.raises(InputError, match=r"block\.toml:3: is not TOML: nested too deeply"):
        read_toml(path)


GEOMETRIES = {
    "no list": {"type": "Polygon", "coordinates": 5},
    "a text": {"type": "Polygon", "coordinates": [[["1", 2], [3, 4], [5, 6]]]},
    "one coordinate": {"type": "LineString", "coordinates": [[1], [2]]},
    "far": {"type": "LineString", "coordinates": [[1e300, 0], [2, 3]]},
    "endless": {"type": "LineString", "coordinates": [[10**400, 0], [2, 3]]},
    "a yes": {"type": "LineString", "coordinates": [[True, 0], [2, 3]]},
    "too deep": {"type": "LineString", "coordinates": [[[1, 0]], [[2, 3]]]},
}


@pytest.mark.parametrize("name", GEOMETRIES)
def test_coordinates_of_geojson(tmp_path, name):
    path = tmp_path / "lines.geojson"
    path.write_text(json.dumps({"features": [{"geometry": GEOMETRIES[name], "properties": {}}]}))
    with pytest.raises(InputError, match="the coordinates of feature 1 are those of no"):
        read_geojson(path)


def _read_all(path) -> None:
    for _, _, rows in read_geopackage(path):
        list(rows)


def _geopackage(path, statements: list[tuple]) -> None:
    database = sqlite3.connect(path)
    database.execute("CREATE TABLE gpkg_geometry_columns (table_name, column_name, srs_id)")
    for statement in statements:
        database.execute(*statement)
    database.commit()
    database.close()


@pytest.mark.slow
def test_a_geopackage_whose_rows_never_end(tmp_path):
    path = tmp_path / "b.gpkg"
    endless = "WITH RECURSIVE c(geom) AS (SELECT 1 UNION ALL SELECT geom + 1 FROM c)"
    view = f"CREATE VIEW v AS {endless} SELECT sum(geom) AS geom FROM c"
    _geopackage(path, [(view,), ("INSERT INTO gpkg_geometry_columns VALUES ('v', 'geom', 0)",)])
    with pytest.raises(InputError, match="cannot be read: interrupted"):
        _read_all(path)


@pytest.mark.parametrize(
    "wkb",
    [
        struct.pack("<BII", 1, 2, 1 << 30),
        struct.pack("<BII", 1, 3, 1) + struct.pack("<I", 1 << 31),
        struct.pack("<BII", 1, 6, 1 << 30) + struct.pack("<BII", 1, 6, 1) * 40_000,
        struct.pack("<BII", 1, 2, 1) + struct.pack("<dd", float("nan"), 1.0),
        b"",
    ],
)
def test_counts_in_a_geopackage_are_held_against_its_size(tmp_path, wkb):
    path = tmp_path / "b.gpkg"
    blob = b"GP\0\1" + struct.pack("<i", 25832) + wkb
    _geopackage(
        path,
        [
            ("CREATE TABLE t (geom BLOB)",),
            ("INSERT INTO t VALUES (?)", (blob,)),
            ("INSERT INTO gpkg_geometry_columns VALUES ('t', 'geom', 25832)",),
        ],
    )
    with pytest.raises(InputError, match="the geometry of row 1 is damaged"):
        _read_all(path)
