"""A rigid probe pressed 10 mm into the wall of a hollow without friction, by felupe's elements and SciPy's solvers.

    python3 probe_felupe.py     writes probe_pressed.csv beside this file (tested with felupe 11.3 and its scipy)

Body: 18 x 16 x 14 cells of 4 mm, a hollow along z, E 15 kPa, nu 0.45, springs to rest of 250 kPa/m on the outer faces of the
gland and none on those of the rectal wall, as in `block` of rt-core/sim/src/probe/tests.rs. The elements are felupe's hexahedra with three fields, of which
dilatation and pressure are constant in each: small strain, so the tangent at rest. The wall is taken at the middle of each face of the hollow: the mean of
the faces within 5.5 mm that do not face away from it, weighted by (1 - d^2 / R^2)^2, at rest and moved. The forces are those of the linear
complementarity problem of all of these points at once, found as a least squares problem without negative unknowns (Lawson and Hanson), for the directions in which
the probe faces, until these stand still. No column is condensed and none interpolated. Units: m, N.
"""
import pathlib

import felupe
import numpy as np
import scipy.linalg
import scipy.optimize
import scipy.sparse as sparse
import scipy.sparse.linalg

DIMS, H, YOUNG, POISSON, FOUNDATION = (18, 16, 14), 4e-3, 15e3, 0.45, 250e3
AROUND, RADIUS = 5.5e-3, 10e-3
TIP = np.array([36e-3, 28e-3, 48e-3])
AXIS = np.array([0.0, 0.0, 1.0])
MIDDLE = 20e-3  # of the hollow, along y


def label(i, j):
    across = ((i + 0.5 - 9) / 3.5) ** 2 + ((j + 0.5 - 5) / 2.5) ** 2
    return 0 if across <= 1 else 2 if across <= 2.6 else 1


cells = [(i, j, k) for k in range(DIMS[2]) for j in range(DIMS[1]) for i in range(DIMS[0]) if label(i, j)]
known = set(cells)
ORDER = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
number = {}
for c in cells:
    for o in ORDER:
        number.setdefault(tuple(np.add(c, o)), len(number))
points = np.array(list(number)) * H
connected = np.array([[number[tuple(np.add(c, o))] for o in ORDER] for c in cells])
mesh = felupe.Mesh(points, connected, "hexahedron")
field = felupe.FieldsMixed(felupe.RegionHexahedron(mesh), n=3)
material = felupe.NeoHooke(mu=YOUNG / 2 / (1 + POISSON), bulk=YOUNG / 3 / (1 - 2 * POISSON))
stiffness = felupe.SolidBody(felupe.ThreeFieldVariation(material), field).assemble.matrix().tocsc()
size = stiffness.shape[0]
springs, faces = np.zeros(size), []
for c in cells:
    for axis in range(3):
        for side in (0, 1):
            beyond = tuple(x + (2 * side - 1) * (a == axis) for a, x in enumerate(c))
            if beyond in known:
                continue
            if label(*c[:2]) == 1:
                for o in ORDER:
                    if o[axis] == side:
                        n = 3 * number[tuple(np.add(c, o))]
                        springs[n : n + 3] += FOUNDATION * H * H / 4
            elif all(0 <= x < d for x, d in zip(beyond, DIMS)):
                outward = np.zeros(3)
                outward[axis] = 2 * side - 1
                middle = (np.array(c) + 0.5) * H
                faces.append((c, middle + outward * H / 2, outward, middle + outward * 0.49 * H))
solver = scipy.sparse.linalg.splu(stiffness + sparse.diags(springs).tocsc())


def shape(cell, place):
    part = place / H - np.array(cell)
    return [(number[tuple(np.add(cell, o))], np.prod([p if s else 1 - p for p, s in zip(part, o)])) for o in ORDER]


rest, normals, loads = [], [], []
for _, place, outward, _ in faces:
    near = [(f, 1 - ((f[1] - place) ** 2).sum() / AROUND**2) for f in faces if f[2] @ outward > -0.3]
    near = [(f, part**2) for f, part in near if part > 1e-12]
    total = sum(part for _, part in near)
    rest.append(sum(part * f[1] for f, part in near) / total)
    normal = sum(part * f[2] for f, part in near)
    normals.append(normal / np.linalg.norm(normal))
    weights = np.zeros(len(points))
    for f, part in near:
        for node, w in shape(f[0], f[3]):
            weights[node] += part / total * w
    loads.append(weights)
rest, normals, loads = np.array(rest), np.array(normals), np.array(loads)
count = len(rest)
moved_by = np.zeros((3 * len(points), 3 * count))
for n in range(count):
    for a in range(3):
        load = np.zeros(size)
        load[a : 3 * len(points) : 3] = loads[n]
        moved_by[:, 3 * n + a] = solver.solve(load)[: 3 * len(points)]
compliance = np.einsum("pn,nac->pac", loads, moved_by.reshape(len(points), 3, -1)).reshape(3 * count, 3 * count)


def gaps(tip, moved):
    from_middle = rest + moved - tip + AXIS * RADIUS
    from_middle = from_middle - np.outer(np.minimum(from_middle @ AXIS, 0), AXIS)
    distance = np.linalg.norm(from_middle, axis=1)
    return distance - RADIUS, from_middle / distance[:, None]


force, moved = np.zeros((count, 3)), np.zeros((count, 3))
for y in np.linspace(MIDDLE, TIP[1], 9):
    tip = np.array([TIP[0], y, TIP[2]])
    for turn in range(200):
        gap, out = gaps(tip, moved)
        faced = np.flatnonzero((out * normals).sum(1) < 0.2)
        free = gap - (out * moved).sum(1)
        direction = np.zeros((3 * count, len(faced)))
        for at, n in enumerate(faced):
            direction[3 * n : 3 * n + 3, at] = out[n]
        matrix = direction.T @ compliance @ direction
        factor = np.linalg.cholesky(0.5 * (matrix + matrix.T) + 1e-9 * np.eye(len(faced)) * matrix.trace() / len(faced))
        pressed, _ = scipy.optimize.nnls(factor.T, -scipy.linalg.solve_triangular(factor, free[faced], lower=True), maxiter=10000)
        before, force = force, (direction @ pressed).reshape(count, 3)
        moved = (compliance @ force.ravel()).reshape(count, 3)
        if np.abs(force - before).max() < 1e-7:
            break
    gap, out = gaps(tip, moved)
    in_probe = -gap[(out * normals).sum(1) < 0.2].min()
    print(f"axis at {1e3 * y:.1f} mm: {turn + 1} turns, on the probe {-force.sum(0)} N, {np.count_nonzero(pressed)} points, {in_probe:.1e} m in it")

field_m = (moved_by @ force.ravel()).reshape(-1, 3)
centres = field_m[connected].mean(1)
gland = np.array([label(*c[:2]) == 1 for c in cells])
size_m = np.linalg.norm(centres[gland], axis=1)
print(f"gland moves by {1e3 * size_m.mean():.4f} mm on average, {1e3 * size_m.max():.4f} mm at most")
lines = [
    "# Written by probe_felupe.py: what it says. Force of the tissue on the probe, N; then cells and the displacement of their middles, m.",
    "force," + ",".join(f"{x:.9e}" for x in -force.sum(0)),
]
lines += [f"{c[0]},{c[1]},{c[2]}," + ",".join(f"{x:.6e}" for x in u) for n, (c, u) in enumerate(zip(cells, centres)) if n % 9 == 0]
(pathlib.Path(__file__).parent / "probe_pressed.csv").write_text("\n".join(lines) + "\n")
