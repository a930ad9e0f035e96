"""An OPF project as its specification has it, projected by the formulas of Pix4D's knowledge base."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from aerotri.functional_model.rotation import rotation_from_angles
from formats.foreign.metashape_sample import ANGLES, CENTRES, Sample

SIZE, FOCAL, CENTRE = (4000, 3000), 2400.5, (2011.75, 1491.0)
R, T = (-0.05, 0.01, -0.002), (1e-3, -2e-3)
AFFINE, POLYNOMIAL = 2200.0, (0.0, 1.0, 0.02, -0.16)
EAST, NORTH, HEIGHT = 514_000.0, 5_394_000.0, 350.0
"""Of the origin of the sample in UTM; its axes are those of the grid."""
SHIFT = (-514_050.0, -5_394_020.0, -300.0)
BIG = (1 << 63) + 5
"""Identifiers have 64 bits."""


def pixels(direction: np.ndarray, kind: str) -> np.ndarray:
    """(n, 2) from the corner, of directions in x right, y down, z forwards."""
    u, v = (direction[:, :2] / direction[:, 2:]).T
    if kind == "fisheye":
        across = np.hypot(u, v)
        t = np.arctan(across) * 2.0 / np.pi
        rho = sum(p * t**k for k, p in enumerate(POLYNOMIAL))
        return np.column_stack([AFFINE * rho * u / across + CENTRE[0], AFFINE * rho * v / across + CENTRE[1]])
    r2 = u * u + v * v
    radial = 1 + R[0] * r2 + R[1] * r2**2 + R[2] * r2**3
    a = radial * u + 2 * T[0] * u * v + T[1] * (r2 + 2 * u * u)
    b = radial * v + 2 * T[1] * u * v + T[0] * (r2 + 2 * v * v)
    return np.column_stack([FOCAL * a + CENTRE[0], FOCAL * b + CENTRE[1]])


class OpfProject:
    """The truth, and its files.

    Parameters
    ----------
    crs : of the scene, east or north first. projected : whether places are there in the processing system as well.
    """

    def __init__(self, crs: str = "EPSG:25832", projected: bool = True, kind: str = "perspective"):
        self.crs, self.projected, self.kind = crs, projected, kind
        self.points, self.centre, self.rotation = Sample().points, CENTRES, rotation_from_angles(ANGLES)
        down = np.diag([1.0, -1.0, -1.0])
        self.px = np.array(
            [pixels((self.points - c) @ r @ down, kind) for c, r in zip(self.centre, self.rotation, strict=True)]
        )
        self.seen = ((self.px > 0) & (self.px < SIZE)).all(axis=2)

    @staticmethod
    def utm(xyz: np.ndarray) -> np.ndarray:
        return xyz + [EAST, NORTH, HEIGHT]

    def processing(self, xyz: np.ndarray) -> np.ndarray:
        return self.utm(xyz) + SHIFT

    def geolocation(self, xyz: np.ndarray, sigmas: list[float]) -> dict:
        """Latitude and longitude, as EPSG:4258 has them."""
        from pyproj import Transformer

        x, y, z = self.utm(xyz).tolist()
        lat, lon = Transformer.from_crs("EPSG:25832", "EPSG:4258").transform(x, y)
        return {"crs": {"definition": "EPSG:4258"}, "coordinates": [lat, lon, z], "sigmas": sigmas}

    def ids(self, k: int) -> int:
        return BIG + k

    def cameras(self) -> tuple[dict, dict, dict, dict]:
        """camera list, input, calibrated and projected cameras."""
        listed = [{"id": self.ids(k), "uri": f"../photos/DJI_{k}.JPG"} for k in range(6)]
        internals = {"type": self.kind, "principal_point_px": list(CENTRE)}
        if self.kind == "perspective":
            internals |= {"focal_length_px": FOCAL, "radial_distortion": list(R), "tangential_distortion": list(T)}
        else:
            affine = {"affine": [AFFINE, 0.0, 0.0, AFFINE], "is_symmetric_affine": True, "is_p0_zero": True}
            internals |= affine | {"polynomial": list(POLYNOMIAL)}
        sensor = {"id": 77, "name": "DJI_FC6310", "image_size_px": list(SIZE), "pixel_size_um": 4.0, "bands": [],
                  "internals": internals, "shutter_type": "global"}  # fmt: skip
        captures = [
            {
                "id": 500 + k, "reference_camera_id": self.ids(k), "rig_model_source": "not_applicable",
                "cameras": [{"id": self.ids(k), "sensor_id": 77}], "time": "2020-01-01T00:00:00Z",
                "geolocation": self.geolocation(self.centre[k] + 0.01, [0.02, 0.02, 0.03]),
                "orientation": {"type": "yaw_pitch_roll", "angles_deg": [0, 0, 0], "sigmas_deg": [5, 5, 5]},
            }
            for k in range(6)
        ]  # fmt: skip
        calibrated = [
            {
                "id": self.ids(k), "sensor_id": 77, "position": self.processing(self.centre[k]).tolist(),
                "orientation_deg": np.degrees(ANGLES[k]).tolist(),
            }
            for k in range(6)
        ]  # fmt: skip
        places = [
            {"id": 500 + k, "geolocation": {"coordinates": self.processing(self.centre[k] + 0.01).tolist(),
                                            "sigmas": [0.02, 0.02, 0.03]}} for k in range(6)
        ]  # fmt: skip
        return (
            {"cameras": listed},
            {"sensors": [sensor], "captures": captures},
            {"sensors": [{"id": 77, "internals": internals}], "cameras": calibrated},
            {"sensors": [], "captures": places},
        )

    def control(self) -> tuple[dict, dict]:
        """The last five points as control points, of which the last is a check point; in degrees and as projected."""
        gcps, places = [], []
        for k in range(55, 60):
            marks = [
                {"camera_id": self.ids(i), "position_px": self.px[i, k].tolist(), "accuracy": 1.0}
                for i in np.flatnonzero(self.seen[:, k]).tolist()
            ]
            place = self.geolocation(self.points[k], [0.01, 0.02, 0.04])
            gcps.append({"id": f"gcp {k - 55}", "geolocation": place, "marks": marks, "is_checkpoint": k == 59})
            coordinates = self.processing(self.points[k]).tolist()
            places.append({"id": f"gcp {k - 55}", "coordinates": coordinates, "sigmas": [0.02, 0.01, 0.04]})
        return {"gcps": gcps, "mtps": []}, {"projected_gcps": places}

    def tracks(self) -> dict[str, bytes]:
        """glTF and its arrays: the first 55 points, in axes with y up."""
        place = self.processing(self.points[:55]).astype("<f4")
        counts = self.seen[:, :55].sum(axis=0)
        first = np.cumsum(counts) - counts
        packed = first.astype("<u8") | (counts.astype("<u8") << np.uint64(40))
        point, image = np.nonzero(self.seen[:, :55].T)
        data = {
            "positions.bin": place.tobytes(), "ranges.bin": packed.tobytes(),
            "cameras.bin": image.astype("<u4").tobytes(), "pixels.bin": self.px[image, point].astype("<f4").tobytes(),
        }  # fmt: skip
        forms = [("VEC3", 5126, 55), ("VEC2", 5125, 55), ("SCALAR", 5125, len(image)), ("VEC2", 5126, len(image))]
        matches = {
            "cameraIds": 2, "cameraUids": [self.ids(k) for k in range(6)], "pointIndexRanges": 1,
            "imagePoints": {"pixelCoordinates": 3},
        }  # fmt: skip
        primitive = {"attributes": {"POSITION": 0}, "mode": 0, "extensions": {"OPF_mesh_primitive_matches": matches}}
        keys = ("type", "componentType", "count")
        gltf = {
            "accessors": [dict(zip(keys, form, strict=True)) | {"bufferView": k} for k, form in enumerate(forms)],
            "bufferViews": [{"buffer": k, "byteLength": len(raw)} for k, raw in enumerate(data.values())],
            "buffers": [{"uri": name, "byteLength": len(raw)} for name, raw in data.items()],
            "meshes": [{"primitives": [primitive]}], "scene": 0, "scenes": [{"nodes": [0]}],
            "nodes": [{"matrix": [1, 0, 0, 0, 0, 0, -1, 0, 0, 1, 0, 0, 0, 0, 0, 1], "mesh": 0}],
        }  # fmt: skip
        return {"tracks.gltf": json.dumps(gltf).encode()} | data

    def files(self) -> dict[str, bytes]:
        """Content by name."""
        listed, inputs, calibrated, places = self.cameras()
        control, projected = self.control()
        frame = {
            "crs": {"definition": self.crs},
            "base_to_canonical": {"scale": [1, 1, 1], "shift": list(SHIFT), "swap_xy": self.crs != "EPSG:25832"},
        }
        parts = {
            "camera-list": ("camera_list", listed), "input-cameras": ("input_cameras", inputs),
            "calibrated-cameras": ("calibration", calibrated),
            "scene-reference-frame": ("scene_reference_frame", frame),
            "input-control-points": ("input_control_points", control),
        }  # fmt: skip
        if self.projected:
            parts["projected-input-cameras"] = ("projected_input_cameras", places)
            parts["projected-control-points"] = ("projected_control_points", projected)
        files, items = {}, []
        for name, (kind, content) in parts.items():
            format_ = f"application/opf-{name}+json"
            files[f"{name}.json"] = json.dumps({"format": format_, "version": "1.0"} | content).encode()
            resources = [{"uri": f"{name}.json", "format": format_}]
            if kind == "calibration":
                resources.append({"uri": "tracks/tracks.gltf", "format": "model/gltf+json"})
            items.append({"id": name, "type": kind, "resources": resources, "sources": []})
        files |= {f"tracks/{name}": raw for name, raw in self.tracks().items()}
        project = {"format": "application/opf-project+json", "version": "1.0", "name": "site", "items": items}
        return files | {"project.opf": json.dumps(project).encode()}

    def write(self, folder: Path) -> Path:
        for name, raw in self.files().items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_bytes(raw)
        return folder / "project.opf"
