"""The logo of `[project]`: a picture in the block folder, read with the block and written with it."""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path, PurePosixPath
from typing import Protocol

from aerotri.conventions import InputError, real_path
from aerotri.formats.block.svg_drawing import fault_of_drawing
from aerotri.observations.project import Project

ENDINGS = {".png": "PNG", ".jpg": "JPEG", ".jpeg": "JPEG", ".svg": "SVG"}
LARGEST = 5 << 20
"""Bytes at most; chosen [C]: the logo is embedded in every report."""
MOST_PIXELS = 50_000_000
KEY = ("project", "logo")
REMEDY = "give the name of a PNG, JPEG or SVG file inside the block folder"


class SettingsFile(Protocol):
    """A TOML file that tells at which line a key stands."""

    @property
    def path(self) -> Path: ...

    def error(self, key: tuple[str, ...], message: str, remedy: str) -> InputError: ...


def with_logo(project: Project, settings: SettingsFile) -> Project:
    """The project with the content of its logo.

    Parameters
    ----------
    settings : of the block, for its folder and the line of the key.

    Raises
    ------
    InputError
        With the line, when the logo lies outside the block folder, is missing, or is no such picture.
    """
    if not project.logo:
        return project

    def refuse(message: str, remedy: str = REMEDY) -> InputError:
        return settings.error(KEY, f"project.logo = '{project.logo}' {message}", remedy)

    path = _inside(settings.path.parent, project.logo, refuse)
    try:
        content = path.read_bytes() if path.stat().st_size <= LARGEST else None
    except OSError as error:
        raise refuse(f"cannot be read: {error.strerror}") from None
    if content is None:
        raise refuse(f"has more than {LARGEST >> 20} MB", "give a smaller picture")
    _check_picture(content, path, refuse)
    return replace(project, logo_content=content)


def _inside(folder: Path, name: str, refuse: Callable[..., InputError]) -> Path:
    """The file, which has to lie in the folder whatever links there are."""
    if _leads_out(name):
        raise refuse("is outside the block folder")
    path = folder / name
    if not real_path(path).is_relative_to(real_path(folder)):
        raise refuse("is outside the block folder")
    if not path.is_file():
        raise refuse("is missing")
    if path.suffix.lower() not in ENDINGS:
        raise refuse("is not a PNG, JPEG or SVG file")
    return path


def _leads_out(name: str) -> bool:
    path = PurePosixPath(name)
    return "\\" in name or ":" in name or path.is_absolute() or ".." in path.parts


def _check_picture(content: bytes, path: Path, refuse: Callable[..., InputError]) -> None:
    """Whether the content is what the ending says."""
    kind = ENDINGS[path.suffix.lower()]
    if kind == "SVG":
        _check_svg(content, path, refuse)
        return
    from PIL import Image

    try:
        with Image.open(io.BytesIO(content), formats=(kind,)) as image:
            if image.width * image.height > MOST_PIXELS:
                raise refuse(f"has {image.width} × {image.height} pixels", "give a smaller picture")
            image.load()
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError):
        raise refuse(f"is no picture in the format {kind}", "save it again, or give another") from None


def _check_svg(content: bytes, path: Path, refuse: Callable[..., InputError]) -> None:
    from aerotri.formats.text.xml_text import xml_of

    try:
        root = xml_of(content, path)
    except InputError as error:
        raise refuse(f"{error.message}", "save it as plain SVG, or as PNG") from None
    if root.tag.rpartition("}")[2] != "svg":
        raise refuse("is no SVG drawing", "save it as plain SVG, or as PNG")
    fault = "names a style sheet" if b"<?xml-stylesheet" in content else fault_of_drawing(root)
    if fault:
        raise refuse(fault, "save it as plain SVG, or as PNG")


def logo_to_write(project: Project) -> dict[str, bytes]:
    """The picture by its name in the block folder; nothing where there is none.

    Raises
    ------
    InputError
        When the name leads out of the folder, or the content is no such picture.
    """
    if _leads_out(project.logo):
        raise InputError(f"project.logo = '{project.logo}' is outside the block folder", REMEDY)
    if project.logo and project.logo_content:

        def refuse(message: str, remedy: str = REMEDY) -> InputError:
            return InputError(f"project.logo = '{project.logo}' {message}", remedy)

        if Path(project.logo).suffix.lower() not in ENDINGS:
            raise refuse("is not a PNG, JPEG or SVG file")
        _check_picture(project.logo_content, Path(project.logo), refuse)
    return {project.logo: project.logo_content} if project.logo and project.logo_content else {}
