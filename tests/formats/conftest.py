"""A small block in a folder of its own."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from format_samples import SMALL


@pytest.fixture
def small_block(tmp_path) -> Callable[..., Path]:
    """Writes the small block with some files replaced, or left out where None stands for the content."""

    def write(changes: dict[str, str | bytes | None] | None = None) -> Path:
        folder = tmp_path / "small"
        folder.mkdir(exist_ok=True)
        for name, content in (SMALL | (changes or {})).items():
            if content is None:
                continue
            data = content if isinstance(content, bytes) else content.encode("utf-8")
            (folder / name).write_bytes(data)
        return folder

    return write
