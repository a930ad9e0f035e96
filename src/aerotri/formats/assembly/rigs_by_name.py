"""Rigs told by the names of photographs, for lists that have a row a photograph and nothing on rigs.

The lists of orientations of Metashape (multi-camera systems too) and of Pix4D (camera rigs too) are such. A pattern
says where exposure and camera stand in the names: ``IMG_{station}_{camera}.tif``; ``*`` is what does not matter.
"""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np

from aerotri.adjustment.rigging import robust_mean
from aerotri.conventions import InputError, counted
from aerotri.formats.assembly.parts import Reading
from aerotri.formats.text.notes import taken
from aerotri.functional_model.rotation import angles_from_rotation, logarithm, rotation_from_angles
from aerotri.observations import Block, Camera, Mounting, Prior, Rig
from aerotri.observations.names import ENDING, stem
from aerotri.observations.rigs import STATION, StationPlaces, station_fault, station_places

NAME = "rig"
PLACES = {"{station}": "(?P<station>.+)", "{camera}": "(?P<camera>.+?)", "*": ".*?"}
LONGEST = 200
"""Characters of a pattern or a name that are compared [C]."""
OPTION = "--station-pattern"


def names_told(names: np.ndarray, pattern: str) -> tuple[np.ndarray, np.ndarray]:
    """The exposure and the camera of every photograph by its name.

    Parameters
    ----------
    names : (n,) str, compared without ending, and without folders unless the pattern has some.
    pattern : with {station} and {camera}; the station takes as much of a name as it can, the camera as little.

    Returns
    -------
    station, camera : (n,) str, '' where a name is not like the pattern.

    Raises
    ------
    InputError
        For a pattern that is none, or that no name is like.
    """
    form, folders = _compiled(pattern), "/" in pattern
    station, camera = np.full(len(names), "", dtype=object), np.full(len(names), "", dtype=object)
    for row, name in enumerate(names.tolist()):
        bare = ENDING.sub("", name.replace("\\", "/")) if folders else stem(name)
        found = form.fullmatch(bare) if len(bare) <= LONGEST else None
        if found:
            station[row], camera[row] = found["station"], found["camera"]
    if not camera.astype(bool).any():
        example = f", for example '{names[0][:LONGEST]}'" if len(names) else ""
        raise InputError(
            f"{OPTION} {pattern}: no name of a photograph is like it{example}",
            "write it as the names are; folders count where it has a /",
        )
    return station, camera


def _compiled(pattern: str) -> re.Pattern[str]:
    parts = re.split(r"(\{station\}|\{camera\}|\*)", ENDING.sub("", pattern.replace("\\", "/")))
    wrong = any(parts.count(place) != 1 for place in ("{station}", "{camera}")) or parts.count("*") > 1
    if wrong or len(pattern) > LONGEST or any("{" in part or "}" in part for part in parts if part not in PLACES):
        raise InputError(
            f"{OPTION} '{pattern[:LONGEST]}' does not say where station and camera stand in the names",
            "write {station} and {camera} once each, as IMG_{station}_{camera}.tif; * may stand once for anything",
        )
    return re.compile("".join(PLACES.get(part, re.escape(part)) for part in parts), re.DOTALL)


def with_rig(reading: Reading, pattern: str, reference: str = "") -> Reading:
    """The block with its photographs on a rigid rig, its mountings from their orientations where there are some.

    Parameters
    ----------
    pattern : see `names_told`.
    reference : the reference camera, as in the names or as the block calls it; '' for that with most photographs, of
        several the one that looks down most steeply.

    Raises
    ------
    InputError
        For a pattern that does not suit the names, a block that has rigs, or two photographs of a camera at a station.
    """
    block = reading.block
    if block.rigs:
        raise InputError("the block has rigs already", f"leave {OPTION} out, or remove [rig.…] from block.toml")
    station, told = names_told(block.images.names, pattern)
    block, own = _with_cameras(block, told)
    if len(own) < 2:
        raise InputError(f"{OPTION} {pattern}: all photographs are of one camera, '{next(iter(own))}'",
                         "check where {camera} stands in it")  # fmt: skip
    lead = _reference(block, own, reference)
    number = [camera.name for camera in block.cameras].index(own[lead])
    led = set(station[(block.images.camera == number) & station.astype(bool)].tolist())
    alone = np.array([bool(name) and name not in led for name in station], dtype=bool)
    station[alone] = ""
    images = replace(block.images, columns={**block.images.columns, STATION: station})
    rig = Rig(NAME, own[lead], {name: Mounting(known=False) for text, name in own.items() if text != lead})
    fault = station_fault(images, block.cameras, (rig,))
    if fault is not None:
        raise InputError(fault.message, f"let {OPTION} tell them apart, with a folder as {{station}}/… if need be")
    block = replace(block, images=images, rigs=(rig,))
    rig, said = _with_mountings(block, rig)
    about = f"rig '{NAME}': {counted(len(led), 'station')}, cameras {', '.join(own.values())}, reference camera "
    messages = [taken(f"{about}'{rig.reference}'"), *said]
    if alone.any():
        many = counted(int(alone.sum()), "photograph stands", "photographs stand")
        messages.append(f"{many} alone: no photograph of the reference camera at the same station")
    strangers = int((~told.astype(bool)).sum())
    if strangers:
        messages.append(f"{counted(strangers, 'photograph has', 'photographs have')} names that are not like {pattern}")
    return replace(reading, block=replace(block, rigs=(rig,)), messages=(*reading.messages, *messages))


