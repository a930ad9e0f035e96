"""A small project as Metashape saves it: a perspective and a fisheye sensor, markers, tie points, positions.

Image points are computed by the formulas of Metashape's manual, coordinates by the definition of earth-centred ones.
"""

from __future__ import annotations

import io
import zipfile
from pathlib import Path

import numpy as np

from aerotri.functional_model.rotation import rotation_from_angles

LON, LAT, HEIGHT = 9.2, 48.7, 350.0
A, F = 6378137.0, 1.0 / 298.257222101
CALIBRATIONS = {
    "frame": {"f": 2400.5, "cx": 12.5, "cy": -7.25, "b1": 1.5, "b2": -0.75, "k1": -0.05, "k2": 0.01, "k3": -0.002,
              "k4": 5e-4, "p1": 1e-3, "p2": -2e-3},
    "fisheye": {"f": 1500.0, "cx": -3.0, "cy": 4.0, "k1": 0.02, "k2": -0.003},
}  # fmt: skip
SIZE = 4000, 3000
CENTRES = np.array([[0, 0, 100.0], [40, 0, 101], [80, 2, 99], [40, 40, 100], [0, 40, 102], [80, 41, 100]], dtype=float)
ANGLES = np.radians([[1, -2, 5.0], [-1, 0.5, 3], [0.7, 1.2, -4], [2.1, -0.4, -176], [0.3, 0.2, 180], [-1, 1, 175]])
UTM_WKT = (
    'PROJCS["ETRS89 / UTM zone 32N",GEOGCS["ETRS89",DATUM["European Terrestrial Reference System 1989",'
    'SPHEROID["GRS 1980",6378137,298.257222101,AUTHORITY["EPSG","7019"]],TOWGS84[0,0,0,0,0,0,0],'
    'AUTHORITY["EPSG","6258"]],PRIMEM["Greenwich",0],UNIT["degree",0.0174532925199433],AUTHORITY["EPSG","4258"]],'
    'PROJECTION["Transverse_Mercator"],PARAMETER["latitude_of_origin",0],PARAMETER["central_meridian",9],'
    'PARAMETER["scale_factor",0.9996],PARAMETER["false_easting",500000],UNIT["metre",1],AUTHORITY["EPSG","25832"]]'
)
DEGREES_WKT = (
    'GEOGCS["ETRS89",DATUM["European Terrestrial Reference System 1989",SPHEROID["GRS 1980",6378137,298.257222101]],'
    'PRIMEM["Greenwich",0],UNIT["degree",0.0174532925199433],AUTHORITY["EPSG","4258"]]'
)


def earth_centred(enu: np.ndarray) -> np.ndarray:
    """East, north, up at the origin as earth-centred coordinates."""
    turn, middle = axes()
    return enu @ turn.T + middle


def axes() -> tuple[np.ndarray, np.ndarray]:
    lon, lat = np.radians([LON, LAT])
    e2 = F * (2 - F)
    n = A / np.sqrt(1 - e2 * np.sin(lat) ** 2)
    middle = np.array([
        (n + HEIGHT) * np.cos(lat) * np.cos(lon), (n + HEIGHT) * np.cos(lat) * np.sin(lon),
        (n * (1 - e2) + HEIGHT) * np.sin(lat),
    ])  # fmt: skip
    east = [-np.sin(lon), np.cos(lon), 0.0]
    north = [-np.sin(lat) * np.cos(lon), -np.sin(lat) * np.sin(lon), np.cos(lat)]
    up = [np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)]
    return np.column_stack([east, north, up]), middle


def pixels(kind: str, direction: np.ndarray) -> np.ndarray:
    """(n, 2) of directions (n, 3) in a camera with x right, y down, z forwards."""
    own = {key: CALIBRATIONS[kind].get(key, 0.0) for key in CALIBRATIONS["frame"]}
    x, y = (direction[:, :2] / direction[:, 2:]).T
    if kind == "fisheye":
        r0 = np.hypot(x, y)
        x, y = x * np.arctan(r0) / r0, y * np.arctan(r0) / r0
    r2 = x * x + y * y
    radial = 1 + own["k1"] * r2 + own["k2"] * r2**2 + own["k3"] * r2**3 + own["k4"] * r2**4
    a = x * radial + own["p1"] * (r2 + 2 * x * x) + 2 * own["p2"] * x * y
    b = y * radial + own["p2"] * (r2 + 2 * y * y) + 2 * own["p1"] * x * y
    u = SIZE[0] / 2 + own["cx"] + a * own["f"] + a * own["b1"] + b * own["b2"]
    return np.column_stack([u, SIZE[1] / 2 + own["cy"] + b * own["f"]])


