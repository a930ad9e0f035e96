"""Damage to files that knows their structure: texts, JSON, XML, TOML, archives of arrays, Parquet, SQLite, binary."""

from __future__ import annotations

import io
import json
import random
import re
import sqlite3
import struct
import zipfile
from collections.abc import Callable
from typing import Any

EVIL_NUMBERS = (
    "nan", "inf", "-inf", "1e308", "-1e308", "-0", "0", "-1", "1e-320", "1e5000", "2147483648", "4294967296",
    "9223372036854775808", "9" * 400, "٣٫١٤", "１２", "1_000", "0x10", "1,5", "+1", ".", "1e", "1d5", "²", "1e15",
    "1e16", "-99", "3.5", "360", "1e-12", "999999999999",
)  # fmt: skip
EVIL_PIECES = (
    "\0", '"', "'", "#", ",", ";", "\t", "=", "\r", "\ufeff", "\u2028", "\x85", "\x1f", "é", "\U0001f600", "  ", "-99",
    "[", "]", "{", "}", "<", ">", "&", "\\", "/", "..", "EPSG:25832", "EPSG:99999", "%s", "{0}", "=1+1", "@x", "\x7f",
)  # fmt: skip
LONG = ("9", "[", "(", " ", ",", "a", "0.", "-", '"', "=", "x ", "1 ", "\t", "<a>", "{")
ENCODINGS = ("utf-16", "utf-16-le", "utf-16-be", "utf-32", "utf-8-sig", "latin-1", "cp1252", "utf-7")
WORD = re.compile(r"[^\s,;\"'<>=\[\](){}:]+")
NUMBER = re.compile(r"[-+]?\d+\.?\d*(?:[eE][-+]?\d+)?")
WHOLE = (0, 1, 2, 3, 7, 255, 256, 65535, 2**31 - 1, 2**31, 2**32 - 1, 2**40, 2**62, 2**63 - 1, 2**63, 2**64 - 1)
FLOATS = (float("nan"), float("inf"), -float("inf"), 1e308, -1e308, 0.0, -1.0, 1e-320, 1e20)

Mutation = Callable[[bytes, random.Random], bytes]


def mutated(name: str, raw: bytes, rng: random.Random) -> bytes:
    """A damaged copy of a file, by its ending; one time in eight bytes at random, whatever it is."""
    if rng.random() < 0.125:
        return of_bytes(raw, rng)
    ending = name.rpartition(".")[2].lower()
    return BY_ENDING.get(ending, of_text)(raw, rng)


def of_bytes(raw: bytes, rng: random.Random) -> bytes:
    """Binary files: fields near the beginning or anywhere, cuts, pieces twice, at other places, or left out."""
    found = bytearray(raw)
    for _ in range(rng.choice((1, 1, 1, 2, 3, 8))):
        size = len(found)
        if not size:
            return bytes(found)
        reach = min(size, rng.choice((64, 256, 1024, size, size)))
        at = rng.randrange(reach)
        at -= at % rng.choice((1, 1, 2, 4, 8)) if at > 8 else 0
        kind = rng.randrange(9)
        if kind == 0:
            found[at] ^= 1 << rng.randrange(8)
        elif kind == 1:
            found[at] = rng.randrange(256)
        elif kind in (2, 3):
            code = rng.choice("<>") + rng.choice("HIQQI")
            limit = 1 << (8 * struct.calcsize(code))
            field = struct.pack(code, rng.choice(WHOLE) % limit)
            found[at : at + len(field)] = field
        elif kind == 4:
            found[at : at + 8] = struct.pack(rng.choice("<>") + "d", rng.choice(FLOATS))
        elif kind == 5:
            del found[at:]
        elif kind == 6:
            del found[at : at + rng.choice((1, 2, 4, 8, 100))]
        elif kind == 7:
            other = rng.randrange(size)
            found[at:at] = found[other : other + rng.choice((1, 4, 8, 64, 1000))]
        else:
            found[at : at + rng.choice((1, 4, 16, 256))] = rng.choice((b"", b"\0" * 16, b"\xff" * 16))
    return bytes(found)


