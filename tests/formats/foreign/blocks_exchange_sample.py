"""A BlocksExchange file as text: photographs in any of its systems and axes, projected by the format's formulas.

Nothing of the program is used: coordinates by PROJ and the definition of earth-centred ones, angles by differences.
"""

from __future__ import annotations

import numpy as np
from pyproj import Transformer

from formats.foreign.metashape_sample import ANGLES, CENTRES, LAT, LON, Sample, axes, earth_centred

SIZE, PIXEL_MM, FOCAL_MM = (4000, 3000), 0.004, 9.6
PRINCIPAL = 2011.25, 1490.5
"""From the centre of the upper left pixel."""
LENS = {"K1": -0.05, "K2": 0.01, "K3": -0.002, "P1": 1e-3, "P2": -2e-3}
DEFINITIONS = {
    "utm": "EPSG:25832", "degrees": "EPSG:4258", "earth": "EPSG:4978", "enu": f"ENU:{LAT},{LON}", "local": "",
}  # fmt: skip
# x and y of the camera in x right, y down; z follows
ORIENTATIONS = {
    "XRightYDown": ((1, 0, 0), (0, 1, 0)), "XRightYUp": ((1, 0, 0), (0, -1, 0)), "XLeftYDown": ((-1, 0, 0), (0, 1, 0)),
    "XLeftYUp": ((-1, 0, 0), (0, -1, 0)), "XDownYRight": ((0, 1, 0), (1, 0, 0)), "XDownYLeft": ((0, 1, 0), (-1, 0, 0)),
    "XUpYRight": ((0, -1, 0), (1, 0, 0)), "XUpYLeft": ((0, -1, 0), (-1, 0, 0)),
}  # fmt: skip


def pixels(direction: np.ndarray, aspect: float = 1.0) -> np.ndarray:
    """(n, 2) from the centre of the upper left pixel, of directions in x right, y down, z forwards."""
    u, v = (direction[:, :2] / direction[:, 2:]).T
    r2 = u * u + v * v
    radial = 1 + LENS["K1"] * r2 + LENS["K2"] * r2**2 + LENS["K3"] * r2**3
    a = u * radial + LENS["P1"] * (r2 + 2 * u * u) + 2 * LENS["P2"] * u * v
    b = v * radial + LENS["P2"] * (r2 + 2 * v * v) + 2 * LENS["P1"] * u * v
    f = FOCAL_MM / PIXEL_MM
    return np.column_stack([PRINCIPAL[0] + f * a, PRINCIPAL[1] + aspect * f * b])


def east_north_up(lon: float, lat: float) -> np.ndarray:
    lon, lat = np.radians([lon, lat])
    east = [-np.sin(lon), np.cos(lon), 0.0]
    north = [-np.sin(lat) * np.cos(lon), -np.sin(lat) * np.sin(lon), np.cos(lat)]
    up = [np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)]
    return np.column_stack([east, north, up])


def element(tag: str, values) -> str:
    return f"<{tag}>" + "".join(f"<{key}>{value!r}</{key}>" for key, value in values.items()) + f"</{tag}>"


