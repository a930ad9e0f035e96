"""Layers of Shapefile, FlatGeobuf, KML and KMZ, read by GDAL through pyogrio: the one module that imports it.

GDAL is handed bytes in memory, never a path: it cannot follow an address or a link, open a file beside the user's,
write one there (the .shx that it restores), or take the ending of a name for a driver. What the bytes are is looked at
before, so that no other driver of GDAL, some of which load addresses that a file names, is tried on them.

GeoJSON and GeoPackage keep readers of their own. GDAL does not keep what those promise: views of a GeoPackage that
never end are given up, every count is held against the size of the file, numbers of a GeoPackage's own list of systems
are no EPSG codes, a feature that is wrong is named, and a GeoJSON file without a CRS whose coordinates are no degrees
is told.
"""

from __future__ import annotations

import io
import logging
import os
import struct
import warnings
import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from aerotri.conventions import InputError, regular_file
from aerotri.crs_text import crs_text
from aerotri.vectors.geojson import LARGEST_M

ENDINGS = (".shp", ".shz", ".zip", ".fgb", ".kml", ".kmz")
"""Of the files that are read here; .shz and .zip hold a Shapefile."""
LARGEST_BYTES = 1 << 29
"""Of a file, and of what an archive unpacks to [C]: outlines and breaklines of a country are smaller."""
SHAPEFILE, FLATGEOBUF, ZIP = b"\x00\x00\x27\x0a", b"fgb", b"PK\x03\x04"
"""How the files begin [L: ESRI Shapefile Technical Description, 1998; FlatGeobuf specification]."""
COMPANIONS = (".shx", ".dbf", ".prj", ".cpg")
"""Files that belong to a .shp: index, attributes, CRS, encoding of the attributes."""
LOADED_FROM_ELSEWHERE = (b"<OGR", b"<OAPIF", b"<GDAL")
"""Beginnings of XML that GDAL takes for the description of data elsewhere: no KML file has them."""
SHAPEFILE_REMEDY = "give all files of the Shapefile, side by side: .shp, .shx, .dbf, .prj"


@dataclass(frozen=True, eq=False)
class VectorLayer:
    """Features of one layer.

    Parameters
    ----------
    name : of the layer. crs : as `crs_text` has it, None where none is stated.
    features : attributes by name and geometry, None where a feature has none; X, Y and where there is one Z.
    """

    name: str
    crs: str | None
    features: list[tuple[Mapping[str, Any], BaseGeometry | None]]

    @property
    def kinds(self) -> list[str]:
        """Kinds of its geometries, such as 'Polygon', each once, in the order of the file."""
        return list(dict.fromkeys(geometry.geom_type for _, geometry in self.features if geometry is not None))


def read_layers(path: Path) -> list[VectorLayer]:
    """The layers of a file that hold something.

    Raises
    ------
    InputError
        When the file cannot be read, is not what its ending says, or has a coordinate that is not possible.
    """
    content, drivers, remedy = _content(path)
    layers = _read(content, drivers, remedy, path)
    return [layer for layer in layers if layer.features]


def _content(path: Path) -> tuple[bytes, tuple[str, ...], str]:
    """What GDAL is to read, by which of its drivers, and the remedy where it cannot."""
    suffix = path.suffix.lower()
    if suffix in (".shp", ".shz", ".zip"):
        parts = _companions(path) if suffix == ".shp" else _archived_shapefile(path)
        return _archive_of(parts, path), ("ESRI Shapefile",), "export the Shapefile again"
    raw = _bytes(path)
    if suffix == ".fgb":
        if raw[:3] != FLATGEOBUF:
            raise InputError("is no FlatGeobuf", "export the file again", path)
        return raw, ("FlatGeobuf",), "export the FlatGeobuf file again"
    if suffix == ".kmz":
        raw = _document_of_kmz(raw, path)
    _check_kml(raw, path)
    return raw, ("LIBKML", "KML"), "export the KML again"


def _bytes(path: Path) -> bytes:
    size = regular_file(path).stat().st_size
    if size > LARGEST_BYTES:
        raise InputError(f"has {size / 1e6:.0f} MB, more than are read", "give the outlines or lines alone", path)
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", "check the file and its permissions", path) from error


def _companions(path: Path) -> dict[str, bytes]:
    """A .shp and the files beside it, by their endings."""
    parts = {".shp": _bytes(path)}
    for ending in COMPANIONS:
        for own in (path.with_suffix(ending), path.with_suffix(ending.upper())):
            if os.path.lexists(own):
                parts[ending] = _bytes(own)
                break
    return parts