def of_text(raw: bytes, rng: random.Random) -> bytes:
    """Text files: lines, words, numbers, separators, encodings."""
    text = raw.decode("utf-8", "replace")
    for _ in range(rng.choice((1, 1, 1, 1, 2, 3))):
        text = rng.choice(TEXT_MUTATIONS)(text, rng)
    if rng.random() < 0.04:
        return text.encode(rng.choice(ENCODINGS), "replace")
    return text.encode("utf-8", "surrogatepass")


def _lines(text: str, rng: random.Random) -> str:
    lines = text.split("\n")
    i, j = rng.randrange(len(lines)), rng.randrange(len(lines))
    kind = rng.randrange(6)
    if kind == 0:
        lines[i], lines[j] = lines[j], lines[i]
    elif kind == 1:
        lines.insert(j, lines[i])
    elif kind == 2:
        del lines[i]
    elif kind == 3:
        lines = lines[:i]
    elif kind == 4:
        lines[i] = ""
    else:
        lines[i] += lines[j]
    return "\n".join(lines)


def _number(text: str, rng: random.Random) -> str:
    return _replaced(NUMBER, text, rng, rng.choice(EVIL_NUMBERS))


def _word(text: str, rng: random.Random) -> str:
    words = WORD.findall(text[:20_000])
    other = rng.choice((*EVIL_PIECES, *EVIL_NUMBERS, *rng.sample(words, min(len(words), 20)), ""))
    return _replaced(WORD, text, rng, other)


def _replaced(pattern: re.Pattern[str], text: str, rng: random.Random, by: str) -> str:
    places = list(pattern.finditer(text[:20_000]))
    if not places:
        return text
    # counts and headers stand at the beginning
    place = places[min(int(rng.random() ** 2 * len(places)), len(places) - 1)]
    return text[: place.start()] + by + text[place.end() :]


def _inserted(text: str, rng: random.Random) -> str:
    at = rng.randrange(len(text) + 1)
    return text[:at] + rng.choice(EVIL_PIECES) + text[at:]


def _removed(text: str, rng: random.Random) -> str:
    at = rng.randrange(len(text) + 1)
    return text[:at] + text[at + rng.choice((1, 1, 2, 10, 100)) :]


def _cut(text: str, rng: random.Random) -> str:
    return text[: rng.randrange(len(text) + 1)]


def _separated(text: str, rng: random.Random) -> str:
    return text.replace(rng.choice((",", " ", "\t", "\n", ";")), rng.choice((",", " ", "\t", ";", "", "\r", "\r\n")))


def _long(text: str, rng: random.Random) -> str:
    if rng.random() < 0.8:
        return _inserted(text, rng)
    at = rng.randrange(len(text) + 1)
    return text[:at] + rng.choice(LONG) * rng.choice((2_000, 50_000)) + text[at:]


def _without_rows(text: str, rng: random.Random) -> str:
    return rng.choice(("", text.partition("\n")[0], text.partition("\n")[0] + "\n", "\n\n", "# only a comment\n"))


def _column(text: str, rng: random.Random) -> str:
    """A column taken out, twice, or empty, in every line."""
    separator = rng.choice((",", "\t", " ", ";"))
    at, kind = rng.randrange(8), rng.randrange(3)
    lines = []
    for line in text.split("\n"):
        cells = line.split(separator)
        if at < len(cells):
            cells[at : at + 1] = ([], [cells[at]] * 2, [""])[kind]
        lines.append(separator.join(cells))
    return "\n".join(lines)


TEXT_MUTATIONS = (
    _lines, _lines, _number, _number, _number, _number, _word, _word, _word, _inserted, _removed, _cut, _separated,
    _long, _without_rows, _column,
)  # fmt: skip