def _with_cameras(block: Block, told: np.ndarray) -> tuple[Block, dict[str, str]]:
    """The block with a camera for every one that names tell, and these by what the names say.

    Cameras that the block does not tell apart begin alike.
    """
    of_text: dict[str, int] = {}
    for row, text in enumerate(told.tolist()):
        number = int(block.images.camera[row])
        if text and of_text.setdefault(text, number) != number:
            first, other = (block.cameras[k].name for k in (of_text[text], number))
            raise InputError(f"photographs of the camera '{text}', by their names, are of the cameras '{first}' and "
                             f"'{other}' of the block", f"correct {OPTION}")  # fmt: skip
    cameras, number_of = list(block.cameras), dict(of_text)
    for number in sorted(set(of_text.values())):
        texts = sorted(text for text, of in of_text.items() if of == number)
        if len(texts) < 2:
            continue
        one = block.cameras[number]
        first, *others = texts
        rest = bool(((told == "") & (block.images.camera == number)).any())
        for text in texts if rest else others:
            number_of[text] = len(cameras)
            cameras.append(_named(one, text))
        if not rest:
            cameras[number] = _named(one, first)
    if len({camera.name for camera in cameras}) < len(cameras):
        raise InputError("two cameras would have the same name", "give the cameras other names")
    camera = np.array(
        [number_of.get(text, int(c)) for text, c in zip(told.tolist(), block.images.camera, strict=True)],
        dtype=np.int64,
    )  # fmt: skip
    block = replace(block, cameras=tuple(cameras), images=replace(block.images, camera=camera))
    return block, {text: cameras[number_of[text]].name for text in sorted(number_of)}


def _named(camera: Camera, text: str) -> Camera:
    return replace(camera, name=f"{camera.name}_{text}")


def _reference(block: Block, own: dict[str, str], wanted: str) -> str:
    """What the names say of the reference camera."""
    if wanted:
        for text, name in own.items():
            if wanted in (text, name):
                return text
        raise InputError(f"there is no camera '{wanted[:LONGEST]}' on the rig", f"there are {', '.join(own)}")
    names = [camera.name for camera in block.cameras]
    down = -rotation_from_angles(np.nan_to_num(block.images.angles), block.rotation)[:, 2, 2]
    known = np.asarray(np.isfinite(block.images.angles).all(axis=1))

    def rank(text: str) -> tuple[int, float]:
        taken = block.images.camera == names.index(own[text])
        return -int(taken.sum()), float(np.median(down[taken & known])) if (taken & known).any() else 0.0

    return min(own, key=rank)


def _with_mountings(block: Block, rig: Rig) -> tuple[Rig, list[str]]:
    """The rig with the robust means of the relative orientations of its photographs, and how they agree."""
    places, said = station_places(block), []
    images = block.images
    known = np.asarray(np.isfinite(np.hstack([images.centre, images.angles])).all(axis=1))
    rotation = rotation_from_angles(np.nan_to_num(images.angles), block.rotation)
    cameras = dict(rig.cameras)
    for k, (_, camera) in enumerate(places.mountings):
        rows = np.flatnonzero((places.mounting == k) & known & known[places.lead])
        if not len(rows):
            continue
        cameras[camera], apart = _mounting(places, rows, images.centre, rotation, block.rotation)
        said.append(f"camera '{camera}' starts from the relative orientations of {counted(len(rows), 'photograph')}: "
                    f"they agree to {np.degrees(apart):.3g}° (median)")  # fmt: skip
    without = [name for name, one in cameras.items() if not one.known]
    if without:
        said.append(f"nothing tells how {', '.join(without)} sit on the rig: give rotation_deg in block.toml")
    return replace(rig, cameras=cameras), said


def _mounting(
    places: StationPlaces, rows: np.ndarray, centre: np.ndarray, rotation: np.ndarray, order: str
) -> tuple[Mounting, float]:
    """Mean position and rotation of photographs in the frames of their reference photographs, and the median angle
    from it."""
    back = np.swapaxes(rotation[places.lead[rows]], 1, 2)
    turns = back @ rotation[rows]
    arms = np.einsum("nij,nj->ni", back, centre[rows] - centre[places.lead[rows]])
    mean = robust_mean(turns)
    apart = np.linalg.norm(logarithm(turns @ mean.T), axis=1)
    x, y, z = (Prior(float(value)) for value in np.median(arms, axis=0))
    a, b, c = (Prior(float(value)) for value in angles_from_rotation(mean, order))
    return Mounting((x, y, z), (a, b, c)), float(np.median(apart))
