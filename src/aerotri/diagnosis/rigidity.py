"""Whether cameras keep their places on a rig, in words."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from aerotri.diagnosis.finding import Finding
from aerotri.results.adjusted_block import AdjustedBlock
from aerotri.results.rigidity import POSITION, ROTATION, HeadTest, Rigidity
from aerotri.results.rigs import RigMovements

ARC_SECONDS = 3600.0 * 180.0 / np.pi
APART = 1.5
"""Movement of a camera over the next largest from which the others are taken to follow from it [C]."""
SETTING = 'constraint = "weighted"'


@dataclass(frozen=True)
class CameraVerdict:
    """A camera of a rig: whether it keeps its place, and a sentence about it."""

    rig: str
    camera: str
    keeps: bool
    says: str


def camera_verdicts(tests: Rigidity) -> tuple[CameraVerdict, ...]:
    """One a camera that was tested; where cameras of a rig move, the one that moves most clearly first."""
    names = dict.fromkeys((one.rig, one.camera) for one in tests.heads)
    said = [_verdict(tests, rig, camera) for rig, camera in names]
    return tuple(sorted(said, key=lambda one: (one.rig, one.keeps or one.camera != _clearest(tests, one.rig))))


def rigidity_in_words(tests: Rigidity | None) -> tuple[str, ...]:
    """Sentences about the cameras that move, and about single photographs of those that do not."""
    if tests is None:
        return ()
    said = []
    for one in camera_verdicts(tests):
        single = _single_photographs(tests, one.rig, one.camera)
        if not one.keeps:
            said.append(one.says)
        elif single:
            said.append(f"camera {one.camera} of the rig {one.rig}: {single[0]} (rig_stations.csv)")
    return tuple(said) or _whole_stations(tests)


def _whole_stations(tests: Rigidity) -> tuple[str, ...]:
    """A sentence on exposures that do not fit their rig, where neither a camera nor a photograph is to blame alone."""
    rows = np.flatnonzero(tests.whole.found).tolist()
    if not rows:
        return ()
    worst = min(rows, key=lambda k: float(tests.whole.p[k]))
    many = f"{len(rows)} exposures do" if len(rows) > 1 else "1 exposure does"
    name = f"{tests.whole.station[worst]} of the rig {tests.whole.rig[worst]}"
    return (f"{many} not fit the rig, least of all {name}; no single photograph stands out (rig_stations.csv)",)


def movements_in_words(movements: RigMovements) -> tuple[str, ...]:
    """A sentence a camera of a weighted rig whose movements were estimated."""
    said = []
    for k in range(len(movements.camera)):
        if movements.estimated is None or not movements.estimated[k].any():
            continue
        position, rotation = (
            _size(text, movements.sigma[k, what], movements.sigma_sigma[k, what])
            for what, text in ((0, length_text), (1, angle_text))
        )
        parts = [part for part, own in ((f"turns by {rotation}", 1), (f"shifts by {position}", 0))
                 if movements.estimated[k, own]]  # fmt: skip
        name = f"camera {movements.camera[k]} of the rig {movements.rig[k]}"
        said.append(f"{name} {' and '.join(parts)} between exposures (estimated)")
    return tuple(said)


def _size(text: Callable[[float], str], sigma: float, own_sigma: float) -> str:
    if sigma <= 0.0:
        return "nothing that image points notice"
    return f"σ {text(sigma)} ± {text(own_sigma)}"


def of_rigs(adjusted: AdjustedBlock) -> list[Finding]:
    """A light a rig."""
    tests = adjusted.rigidity
    if tests is None or not tests.heads:
        return []
    out, verdicts = [], camera_verdicts(tests)
    for rig in dict.fromkeys(one.rig for one in verdicts):
        own = [one for one in verdicts if one.rig == rig]
        moving = [one.camera for one in own if not one.keeps]
        detectable = [tests.head(rig, one.camera).movement_detectable for one in own]
        known = [value for value in detectable if np.isfinite(value)]
        expected = f"found from σ {angle_text(max(known))} on" if known else "no movement"
        if not moving:
            out.append(Finding(f"rig {rig}", "all cameras keep their places", expected, "the rig is rigid", "good"))
            continue
        says = "; ".join(one.says for one in own if not one.keeps)
        value = f"{', '.join(moving)} {'move' if len(moving) > 1 else 'moves'}"
        out.append(Finding(f"rig {rig}", value, expected, says, "attention"))
    return out


def _verdict(tests: Rigidity, rig: str, camera: str) -> CameraVerdict:
    rotation, position = (tests.head(rig, camera, what) for what in (ROTATION, POSITION))
    moves = [text for text in (_movement(rotation, tests), _movement(position, tests)) if text]
    drifts = [text for text in (_drift(rotation), _drift(position)) if text]
    if not moves and not drifts:
        found = rotation.movement_detectable
        rest = f"movements of σ {angle_text(found)} would be found (power {100.0 * tests.power:.0f} %)"
        if not np.isfinite(found):
            rest = "the block is too small to find movements"
        return CameraVerdict(rig, camera, True, f"camera {camera} keeps its place on the rig {rig}: {rest}")
    clearest, alike = _clearest(tests, rig), _all_move_alike(tests, rig)
    advice = f". {SETTING} tells which cameras move" if moves else ""
    if moves and clearest != camera and not alike:
        text = (
            f"camera {camera} seems to move on the rig {rig} as well: {moves[0]}. This may come from camera {clearest}"
        )
        return CameraVerdict(rig, camera, False, f"{text}, whose movement is clearer{advice}")
    said = "; ".join([*moves, *drifts, *_single_photographs(tests, rig, camera)])
    other = "; all cameras of the rig seem to move: image errors that are not modelled look the same"
    text = f"camera {camera} does not keep its place on the rig {rig}: {said}{other if moves and alike else ''}{advice}"
    return CameraVerdict(rig, camera, False, text)


def _clearest(tests: Rigidity, rig: str) -> str:
    """The camera whose movement is least likely by chance: where one moves, others seem to."""
    return min((one for one in tests.heads if one.rig == rig), key=lambda one: one.movement_p).camera


def _all_move_alike(tests: Rigidity, rig: str) -> bool:
    """Whether all cameras turn, none of them much more in the image than the next."""
    heads = [one for one in tests.heads if one.rig == rig and one.what == ROTATION]
    sizes = sorted(one.movement * tests.focal_mm.get(one.camera, np.nan) for one in heads)
    return all(one.movement_found for one in heads) and (len(sizes) < 2 or sizes[-1] < APART * sizes[-2])


def _movement(one: HeadTest, tests: Rigidity) -> str:
    if not one.movement_found:
        return ""
    p = probability_text(one.movement_p)
    if one.what == POSITION:
        return f"its position moves by σ {length_text(one.movement)} between exposures ({p} by chance)"
    micron = 1e3 * tests.focal_mm.get(one.camera, np.nan) * one.movement
    size = f"σ {angle_text(one.movement)} ± {angle_text(one.movement_sigma)}"
    return f"it turns by {size} between exposures, {micron:.2g} µm in the image ({p} by chance)"


def _drift(one: HeadTest) -> str:
    if not one.drift_found:
        return ""
    worst = int(np.argmax(np.abs(one.drift / one.drift_sigma)))
    text = angle_text if one.what == ROTATION else length_text
    verb = f"about {'xyz'[worst]}" if one.what == ROTATION else f"along {'xyz'[worst]}"
    size = f"{text(one.drift[worst])} ± {text(one.drift_sigma[worst])}"
    how = "turns" if one.what == ROTATION else "shifts"
    p = probability_text(one.drift_p)
    return f"it {how} by {size} {verb} from the first to the last exposure ({p} by chance)"


def _single_photographs(tests: Rigidity, rig: str, camera: str) -> list[str]:
    """The photographs of a camera that are out of their places, in one sentence; none where there are none."""
    s = tests.stations
    rows = np.flatnonzero(s.found & (s.rig == rig) & (s.camera == camera)).tolist()
    if not rows:
        return []
    worst = min(rows, key=lambda k: float(s.p[k]))
    turn = float(np.linalg.norm(s.turned[worst]))
    turned = f", turned by {angle_text(turn)}" if np.isfinite(turn) else ""
    many = f"{len(rows)} photographs are" if len(rows) > 1 else "1 photograph is"
    return [f"{many} out of place, most of all at station {s.station[worst]}{turned}"]


def angle_text(angle: float) -> str:
    """In seconds of arc below a minute and a half, else in degrees."""
    seconds = angle * ARC_SECONDS
    return f"{seconds:.2g}″" if abs(seconds) < 90.0 else f"{seconds / 3600.0:.2g}°"


def length_text(length: float) -> str:
    """In millimetres below 10 cm, else in metres."""
    return f"{1e3 * length:.2g} mm" if abs(length) < 0.1 else f"{length:.2g} m"


def probability_text(p: float) -> str:
    """In percent."""
    return f"{100.0 * p:.2g} %" if p >= 1e-5 else "less than 0.001 %"
