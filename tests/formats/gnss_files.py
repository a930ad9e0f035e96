"""A flight, and the files that a drone and GNSS programs leave of it, written by the book of each format."""

from __future__ import annotations

from datetime import datetime, timedelta

import numpy as np
from pyproj import Transformer

BASE = np.array([11.5, 48.1, 520.0])
"""Longitude, latitude, height of the base station."""
WEEK, START = 2235, 21262.2
"""GPS week, and second of the week of the first epoch: 2022-11-06 05:54:22.2 GPS."""
LEAP = 18.0
GPS_BEGAN = datetime(1980, 1, 6)
CART = Transformer.from_pipeline("+proj=pipeline +step +proj=unitconvert +xy_in=deg +xy_out=rad +step +proj=cart")
SIGMA = (0.011, 0.014, 0.031)
"""m, east, north, up."""
OFFSET_MM = np.array(
    [[-180, 574, 233], [-120, 590, 260], [200, -500, 240], [30, 610, 250], [0, 600, 255], [-75, 580, 245]]
)
"""From the antenna to the camera, north, east, down."""


def path(seconds: np.ndarray) -> np.ndarray:
    """(n, 3) m east, north, up of the base: a drone that sways along its strip at 8 m/s."""
    t = np.asarray(seconds, float)
    return np.column_stack([30.0 * np.sin(0.05 * t) + 0.2 * np.sin(0.7 * t), 8.0 * t, 80.0 + 0.5 * np.sin(0.4 * t)])


def axes(place: np.ndarray) -> np.ndarray:
    """(3, 3) rows east, north, up at a place, by small steps."""
    step = np.diag([1e-5, 1e-5, 1.0])
    rows = np.array([geocentric(place[None] + s)[0] - geocentric(place[None] - s)[0] for s in step])
    return rows / np.linalg.norm(rows, axis=1)[:, None]


def geocentric(place: np.ndarray) -> np.ndarray:
    return np.column_stack(CART.transform(*place.T))


def geographic(xyz: np.ndarray) -> np.ndarray:
    return np.column_stack(CART.transform(*xyz.T, direction="INVERSE"))


def places(seconds: np.ndarray) -> np.ndarray:
    """(n, 3) longitude, latitude, height of the antenna."""
    return geographic(geocentric(BASE[None]) + path(seconds) @ axes(BASE))


def in_minutes(value: float) -> str:
    degrees, rest = divmod(abs(value) * 3600.0, 3600.0)
    minutes, seconds = divmod(rest, 60.0)
    return f"{'-' if value < 0 else ''}{degrees:.0f} {minutes:02.0f} {seconds:09.6f}"


def clock_text(seconds: float, clock: str, calendar: bool) -> str:
    """The time of an epoch, `seconds` after the first."""
    total = WEEK * 604800.0 + START + seconds + {"GPST": 0.0, "UTC": -LEAP, "JST": -LEAP + 9 * 3600.0}[clock]
    if not calendar:
        return f"{total // 604800:.0f} {total % 604800:.3f}"
    moment = GPS_BEGAN + timedelta(seconds=round(total, 3))
    return f"{moment:%Y/%m/%d %H:%M:%S}.{moment.microsecond // 1000:03d}"


RTKLIB_COLUMNS = {
    "deg": "latitude(deg) longitude(deg)  height(m)   Q  ns   sdn(m)   sde(m)   sdu(m)  sdne(m)  sdeu(m)  sdun(m)",
    "dms": "latitude(d'\")  longitude(d'\")  height(m)   Q  ns   sdn(m)   sde(m)   sdu(m)  sdne(m)  sdeu(m)  sdun(m)",
    "xyz": "x-ecef(m)      y-ecef(m)      z-ecef(m)   Q  ns   sdx(m)   sdy(m)   sdz(m)  sdxy(m)  sdyz(m)  sdzx(m)",
    "enu": "e-baseline(m)  n-baseline(m)  u-baseline(m)   Q  ns   sde(m)   sdn(m)   sdu(m)  sden(m)  sdnu(m)  sdue(m)",
}