class Sample:
    """A project: what it holds in truth, and its files.

    Parameters
    ----------
    system : 'utm', 'degrees' or 'local'.
    """

    def __init__(self, system: str = "utm", rig: bool = False):
        rng = np.random.default_rng(3)
        self.system, self.rig = system, rig
        self.points = np.column_stack([rng.uniform(-30, 110, 60), rng.uniform(-30, 70, 60), rng.uniform(-3, 3, 60)])
        # the last five are markers
        self.kinds = ["frame", "frame", "frame", "fisheye", "fisheye", "fisheye"]
        self.rotation, self.centre = rotation_from_angles(ANGLES), CENTRES
        down = np.diag([1.0, -1.0, -1.0])
        self.px = np.array(
            [
                pixels(kind, (self.points - c) @ r @ down)
                for kind, c, r in zip(self.kinds, self.centre, self.rotation, strict=True)
            ]
        )
        self.seen = ((self.px > 0) & (self.px < SIZE)).all(axis=2)
        # the chunk's own axes: turned, moved and a hundred times smaller
        self.turn, self.scale = rotation_from_angles(np.array([[0.3, -0.5, 1.0]]))[0], 100.0
        to_world, middle = axes() if system != "local" else (np.eye(3), np.array([1000.0, 2000.0, 0.0]))
        self.world = to_world @ self.turn
        self.shift = to_world @ np.array([20.0, 10.0, 5.0]) + middle

    def in_chunk(self, enu: np.ndarray) -> np.ndarray:
        return (enu - [20.0, 10.0, 5.0]) @ self.turn / self.scale

    def in_system(self, enu: np.ndarray) -> np.ndarray:
        """(n, 3) as references state it."""
        if self.system == "local":
            return enu + [1000.0, 2000.0, 0.0]
        from pyproj import Transformer

        target = "EPSG:25832" if self.system == "utm" else "EPSG:4258"
        cart = Transformer.from_pipeline("+proj=pipeline +step +inv +proj=cart +ellps=GRS80 +step +proj=unitconvert "
                                         "+xy_in=rad +xy_out=deg")  # fmt: skip
        lon, lat, height = cart.transform(*earth_centred(enu).T)
        if self.system == "degrees":
            return np.column_stack([lon, lat, height])
        x, y = Transformer.from_crs("EPSG:4258", target, always_xy=True).transform(lon, lat)
        return np.column_stack([x, y, height])

    def chunk(self, inline: bool) -> str:
        down = np.diag([1.0, -1.0, -1.0])
        lines = ['<sensors next_id="2">']
        for key, kind in enumerate(("frame", "fisheye")):
            values = "".join(f"<{name}>{value}</{name}>" for name, value in CALIBRATIONS[kind].items())
            master = ' master_id="0"' if self.rig and key else ""
            lines.append(
                f'<sensor id="{key}" label="camera" type="{kind}"{master}><resolution width="4000" height="3000"/>'
                '<property name="pixel_width" value="0.004"/><property name="fixed_params" value="k4"/>'
                f'<calibration type="{kind}" class="initial"><f>1</f></calibration>'
                f'<calibration type="{kind}" class="adjusted">{values}</calibration></sensor>'
            )
        lines.append('</sensors><cameras next_id="7"><group id="0" label="all">')
        seen_from = self.in_system(self.centre + 0.01)
        for key in range(6):
            pose = np.eye(4)
            pose[:3, :3] = self.turn.T @ self.rotation[key] @ down
            pose[:3, 3] = self.in_chunk(self.centre)[key]
            words = " ".join(repr(value) for value in pose.ravel().tolist())
            x, y, z = (repr(value) for value in seen_from[key].tolist())
            master = f' master_id="{10 + key - 3}"' if self.rig and key > 2 else ""
            lines.append(
                f'<camera id="{10 + key}" sensor_id="{int(key > 2)}" label="DJI_{key}.JPG"{master}>'
                f'<transform>{words}</transform><reference x="{x}" y="{y}" z="{z}" sxy="0.02" sz="0.03" enabled="1"/>'
                "</camera>"
            )
        lines.append('<camera id="99" sensor_id="0" label="off.JPG" enabled="false"/></group></cameras><markers>')
        for key, xyz in enumerate(self.in_system(self.points[-5:]).tolist()):
            x, y, z = (repr(value) for value in xyz)
            sigma = 'sx="0.01" sy="0.02" sz="0.04"' if key else ""
            enabled = "false" if key == 4 else "true"
            lines.append(
                f'<marker id="{key}" label="gcp {key}"><reference x="{x}" y="{y}" z="{z}" {sigma} '
                f'enabled="{enabled}"/></marker>'
            )
        lines.append("</markers>")
        lines.append(f'<frames next_id="1">{self.frame(True) if inline else FRAME}</frames>')
        wkt = {"utm": UTM_WKT, "degrees": DEGREES_WKT, "local": 'LOCAL_CS["Local Coordinates (m)"]'}[self.system]
        lines.append(f"<reference>{wkt.replace(chr(34), '&quot;')}</reference>")
        rotation = " ".join(repr(value) for value in self.world.ravel().tolist())
        shift = " ".join(repr(value) for value in self.shift.tolist())
        lines.append(
            f"<transform><rotation>{rotation}</rotation><translation>{shift}</translation>"
            f"<scale>{self.scale}</scale></transform>"
        )
        lines.append(
            '<settings><property name="accuracy_tiepoints" value="0.5"/>'
            '<property name="accuracy_markers" value="0.03"/>'
            '<property name="accuracy_projections" value="0.25"/></settings>'
        )
        return "\n".join(lines)

    def frame(self, with_points: bool) -> str:
        lines = ['<frame id="0"><markers>']
        for key in range(5):
            lines.append(f'<marker marker_id="{key}">')
            for camera in range(6):
                x, y = self.px[camera, 55 + key].tolist()
                if self.seen[camera, 55 + key]:
                    pinned = 'pinned="true"' if camera != 1 else ""
                    lines.append(f'<location camera_id="{10 + camera}" {pinned} x="{x!r}" y="{y!r}"/>')
            lines.append("</marker>")
        lines.append("</markers>")
        if with_points:
            lines.append(f"<point_cloud>{self.cloud()}</point_cloud>")
        else:
            lines.append('<tie_points path="point_cloud/point_cloud.zip"/>')
        return "\n".join([*lines, "</frame>"])

    def cloud(self) -> str:
        parts = "".join(f'<projections camera_id="{10 + k}" path="p{k}.ply"/>' for k in range(6))
        return f'<tracks path="tracks.ply"/><points path="points0.ply"/>{parts}'

    def cloud_files(self) -> dict[str, bytes]:
        ids = 1000 + np.arange(55)
        places = self.in_chunk(self.points[:55])
        files = {"points0.ply": ply(["float x", "float y", "float z", "uint id"], [*places.T, ids])}
        for k in range(6):
            own = np.flatnonzero(self.seen[k, :55])
            # a track without place, and one that is twice in the photograph
            tracks = np.concatenate([ids[own], [5, ids[own[0]]]])
            px = np.vstack([self.px[k, own], [[1.0, 1.0], [2.0, 2.0]]])
            size = np.ones(len(tracks))
            files[f"p{k}.ply"] = ply(["float x", "float y", "float size", "uint id"], [*px.T, size, tracks])
        return files

    def write(self, folder: Path, ending: str) -> Path:
        path = folder / f"site{ending}"
        if ending == ".psz":
            text = f'<document version="1.2.0"><chunks><chunk id="0">{self.chunk(True)}</chunk></chunks></document>'
            path.write_bytes(archive({"doc.xml": text.encode(), **self.cloud_files()}))
        elif ending == ".xml":
            text = f'<document version="1.5.0">\n<chunk label="Chunk 1">{self.chunk(True)}</chunk></document>'
            path.write_text(text.replace(f"<point_cloud>{self.cloud()}</point_cloud>", ""))
        else:
            path.write_text('<document version="1.2.0" path="{projectname}.files/project.zip"/>')
            inside = folder / "site.files"
            (inside / "0/0/point_cloud").mkdir(parents=True, exist_ok=True)
            chunks = '<document><chunks active_id="0"><chunk id="0" path="0/chunk.zip"/></chunks></document>'
            (inside / "project.zip").write_bytes(archive({"doc.xml": chunks.encode()}))
            chunk = f'<chunk version="1.2.0" label="Chunk 1" enabled="true">{self.chunk(False)}</chunk>'
            (inside / "0/chunk.zip").write_bytes(archive({"doc.xml": chunk.encode()}))
            (inside / "0/0/frame.zip").write_bytes(archive({"doc.xml": self.frame(False).encode()}))
            cloud = f'<point_cloud version="1.2.0">{self.cloud()}</point_cloud>'
            (inside / "0/0/point_cloud/point_cloud.zip").write_bytes(
                archive({"doc.xml": cloud.encode(), **self.cloud_files()})
            )
        return path


FRAME = '<frame id="0" path="0/frame.zip"/>'


def archive(files: dict[str, bytes]) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as file:
        for name, content in files.items():
            file.writestr(name, content)
    return buffer.getvalue()


def ply(properties: list[str], columns: list[np.ndarray]) -> bytes:
    lines = ["ply", "format binary_little_endian 1.0", f"element vertex {len(columns[0])}"]
    head = "\n".join([*lines, *(f"property {text}" for text in properties), "end_header"]) + "\n"
    form = np.dtype([(text.split()[1], "<u4" if text.startswith("uint") else "<f4") for text in properties])
    table = np.zeros(len(columns[0]), form)
    for text, column in zip(properties, columns, strict=True):
        table[text.split()[1]] = column
    return head.encode() + table.tobytes()