def of_json(raw: bytes, rng: random.Random) -> bytes:
    """JSON: values of other types, keys missing or renamed, huge numbers, deep nesting."""
    if rng.random() < 0.2:
        return of_text(raw, rng)
    try:
        tree = json.loads(raw)
    except ValueError:
        return of_text(raw, rng)
    holder = [tree]
    for _ in range(rng.choice((1, 1, 1, 2))):
        _change_tree(holder, rng)
    text = json.dumps(holder[0], ensure_ascii=False)
    if rng.random() < 0.03:
        opening, closing = rng.choice((("[", "]"), ('{"a":', "}")))
        depth = rng.choice((500, 1500, 100_000))
        nested = opening * depth + "1" + closing * depth
        return _replaced(NUMBER, text, rng, nested).encode("utf-8", "surrogatepass")
    return text.encode("utf-8", "surrogatepass")


def _change_tree(holder: Any, rng: random.Random) -> None:
    """Change one node below a list or table, in place."""
    node, places = holder, []
    while isinstance(node, list | dict) and node and (not places or rng.random() < 0.85):
        key = rng.choice(list(node)) if isinstance(node, dict) else rng.randrange(len(node))
        places.append((node, key))
        node = node[key]
    if not places:
        return
    parent, key = places[-1]
    kind = rng.randrange(6)
    if kind == 0 and parent is not holder:
        del parent[key]
    elif kind == 1 and isinstance(parent, dict):
        parent[rng.choice((*EVIL_PIECES, "type", "1e-400", ""))] = parent.pop(key)
    elif kind == 2 and isinstance(parent, list) and parent is not holder:
        parent.insert(key, parent[key])
    else:
        parent[key] = rng.choice(EVIL_VALUES)()


EVIL_VALUES: tuple[Callable[[], Any], ...] = (
    lambda: None, lambda: True, lambda: "", lambda: "x", lambda: [], dict, lambda: 0, lambda: -1, lambda: 2**31,
    lambda: 10**400, lambda: 1e308, lambda: -1e308, lambda: float("nan"), lambda: float("inf"), lambda: [[]],
    lambda: [None], lambda: [1.0], lambda: [1, 2, 3], lambda: {"a": 1}, lambda: "\0", lambda: "\ud800", lambda: 1.5,
    lambda: [[1, 2], [3]], lambda: "9" * 400, lambda: [10**400] * 3,
)  # fmt: skip


def of_xml(raw: bytes, rng: random.Random) -> bytes:
    """XML: as text, with other encodings, document types, deep nesting, elements left out."""
    text = raw.decode("utf-8", "replace")
    kind = rng.randrange(10)
    if kind == 0:
        declared = rng.choice(("utf-16", "utf-32", "utf-16-le", "utf-16-be", "latin-1", "utf-7", "cp037", "nonsense"))
        text = re.sub(r"encoding=[\"'][^\"']*[\"']", f'encoding="{declared}"', text)
        doctype = '<!DOCTYPE a [<!ENTITY b "c">]>' if rng.random() < 0.5 else ""
        text = text.replace("?>", f"?>{doctype}", 1)
        try:
            return text.encode(rng.choice((declared, "utf-8")), "replace")
        except LookupError:
            return text.encode("utf-8", "surrogatepass")
    if kind == 1:
        doctype = rng.choice(('<!DOCTYPE a SYSTEM "file:///etc/passwd">', "<!doctype a>"))
        return text.replace("?>", "?>" + doctype, 1).encode("utf-8", "surrogatepass")
    if kind == 2:
        depth = rng.choice((500, 50_000))
        return _replaced(NUMBER, text, rng, "<a>" * depth + "</a>" * depth).encode("utf-8", "surrogatepass")
    if kind in (3, 4, 5):
        elements = list(re.finditer(r"<(\w+)[^<>]*>[^<]*</\1>", text))
        if elements:
            place = rng.choice(elements)
            other = rng.choice((*(one.group() for one in rng.sample(elements, min(3, len(elements)))), "", "<a/>"))
            return (text[: place.start()] + other + text[place.end() :]).encode("utf-8", "surrogatepass")
    return of_text(raw, rng)


