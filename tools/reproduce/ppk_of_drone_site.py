"""What a drone with PPK would have left of the flight of blocks/drone_site: trajectory (.pos) and time stamps (.MRK).

The antenna sits 0.31 m from the camera and turns with it. The path between the true places at exposure is a cubic
spline, 3 m/s along the strips; its solution is fixed, with noise of 6 mm in plan and 12 mm in height. The drone's own
solution is a single point, metres off. The outcome stands in blocks/drone_site/ppk.

Example: python tools/reproduce/ppk_of_drone_site.py --out blocks/drone_site/ppk
"""

from __future__ import annotations

import argparse
import csv
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
from pyproj import Transformer
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

SITE = Path(__file__).resolve().parents[2] / "blocks" / "drone_site"
LEVER_ARM_M = np.array([0.06, 0.03, 0.30])
"""From the camera to the antenna: right, up in the photograph, backwards."""
WEEK, START_S, LEAD_S, STEP_S = 2318, 554437.2, 4.0, 0.2
"""GPS week and second of the first epoch, time before the first photograph, and between epochs."""
INTERVAL_S, TURN_S = 2.03, 8.11
SIGMA_M = np.array([0.006, 0.006, 0.012])
OWN_M, OWN_SIGMA_M = np.array([1.1, -0.8, 2.6]), np.array([0.1, 0.1, 0.2])
"""What the drone's own solution is off by, east, north, up, and its noise."""


def exposures() -> tuple[np.ndarray, np.ndarray]:
    """(n, 3) longitude, latitude, height of the cameras and of the antenna at exposure."""
    with (SITE / "truth" / "images.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    centre = np.array([[float(row[name]) for name in ("X0", "Y0", "Z0")] for row in rows])
    angles = np.array([[float(row[name]) for name in ("omega", "phi", "kappa")] for row in rows])
    antenna = centre + Rotation.from_euler("XYZ", angles, degrees=True).apply(LEVER_ARM_M)
    to_geographic = Transformer.from_crs("EPSG:32632", "EPSG:4326", always_xy=True)
    return tuple(np.column_stack([*to_geographic.transform(*p[:, :2].T), p[:, 2]]) for p in (centre, antenna))  # type: ignore[return-value]


def local(place: np.ndarray) -> tuple[Transformer, np.ndarray]:
    """East, north and up around the first place, and what brings places there."""
    lon, lat, height = place[0].tolist()
    steps = f"+step +proj=cart +step +proj=topocentric +lon_0={lon!r} +lat_0={lat!r} +h_0={height!r}"
    there = Transformer.from_pipeline(f"+proj=pipeline +step +proj=unitconvert +xy_in=deg +xy_out=rad {steps}")
    return there, np.column_stack(there.transform(*place.T))


def times(count: int) -> np.ndarray:
    """(n,) s from the first epoch to every exposure, four in a strip."""
    steps = np.where(np.arange(1, count) % 4 == 0, TURN_S, INTERVAL_S)
    return LEAD_S + 0.113 + np.concatenate([[0.0], np.cumsum(steps)])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    out = parser.parse_args().out
    out.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(5)
    camera, antenna = exposures()
    there, path = local(antenna)
    offset = (np.column_stack(there.transform(*camera.T)) - path) * 1e3
    taken = times(len(path))
    # before and behind the flight the drone flies on as in its first and last strip
    way = (path[1] - path[0]) / INTERVAL_S, (path[-1] - path[-2]) / INTERVAL_S
    ends = path[0] - way[0] * (taken[0] + 1.0), path[-1] + way[1] * 5.0
    spline = CubicSpline(np.concatenate([[-1.0], taken, [taken[-1] + 5.0]]), np.vstack([ends[0], path, ends[1]]))
    epochs = STEP_S * np.arange(int((taken[-1] + 4.0) / STEP_S))
    solved = np.column_stack(
        there.transform(*(spline(epochs) + rng.normal(0.0, SIGMA_M, (len(epochs), 3))).T, direction="INVERSE")
    )
    (out / "flight.pos").write_text(solution(epochs, solved), encoding="utf-8")
    own = np.column_stack(
        there.transform(*(path + OWN_M + rng.normal(0.0, OWN_SIGMA_M, path.shape)).T, direction="INVERSE")
    )
    (out / "flight.MRK").write_text(time_stamps(taken, offset, own), encoding="utf-8")


def solution(epochs: np.ndarray, place: np.ndarray) -> str:
    head = """\
% program   : RTKLIB ver.2.4.3 b34
% pos mode  : Kinematic
% solution  : Combined
% ref pos   :  48.097500000   11.417000000   519.2310
%
% (lat/lon/height=WGS84/ellipsoidal,Q=1:fix,2:float,3:sbas,4:dgps,5:single,6:ppp,ns=# of satellites)
%  GPST                  latitude(deg) longitude(deg)  height(m)   Q  ns   sdn(m)   sde(m)   sdu(m)  age(s)  ratio
"""
    began = datetime(1980, 1, 6) + timedelta(weeks=WEEK, seconds=START_S)
    rows = []
    for second, (lon, lat, height) in zip(epochs, place, strict=True):
        moment = began + timedelta(seconds=round(float(second), 3))
        sigma = "{1:8.4f} {0:8.4f} {2:8.4f}".format(*SIGMA_M)
        text = f"{moment:%Y/%m/%d %H:%M:%S}.{moment.microsecond // 1000:03d}"
        rows.append(f"{text} {lat:14.9f} {lon:14.9f} {height:10.4f}   1  19 {sigma}   0.00   42.1")
    return head + "\n".join(rows) + "\n"


def time_stamps(taken: np.ndarray, offset: np.ndarray, own: np.ndarray) -> str:
    rows = []
    for number, (second, (east, north, up), (lon, lat, height)) in enumerate(zip(taken, offset, own, strict=True), 1):
        rows.append(
            f"{number}\t{START_S + second:.6f}\t[{WEEK}]\t{north:6.0f},N\t{east:6.0f},E\t{-up:6.0f},V\t{lat:.8f},Lat\t"
            f"{lon:.8f},Lon\t{height:.3f},Ellh\t0.912345, 0.874321, 2.123456\t16,Q"
        )
    return "\n".join(rows) + "\n"


if __name__ == "__main__":
    main()
