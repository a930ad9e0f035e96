"""Tables of what was found, as Markdown."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.stats import chi2

from moving import cells, correlations, crab, photographs, shadows, strips
from moving.flights import Flight
from moving.rates import holm, text


def table(head: str, rows: list[list[str]]) -> None:
    columns = head.split("|")
    print("| " + " | ".join(one.strip() for one in columns) + " |\n" + "|---" * len(columns) + "|")
    for row in rows:
        print("| " + " | ".join(row) + " |")
    print(flush=True)


def residuals(flight: Flight, simulated: list[Flight], cameras: bool = False) -> None:
    """Averaged residuals of groups against all, and the same in a block of white noise."""
    print(f"### {flight.name}: averaged residuals of groups of rays against all\n")
    found = {name: tested(flight, name, label, cameras) for name, label in cells.groupings(flight).items()}
    chance = [{n: tested(one, n, la, cameras) for n, la in cells.groupings(one).items()} for one in simulated]
    p = holm(np.array([chi2.sf(*one[:2]) for one in found.values()]))
    rows = []
    for (name, (chi, freedom, rms)), q in zip(found.items(), p, strict=True):
        white = [f"{one[name][0] / one[name][1]:.3f}" for one in chance]
        rows.append([name, str(freedom), f"{chi / freedom:.3f}", text(q), f"{rms:.3f}", *white])
    head = "divided by | f | χ²/f | p, all tests together | RMS of the differences µm"
    table(head + "".join(f" | χ²/f, {one.name}" for one in simulated), rows)


def tested(flight: Flight, name: str, label: np.ndarray, cameras: bool) -> tuple[float, int, float]:
    """χ², degrees of freedom and RMS µm; every camera by itself where there are several."""
    if not cameras:
        one = cells.cell_test(flight, name, label)
        return one.chi2, one.freedom, one.rms_um
    camera = flight.adjusted.block.images.camera[flight.adjusted.block.image_points.image]
    each = [cells.cell_test(flight, name, np.where(camera == k, label, -1)) for k in np.unique(camera)]
    rms2 = np.mean([np.sign(one.rms_um) * one.rms_um**2 for one in each])
    return sum(one.chi2 for one in each), sum(one.freedom for one in each), float(np.sign(rms2) * np.sqrt(abs(rms2)))


def of_strips(found_in: dict[str, strips.StripValues]) -> list[str]:
    """Change, its kind and its causes, by parameter; the names by how sure the change is."""
    causes, values = ("direction", "time", "landing"), next(iter(found_in.values()))
    chi, freedom = strips.chi_square_of_change(values)
    p = holm(strips.probability_of_change(values))
    found = {(one.parameter, one.cause): one for one in strips.causes_of(values, causes)}
    together = dict(zip(found, holm(np.array([one.p for one in found.values()])), strict=True))
    order = np.argsort(-chi)
    print(f"### Parameters of {len(values.time)} groups of photographs, {len(values.names)} parameters\n")
    for name, one in found_in.items():
        changes, few = strips.chi_square_of_change(one)
        count = int((holm(strips.probability_of_change(one)) < 0.05).sum())
        worst = ", ".join(
            f"{one.names[k].removeprefix('legendre.')} {changes[k] / few:.1f}" for k in np.argsort(-changes)[:5]
        )
        total = strips.variance(one, np.ones((len(one.time), 1))).sum()
        print(
            f"{name}: χ²/f of all parameters {changes.mean() / few:.2f}; significant at 5 % with all tests together "
            f"{count}; largest {worst}; variance between the groups {total:.4f} µm².\n"
        )
    rows = []
    for k in order[:16]:
        name = values.names[k]
        y, c, one = values.value[:, k], values.covariance[k], np.ones((len(values.time), 1))
        s_free, l_free = strips.restricted(y, c, one, np.eye(len(y)))
        s_walk, l_walk = strips.restricted(y, c, one, strips.walk_kernel(len(y)))
        cells_ = [
            name,
            f"{chi[k] / freedom:.1f}",
            text(p[k]),
            f"{np.sqrt(s_free):.3f}",
            f"{np.sqrt(s_walk):.3f}",
            f"{l_free - l_walk:+.1f}",
        ]
        for cause in causes:
            f = found[name, cause]
            mark = " **" + text(together[name, cause]) + "**" if together[name, cause] < 0.05 else ""
            cells_.append(f"{f.effect:+.3f} ± {f.sigma:.3f}{mark}")
        rows.append(cells_)
    table(
        "parameter | χ²/f of change | p, all tests together | s independent µm | step of a walk µm "
        "| −2 ln L, independent less walk | direction (half the difference) µm | drift over the flight µm "
        "| step at the landing µm",
        rows,
    )
    count = sum(q < 0.05 for q in together.values())
    print(
        f"Causes significant at 5 % with all {len(together)} tests together: {count}. "
        + "; ".join(f"{a.removeprefix('legendre.')} {b} p {text(q)}" for (a, b), q in together.items() if q < 0.05)
        + "\n"
    )
    print(
        "Largest other effects: "
        + "; ".join(
            f"{o.parameter.removeprefix('legendre.')} {o.cause} {o.effect:+.3f} ± {o.sigma:.3f} µm, p alone {text(o.p)}"
            for o in sorted(found.values(), key=lambda o: o.p)[:12]
        )
        + "\n"
    )
    return [values.names[k] for k in order]


def of_crab(before: crab.CrabEffect, after: crab.CrabEffect, values: strips.StripValues) -> None:
    """Parameters against the crab angle, and what a constant error that the set has not makes of it."""
    print("### Parameters against the crab angle\n")
    print("Crab angles of the groups, degrees: " + ", ".join(f"{a:+.1f}" for a in before.crab) + "\n")
    rows = []
    for k in np.argsort(-np.abs(before.expected))[:4]:
        rows.append(
            [
                values.names[k],
                f"{before.expected[k]:+.3f}",
                f"{before.found[k]:+.3f} ± {before.sigma[k]:.3f}",
                f"{after.found[k]:+.3f} ± {after.sigma[k]:.3f}",
            ]
        )
    table("parameter | expected µm for a degree | found | found, corrected before", rows)
    for name, one in {"as it is": before, "corrected before": after}.items():
        print(f"Found over expected, all parameters, {name}: {one.factor:+.2f} ± {one.factor_sigma:.2f}\n")
    k = int(np.argmax(np.abs(before.expected)))
    both = np.stack([np.ones(len(before.crab)), 2.0 * values.way - 1.0, before.crab - before.crab.mean()], axis=1)
    y, covariance = values.value[:, k], values.covariance[k]
    s2, _ = strips.restricted(y, covariance, both, np.eye(len(y)))
    weight = np.linalg.inv(covariance + s2 * np.eye(len(y)))
    cofactor = np.linalg.inv(both.T @ weight @ both)
    found, sigma = cofactor @ both.T @ weight @ y, np.sqrt(np.diagonal(cofactor))
    print(
        f"{values.names[k]} with both together: direction (half the difference) {found[1]:+.3f} ± {sigma[1]:.3f} µm, "
        f"crab {found[2]:+.3f} ± {sigma[2]:.3f} µm for a degree\n"
    )


def explained(values: strips.StripValues, name: str) -> None:
    """The variance between groups by cause, all parameters together."""
    rng = np.random.default_rng(1)
    one = np.ones((len(values.time), 1))
    total = strips.variance(values, one).sum()
    print(f"### What goes with direction, time and landing, all parameters together: {name}\n")
    print(f"Variance between the groups {total:.4f} µm² ({np.sqrt(max(total, 0)):.3f} µm), noise taken off.\n")
    rows = []
    cases = {
        "direction": ("direction",),
        "time": ("time",),
        "landing": ("landing",),
        "direction, time": ("direction", "time"),
        "direction, time, landing": ("direction", "time", "landing"),
    }
    for name, causes in cases.items():
        left = strips.variance(values, strips.columns(values, causes)).sum()
        rows.append([name, f"{100 * (1 - left / total):.0f} %", f"{np.sqrt(max(left, 0)):.3f}"])
    table("taken off | share of the variance | left µm", rows)
    rows = []
    for cause, beside in (
        ("direction", ("time", "landing")),
        ("time", ("direction",)),
        ("landing", ("direction",)),
        ("time", ("direction", "landing")),
        ("landing", ("direction", "time")),
    ):
        rows.append([cause, ", ".join(beside), text(strips.permuted(values, cause, beside, rng))])
    table("cause | beside | p (groups exchanged)", rows)
    share, amount, sigma, pattern = strips.principal(values)
    for k in range(2):
        largest = np.argsort(-np.abs(pattern[k]))[:5]
        what = ", ".join(f"{values.names[j].removeprefix('legendre.')} {pattern[k][j]:+.2f}" for j in largest)
        print(f"Pattern {k + 1} of the deviations: {100 * share[k]:.0f} % of the sum of squares; {what}.\n")
    rows = [
        [
            str(k + 1),
            f"{values.time[k] / 60:.1f}",
            "NW" if values.way[k] == 0 else "SE",
            str(int(values.landing[k])),
            *(f"{a:+.2f} ± {s:.2f}" for a, s in zip(amount[k, :2], sigma[k, :2], strict=True)),
        ]
        for k in range(len(amount))
    ]
    table("group | minute | flown to | landings before | pattern 1 µm | pattern 2 µm", rows)


def interior(values: strips.StripValues, name: str) -> None:
    """c, x0, y0 of the groups: change, direction, time, landing."""
    print(f"### Interior orientation of the groups, {name}\n")
    rows = []
    for k, name in enumerate(("c", "x0", "y0")):
        y, c = values.interior[:, k], values.interior_covariance[k]
        weight, one = np.linalg.inv(c), np.ones(len(y))
        mean = one @ weight @ y / (one @ weight @ one)
        chi = float((y - mean) @ weight @ (y - mean))
        design = strips.columns(values, ("direction", "time", "landing"))
        s2, _ = strips.restricted(y, c, design, np.eye(len(y)))
        w = np.linalg.inv(c + s2 * np.eye(len(y)))
        cofactor = np.linalg.inv(design.T @ w @ design)
        beta = cofactor @ design.T @ w @ y
        sigma = np.sqrt(np.diagonal(cofactor))
        rows.append(
            [
                name,
                f"{np.ptp(y):.1f}",
                f"{np.sqrt(np.diagonal(c)).mean():.1f}",
                f"{chi / (len(y) - 1):.2f}",
                text(float(chi2.sf(chi, len(y) - 1))),
                f"{np.sqrt(s2):.2f}",
                *(f"{b:+.2f} ± {s:.2f}" for b, s in zip(beta[1:], sigma[1:], strict=True)),
            ]
        )
    table(
        "element | range µm | σ of a group µm | χ²/f of change | p | s beside the causes µm | direction (half) µm "
        "| drift over the flight µm | step at the landing µm",
        rows,
    )


def of_photographs(flight: Flight, noise: Flight, group: np.ndarray, values: strips.StripValues | None) -> None:
    """Parameters of single photographs: scatter within strips, correlation in time, what goes with the flight."""
    own, white = photographs.photograph_values(flight), photographs.photograph_values(noise)
    if not own.names:
        print("Too few rays in a photograph.\n")
        return
    there = np.isfinite(own.value).all(axis=1)
    print(f"### {flight.name}: parameters of {int(there.sum())} single photographs, from the residuals\n")
    if values is not None:
        slope = photographs.attenuation(flight, group, own.value, values.value)
        print(f"The residuals show {100 * slope:.0f} % of a change between groups.\n")
    ratio = [within_variance(f, v) for f, v in ((flight, own), (noise, white))]
    print(
        f"Variance within strips over that of white noise (median of the parameters): "
        f"{np.median(ratio[0] / ratio[1]):.3f}; largest: "
        + ", ".join(
            f"{own.names[k].removeprefix('legendre.')} {ratio[0][k] / ratio[1][k]:.2f}"
            for k in np.argsort(-ratio[0] / ratio[1])[:6]
        )
        + "\n"
    )
    pairs = [photographs.alike_after(f, v.value) for f, v in ((flight, own), (noise, white))]
    rows = [[str(lag), *(f"{found[lag][0]:+.3f} ± {found[lag][1]:.3f}" for found in pairs)] for lag in pairs[0]]
    table("photographs later | correlation within strips, mean of the parameters | white noise", rows)
    rng, conditions = np.random.default_rng(2), photographs.conditions_of(flight)
    results = {name: photographs.condition_test(flight, own.value, c, rng) for name, c in conditions.items()}
    p = holm(np.array([one[2] for one in results.values()]))
    rows = []
    for (name, one), q in zip(results.items(), p, strict=True):
        scatter = photographs.within_strips(flight, conditions[name], np.isfinite(conditions[name]))
        rows.append(
            [
                name,
                f"{np.nanstd(scatter):.3g}",
                f"{one[0]:.2f}",
                f"{one[1]:.2f}",
                text(one[2]),
                text(q),
                f"{100 * one[3]:.1f} % {own.names[int(one[4])].removeprefix('legendre.')}",
            ]
        )
    table(
        "condition | its scatter within strips | χ²/f | χ²/f by chance | p | p, all tests together "
        "| largest share of variance",
        rows,
    )


def within_variance(flight: Flight, values: photographs.PhotographValues) -> np.ndarray:
    there = np.isfinite(values.value).all(axis=1)
    return photographs.within_strips(flight, np.nan_to_num(values.value), there)[there].var(axis=0)


Pairs = Mapping[str, correlations.Products]


def of_pairs(blocks: list[Flight]) -> tuple[dict, dict]:
    """Correlations of residuals; returned for the picture: within photographs, and of the same point."""
    print(f"### {blocks[0].name}: correlation of residuals\n")
    u = [correlations.normalised(one) for one in blocks]
    within = [correlations.within_photographs(*pair) for pair in zip(blocks, u, strict=True)]
    head = "| x | y | pairs" + "".join(f" | x, {one.name} | y, {one.name}" for one in blocks[1:])
    rows = [[f"{a:.0f} to {b:.0f}", *cells_of([w[a, b] for w in within])] for a, b in within[0]]
    table("two rays of one photograph, px apart " + head, rows)
    ground = [correlations.on_the_ground(*pair) for pair in zip(blocks, u, strict=True)]
    rows = [
        [f"{a:g} to {b:g}", kind, *cells_of([g[a, b][place] for g in ground])]
        for place, kind in enumerate(("the same photograph", "two photographs one after the other"))
        for a, b in ground[0]
    ]
    table("two points, m apart on the ground | seen in " + head, rows)
    same = [
        dict(correlations.at_the_same_place(*pair, np.random.default_rng(3))) for pair in zip(blocks, u, strict=True)
    ]
    rows = [[name, *cells_of([one[name] for one in same])] for name in same[0] if same[0][name].count]
    table("the same place of the image in two photographs " + head, rows)
    points = [dict(correlations.of_the_same_point(*pair)) for pair in zip(blocks, u, strict=True)]
    rows = [[name, *cells_of([one[name] for one in points])] for name in points[0] if points[0][name].count > 100]
    table("the same point in two photographs " + head, rows)
    for one in blocks:
        for low, high in ((0.5, 2.0), (2.0, 8.0)):
            azimuth, sigma, size = correlations.main_direction(one, low, high, np.random.default_rng(4))
            print(
                f"{one.name}: points {low:g} to {high:g} m apart in successive photographs: correlation "
                f"{size[1]:.3f} along azimuth {azimuth:.0f}° ± {sigma:.0f}°, {size[0]:.3f} across it\n"
            )
    for one, residual in zip(blocks, u, strict=True):
        mean, chi = correlations.within_a_pixel(one, residual)
        print(
            f"{one.name}: residual by the place within the pixel: largest mean {np.abs(mean).max():.3f} of the RMS, "
            f"χ²/f x {chi[0]:.2f}, y {chi[1]:.2f}\n"
        )
    names = [one.name for one in blocks]
    return dict(zip(names, within, strict=True)), dict(zip(names, points, strict=True))


def cells_of(found: list[correlations.Products]) -> list[str]:
    first = found[0]
    out = [f"{c:+.3f} ± {s:.3f}" for c, s in zip(first.correlation, first.sigma, strict=True)] + [str(first.count)]
    for other in found[1:]:
        out += [f"{c:+.3f}" for c in other.correlation]
    return out


def of_shadows(blocks: list[Flight], sun: list[tuple[float, float]]) -> dict:
    """Points that two strips see at different places, and the sun at the first and the last photograph."""
    flight = blocks[0]
    print(f"### {flight.name}: places of a point as two strips see it\n")
    azimuth, length = shadows.shadow_motion(*sun)
    course = float(np.degrees(np.pi / 2 - flight.course[0])) % 180.0
    print(
        f"Sun: azimuth {sun[0][0]:.1f}° to {sun[1][0]:.1f}°, elevation {sun[0][1]:.1f}° to {sun[1][1]:.1f}°. The "
        f"shadow of the top of an object 1 m high moves by {length:.2f} m towards azimuth {azimuth:.0f}°. Strips: "
        f"azimuth {course:.0f}° and {course + 180:.0f}°.\n"
    )
    found = {}
    rows = []
    for one in blocks:
        all_pairs = shadows.differences(one)
        found[one.name] = all_pairs
        for low, high in ((0.0, 1e9), (0.0, 80.0), (80.0, 160.0), (160.0, 1e9)):
            k = (all_pairs.time >= low) & (all_pairs.time < high)
            if k.sum() < 200:
                continue
            some = shadows.Differences(all_pairs.d[k], all_pairs.time[k], all_pairs.cell[k])
            skew = shadows.greatest_skewness(some, np.random.default_rng(5))
            square = np.mean(some.along(np.array([sun[0][0], sun[0][0] + 90.0])) ** 2, axis=0) * 1e4
            rows.append(
                [
                    one.name,
                    "all"
                    if high - low > 1e8 and not low
                    else f"{low:.0f} to {high:.0f}".replace("to 1000000000", "and more"),
                    str(int(k.sum())),
                    f"{np.sqrt(square[0]):.2f}",
                    f"{np.sqrt(square[1]):.2f}",
                    f"{skew.value:.2f} ± {skew.sigma:.2f}",
                    f"{skew.azimuth:.0f} ± {skew.azimuth_sigma:.0f}",
                ]
            )
    table(
        "block | s between the strips | pairs | RMS towards the sun cm | across cm | greatest skewness | its azimuth °",
        rows,
    )
    _own, limit = shadows.large_by_azimuth(found[flight.name])
    shares = {name: shadows.share_beyond(one, limit) for name, one in found.items()}
    rows = [[f"{a:.0f}", *(f"{100 * one[k]:.2f}" for one in shares.values())] for k, a in enumerate(shadows.AZIMUTHS)]
    table("azimuth ° | " + " | ".join(f"{name}, share above {100 * limit:.1f} cm, %" for name in shares), rows)
    angle = np.radians(shadows.AZIMUTHS)
    for name, one in shares.items():
        net = one - np.roll(one, len(one) // 2)
        mean = np.degrees(np.arctan2(one @ np.sin(angle), one @ np.cos(angle))) % 360.0
        print(
            f"{name}: mean direction of the large differences azimuth {mean:.0f}°; {100 * net[net > 0].sum():.1f} % of "
            f"all points more to this side than to the other; large {100 * one.sum():.1f} %.\n"
        )
    return {"shares": shares, "limit": limit, "tip": azimuth, "sun": 0.5 * (sun[0][0] + sun[1][0]), "course": course}
