"""A patch of the tip's size pushed into a gland, neo-Hookean, by felupe: displacements of the elements' centres.

    pip install felupe==11.3.0 && python3 gland_large_strain.py [file]

writes the file, by default `large_strain.csv` beside this one: cell, then displacement in mm where the patch is moved by 4, 8 and 10 mm.

Body: a quarter of that of gland_neo_hooke.py, as it is symmetric, with the same elements of 2.2 mm, springs and patch, but hexahedra of
eight nodes whose mean dilatation carries what is volumetric (three fields, condensed). Neo-Hookean as felupe has it: mu / 2 (J^-2/3 I1 - 3)
and K / 2 (J - 1)^2, with E 17 kPa and nu 0.49. Units: mm, N, MPa.
"""
import pathlib
import sys

import felupe as fem
import numpy as np
from scipy.sparse import csr_matrix, diags

HALF, H = (10, 8, 11), 2.2
YOUNG, POISSON, FOUNDATION = 17e-3, 0.49, 2.5e-4
HELD_CELLS = [(10, 8, 2), (10, 8, 3)]
MOVES, STEP = (4, 8, 10), 0.25
target = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else pathlib.Path(__file__).parent / "large_strain.csv")

cells = [
    (i, j, k)
    for k in range(2 * HALF[2])
    for j in range(HALF[1], 2 * HALF[1])
    for i in range(HALF[0], 2 * HALF[0])
    if sum(((c + 0.5 - n) / n) ** 2 for c, n in zip((i, j, k), HALF)) <= 1.0
]
known = set(cells)
CORNERS = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
corners = lambda cell: [tuple(c + p for c, p in zip(cell, corner)) for corner in CORNERS]
nodes = {place: n for n, place in enumerate(sorted({p for cell in cells for p in corners(cell)}))}
springs = np.zeros(len(nodes))
for cell in cells:
    for axis in range(3):
        for side in (0, 1):
            beyond = tuple(c + (2 * side - 1) * (a == axis) for a, c in enumerate(cell))
            if beyond in known or (axis < 2 and side == 0 and cell[axis] == HALF[axis]):
                continue
            for place in corners(cell):
                if place[axis] == cell[axis] + side:
                    springs[nodes[place]] += FOUNDATION * H * H / 4

points = H * np.array(sorted(nodes), dtype=float)
mesh = fem.Mesh(points, np.array([[nodes[p] for p in corners(cell)] for cell in cells]), "hexahedron")
field = fem.FieldContainer([fem.Field(fem.RegionHexahedron(mesh), dim=3)])
mu, bulk = YOUNG / (2 * (1 + POISSON)), YOUNG / (3 * (1 - 2 * POISSON))
solid = fem.SolidBodyNearlyIncompressible(umat=fem.NeoHooke(mu=mu), field=field, bulk=bulk)


class Springs:
    """To rest, on nodes."""

    def __init__(self):
        self.results = type("R", (), {"force": None, "stiffness": None, "update_statevars": lambda self: None})()
        self.matrix_ = csr_matrix(diags(np.repeat(springs, 3)))
        self.assemble = type("A", (), {})()
        self.assemble.vector, self.assemble.matrix = self.vector, self.matrix
        self.assemble.multiplier = None
        self.field = field

    def vector(self, field=None, **_):
        values = (field or self.field)[0].values
        return csr_matrix((self.matrix_ @ values.ravel()).reshape(-1, 1))

    def matrix(self, field=None, **_):
        return self.matrix_


on = lambda axis: np.array([nodes[p] for p in nodes if p[axis] == HALF[axis]])
held = np.array(sorted({nodes[p] for cell in HELD_CELLS for p in corners(cell)}))
mask = lambda which: np.isin(np.arange(len(nodes)), which)
skip = lambda *axes: tuple(int(a in axes) for a in range(3))
boundaries = {
    "held": fem.Boundary(field[0], mask=mask(held), skip=skip(2)),
    "x": fem.Boundary(field[0], mask=mask(on(0)), skip=skip(1, 2)),
    "y": fem.Boundary(field[0], mask=mask(on(1)), skip=skip(0, 2)),
    "move": fem.Boundary(field[0], mask=mask(held), skip=skip(0, 1)),
}
rows = {cell: [] for cell in cells}
for n in range(1, int(MOVES[-1] / STEP) + 1):
    boundaries["move"].value = n * STEP
    dof0, dof1 = fem.dof.partition(field, boundaries)
    ext0 = fem.dof.apply(field, boundaries, dof0)
    result = fem.newtonraphson(items=[solid, Springs()], dof0=dof0, dof1=dof1, ext0=ext0, tol=1e-7, verbose=0)
    if n * STEP in MOVES:
        u = field[0].values
        force = solid.assemble.vector(field).toarray().reshape(-1, 3) + springs[:, None] * u
        print(f"{n * STEP} mm: {4 * force[held, 2].sum():.4f} N", flush=True)
        for cell in cells:
            rows[cell].append(u[[nodes[p] for p in corners(cell)]].mean(axis=0))
with open(target, "w") as file:
    file.write(f"# felupe {fem.__version__}; tests/oracles/gland_large_strain.py\n")
    file.write("i,j,k," + ",".join(f"{axis}{by}_mm" for by in MOVES for axis in "xyz") + "\n")
    for cell in cells:
        numbers = [f"{c:.4f}" for u in rows[cell] for c in u]
        file.write(",".join(map(str, cell)) + "," + ",".join(numbers) + "\n")
