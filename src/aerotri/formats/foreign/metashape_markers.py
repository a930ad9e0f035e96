"""Markers of Metashape with their image points: of a project, or of the XML that it exports beside cameras or alone.

Pixels begin at the corner of the upper left one. Only those image points count that a person has placed or confirmed
(pinned). Markers whose reference is switched off are check points.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from aerotri.conventions import FilePath, InputError, counted
from aerotri.formats.assembly.parts import PointList, RayList, no_sigma, texts
from aerotri.formats.foreign.metashape_chunk import accuracies_of, crs_of, is_on, names_of, number, place_of
from aerotri.formats.foreign.metashape_files import PROJECTS, REMEDY, Project, is_metashape_project, open_project
from aerotri.formats.text.notes import assumed, left_behind


@dataclass(frozen=True, eq=False)
class Rays:
    """Image points.

    Parameters
    ----------
    image, point : (m,) rows. px : (m, 2). sigma : (m,) pixels.
    """

    image: np.ndarray
    point: np.ndarray
    px: np.ndarray
    sigma: np.ndarray


@dataclass(frozen=True, eq=False)
class Markers:
    """Markers of a chunk.

    Parameters
    ----------
    labels : names. xyz, sigma : (n, 3) in the system of the chunk, NaN where unknown. is_check : (n,).
    rays : their image points. messages : what the user should know.
    """

    labels: list[str]
    xyz: np.ndarray
    sigma: np.ndarray
    is_check: np.ndarray
    rays: Rays
    messages: tuple[str, ...] = ()


def markers_of(project: Project, photographs: Mapping[str, int], accuracy: Mapping[str, float]) -> Markers:
    """The markers of a chunk and their image points in these photographs.

    Parameters
    ----------
    photographs : rows by id. accuracy : see `accuracies_of`.

    Raises
    ------
    InputError
    """
    path, elements = project.path, project.chunk.findall("markers//marker")
    names = names_of(elements, "marker", path)
    xyz, sigma = no_sigma(len(names)), no_sigma(len(names))
    is_check = np.zeros(len(names), bool)
    for k, node in enumerate(elements):
        reference = node.find("reference")
        if reference is not None:
            xyz[k], sigma[k] = place_of(reference, accuracy["markers"], path)
            is_check[k] = not is_on(reference, "enabled")
    sigma[np.isnan(xyz)] = np.nan
    labels = list(names.values())
    rays, left = _rays(project, {key: k for k, key in enumerate(names)}, labels, photographs, accuracy["projections"])
    about = f"left out: {counted(left, 'image point')} of markers, not pinned or of photographs switched off"
    return Markers(labels, xyz, sigma, is_check, rays, (left_behind(about),) if left else ())


def _rays(
    project: Project, row: Mapping[str, int], labels: list[str], photographs: Mapping[str, int], sigma_px: float
) -> tuple[Rays, int]:
    """The image points of markers that are pinned, and how many others there are."""
    image, point, px, left = [], [], [], 0
    seen: set[tuple[int, int]] = set()
    for node in project.frame.findall("markers/marker"):
        marker = row.get(node.get("marker_id", ""))
        if marker is None:
            continue
        for place in node.findall("location"):
            photograph = photographs.get(place.get("camera_id", ""))
            if photograph is None or not is_on(place, "pinned", "false") or not is_on(place, "valid"):
                left += 1
            elif (photograph, marker) in seen:
                raise InputError(f"marker '{labels[marker][:60]}' is twice in a photograph", REMEDY, project.path)
            else:
                seen.add((photograph, marker))
                image.append(photograph)
                point.append(marker)
                px.append([number(place.get(key), f"{key} of a marker", project.path) for key in ("x", "y")])
    found = Rays(
        np.array(image, np.int64),
        np.array(point, np.int64),
        np.array(px, float).reshape(-1, 2),
        np.full(len(image), sigma_px),
    )
    return found, left


def is_metashape_markers(path: Path) -> bool:
    """Whether an XML file or project of Metashape may hold markers."""
    return is_metashape_project(path)


def read_metashape_markers(path: FilePath) -> PointList:
    """The markers of an exported XML file, or of a project, as control and check points.

    Raises
    ------
    InputError
        When there are none, or the file is damaged.
    """
    project = open_project(Path(path))
    path, chunk = project.path, project.chunk
    elements = [node for node in chunk.findall("cameras//camera") if is_on(node, "enabled")]
    images = names_of(elements, "photograph", path)
    markers = markers_of(project, {key: k for k, key in enumerate(images)}, accuracies_of(chunk, path))
    if not markers.labels:
        remedy = "export them: File > Export > Export Markers" if path.suffix.lower() not in PROJECTS else REMEDY
        raise InputError("holds no markers", remedy, path)
    crs, known = crs_of(chunk, path), np.asarray(np.isfinite(markers.xyz).any(axis=1))
    return PointList(
        path=path,
        points=texts(markers.labels)[known],
        xyz=markers.xyz[known],
        sigma=markers.sigma[known],
        is_check=markers.is_check[known],
        crs="" if crs == "local" else crs,
        rays=RayList(
            path=path,
            images=texts(list(images.values())),
            cameras=np.full(len(images), ""),
            points=texts(markers.labels),
            image=markers.rays.image,
            point=markers.rays.point,
            xy=markers.rays.px,
            unit="px",
            focal_length_mm=np.full(len(images), np.nan),
        ),
        messages=(*project.messages, *markers.messages, *_about(project, markers, known)),
    )


def _about(project: Project, markers: Markers, known: np.ndarray) -> list[str]:
    said: list[str] = []
    if not known.all():
        words = f"{project.path.name}: {counted(int((~known).sum()), 'marker')} without coordinates: not control points"
        said.append(left_behind(words))
    given = {node.get("name", ""): node.get("value", "") for node in project.chunk.findall("settings/property")}
    references = [node.find("reference") for node in project.chunk.findall("markers//marker")]
    own = ("sx", "sxy", "sxyz")
    alone = sum(
        one is not None and one.get("x") is not None and not any(one.get(key) for key in own) for one in references
    )
    if alone and not given.get("accuracy_markers"):
        accuracy = accuracies_of(project.chunk, project.path)["markers"]
        said.append(assumed(f"{counted(alone, 'marker')} without accuracy: {accuracy:g} m, that of a new project"))
    if given.get("accuracy_projections"):
        words = f"the accuracy of image points of markers, {given['accuracy_projections'][:20]} pixels"
        said.append(left_behind(f"not used: {words}; state it with --image-sigma-px"))
    return said