def of_toml(raw: bytes, rng: random.Random) -> bytes:
    """TOML: as text, with values of other types, deep nesting, huge numbers."""
    text = raw.decode("utf-8", "replace")
    if rng.random() < 0.5:
        values = (
            "nan", "inf", "-inf", "1e308", "1" * 5000, "9223372036854775808", "true", '"x"', "[]", "{}", "[[]]", "-1",
            "0", "[1, 2]", "1979-05-27", "[" * 2000, "[" * 2000 + "]" * 2000, "{a=" * 500 + "1" + "}" * 500, '""',
            "1e-320", "[nan, 1]",
            "0x10", '"\\u0000"', "[{}]", "2", "1.5", "[1e308, 1e308]", '["bluh:1-999999999999"]', '"auto"',
        )  # fmt: skip
        places = list(re.finditer(r"= *(.*)", text))
        if places:
            place = rng.choice(places)
            return (text[: place.start(1)] + rng.choice(values) + text[place.end(1) :]).encode("utf-8", "surrogatepass")
    if rng.random() < 0.1:
        return (text + "\n" + "a." * rng.choice((100, 20_000)) + "b = 1\n").encode("utf-8", "surrogatepass")
    return of_text(raw, rng)


def of_npz(raw: bytes, rng: random.Random) -> bytes:
    """Archives of arrays: members missing, of other shapes, types and values, wrong headers; or bytes."""
    import numpy as np

    if rng.random() < 0.25:
        return of_bytes(raw, rng)
    with zipfile.ZipFile(io.BytesIO(raw)) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    name = rng.choice(list(members))
    kind = rng.randrange(8)
    if kind == 0:
        del members[name]
    elif kind == 1:
        members[rng.choice(("extra.npy", "schema.npy", "shared.npy", "../x.npy", "status"))] = members[name]
    elif kind == 2:
        members[name] = of_bytes(members[name], rng)
    elif kind == 3:
        head = members[name][10:128].decode("latin-1")
        new = _word(_number(head, rng), rng) if rng.random() < 0.5 else _number(head, rng)
        members[name] = members[name][:10] + new.encode("latin-1", "replace")[:118].ljust(118) + members[name][128:]
    else:
        array = np.load(io.BytesIO(members[name]), allow_pickle=False)
        place = io.BytesIO()
        np.save(place, _changed_array(array, rng), allow_pickle=True)
        members[name] = place.getvalue()
    found = io.BytesIO()
    with zipfile.ZipFile(found, "w", rng.choice((zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED))) as archive:
        for entry, content in members.items():
            archive.writestr(entry, content)
    return found.getvalue()


def _changed_array(array: Any, rng: random.Random) -> Any:
    import numpy as np

    kind = rng.randrange(12)
    if kind == 0:
        return array[:-1] if array.ndim else np.repeat(array, 3)
    if kind == 1:
        return array[None]
    if kind == 2:
        return array.T if array.ndim > 1 else array.reshape(1, -1)
    if kind == 3:
        return np.zeros(0, array.dtype)
    if kind == 4:
        return array.astype(object)
    if kind == 5:
        return array.astype(str)
    if kind == 6:
        return np.concatenate([array, array]) if array.ndim else array
    if kind == 7:
        return np.zeros_like(array)
    if array.dtype.kind == "U":
        choices = ("", "x", "converged", "rank deficient", "[{}]", "null", '{"components": 1}', "[" * 5000, "nan")
        return np.array(rng.choice(choices)) if array.ndim == 0 else np.full(array.shape, "x")
    changed = array.astype(rng.choice((float, np.int64, np.float32, complex, array.dtype, array.dtype)))
    value = rng.choice((*FLOATS, -5.0, 7.0, 1e9))
    with np.errstate(all="ignore"):
        if changed.ndim == 0:
            return np.array(value).astype(changed.dtype)
        if changed.size:
            changed.flat[rng.randrange(changed.size)] = np.array(value).astype(changed.dtype)
    return changed


