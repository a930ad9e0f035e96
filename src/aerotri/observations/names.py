"""Names that do not meet: what two tables call the same point or photograph differently, and control renamed.

Names meet only when they are equal. Those that have no partner are compared with the others by what people write in two
ways: upper and lower case, blanks and signs, leading zeros, folder and ending of a file, characters that look alike in
two alphabets, something before or behind the name.
"""

from __future__ import annotations

import re
import unicodedata
from collections import Counter
from collections.abc import Container, Iterable, Sequence
from dataclasses import replace
from difflib import SequenceMatcher

import numpy as np

from aerotri.conventions import InputError
from aerotri.observations.block import Block

ENDING = re.compile(r"\.(jpe?g|tiff?|png|dng|raw|iiq|arw|cr2|cr3|nef|bmp|jp2|ecw|sid|img|ptx)$", re.IGNORECASE)
"""File endings of images."""
LOOK_ALIKE = str.maketrans(
    "АВЕКМНОРСТУХІЈЅавекмнорстухіјѕΑΒΕΖΗΙΚΜΝΟΡΤΥΧοαν", "ABEKMHOPCTYXIJSabekmhopctyxijsABEZHIKMNOPTYXoav"
)
"""Cyrillic and Greek letters and the Latin ones that look the same."""
AS_DIGITS = str.maketrans("oil|", "0111")
SIGNS = re.compile(r"[\s_\-./\\:#()\[\]'\"]+")
ZEROS = re.compile(r"(?<!\d)0+(?=\d)")
NUMBER = re.compile(r"\d+")
BETWEEN = re.compile(r"(?<=[^\W\d_])(?=\d)|(?<=\d)(?=[^\W\d_])")
"""Where letters end and a number begins, and the reverse."""
SHOWN, SHOWN_NEAR, MOST_COMPARED, MANY = 5, 2, 200, 50_000
"""Names a message shows, near names behind each, names compared with the known ones, and known names from which only
those with the same core are compared [C]: a message stays one line, and the search of large tables short."""


def stem(name: str) -> str:
    """The name of an image file without folder and ending."""
    return ENDING.sub("", name.replace("\\", "/").rsplit("/", 1)[-1])


def near_names(names: Iterable[str], known: Iterable[str]) -> dict[str, tuple[str, ...]]:
    """For every name those of the known ones that may mean the same, the likeliest first; () where there is none.

    Parameters
    ----------
    names : without a partner among the known ones; the first `MOST_COMPARED` are looked at.
    """
    names = list(dict.fromkeys(names))[:MOST_COMPARED]
    known = _worth_comparing(names, list(dict.fromkeys(known)))
    by_key: dict[str, list[str]] = {}
    for name in known:
        for key in _keys(name):
            by_key.setdefault(key, []).append(name)
    plain = list({_keys(name)[0]: name for name in reversed(known)}.items())
    found = {}
    for name in names:
        same = [other for key in _keys(name) for other in by_key.get(key, ())]
        longer = [] if same else [other for key, other in plain if _with_affix(_keys(name)[0], key)]
        found[name] = tuple(dict.fromkeys(same or sorted(longer, key=len)))
    return found


def alike(names: Sequence[str]) -> list[tuple[str, ...]]:
    """Groups of names that differ only in upper and lower case, signs, leading zeros, look-alike letters or ending.

    Unlike for near names a sign still parts numbers: 1_11 and 11_1 are two names. Of more than `MANY` none are found.
    """
    groups: dict[str, list[str]] = {}
    for name in dict.fromkeys(names) if len(names) <= MANY else ():
        plain = unicodedata.normalize("NFKC", ENDING.sub("", name)).translate(LOOK_ALIKE).casefold()
        parted = BETWEEN.sub("_", SIGNS.sub("_", plain)).strip("_")
        groups.setdefault(ZEROS.sub("", parted), []).append(name)
    return [tuple(group) for group in groups.values() if len(group) > 1]


def _worth_comparing(names: list[str], known: list[str]) -> list[str]:
    """Of very many known names those that hold the core of one of the names."""
    if len(known) <= MANY:
        return known
    cores = {max(re.findall(r"[^\W_]+", ZEROS.sub("", stem(name))) or [name], key=len) for name in names}
    holds = re.compile("|".join(re.escape(core) for core in sorted(cores)), re.IGNORECASE)
    return [name for name in known if holds.search(name)]


def _keys(name: str) -> tuple[str, str]:
    """The name freed of what people write in two ways; and with letters read as the digits they look like."""
    plain = unicodedata.normalize("NFKC", stem(name)).translate(LOOK_ALIKE).casefold()
    plain = ZEROS.sub("", SIGNS.sub("", plain))
    return plain, ZEROS.sub("", plain.translate(AS_DIGITS))


def _with_affix(one: str, other: str) -> bool:
    """Whether one of two names is the other with something before or behind it; a number is never a part of one."""
    short, long = sorted((one, other), key=len)
    if not short or short == long:
        return False
    if long.endswith(short) and not (short[0].isdigit() and long[-len(short) - 1].isdigit()):
        return True
    return long.startswith(short) and not (short[-1].isdigit() and long[len(short)].isdigit())


def prefix_of(names: Iterable[str], known: Iterable[str]) -> str | None:
    """What stands before most of the names in one of the two lists alone; None where nothing fits."""
    known, found = list(known), Counter[str]()
    for name in list(names)[:MOST_COMPARED]:
        pairs = (sorted((name, other), key=len) for other in known if len(other) != len(name))
        found.update(
            long[: -len(short)] for short, long in pairs
            if long.endswith(short) and _with_affix(short, long)
        )  # fmt: skip
    return found.most_common(1)[0][0] if found else None


