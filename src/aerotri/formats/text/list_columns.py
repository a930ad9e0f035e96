"""What the columns of a list hold, by their names: any program's, several languages, with units in brackets.

``X/Easting``, ``Accuracy_X/Y_(m)``, ``Hochwert [m]``, ``Elevation RMS``: a name is cut into words, its unit taken off,
and every word has to be known. A column of residuals or of estimates is never one of coordinates.
"""

from __future__ import annotations

import re
import unicodedata
from dataclasses import dataclass

import numpy as np

LONGEST_COLUMN = 120
"""Characters of a column's name at most [C]."""
WORDS: dict[str, tuple[str, ...]] = {
    "name": (
        "imagename", "image", "filename", "file", "photo", "photoid", "photoname", "label", "name", "id", "point",
        "pointid", "pointname", "gcp", "gcpname", "gcplabel", "target", "marker", "nr", "no", "number", "pt", "ptid",
        "station", "camera", "photograph", "punkt", "punktnummer", "punktnr", "punktname", "pktnr", "pktname", "pnr",
        "bild", "bildname", "bildnummer", "foto", "fotonummer", "nom", "matricule", "cliche", "punto", "nombre",
        "nome", "ponto", "naam", "imagen", "immagine",
    ),
    "X": (
        "x", "xgps", "x0", "easting", "east", "e", "xeasting", "rechtswert", "rechts", "rw", "ost", "ostwert", "est",
        "este", "leste", "oost",
    ),
    "Y": (
        "y", "ygps", "y0", "northing", "north", "n", "ynorthing", "hochwert", "hoch", "hw", "nord", "nordwert",
        "norte", "noord",
    ),
    "Z": (
        "z", "zgps", "z0", "height", "h", "altitude", "alt", "elevation", "elev", "orthometricheight", "orthoheight",
        "hohe", "hoehe", "nhn", "hauteur", "altitud", "altura", "cota", "quota", "hoogte", "zaltitude", "ht", "orthoht",
    ),
    "h_ell": (
        "ellipsoidalheight", "ellheight", "ellipsoidheight", "ellipsoidischehohe", "heightell", "hae", "ellipht",
        "ellht", "hell", "wgs84height",
    ),
    "lon": ("longitude", "lon", "long", "lng", "langengrad", "lange", "laenge", "longitud", "longitudine"),
    "lat": ("latitude", "lat", "breitengrad", "breite", "latitud", "latitudine"),
    "sX": ("sx", "xacc", "accx", "sx0", "sigmae", "se", "stdx", "sdx", "sigmax"),
    "sY": ("sy", "yacc", "accy", "sy0", "sigman", "sn", "stdy", "sdy", "sigmay"),
    "sZ": ("sz", "zacc", "accz", "sz0", "sigmah", "sigmau", "stdz", "sdz", "sigmaz"),
    "s_plan": ("acchor", "horacc", "hacc", "acch", "accuracyh", "sxy", "hrms"),
    "s_height": ("accver", "veracc", "vacc", "accv", "accuracyv", "sh", "vrms"),
    "s_all": ("sxyz",),
    "omega": ("omega",), "phi": ("phi",), "kappa": ("kappa",),
    "yaw": ("yaw", "heading"), "pitch": ("pitch",), "roll": ("roll",),
    "role": ("role",),
    "crs": ("csname", "crs", "coordinatesystem", "epsg"),
}  # fmt: skip
LETTERS = ("x", "y", "z", "e", "n", "h")
"""Words that give way to others: X/Longitude is a longitude."""
ACCURACY = (
    "acc",
    "accuracy",
    "sigma",
    "std",
    "stdev",
    "stddev",
    "sd",
    "precision",
    "rms",
    "uncertainty",
    "genauigkeit",
)
NO_COORDINATE = (
    "error", "err", "residual", "residuals", "est", "estimated", "diff", "difference", "delta", "computed", "corrected",
    "adjusted", "velocity", "antenna", "pole", "base", "offset",
)  # fmt: skip
"""Words of columns that repeat what was measured, as another program sees it."""
NEUTRAL = ("grid", "utm", "local", "coord", "coordinate", "gps")
"""Words that say nothing of the axis."""
PLAN = ("hor", "horz", "horizontal", "plan", "xy", "lateral", "planimetric", "lage")
HEIGHT = ("ver", "vert", "vertical", "v", "u", "up")
US_FOOT = 1200.0 / 3937.0
LENGTHS = {
    "m": 1.0, "meter": 1.0, "meters": 1.0, "metre": 1.0, "metres": 1.0, "km": 1e3, "cm": 1e-2, "mm": 1e-3,
    "ft": 0.3048, "foot": 0.3048, "feet": 0.3048, "ift": 0.3048, "intft": 0.3048, "internationalfeet": 0.3048,
    "usft": US_FOOT, "ftus": US_FOOT, "sft": US_FOOT, "ussurveyfoot": US_FOOT, "ussurveyfeet": US_FOOT,
    "ussurveyft": US_FOOT, "surveyft": US_FOOT, "surveyfoot": US_FOOT, "surveyfeet": US_FOOT, "usfeet": US_FOOT,
    "usfoot": US_FOOT,
}  # fmt: skip
ANGLES = {
    "deg": 1.0, "degree": 1.0, "degrees": 1.0, "decimaldegrees": 1.0, "°": 1.0, "dd": 1.0,
    "grad": 0.9, "gon": 0.9, "gons": 0.9, "grads": 0.9,
    "rad": float(np.degrees(1.0)), "radian": float(np.degrees(1.0)), "radians": float(np.degrees(1.0)),
}  # fmt: skip
UNIT_WORD = re.compile(
    r"(?<![a-z])(?:(?:us|s|intl?)?(?:ft|foot|feet)(?:us|intl?)?|inch(?:es)?|yds?|yards?|dmm?s?|(?:arc)?secs?|sigma)(?![a-z])"
    r"|mmss|seconds|%|σ|^[WS]$",
    re.IGNORECASE,
)
"""Words of units, sides and standard deviations that are not known here."""
IN_DEGREES = ("lon", "lat", "omega", "phi", "kappa", "yaw", "pitch", "roll")
IN_METRES = ("X", "Y", "Z", "h_ell", "sX", "sY", "sZ", "s_plan", "s_height", "s_all")