def rtklib(
    seconds: np.ndarray,
    form="deg",
    clock="GPST",
    calendar=True,
    separator=" ",
    quality=None,
    velocity=False,
    sigmas=SIGMA,
):
    """A solution as RTKLIB and Emlid Studio write it."""
    columns = RTKLIB_COLUMNS[form] + " age(s)  ratio" + ("    vn(m/s)" if velocity else "")
    head = [
        "% program   : RTKLIB ver.2.4.3 b34", "% obs start : 2022/11/06 05:54:22.2 GPST (week2235  21262.2s)",
        "% pos mode  : Kinematic", f"% ref pos   :  {BASE[1]:.9f} {BASE[0]:.9f} {BASE[2]:.4f}", "%",
        "% (lat/lon/height=WGS84/ellipsoidal,Q=1:fix,2:float,3:sbas,4:dgps,5:single,6:ppp,ns=# of satellites)",
        f"%  {clock} ".ljust(24) + separator + separator.join(columns.split()),
    ]  # fmt: skip
    quality = np.ones(len(seconds), int) if quality is None else quality
    rows = []
    for t, place, enu, q in zip(seconds, places(seconds), path(seconds), quality, strict=True):
        e, n, u = sigmas
        sigma = [n, e, u, 0.0, 0.0, 0.0]
        if form in ("deg", "dms"):
            spot = [in_minutes(v) if form == "dms" else f"{v:.10f}" for v in (place[1], place[0])] + [f"{place[2]:.5f}"]
        elif form == "xyz":
            spot = [f"{v:.5f}" for v in geocentric(place[None])[0]]
            turned = axes(place).T @ np.diag(np.square(sigmas)) @ axes(place)
            root = np.sign(turned) * np.sqrt(np.abs(turned))
            sigma = [*np.diag(root), root[0, 1], root[1, 2], root[2, 0]]
        else:
            spot, sigma = [f"{v:.5f}" for v in enu], [e, n, u, 0.0, 0.0, 0.0]
        words = [*" ".join(spot).split(), f"{q}", "14", *(f"{s:.7f}" for s in sigma), "0.00", "12.3"]
        rows.append(separator.join([clock_text(t, clock, calendar).replace(" ", separator if not calendar else " "),
                                    *words, *(["7.98"] if velocity else [])]))  # fmt: skip
    return "\n".join([*head, *rows]) + "\n"


def grafnav(seconds: np.ndarray, minutes=False, utc=False, quality=None, lengths=1.0, more=""):
    """A trajectory as GrafNav writes it; `lengths`: metres in the unit of heights and σ; `more`: names of columns."""
    clock = "UTC" if utc else "GPS"
    unit = "(D M S)" if minutes else "(deg)"
    head = [
        "", "Project:     field", "Program:     GrafNav Version 8.90", "Datum:       WGS84", "UTC Offset:  18 s", "",
        f"   {clock}Date {clock}Time {clock}Time          Latitude         Longitude        H-Ell      SDHoriz "
        f"    SDHeight Q{more}",
        f"     (YMD)   (HMS)   (sec) {unit:>17} {unit:>17}          (m)          (m)          (m)  ",
    ]  # fmt: skip
    quality = np.ones(len(seconds), int) if quality is None else quality
    rows = []
    for t, place, q in zip(seconds, places(seconds), quality, strict=True):
        moment = clock_text(t, "UTC" if utc else "GPST", True)
        spot = [in_minutes(v) if minutes else f"{v:.10f}" for v in (place[1], place[0])]
        plan = np.sqrt(2.0) * SIGMA[0]
        second = START + t - (LEAP if utc else 0.0)
        sizes = " ".join(f"{size / lengths:12.4f}" for size in (place[2], plan, SIGMA[2]))
        rows.append(f"{moment} {second:10.3f} {spot[0]:>17} {spot[1]:>17} {sizes} {q}" + " 0.1" * len(more.split()))
    return "\n".join([*head, *rows]) + "\n"


def mrk(seconds: np.ndarray, first=1, code=50, error=0.0):
    """Time stamps as DJI's drones write them."""
    rows = []
    for k, (t, place) in enumerate(zip(seconds, places(np.asarray(seconds) + error), strict=True)):
        north, east, down = OFFSET_MM[k % len(OFFSET_MM)]
        rows.append(
            f"{first + k}\t{START + t:.6f}\t[{WEEK}]\t{north:6d},N\t{east:6d},E\t{down:6d},V\t{place[1]:.10f},Lat\t"
            f"{place[0]:.10f},Lon\t{place[2]:.3f},Ellh\t0.013000, 0.012000, 0.027000\t{code},Q"
        )
    return "\n".join(rows) + "\n"


def cameras(seconds: np.ndarray) -> np.ndarray:
    """(n, 3) where the cameras were, longitude, latitude, height."""
    found = geocentric(places(seconds))
    offset = OFFSET_MM[np.arange(len(seconds)) % len(OFFSET_MM)][:, [1, 0, 2]] * np.array([1e-3, 1e-3, -1e-3])
    for k, place in enumerate(places(seconds)):
        found[k] += offset[k] @ axes(place)
    return geographic(found)
