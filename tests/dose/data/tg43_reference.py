#!/usr/bin/env python3
"""Writes tg43_reference.csv: total dose of 1 U from the source files, by nothing but the definitions.

Geometry: numerical integral of 1/distance^2 along the active line. Tables: scipy's interpolators. Needs numpy, scipy,
Python 3.11. Run in this folder: /usr/bin/python3 tg43_reference.py
"""
import csv, math, pathlib, tomllib
import numpy as np
from scipy import integrate, interpolate

here = pathlib.Path(__file__).parent
RADII_CM = [0.25, 0.3, 0.4, 0.5, 0.6, 0.75, 0.9, 1.0, 1.25, 1.5, 2.0, 2.5, 3.3, 4.0, 5.0, 5.5, 7.0, 8.5, 10.0]
ANGLES_DEG = [0.0, 0.4, 1.0, 2.5, 5.0, 7.0, 10.0, 13.0, 22.0, 30.0, 37.5, 45.0, 60.0, 73.0, 85.0, 90.0,
              98.0, 120.0, 143.0, 170.0, 176.0, 179.5, 180.0]


def seen(length, r, angle):
    """Mean of 1/distance^2 over the line, which lies on the z axis."""
    x, z = r * math.sin(angle), r * math.cos(angle)
    value, _ = integrate.quad(lambda s: 1 / (x * x + (z - s) ** 2), -length / 2, length / 2, epsabs=0, epsrel=1e-11, limit=200)
    return value / length


def tables(data):
    r, g = (np.array(data["radial"][k], float) for k in ("r_cm", "g_line"))
    slope = math.log(g[-1] / g[-2]) / (r[-1] - r[-2])

    def radial(x):
        if x <= r[0]:
            return g[0]
        if x >= r[-1]:
            return g[-1] * math.exp(slope * (x - r[-1]))
        return float(np.exp(interpolate.interp1d(r, np.log(g))(x)))

    one = data["anisotropy_1d"]
    two = data["anisotropy_2d"]
    rows, columns = np.array(two["r_cm"], float), np.array(two["theta_deg"], float)
    bilinear = interpolate.RegularGridInterpolator((rows, columns), np.array(two["F"], float))
    phi = lambda x: float(np.interp(x, one["r_cm"], one["phi_an"]))
    aniso = lambda x, deg: bilinear((min(max(x, rows[0]), rows[-1]), min(deg, 180 - deg))).item()
    return radial, phi, aniso


def main():
    with open(here / "tg43_reference.csv", "w", newline="") as out:
        w = csv.writer(out, lineterminator="\n")
        w.writerow(["source", "r_cm", "theta_deg", "dose_1d_gy_per_u", "dose_2d_gy_per_u"])
        for name in ("i125_6711", "pd103_200"):
            data = tomllib.loads((here / "../../../sources" / f"{name}.toml").resolve().read_text())
            s = data["source"]
            radial, phi, aniso = tables(data)
            line = s["active_length_cm"]
            # cGy/h to Gy, times the mean life in hours
            total = s["dose_rate_constant"] / 100 * s["half_life_days"] * 24 / math.log(2)
            reference = seen(line, 1.0, math.pi / 2)
            for r in RADII_CM:
                across = seen(line, r, math.pi / 2)
                for deg in ANGLES_DEG:
                    angle = math.radians(deg)
                    one = total * across / reference * radial(r) * phi(r)
                    two = total * seen(line, r, angle) / reference * radial(r) * aniso(r, deg)
                    w.writerow([name, r, deg, f"{one:.9g}", f"{two:.9g}"])


main()
