"""What a part keeps on disk between tasks: its system, its states, and what it eliminated. Files appear whole."""

from __future__ import annotations

import os
import pickle
import uuid
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from aerotri.adjustment.partial_factor import Eliminated
from aerotri.adjustment.unknowns import State
from aerotri.partition.common import Left
from aerotri.partition.part_system import PartSystem


@dataclass(frozen=True)
class PartFiles:
    """The folder of a part's work.

    Parameters
    ----------
    folder : of its own; not that of its observations.
    """

    folder: Path

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

    def keep_left(self, left: Left, numbers: Eliminated, half: np.ndarray, tag: str) -> None:
        """What is left of the equations, and what leads back from a solution of that."""
        self._keep(f"panels_{tag}", lambda file: np.save(file, numbers.panels))
        self._keep(f"half_{tag}", lambda file: np.savez(file, half=half, scale=numbers.scale))
        self._keep(f"left_{tag}", lambda file: np.savez(file, matrix=left.matrix, right=left.right))

    def left(self, tag: str) -> tuple[np.ndarray, np.ndarray]:
        """Matrix and right side that are left."""
        with np.load(self.folder / f"left_{tag}") as kept:
            return kept["matrix"], kept["right"]

    def eliminated(self, tag: str) -> tuple[Eliminated, np.ndarray]:
        """The numbers of the factor, and L⁻¹ times the right side."""
        panels = np.load(self.folder / f"panels_{tag}", mmap_mode="r")
        with np.load(self.folder / f"half_{tag}") as kept:
            return Eliminated(panels, kept["scale"]), kept["half"]

    def keep_object(self, name: str, value: Any) -> None:
        self._keep(name, lambda file: pickle.dump(value, file, pickle.HIGHEST_PROTOCOL))

    def object(self, name: str) -> Any:
        return pickle.loads((self.folder / name).read_bytes())

    def keep_array(self, name: str, values: np.ndarray) -> None:
        self._keep(name, lambda file: np.save(file, values))

    def array(self, name: str) -> np.ndarray:
        return np.load(self.folder / name)

    def drop(self, *names: str) -> None:
        """Remove what nobody needs any more."""
        for name in names:
            (self.folder / name).unlink(missing_ok=True)

    def drop_left(self, tag: str) -> None:
        self.drop(f"left_{tag}", f"half_{tag}", f"panels_{tag}", f"lengths_{tag}")

    def _keep(self, name: str, write: Callable[[BinaryIO], Any]) -> None:
        self.folder.mkdir(parents=True, exist_ok=True)
        part = self.folder / f"{name}.{uuid.uuid4().hex}.part"
        try:
            with open(part, "wb") as file:
                write(file)
            os.replace(part, self.folder / name)
        finally:
            part.unlink(missing_ok=True)
