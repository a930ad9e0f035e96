"""Bundle block adjustment with self-calibration for aerial photographs, and how sure it is.

>>> import aerotri
>>> block = aerotri.simulate(aerotri.example_flight(), seed=1).block
>>> result = aerotri.adjust(block)
>>> result.status
'converged'
"""

from __future__ import annotations

import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

from aerotri.version import __version__

if TYPE_CHECKING:
    from aerotri import observations as observations
    from aerotri.conventions import InputError as InputError
    from aerotri.execution.work import TasksFailedError as TasksFailedError
    from aerotri.observations import Block as Block
    from aerotri.pipeline import AdjustmentFailedError as AdjustmentFailedError
    from aerotri.public import drawing as drawing
    from aerotri.public import geometry as geometry
    from aerotri.public import parameters as parameters
    from aerotri.public import predict as predict
    from aerotri.public.accuracy import accuracy as accuracy
    from aerotri.public.adjustment import Adjustment as Adjustment
    from aerotri.public.block_check import check as check
    from aerotri.public.block_settings import with_settings as with_settings
    from aerotri.public.blocks import read as read
    from aerotri.public.blocks import read_block as read_block
    from aerotri.public.change import change as change
    from aerotri.public.changes import changes as changes
    from aerotri.public.cloud_change import cloud_change as cloud_change
    from aerotri.public.comparing import compare_parameters as compare_parameters
    from aerotri.public.comparing import crosscheck as crosscheck
    from aerotri.public.converting import convert as convert
    from aerotri.public.covariance import Covariance as Covariance
    from aerotri.public.dem import correct_dem as correct_dem
    from aerotri.public.dense import dense_surface as dense_surface
    from aerotri.public.editing import edit as edit
    from aerotri.public.exporting import export as export
    from aerotri.public.halves import halves as halves
    from aerotri.public.ideal import ideal_photographs as ideal_photographs
    from aerotri.public.image_errors import ImageErrors as ImageErrors
    from aerotri.public.models import deform as deform
    from aerotri.public.ortho import orthophoto as orthophoto
    from aerotri.public.parts import PartsAdjustment as PartsAdjustment
    from aerotri.public.parts import adjust_parts as adjust_parts
    from aerotri.public.parts import convert_parts as convert_parts
    from aerotri.public.parts import divide as divide
    from aerotri.public.parts import simulate_parts as simulate_parts
    from aerotri.public.planning import plan_flight as plan_flight
    from aerotri.public.results import adjust as adjust
    from aerotri.public.results import open_result as open_result
    from aerotri.public.running import run as run
    from aerotri.public.simulating import example_flight as example_flight
    from aerotri.public.simulating import simulate as simulate
    from aerotri.public.surface_comparison import compare as compare
    from aerotri.public.surfaces import Surface as Surface
    from aerotri.public.table import Table as Table
    from aerotri.public.terrain import terrain as terrain
    from aerotri.public.tying import tie_points as tie_points
    from aerotri.public.volume import volume as volume


_PLACES = {
    "Adjustment": "aerotri.public.adjustment",
    "AdjustmentFailedError": "aerotri.pipeline",
    "Block": "aerotri.observations",
    "Covariance": "aerotri.public.covariance",
    "ImageErrors": "aerotri.public.image_errors",
    "InputError": "aerotri.conventions",
    "PartsAdjustment": "aerotri.public.parts",
    "Surface": "aerotri.public.surfaces",
    "Table": "aerotri.public.table",
    "TasksFailedError": "aerotri.execution.work",
    "accuracy": "aerotri.public.accuracy",
    "changes": "aerotri.public.changes",
    "check": "aerotri.public.block_check",
    "change": "aerotri.public.change",
    "cloud_change": "aerotri.public.cloud_change",
    "compare": "aerotri.public.surface_comparison",
    "compare_parameters": "aerotri.public.comparing",
    "correct_dem": "aerotri.public.dem",
    "crosscheck": "aerotri.public.comparing",
    "deform": "aerotri.public.models",
    "dense_surface": "aerotri.public.dense",
    "drawing": "aerotri.public.drawing",
    "edit": "aerotri.public.editing",
    "adjust": "aerotri.public.results",
    "adjust_parts": "aerotri.public.parts",
    "convert_parts": "aerotri.public.parts",
    "divide": "aerotri.public.parts",
    "simulate_parts": "aerotri.public.parts",
    "convert": "aerotri.public.converting",
    "example_flight": "aerotri.public.simulating",
    "export": "aerotri.public.exporting",
    "geometry": "aerotri.public.geometry",
    "halves": "aerotri.public.halves",
    "ideal_photographs": "aerotri.public.ideal",
    "observations": "aerotri.observations",
    "open_result": "aerotri.public.results",
    "orthophoto": "aerotri.public.ortho",
    "parameters": "aerotri.public.parameters",
    "plan_flight": "aerotri.public.planning",
    "predict": "aerotri.public.predict",
    "read": "aerotri.public.blocks",
    "read_block": "aerotri.public.blocks",
    "run": "aerotri.public.running",
    "simulate": "aerotri.public.simulating",
    "terrain": "aerotri.public.terrain",
    "tie_points": "aerotri.public.tying",
    "volume": "aerotri.public.volume",
    "with_settings": "aerotri.public.block_settings",
}
"""Where every public name stands; imported when it is used, so that `import aerotri` is quick."""
_MODULES = ("drawing", "geometry", "observations", "parameters", "predict")
"""Names that are whole modules."""

__all__ = [
    "Adjustment",
    "AdjustmentFailedError",
    "Block",
    "Covariance",
    "ImageErrors",
    "InputError",
    "PartsAdjustment",
    "Surface",
    "Table",
    "TasksFailedError",
    "__version__",
    "accuracy",
    "adjust",
    "adjust_parts",
    "change",
    "changes",
    "check",
    "cloud_change",
    "compare",
    "compare_parameters",
    "convert",
    "convert_parts",
    "correct_dem",
    "crosscheck",
    "deform",
    "dense_surface",
    "divide",
    "drawing",
    "edit",
    "example_flight",
    "export",
    "geometry",
    "halves",
    "ideal_photographs",
    "observations",
    "open_result",
    "orthophoto",
    "parameters",
    "plan_flight",
    "predict",
    "read",
    "read_block",
    "run",
    "simulate",
    "simulate_parts",
    "terrain",
    "tie_points",
    "volume",
    "with_settings",
]


class _Package(ModuleType):
    """Some functions have the name of the package below that does their work: the import of it leaves them alone."""

    def __setattr__(self, name: str, value: Any) -> None:
        if name not in _PLACES or not isinstance(value, ModuleType) or name in _MODULES:
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package


def __getattr__(name: str) -> Any:
    if name not in _PLACES:
        raise AttributeError(f"module 'aerotri' has no attribute '{name}'")
    module = import_module(_PLACES[name])
    value = module if name in _MODULES else getattr(module, name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return __all__