def _archived_shapefile(path: Path) -> dict[str, bytes]:
    """As `_companions`, of an archive that holds one Shapefile."""
    with _opened(_bytes(path), path) as archive:
        members = [own for own in archive.infolist() if not Path(own.filename).name.startswith("._")]
        shapes = [own.filename for own in members if own.filename.lower().endswith(".shp")]
        if len(shapes) != 1:
            names = ", ".join(f"'{name[:80]}'" for name in shapes[:5])
            message = f"holds {len(shapes)} Shapefiles: {names}" if shapes else "holds no Shapefile"
            raise InputError(message, "give an archive with one Shapefile", path)
        stem = shapes[0][:-4].lower()
        wanted = {f"{stem}{ending}": ending for ending in (".shp", *COMPANIONS)}
        return {
            wanted[own.filename.lower()]: _member(archive, own, path)
            for own in members
            if own.filename.lower() in wanted
        }


def _opened(raw: bytes, path: Path) -> zipfile.ZipFile:
    try:
        return zipfile.ZipFile(io.BytesIO(raw))
    except (zipfile.BadZipFile, ValueError, OSError, NotImplementedError) as error:
        raise InputError(f"is no archive: {error}", "export the file again; is it cut off?", path) from error


def _member(archive: zipfile.ZipFile, member: zipfile.ZipInfo, path: Path) -> bytes:
    """What a file in an archive holds, never more than `LARGEST_BYTES`."""
    try:
        with archive.open(member) as file:
            raw = file.read(LARGEST_BYTES + 1)
    except (zipfile.BadZipFile, zlib.error, OSError, EOFError, RuntimeError, NotImplementedError) as error:
        message = f"'{member.filename[:80]}' in it cannot be unpacked: {error}"
        raise InputError(message, "export the file again; is it cut off?", path) from error
    if len(raw) > LARGEST_BYTES:
        raise InputError("unpacks to more than is read", "give the outlines or lines alone", path)
    return raw


def _archive_of(parts: Mapping[str, bytes], path: Path) -> bytes:
    """The files of one Shapefile as the archive that GDAL reads from memory."""
    if parts[".shp"][:4] != SHAPEFILE:
        raise InputError("is no Shapefile", "export the Shapefile again", path)
    if ".shx" not in parts:
        raise InputError("its .shx is missing", SHAPEFILE_REMEDY, path)
    _check_counts(parts, path)
    place = io.BytesIO()
    with zipfile.ZipFile(place, "w", zipfile.ZIP_STORED) as archive:
        for ending, raw in parts.items():
            archive.writestr(f"layer{ending}", raw)
    return place.getvalue()


