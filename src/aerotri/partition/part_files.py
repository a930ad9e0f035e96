"""What parts and joints keep on disk between tasks: systems, states, what was eliminated. Files appear whole."""

from __future__ import annotations

import os
import pickle
import uuid
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from aerotri.adjustment.dense_front import DenseFront
from aerotri.adjustment.partial_factor import Eliminated
from aerotri.adjustment.unknowns import State
from aerotri.partition.common import Left
from aerotri.partition.part_system import PartSystem

SOLUTION, INVERSE = "solution", "inverse"
"""Of a front: the values of all its unknowns; the inverse over them."""


@dataclass(frozen=True)
class WorkFiles:
    """A folder of work.

    Parameters
    ----------
    folder : of its own; not that of observations.
    """

    folder: Path

    def keep_left(self, left: Left, tag: str) -> None:
        """What is left of the equations."""
        self.keep_array(f"matrix_{tag}", left.matrix)
        self._keep(f"left_{tag}", lambda file: np.savez(file, right=left.right, diagonal=left.diagonal))

    def left(self, tag: str) -> Left:
        with np.load(self.folder / f"left_{tag}") as kept:
            return Left(self.array(f"matrix_{tag}"), kept["right"], kept["diagonal"])

    def drop_left(self, tag: str) -> None:
        self.drop(f"matrix_{tag}", f"left_{tag}")

    def keep_object(self, name: str, value: Any) -> None:
        self._keep(name, lambda file: pickle.dump(value, file, pickle.HIGHEST_PROTOCOL))

    def object(self, name: str) -> Any:
        with open(self.folder / name, "rb") as file:
            return pickle.load(file)

    def keep_array(self, name: str, values: np.ndarray) -> None:
        self._keep(name, lambda file: np.save(_Plain(file), values))

    def array(self, name: str) -> np.ndarray:
        return np.load(self.folder / name)

    def drop(self, *names: str) -> None:
        """Remove what nobody needs any more."""
        for name in names:
            (self.folder / name).unlink(missing_ok=True)

    def _keep(self, name: str, write: Callable[[BinaryIO], Any]) -> None:
        self.folder.mkdir(parents=True, exist_ok=True)
        part = self.folder / f"{name}.{uuid.uuid4().hex}.part"
        try:
            with open(part, "wb") as file:
                write(file)
            os.replace(part, self.folder / name)
        finally:
            part.unlink(missing_ok=True)


class _Plain:
    """A file that numpy does not take for one: into a file it writes by itself, and then a full disk has no name."""

    def __init__(self, file: BinaryIO):
        self._file = file

    def write(self, part: bytes) -> int:
        """Write a part of the file."""
        return self._file.write(part)


@dataclass(frozen=True)
class PartFiles(WorkFiles):
    """The folder of a part's work."""

    def keep_system(self, part: PartSystem, positions: int) -> None:
        """The system with its parameters evaluated at the image points of a round."""
        self.keep_object(f"system_{positions}", part)

    def system(self, positions: int) -> PartSystem:
        return self.object(f"system_{positions}")

    def keep_state(self, state: State, number: int) -> None:
        """Where photographs and points stand; shared parameters are kept by who knows all of them."""
        self._keep(
            f"state_{number}",
            lambda file: np.savez(file, centre=state.centre, rotation=state.rotation, points=state.points),
        )

    def state(self, number: int, shared: np.ndarray) -> State:
        with np.load(self.folder / f"state_{number}") as kept:
            return State(kept["centre"], kept["rotation"], kept["points"], shared)

    def keep_eliminated(self, numbers: Eliminated, half: np.ndarray, tag: str) -> None:
        """What leads back from a solution of what is left."""
        self.keep_array(f"panels_{tag}", numbers.panels)
        self._keep(f"half_{tag}", lambda file: np.savez(file, half=half, scale=numbers.scale))

    def eliminated(self, tag: str) -> tuple[Eliminated, np.ndarray]:
        """The numbers of the factor, and L⁻¹ times the right side."""
        panels = np.load(self.folder / f"panels_{tag}", mmap_mode="r")
        with np.load(self.folder / f"half_{tag}") as kept:
            return Eliminated(panels, kept["scale"]), kept["half"]

    def drop_place(self, tag: str) -> None:
        """What belongs to the equations at one place."""
        self.drop_left(tag)
        self.drop(f"half_{tag}", f"panels_{tag}", f"lengths_{tag}")


@dataclass(frozen=True)
class JointFiles(WorkFiles):
    """The folder of a joint's work."""

    def keep_eliminated(self, front: DenseFront, scale: np.ndarray, half: np.ndarray, tag: str) -> None:
        """The factor of the own photographs, and L⁻¹ times their right side."""
        self.keep_array(f"top_{tag}", front.top)
        self.keep_array(f"low_{tag}", front.low)
        self._keep(f"half_{tag}", lambda file: np.savez(file, half=half, scale=scale))

    def eliminated(self, border: int, tag: str) -> tuple[DenseFront, np.ndarray, np.ndarray]:
        """The front without its rest, the scale, L⁻¹ times the right side."""
        with np.load(self.folder / f"half_{tag}") as kept:
            front = DenseFront(self.array(f"top_{tag}"), self.array(f"low_{tag}"), np.zeros((0, 0)), border)
            return front, kept["scale"], kept["half"]

    def keep_inverse(self, front: DenseFront) -> None:
        for part, values in zip(("top", "low", "rest"), (front.top, front.low, front.rest), strict=True):
            self.keep_array(f"{INVERSE}_{part}", values)

    def inverse(self, border: int) -> DenseFront:
        """The inverse over the front."""
        top, low, rest = (self.array(f"{INVERSE}_{part}") for part in ("top", "low", "rest"))
        return DenseFront(top, low, rest, border)

    def drop_inverse(self) -> None:
        self.drop(*(f"{INVERSE}_{part}" for part in ("top", "low", "rest")))

    def drop_place(self, tag: str) -> None:
        """What belongs to the equations at one place."""
        self.drop_left(tag)
        self.drop(f"half_{tag}", f"top_{tag}", f"low_{tag}", f"{SOLUTION}_{tag}")
