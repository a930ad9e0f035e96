"""The process that plans a flight for the bench: progress as lines of JSON, the plan in a folder."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from aerotri.conventions import InputError


def work(request: dict[str, Any], out: Path) -> int:
    """Exit code: 0 with a plan, 1 without one.

    Parameters
    ----------
    request : arguments of `plan_flight`. out : folder of the plan.
    """
    from aerotri.public.planning import plan_flight

    pairs = ("positions_sigma", "control_sigma")
    area = request.pop("area", "")
    given: dict[str, Any] = {
        name: tuple(value) if name in pairs and value is not None else value for name, value in request.items()
    }
    try:
        plan_flight(area, **given, progress=_say).save(out)
    except InputError as error:
        _print({"error": str(error)})
        return 1
    except TypeError as error:
        _print({"error": f"{error}: the plan is of another version of aerotri; run aerotri plan again"})
        return 1
    return 0


def _say(stage: str) -> None:
    _print({"stage": stage, "share": None})


def _print(content: dict[str, Any]) -> None:
    print(json.dumps(content), flush=True)


if __name__ == "__main__":
    raise SystemExit(work(json.loads(sys.argv[1]), Path(sys.argv[2])))