class BlocksExchange:
    """The truth in axes east, north, up at LON, LAT, and its file.

    Parameters
    ----------
    system : a key of `DEFINITIONS`. orientation : a key of `ORIENTATIONS`. rotations : 'matrix' or 'angles'.
    unit : 'px' or 'mm' of principal point and measurements.
    """

    def __init__(self, system="utm", orientation="XRightYDown", rotations="matrix", unit="px", aspect=1.0):
        from aerotri.functional_model.rotation import rotation_from_angles

        self.system, self.orientation, self.rotations, self.unit, self.aspect = (
            system, orientation, rotations, unit, aspect,
        )  # fmt: skip
        self.points, self.centre = Sample().points, CENTRES
        # camera with x right, y down, z forwards → east, north, up
        self.rotation = rotation_from_angles(ANGLES) @ np.diag([1.0, -1.0, -1.0])
        self.px = np.array(
            [pixels((self.points - c) @ r, aspect) for c, r in zip(self.centre, self.rotation, strict=True)]
        )
        self.seen = ((self.px > 0) & (self.px < np.array(SIZE) - 1)).all(axis=2)

    def coordinates(self, enu: np.ndarray) -> np.ndarray:
        """In the system of the file; of east, north, up at the ellipsoid the height of the sample's origin is added."""
        if self.system == "earth":
            return earth_centred(enu)
        if self.system == "local":
            return enu
        if self.system == "enu":
            a, f = 6378137.0, 1.0 / 298.257223563
            e2, lat = f * (2 - f), np.radians(LAT)
            n = a / np.sqrt(1 - e2 * np.sin(lat) ** 2)
            origin = east_north_up(LON, LAT)[:, 2] * n - np.array([0.0, 0.0, e2 * n * np.sin(lat)])
            return (earth_centred(enu) - origin) @ east_north_up(LON, LAT)
        return Sample("utm" if self.system == "utm" else "degrees").in_system(enu)

    def turn(self, place: np.ndarray, enu: np.ndarray) -> np.ndarray:
        """(3, 3) from east, north, up at the origin to the axes of the system at a place."""
        to_earth, _ = axes()
        if self.system == "earth":
            return to_earth
        if self.system in ("local", "enu"):
            return np.eye(3)
        lon, lat = (Transformer.from_crs("EPSG:25832", "EPSG:4258", always_xy=True).transform(*place[:2])
                    if self.system == "utm" else place[:2])  # fmt: skip
        own = east_north_up(lon, lat).T @ to_earth
        if self.system == "degrees":
            return own
        step = Transformer.from_crs("EPSG:4258", "EPSG:25832", always_xy=True).transform(
            [lon, lon], [lat - 1e-5, lat + 1e-5]
        )
        north = np.arctan2(step[0][1] - step[0][0], step[1][1] - step[1][0])
        return np.array([[np.cos(north), np.sin(north), 0], [-np.sin(north), np.cos(north), 0], [0, 0, 1]]) @ own

    def text(self, extra: str = "", control: str = "") -> str:
        x, y = (np.array(axis, float) for axis in ORIENTATIONS[self.orientation])
        camera = np.column_stack([x, y, np.cross(x, y)])
        photos = ""
        for k, (centre, enu) in enumerate(zip(self.coordinates(self.centre), self.centre, strict=True)):
            m = (self.turn(centre, enu) @ self.rotation[k] @ camera).T
            if self.rotations == "matrix":
                rotation = element("Rotation", {f"M_{i}{j}": float(m[i, j]) for i in range(3) for j in range(3)})
            else:
                phi = np.arcsin(m[2, 0])
                angles = np.degrees([np.arctan2(-m[2, 1], m[2, 2]), phi, np.arctan2(-m[1, 0], m[0, 0])]).tolist()
                rotation = element("Rotation", dict(zip(("Omega", "Phi", "Kappa"), angles, strict=True)))
            place = dict(zip("xyz", centre.tolist(), strict=True))
            before = dict(zip("xyz", self.coordinates(self.centre + 0.01)[k].tolist(), strict=True))
            metadata = f"<Metadata>{element('Center', before)}<HorizontalAccuracy>0.02</HorizontalAccuracy>" \
                "<VerticalAccuracy>0.03</VerticalAccuracy></Metadata>"  # fmt: skip
            photos += (
                f"<Photo><Id>{k}</Id><ImagePath>D:\\flight\\DJI_{k}.JPG</ImagePath><Pose>{rotation}"
                f"{element('Center', place)}{metadata}</Pose></Photo>\n"
            )
        points = self.points_text()
        principal = self._place(np.array(PRINCIPAL), (np.array(SIZE) - 1) / 2)
        definition = DEFINITIONS[self.system]
        systems = f"<SRS><Id>7</Id><Name>n</Name><Definition>{definition}</Definition></SRS>" if definition else ""
        return f"""<?xml version="1.0" encoding="utf-8"?>
<BlocksExchange version="3.2">
<SpatialReferenceSystems>{systems}</SpatialReferenceSystems>
<Block><Name>site</Name>{"<SRSId>7</SRSId>" if definition else ""}
<Photogroups><Photogroup><Name>FC6310</Name>
<ImageDimensions><Width>{SIZE[0]}</Width><Height>{SIZE[1]}</Height></ImageDimensions>
<CameraModelType>Perspective</CameraModelType><FocalLength>{FOCAL_MM}</FocalLength>
<SensorSize>{SIZE[0] * PIXEL_MM}</SensorSize><CameraOrientation>{self.orientation}</CameraOrientation>
{element("PrincipalPoint", principal)}{element("Distortion", LENS)}<AspectRatio>{self.aspect}</AspectRatio>
<Skew>0</Skew>{extra}
{photos}</Photogroup></Photogroups>
{control or points}</Block></BlocksExchange>
"""

    def _place(self, px: np.ndarray, origin: np.ndarray) -> dict[str, float]:
        if self.unit == "px":
            return dict(zip("xy", px.tolist(), strict=True))
        x, y = (np.array(axis[:2], float) for axis in ORIENTATIONS[self.orientation])
        mm = (px - origin) * PIXEL_MM
        return {"xmm": float(mm @ x), "ymm": float(mm @ y)}

    def points_text(self) -> str:
        """The last five are control points, of which the last is a check point."""
        places = self.coordinates(self.points)
        control, ties = "", ""
        for k, place in enumerate(places.tolist()):
            measured = ""
            for image in np.flatnonzero(self.seen[:, k]).tolist():
                values = self._place(self.px[image, k], np.array(PRINCIPAL))
                own = "".join(f"<{key}>{value!r}</{key}>" for key, value in values.items())
                measured += f"<Measurement><PhotoId>{image}</PhotoId>{own}</Measurement>"
            position = element("Position", dict(zip("xyz", place, strict=True)))
            if k >= 55:
                check = "<CheckPoint>true</CheckPoint>" if k == 59 else ""
                accuracy = "<HorizontalAccuracy>0.02</HorizontalAccuracy><VerticalAccuracy>0.04</VerticalAccuracy>"
                control += (
                    f"<ControlPoint><Name>gcp {k - 55}</Name>{position}{check}{accuracy}{measured}</ControlPoint>\n"
                )
            else:
                ties += f"<TiePoint>{position}{measured}</TiePoint>\n"
        return f"<ControlPoints>{control}</ControlPoints>\n<TiePoints>{ties}</TiePoints>\n"
