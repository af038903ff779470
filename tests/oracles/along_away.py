#!/usr/bin/env python3
"""Writes along_away.csv: a source file of ours as a consensus sheet, with a table of dose rates along and away.

By nothing but the definitions: the geometry is the mean of 1/distance^2 over the line by Simpson's rule, tables are interpolated
by hand. Needs Python 3.11 alone. Run in this folder: ./along_away.py, which writes into ../dose/data
"""
import csv, math, pathlib, tomllib

here = pathlib.Path(__file__).resolve().parent
data = tomllib.loads((here / "../../sources/i125_iai125a.toml").read_text())
length, constant = data["source"]["active_length_cm"], data["source"]["dose_rate_constant"]
radii, g = data["radial"]["r_cm"], data["radial"]["g_line"]
f_radii, angles, f = (data["anisotropy_2d"][key] for key in ("r_cm", "theta_deg", "F"))


def between(at, values, x):
    i = max(k for k in range(len(at) - 1) if k == 0 or at[k] <= x)
    return values[i] + (values[i + 1] - values[i]) * (x - at[i]) / (at[i + 1] - at[i])


def seen(away, along, steps=20000):
    at = lambda k: 1 / (away ** 2 + (along - length * (k / steps - 0.5)) ** 2)
    return sum((1 if k in (0, steps) else 4 if k % 2 else 2) * at(k) for k in range(steps + 1)) / (3 * steps)


def rate(away, along):
    r, theta = math.hypot(away, along), math.degrees(math.atan2(away, abs(along)))
    radial = math.exp(between(radii, [math.log(v) for v in g], max(r, radii[0])))
    column = [between(angles, row, theta) for row in f]
    anisotropy = between(f_radii, column, min(max(r, f_radii[0]), f_radii[-1]))
    return constant * seen(away, along) / seen(1, 0) * radial * anisotropy


AWAY = [0, 0.1, 0.25, 0.5, 0.75, 1, 1.5, 2, 3, 4, 5, 6, 7]
ALONG = [7, 6, 5, 4, 3, 2, 1.5, 1, 0.5, 0, -0.5, -1, -2, -5]
inside = lambda away, along: away < 0.04 and abs(along) < 0.225
with open(here / "../dose/data/along_away.csv", "w", newline="") as out:
    w = csv.writer(out, lineterminator="\n")
    w.writerow(["", "L   =", constant, "", "cGy/(h U)"])
    w.writerow(["", "L =", length, "cm"] + [""] * 10 + ["y / cm"])
    w.writerow(["", "r (cm)", "gL(r)", "", "Theta/deg", *f_radii, "", "z / cm", *AWAY])
    for k in range(max(len(radii), len(angles), len(ALONG))):
        row = [""] + ([radii[k], g[k]] if k < len(radii) else ["", ""]) + [""]
        row += [angles[k], *(line[k] for line in f)] if k < len(angles) else [""] * (len(f_radii) + 1)
        if k < len(ALONG):
            rates = ["" if inside(away, ALONG[k]) else f"{rate(away, ALONG[k]):.6g}" for away in AWAY]
            row += ["", ALONG[k], *rates]
        w.writerow(row)
