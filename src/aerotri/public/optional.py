"""Packages that only some users need."""

from __future__ import annotations

from importlib import import_module
from types import ModuleType

from aerotri.conventions import InputError


def optional_module(name: str, instead: str = "") -> ModuleType:
    """A package that aerotri can do without.

    Parameters
    ----------
    name : of the package. instead : what can be done where it is missing.

    Raises
    ------
    InputError
        When the package is not installed.
    """
    try:
        return import_module(name)
    except ImportError:
        remedy = f"install it: pip install {name}" + (f"; {instead}" if instead else "")
        raise InputError(f"{name} is not installed", remedy) from None