def under_prefix(name: str, prefix: str, measured: Container[str]) -> str:
    """What image points call a control point: its name with the prefix, or without it where that is measured."""
    bare = name.removeprefix(prefix)
    return bare if prefix + name not in measured and bare != name and bare in measured else prefix + name


def in_words(names: Sequence[str], known: Iterable[str], left_over: Sequence[str] = ()) -> str:
    """The names, and behind each those that are near: "'1' (near: 'GCP1'), '7'".

    Parameters
    ----------
    left_over : names that nothing else has met: they come before those that only hold the name, or are held by it.
    """
    near = near_names(names[:SHOWN], known)
    said = []
    for name in names[:SHOWN]:
        meant = near[name]
        if not any(set(_keys(name)) & set(_keys(other)) for other in meant):
            alike = sorted(left_over, key=lambda other: -SequenceMatcher(None, name, other).ratio())
            meant = tuple(dict.fromkeys((*alike, *meant)))
        others = ", ".join(_shown(other, name) for other in meant[:SHOWN_NEAR])
        said.append(f"'{name}'" + (f" (near: {others})" if others else ""))
    more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    return ", ".join(said) + more


def _shown(other: str, name: str) -> str:
    """A near name; characters that only look like those of the other one are said."""
    alike = unicodedata.normalize("NFKC", other).translate(LOOK_ALIKE)
    same = alike == unicodedata.normalize("NFKC", name).translate(LOOK_ALIKE)
    if not same:
        return f"'{other}'"
    odd = next((c for c in other + name if ord(c) > 127), "")
    return f"'{other}', which looks the same but has other characters" + (
        f", {unicodedata.name(odd, 'unnamed').lower()}" if odd else ""
    )


def without_image_points(block: Block) -> np.ndarray:
    """(k,) bool of the block's control and check points, those that no photograph shows."""
    return ~np.isin(block.control.point, block.image_points.point)


def partnerless_in_words(block: Block) -> tuple[str, ...]:
    """Sentences about control and check points that have no image points, and the names that are near."""
    missing = without_image_points(block)
    measured = None
    said = []
    for is_check, what in ((False, "control points"), (True, "check points")):
        own = missing & (block.control.is_check == is_check)
        if not own.any():
            continue
        if measured is None:
            others = np.setdiff1d(block.image_points.point, block.control.point)
            measured = block.points[others].astype(str).tolist()
        names = block.points[block.control.point[own]].astype(str).tolist()
        left_over = _left_over(measured, block.points[block.control.point].astype(str).tolist(), len(names))
        text = f"{len(names)} of {int((block.control.is_check == is_check).sum())} {what} have no image points: "
        text += in_words(names, measured, left_over)
        prefix = prefix_of(names, measured)
        if prefix is not None:
            text += f"; --control-prefix {quoted(prefix)} would make them meet"
        said.append(text)
    return tuple(said)


def _left_over(measured: list[str], controls: list[str], missing: int) -> list[str]:
    """Measured names without coordinates that are built as those of control: as many as are missing at most.

    Names that are numbers alone tell nothing: tie points have such, too.
    """
    forms = {form for name in controls if (form := NUMBER.sub("0", name.casefold())) != "0"}
    found = [name for name in measured if NUMBER.sub("0", name.casefold()) in forms] if forms else []
    return found if len(found) <= missing else []


def quoted(text: str) -> str:
    """A word as the shell takes it."""
    return f'"{text}"' if re.search(r"[^\w.-]", text) or not text else text


def with_control_prefix(block: Block, prefix: str) -> Block:
    """The block with control and check points that no photograph shows renamed to what image points call them.

    Parameters
    ----------
    prefix : stands before their names there, or before their names in the list of control; '' changes nothing.

    Raises
    ------
    InputError
        When no such point has image points under the longer name, or one of them has coordinates already.
    """
    if not prefix:
        return block
    place = {str(name): k for k, name in enumerate(block.points.tolist())}
    measured = set(np.unique(block.image_points.point).tolist())
    names = {str(block.points[k]) for k in measured}
    lonely = block.control.point[without_image_points(block)]
    moved = {int(k): place.get(under_prefix(str(block.points[k]), prefix, names), -1) for k in lonely}
    moved = {old: new for old, new in moved.items() if new in measured}
    if not moved:
        names = block.points[lonely].astype(str).tolist()
        problem = f"none of the {len(names)} control points without image points meets one by it" if names else (
            "all control points have image points under their own names")  # fmt: skip
        near = f": {in_words(names, block.points[sorted(measured)].astype(str).tolist())}" if names else ""
        remedy = "give what stands before the names in the image points, or leave it out"
        raise InputError(f"--control-prefix {quoted(prefix)}: {problem}{near}", remedy)
    twice = np.isin(list(moved.values()), block.control.point)
    if twice.any():
        name = block.points[list(moved.values())[int(np.argmax(twice))]]
        raise InputError(f"--control-prefix {quoted(prefix)}: point '{name}' has coordinates already", "give them once")
    return _renumbered(block, moved)


def _renumbered(block: Block, moved: dict[int, int]) -> Block:
    """The block with points that are others, by index, in all tables; the old names are gone."""
    target = np.arange(len(block.points))
    target[list(moved)] = list(moved.values())
    gone = np.zeros(len(block.points), dtype=bool)
    gone[list(moved)] = True
    number = (np.cumsum(~gone) - 1)[target]
    edits, constraints = block.edits, block.constraints
    return replace(
        block,
        points=block.points[~gone],
        image_points=replace(block.image_points, point=number[block.image_points.point]),
        control=replace(block.control, point=number[block.control.point]),
        edits=None if edits is None else replace(edits, point=number[edits.point]),
        constraints=None if constraints is None else replace(
            constraints, points=tuple(number[members] for members in constraints.points)
        ),
    )  # fmt: skip