def of_parquet(raw: bytes, rng: random.Random) -> bytes:
    """Parquet: columns of other types, missing, renamed, with nulls and strange values; or bytes."""
    import pyarrow as pa
    from pyarrow import parquet

    if rng.random() < 0.35:
        return of_bytes(raw, rng)
    table = parquet.read_table(pa.BufferReader(raw), use_threads=False)
    at = rng.randrange(table.num_columns)
    name, column, n = table.column_names[at], table.column(at), table.num_rows
    kind = rng.randrange(9)
    made: Any
    if kind == 0:
        table = table.remove_column(at)
    elif kind == 1:
        names = list(table.column_names)
        names[at] = rng.choice(("x", "", name + " "))
        table = table.rename_columns(names)
    elif kind == 2:
        table = table.append_column(name, column)
    elif kind == 3:
        table = table.slice(0, rng.choice((0, 1, 2)))
    else:
        made = rng.choice((
            lambda: pa.nulls(n), lambda: pa.array([None] * n, pa.string()), lambda: pa.array([["x"]] * n),
            lambda: pa.array([1 << 40] * n), lambda: pa.array([float("nan")] * n), lambda: pa.array([1e308] * n),
            lambda: pa.array(["x\0y"] * n), lambda: pa.array([b"\xff"] * n), lambda: pa.array([True] * n),
            lambda: pa.array(["a" * 2000] * n), lambda: pa.array([{"a": 1}] * n), lambda: pa.array(["1"] * n),
            lambda: pa.array([None, *(["x"] * (n - 1))][:n]).dictionary_encode(), lambda: pa.array([[None]] * n),
            lambda: pa.array([float("inf"), *([0.0] * (n - 1))][:n]), lambda: pa.array(range(n), pa.timestamp("s")),
        ))()  # fmt: skip
        table = table.set_column(at, name, made)
    sink = pa.BufferOutputStream()
    parquet.write_table(table, sink)
    return sink.getvalue().to_pybytes()


def of_gpkg(raw: bytes, rng: random.Random) -> bytes:
    """GeoPackage: geometries, names and numbers of its tables; or bytes."""
    if rng.random() < 0.4:
        return of_bytes(raw, rng)
    database = sqlite3.connect(":memory:")
    database.deserialize(raw)
    kind = rng.randrange(6)
    table = database.execute("SELECT table_name FROM gpkg_geometry_columns").fetchone()[0]
    if kind < 3:
        (blob,) = database.execute(f"SELECT geom FROM {table} LIMIT 1").fetchone()
        new: Any = of_bytes(blob, rng) if rng.random() < 0.9 else rng.choice(("text", 5, 1.5, None, b""))
        database.execute(f"UPDATE {table} SET geom = ? WHERE rowid = 1", (new,))
    elif kind == 3:
        value = rng.choice(("x", 1 << 62, None, 1.5, b"\xff", 'a"b', "sqlite_master", "nothing"))
        column = rng.choice(("table_name", "column_name", "srs_id"))
        database.execute(f"UPDATE gpkg_geometry_columns SET {column} = ?", (value,))
    elif kind == 4:
        database.execute(rng.choice(("DELETE FROM gpkg_geometry_columns", f"DELETE FROM {table}",
                                     f"DROP TABLE {table}", "DROP TABLE gpkg_geometry_columns")))  # fmt: skip
    else:
        database.execute(f"INSERT INTO {table} (geom) VALUES (?)", (rng.choice((None, b"GP", "x", b"GP\0\1")),))
    database.commit()
    return database.serialize()


BY_ENDING: dict[str, Mutation] = {
    "json": of_json, "geojson": of_json, "xml": of_xml, "toml": of_toml, "npz": of_npz, "parquet": of_parquet,
    "gpkg": of_gpkg, "tif": of_bytes, "jpg": of_bytes, "las": of_bytes, "laz": of_bytes, "bin": of_bytes,
}  # fmt: skip