def _check_counts(parts: Mapping[str, bytes], path: Path) -> None:
    """Refuse files of different states of a Shapefile: GDAL reads what the index lists and leaves out the rest.

    The index has big-endian places and lengths in 16-bit words behind a head of 100 bytes; a record has a head of 8
    bytes [L: ESRI Shapefile Technical Description, 1998]. Records that no entry lists are no fault: programs that edit
    in place leave them behind.
    """
    index, rows = parts[".shx"], parts.get(".dbf", b"")
    entries = np.frombuffer(index, ">i4", 2 * (max(len(index) - 100, 0) // 8), 100 if len(index) >= 100 else 0)
    ends = 2 * entries.reshape(-1, 2).astype(np.int64).sum(axis=1) + 8
    if (ends > len(parts[".shp"])).any():
        raise InputError("its .shp is shorter than its .shx says", SHAPEFILE_REMEDY, path)
    if len(rows) >= 8:
        count = int(struct.unpack_from("<I", rows, 4)[0])
        if count != len(ends):
            raise InputError(f"its .shx lists {len(ends)} shapes, its .dbf {count}", SHAPEFILE_REMEDY, path)


def _document_of_kmz(raw: bytes, path: Path) -> bytes:
    """The document of a KMZ: doc.kml, else its first .kml [L: OGC 12-007]."""
    with _opened(raw, path) as archive:
        documents = [own for own in archive.infolist() if own.filename.lower().endswith(".kml")]
        documents.sort(key=lambda own: own.filename.lower() != "doc.kml")
        if not documents:
            raise InputError("holds no KML document", "export the KMZ again", path)
        return _member(archive, documents[0], path)


def _check_kml(raw: bytes, path: Path) -> None:
    """Refuse what is no KML, or what another driver of GDAL would take for its own.

    Document types can define entities that grow without bound or refer to other files, and KML has none; where every
    letter of ASCII is not one byte they would pass unseen.
    """
    if b"\0" in raw:
        raise InputError("is not UTF-8", "save the KML as UTF-8", path)
    if b"<!DOCTYPE" in raw or b"<!ENTITY" in raw:
        raise InputError("declares a document type or entities", "remove the declaration", path)
    try:
        root = ElementTree.fromstring(raw)
    except ElementTree.ParseError as error:
        message = f"is not XML: {str(error).split(':')[0]}"
        raise InputError(message, "export the KML again; is it cut off?", path, error.position[0]) from error
    except (ValueError, LookupError, RecursionError) as error:
        raise InputError(f"is not XML: {error}", "save the KML as UTF-8", path) from error
    if root.tag.rpartition("}")[2].lower() != "kml" or any(text in raw for text in LOADED_FROM_ELSEWHERE):
        raise InputError("is no KML", "export the KML again", path)


def _read(content: bytes, drivers: tuple[str, ...], remedy: str, path: Path) -> list[VectorLayer]:
    from pyogrio import list_layers, read_info
    from pyogrio.errors import CRSError
    from pyogrio.raw import read

    # what GDAL logs where nobody listens would be printed
    logging.getLogger("pyogrio").addHandler(logging.NullHandler())
    with warnings.catch_warnings():
        # such as: measures beside X, Y, Z are left out
        warnings.simplefilter("ignore")
        try:
            names = [str(name) for name, _ in list_layers(content)]
            if not names:
                raise InputError("cannot be read: no layer of it is whole", remedy, path)
            used = read_info(content, layer=names[0])["driver"]
            if used not in drivers:
                raise InputError(f"is no {drivers[-1]} file", remedy, path)
            tables = [(name, read(content, layer=name)) for name in names]
        except InputError:
            raise
        except CRSError as error:
            raise InputError("its CRS cannot be read", "write its CRS anew (.prj of a Shapefile)", path) from error
        except Exception as error:  # whatever a damaged file leads to, in GDAL or in pyogrio
            short = (str(error).splitlines() or [type(error).__name__])[0][:200]
            raise InputError(f"cannot be read: {short}", remedy, path) from error
    return [_layer(name, table, path) for name, table in tables]


def _layer(name: str, table: tuple[Any, ...], path: Path) -> VectorLayer:
    meta, _, wkb, columns = table
    geometries = [_geometry(own, number, path) for number, own in enumerate(wkb, start=1)] if wkb is not None else []
    values = [_values(own, kind) for own, kind in zip(columns, _kinds(meta), strict=True)]
    fields = [str(field) for field in meta["fields"]]
    rows = [dict(zip(fields, row, strict=True)) for row in zip(*values, strict=True)] if values else None
    return VectorLayer(
        name,
        _system(meta.get("crs"), path),
        list(zip(rows if rows is not None else [{} for _ in geometries], geometries, strict=True)),
    )


def _kinds(meta: Mapping[str, Any]) -> list[str]:
    """What the fields are for GDAL; releases of pyogrio that do not tell it leave it to numpy."""
    return [str(kind) for kind in meta.get("ogr_types", [""] * len(meta["fields"]))]


def _values(column: np.ndarray, kind: str) -> list[Any]:
    """Values of a field; None where there is none. Whole numbers with gaps come as decimals, and become whole again."""
    whole = kind.startswith("OFTInteger")
    found: list[Any] = []
    for value in column.tolist():
        if value is None or value != value:
            found.append(None)
        else:
            found.append(int(value) if whole and isinstance(value, float) else value)
    return found


def _geometry(wkb: bytes | None, number: int, path: Path) -> BaseGeometry | None:
    if wkb is None:
        return None
    try:
        # numbers beyond all bounds are refused below
        with np.errstate(all="ignore"):
            geometry = shapely.from_wkb(wkb)
    except (shapely.errors.ShapelyError, ValueError, TypeError) as error:
        raise InputError(f"the geometry of feature {number} cannot be read: {error}", "correct it", path) from error
    if not (np.abs(shapely.get_coordinates(geometry)) <= LARGEST_M).all():
        raise InputError(f"feature {number} has a coordinate that is not possible", "give finite numbers", path)
    return geometry


def _system(stated: str | None, path: Path) -> str | None:
    """The CRS of a layer by its definition; None where none is stated."""
    if not stated:
        return None
    from pyproj import CRS
    from pyproj.exceptions import CRSError

    try:
        return crs_text(CRS.from_user_input(stated)) or None
    except CRSError:
        raise InputError("its CRS is not known to PROJ", "give the file in a known CRS", path) from None