@dataclass(frozen=True)
class ListColumn:
    """A column of a list.

    Parameters
    ----------
    name : as the file has it. meaning : a key of `WORDS`, '' where it is not known.
    unit : as the file has it, '' where it says none. factor : to metres or degrees; NaN where the unit does not fit.
    """

    name: str
    meaning: str
    unit: str = ""
    factor: float = 1.0


def list_column(name: str) -> ListColumn:
    """What a column holds, by its name."""
    if len(name) > LONGEST_COLUMN:
        return ListColumn(name, "")
    stated = re.findall(r"[(\[{]([^)\]}]*)[)\]}]", name)
    words = _words(re.sub(r"[(\[{][^)\]}]*[)\]}]", " ", name))
    texts = [text.strip() for text in stated if text.strip()]
    unit = next((text for text in texts if is_unit(text)), texts[0] if texts else "")
    if not stated:
        words, unit = _without_unit(words)
    meaning = _meaning(words)
    if not unit or not meaning:
        return ListColumn(name, meaning)
    key = _unit_key(unit)
    if meaning.startswith("s") and key in ANGLES:
        # an accuracy of angles
        return ListColumn(name, "", unit)
    if meaning == "Z" and key.startswith("ellips"):
        return ListColumn(name, "h_ell")
    if meaning in ("X", "Y") and key in ANGLES:
        meaning = "lon" if meaning == "X" else "lat"
    known = ANGLES if meaning in IN_DEGREES else LENGTHS if meaning in IN_METRES else {}
    return ListColumn(name, meaning, unit, known.get(key, float("nan")))


def looks_like_unit(text: str) -> bool:
    """Whether a text in brackets that is no unit here states one, a side, or how sure a value is."""
    return UNIT_WORD.search(text) is not None


def is_unit(text: str) -> bool:
    """Whether a text in brackets is a unit that is known here."""
    return _unit_key(text) in {**LENGTHS, **ANGLES}


def _unit_key(unit: str) -> str:
    return re.sub(r"[^a-z°]", "", unit.lower())


def _without_unit(words: list[str]) -> tuple[list[str], str]:
    """Words of a name without the unit that they end with: Elev ft, Elev ft US."""
    for count in (2, 1):
        unit = "".join(words[-count:])
        if len(words) > count and is_unit(unit):
            return words[:-count], unit
    return words, ""


def _words(name: str) -> list[str]:
    """Lower case words of letters and digits without accents; ImageName has two."""
    plain = unicodedata.normalize("NFKD", re.sub("[Nn]°", "no ", name).replace("ß", "ss").replace("σ", "sigma"))
    plain = "".join(c for c in plain if not unicodedata.combining(c))
    parted = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", plain)
    return re.findall(r"[a-z0-9]+", parted.lower())


def _meaning(words: list[str]) -> str:
    if not words or (len(words) > 1 and set(words) & set(NO_COORDINATE)):
        return ""
    found = _of_word("".join(words))
    if found:
        return found
    if len(words) == 2 and words[0] in ("point", "gps") and words[1] in LETTERS[:3]:
        words = words[1:]
    words = [word for word in words if word not in NEUTRAL] or words
    if _of_word("".join(words)):
        return _of_word("".join(words))
    accuracy = [word for word in words if word in ACCURACY]
    if accuracy:
        return _accuracy_of([word for word in words if word not in ACCURACY])
    meanings = [(word, _of_word(word)) for word in words]
    if not all(meaning for _, meaning in meanings):
        return ""
    told = {meaning for word, meaning in meanings if word not in LETTERS} or {meaning for _, meaning in meanings}
    return told.pop() if len(told) == 1 else ""


def _of_word(word: str) -> str:
    return next((meaning for meaning, words in WORDS.items() if word in words), "")


def _accuracy_of(words: list[str]) -> str:
    axes = {"plan" if word in PLAN else "Z" if word in HEIGHT else _of_word(word) for word in words}
    axes = {{"lon": "X", "lat": "Y", "h_ell": "Z"}.get(axis, axis) for axis in axes}
    known: dict[frozenset[str], str] = {
        frozenset(): "s_all", frozenset("XYZ"): "s_all", frozenset("X"): "sX", frozenset("Y"): "sY",
        frozenset("Z"): "sZ", frozenset("XY"): "s_plan", frozenset({"plan"}): "s_plan",
    }  # fmt: skip
    return known.get(frozenset(axes), "")
