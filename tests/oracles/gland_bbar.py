"""The gland of `gland_ccx.py` with mean-dilatation (B-bar) elements, assembled from their definition and solved by SciPy's sparse LU.

    python3 gland_bbar.py [folder]     writes gland_linear_bbar.csv: node in cells, displacement in mm for 1 N along z

CalculiX 2.20 integrates the C3D8 of a linear material fully: with `full` as a second argument this prints the largest difference
from its gland_linear.csv in that folder. Needs numpy and scipy.
"""
import pathlib
import sys

import numpy as np
import scipy.sparse as sparse
import scipy.sparse.linalg

H, YOUNG, POISSON, FOUNDATION = 2.2, 17e-3, 0.49, 2.5e-4
HALF, AT = (10, 8, 11), (10, 8, 2)
IS_FULL = sys.argv[2:] == ["full"]
LAMBDA = YOUNG * POISSON / ((1 + POISSON) * (1 - 2 * POISSON))
MU = YOUNG / 2 / (1 + POISSON)


def corner(cell, n):
    return cell[0] + (n & 1), cell[1] + (n >> 1 & 1), cell[2] + (n >> 2)


def gradient(c, point):
    def part(axis, a):
        upper = c >> a & 1
        if a == axis:
            return 1 / H if upper else -1 / H
        return point[a] if upper else 1 - point[a]

    return np.array([np.prod([part(axis, a) for a in range(3)]) for axis in range(3)])


def element():
    g = 0.5 / 3**0.5
    points = [[0.5 + (g if n >> a & 1 else -g) for a in range(3)] for n in range(8)]
    gradients = np.array([[gradient(c, p) for c in range(8)] for p in points])
    mean = gradients.mean(0)
    matrix = np.zeros((24, 24))
    for at_point in gradients:
        strains = []
        for c in range(8):
            for a in range(3):
                e = np.zeros((3, 3))
                e[a] += 0.5 * at_point[c]
                e[:, a] += 0.5 * at_point[c]
                if not IS_FULL:
                    e += np.eye(3) * (mean[c][a] - at_point[c][a]) / 3
                strains.append(e)
        s = np.array(strains)
        trace = np.einsum("nii->n", s)
        matrix += (LAMBDA * np.outer(trace, trace) + 2 * MU * np.einsum("nij,mij->nm", s, s)) * H**3 / 8
    return matrix


cells = [
    (i, j, k)
    for k in range(2 * HALF[2])
    for j in range(2 * HALF[1])
    for i in range(2 * HALF[0])
    if sum(((c + 0.5 - n) / n) ** 2 for c, n in zip((i, j, k), HALF)) <= 1
]
known, number = set(cells), {}
for cell in cells:
    for n in range(8):
        number.setdefault(corner(cell, n), len(number))
springs, rows, columns, values, matrix = np.zeros(len(number)), [], [], [], element()
for cell in cells:
    nodes = [number[corner(cell, n)] for n in range(8)]
    at = np.array([3 * n + a for n in nodes for a in range(3)])
    rows.append(np.repeat(at, 24))
    columns.append(np.tile(at, 24))
    values.append(matrix.ravel())
    for axis in range(3):
        for side in (0, 1):
            beyond = tuple(c + (2 * side - 1) * (a == axis) for a, c in enumerate(cell))
            if beyond not in known:
                for n in range(8):
                    if n >> axis & 1 == side:
                        springs[nodes[n]] += FOUNDATION * H * H / 4
size = 3 * len(number)
stiffness = sparse.coo_matrix((np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), shape=(size, size))
load = np.zeros(size)
for n in range(8):
    load[3 * number[corner(AT, n)] + 2] = 0.125
u = scipy.sparse.linalg.spsolve((stiffness + sparse.diags(np.repeat(springs, 3))).tocsc(), load).reshape(-1, 3)
folder = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else pathlib.Path(__file__).parent)
given = [line.split(",") for line in (folder / "gland_linear.csv").read_text().splitlines() if line[0] != "#"]
if IS_FULL:
    worst = max(np.abs(u[number[tuple(map(int, row[:3]))]] - np.array(row[3:], float)).max() for row in given)
    print(f"largest difference from CalculiX: {worst:.2e} mm")
else:
    with open(folder / "gland_linear_bbar.csv", "w") as file:
        file.write(f"# SciPy; tests/oracles/gland_bbar.py; {len(cells)} elements. Node in cells, displacement in mm for 1 N\n")
        for row in given:
            at = tuple(map(int, row[:3]))
            file.write(",".join(map(str, at)) + "," + ",".join(f"{v:.9e}" for v in u[number[at]]) + "\n")
