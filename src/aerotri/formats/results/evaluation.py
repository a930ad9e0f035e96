"""The columns of work_list.csv and parameter_effects.csv."""

from __future__ import annotations

import numpy as np

from aerotri.diagnosis.work_items import PRIORITIES
from aerotri.diagnosis.work_list import WorkList
from aerotri.statistics.parameter_effects import ParameterEffects, rms_by_axis


def work_columns(work: WorkList) -> dict[str, np.ndarray]:
    """What to look at, first things first: the items of the report."""
    items = work.items
    texts = {
        "level": [PRIORITIES[item.priority - 1] for item in items],
        "kind": [item.kind for item in items],
        "where": [item.where for item in items],
        "what": [item.what for item in items],
    }
    columns = {name: np.array(values, dtype=object) for name, values in texts.items()}
    columns["times_limit"] = np.array([float(item.severity) for item in items])
    return columns | {"do": np.array([item.hint for item in items], dtype=object)}


def effects_columns(effects: ParameterEffects) -> dict[str, np.ndarray]:
    """RMS of the check points, m, as adjusted and with all, a family or one of the parameters left out."""
    found = effects.left_out
    rms = np.array([rms_by_axis(effects.difference), *(rms_by_axis(one.difference) for one in found)])
    columns: dict[str, np.ndarray] = {
        "left_out": np.array(["nothing", *(one.label for one in found)], dtype=object),
        "group": np.array(["", *(one.group for one in found)], dtype=object),
        "t": np.array([np.nan, *(one.t for one in found)]),
    }
    columns |= {f"rms_{axis}": rms[:, k] for k, axis in enumerate("XYZ")}
    return columns | {"verdict": np.array(["", *(one.verdict for one in found)], dtype=object)}
