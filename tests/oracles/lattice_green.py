"""Table `GREEN` of rt-core/sim/src/line/compliance.rs: a line load on a lattice of trilinear elements.

A load that is uniform along z on the nodes of a square lattice (bilinear elements, spacing 1, shear modulus 1) moves the nodes
along z by the lattice's Green function. This prints

    g(i, j) = 1/(4 pi^2) int_BZ [cos(i a) cos(j b) / symbol(a, b) - 1_{a^2+b^2<1} / (a^2+b^2)] da db - (ln 2 - gamma) / (2 pi)

which for large r = |(i, j)| is -ln(r) / (2 pi). So a stencil with weights w moves itself as a cylinder of radius r_h would,
ln(r_h / h) = -2 pi sum_pq w_p w_q g(p - q).     Run: python3 lattice_green.py (needs numpy)
"""
import numpy as np

EULER = 0.5772156649015329
LEGENDRE = np.polynomial.legendre.leggauss(120)


def points(low, high):
    x, w = LEGENDRE
    return 0.5 * (high - low) * x + 0.5 * (high + low), 0.5 * (high - low) * w


def symbol(a, b):
    stiffness, mass = (lambda t: 2 - 2 * np.cos(t)), (lambda t: (2 + np.cos(t)) / 3)
    return stiffness(a) * mass(b) + mass(a) * stiffness(b)


def green(i, j):
    total = 0.0
    for low, high in ((0, np.pi / 4), (np.pi / 4, np.pi / 2)):
        for phi, w in zip(*points(low, high)):
            edge = np.pi / max(np.cos(phi), np.sin(phi))
            for r0, r1, inside in ((0, 1, 1.0), (1, edge, 0.0)):
                r, rw = points(r0, r1)
                a, b = r * np.cos(phi), r * np.sin(phi)
                value = np.cos(i * a) * np.cos(j * b) / symbol(a, b) - inside / r**2
                total += w * np.sum(rw * r * value)
    return 4 * total / (4 * np.pi**2) - (np.log(2) - EULER) / (2 * np.pi)


for i in range(5):
    print("[" + ", ".join(f"{green(i, j):.9f}" for j in range(5)) + "],")
for i, j in ((3, 0), (4, 4)):
    print("check", i, j, green(i, j), -np.log(np.hypot(i, j)) / (2 * np.pi))
