"""What linear elasticity leaves out: a patch of the tip's size pushed into a gland, linear and neo-Hookean, by CalculiX.

    python3 gland_neo_hooke.py [folder]     (Debian: calculix-ccx; tested with 2.20)

writes into the folder, by default `neo_hooke` beside this file:

  gland.inp                    the mesh, its springs and its sets
  linear.inp, neo_hooke.inp    what is run: `ccx neo_hooke` in that folder solves it again
  neo_hooke.csv                force on the patch and displacements along z, linear and neo-Hookean, at 4, 8 and 10 mm

Body: as in gland_ccx.py, cells of 2.2 mm inside an ellipsoid of 10 x 8 x 11 cells, E 17 kPa, nu 0.49, on springs to rest of 250 kPa/m;
a quarter of it, as it is symmetric to the planes through its axis. The elements are quadratic with reduced integration (C3D20R), which
do not lock; both runs have the same. Held: 2 x 2 x 2 cells (4.4 mm) about the axis, 4.4 to 8.8 mm behind the apex, moved along z.
A face's spring is shared by its nodes as its mass would be: 3/76 for a corner, 16/76 for the middle of an edge.
Units in the files: mm, N, MPa.
"""
import pathlib
import re
import subprocess
import sys

HALF, H = (10, 8, 11), 2.2
YOUNG, POISSON, FOUNDATION = 17e-3, 0.49, 2.5e-4
HELD_CELLS = [(10, 8, 2), (10, 8, 3)]
MOVES = (4, 8, 10)
folder = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else pathlib.Path(__file__).parent / "neo_hooke")
folder.mkdir(exist_ok=True)

cells = [
    (i, j, k)
    for k in range(2 * HALF[2])
    for j in range(HALF[1], 2 * HALF[1])
    for i in range(HALF[0], 2 * HALF[0])
    if sum(((c + 0.5 - n) / n) ** 2 for c, n in zip((i, j, k), HALF)) <= 1.0
]
known = set(cells)
# Places in half cells. Corners below, corners above, edges below, edges above, upright edges: the order of C3D20R.
BELOW = [(0, 0), (2, 0), (2, 2), (0, 2)]
EDGES = [(1, 0), (2, 1), (1, 2), (0, 1)]
PLACES = (
    [(x, y, 0) for x, y in BELOW]
    + [(x, y, 2) for x, y in BELOW]
    + [(x, y, 0) for x, y in EDGES]
    + [(x, y, 2) for x, y in EDGES]
    + [(x, y, 1) for x, y in BELOW]
)


def places(cell):
    return [tuple(2 * c + p for c, p in zip(cell, place)) for place in PLACES]


nodes = {place: 0 for cell in cells for place in places(cell)}
for n, place in enumerate(sorted(nodes, key=lambda p: p[::-1])):
    nodes[place] = n + 1
springs = {}
for cell in cells:
    for axis in range(3):
        for side in (0, 1):
            beyond = tuple(c + (2 * side - 1) * (a == axis) for a, c in enumerate(cell))
            # The planes of symmetry are no surface.
            if beyond in known or (axis < 2 and side == 0 and cell[axis] == HALF[axis]):
                continue
            for place in places(cell):
                if place[axis] == 2 * (cell[axis] + side):
                    odd = sum(c % 2 for c in place)
                    springs[place] = springs.get(place, 0.0) + FOUNDATION * H * H * (16 if odd else 3) / 76
held = {place for cell in HELD_CELLS for place in places(cell)}
planes = [[p for p in nodes if p[axis] == 2 * HALF[axis] and p not in held] for axis in (0, 1)]
asked = [p for n, p in enumerate(sorted(nodes, key=lambda p: p[::-1])) if n % 12 == 0 and p not in held]


def listed(numbers):
    return [f"{n}," for n in numbers]


mesh = ["*NODE, NSET=ALL"]
mesh += [f"{n}, {p[0] * H / 2:.3f}, {p[1] * H / 2:.3f}, {p[2] * H / 2:.3f}" for p, n in nodes.items()]
mesh.append("*ELEMENT, TYPE=C3D20R, ELSET=GLAND")
for n, cell in enumerate(cells):
    numbers = [str(nodes[p]) for p in places(cell)]
    mesh += [f"{n + 1}, " + ", ".join(numbers[:10]) + ",", ", ".join(numbers[10:])]
number = len(cells)
for n, stiffness in enumerate(sorted(set(springs.values()))):
    for direction in (1, 2, 3):
        mesh.append(f"*ELEMENT, TYPE=SPRING1, ELSET=S{n}_{direction}")
        for place in (p for p, k in springs.items() if k == stiffness):
            number += 1
            mesh.append(f"{number}, {nodes[place]}")
        mesh += [f"*SPRING, ELSET=S{n}_{direction}", f"{direction}", f"{stiffness:.12e}"]
for name, members in (("HELD", held), ("PLANEX", planes[0]), ("PLANEY", planes[1]), ("ASKED", asked)):
    mesh += [f"*NSET, NSET={name}"] + listed(sorted(nodes[p] for p in members))
(folder / "gland.inp").write_text("\n".join(mesh) + "\n")

MU, BULK = YOUNG / (2 * (1 + POISSON)), YOUNG / (3 * (1 - 2 * POISSON))
MATERIALS = {
    "linear": f"*ELASTIC\n{YOUNG}, {POISSON}",
    "neo_hooke": f"*HYPERELASTIC, NEO HOOKE\n{MU / 2:.12e}, {2 / BULK:.12e}",
}
HEAD = "*INCLUDE, INPUT=gland.inp\n*MATERIAL, NAME=TISSUE\n{}\n*SOLID SECTION, ELSET=GLAND, MATERIAL=TISSUE\n"
FIXED = "*BOUNDARY\nPLANEX, 1, 1\nPLANEY, 2, 2\nHELD, 1, 2\n"
PRINT = "*NODE PRINT, NSET=ASKED\nU\n*NODE PRINT, NSET=HELD, TOTALS=ONLY\nRF\n"


def solve(name):
    text = HEAD.format(MATERIALS[name]) + FIXED
    for by in MOVES:
        step = "*STEP\n*STATIC\n" if name == "linear" else "*STEP, NLGEOM, INC=400\n*STATIC\n0.25, 1.\n"
        text += step + f"*BOUNDARY\nHELD, 3, 3, {by}.\n" + PRINT + "*END STEP\n"
    (folder / f"{name}.inp").write_text(text)
    done = subprocess.run(["ccx", "-i", name], cwd=folder, capture_output=True, text=True)
    data = folder / f"{name}.dat"
    if done.returncode != 0 or not data.exists():
        sys.exit(done.stdout[-3000:])
    blocks, rows = {}, None
    for line in data.read_text().splitlines():
        if "for set" in line:
            rows = []
            time = float(line.split()[-1])
            blocks[("force" if line.split()[0] != "displacements" else "u", round(time, 6))] = rows
        elif rows is not None and line.strip():
            fields = line.split()
            rows.append([float(f) for f in (fields[1:4] if re.match(r"\s+\d+\s", line) else fields[:3])])
    for ending in (".dat", ".frd", ".sta", ".cvg", ".12d"):
        (folder / f"{name}{ending}").unlink(missing_ok=True)
    # Steps end at times 1, 2 and 3; a quarter of the patch has a quarter of the force.
    return {by: (4 * blocks[("force", n + 1.0)][0][2], blocks[("u", n + 1.0)]) for n, by in enumerate(MOVES)}


version = subprocess.run(["ccx", "-v"], capture_output=True, text=True).stdout.strip()
results = {name: solve(name) for name in MATERIALS}
for left in ("spooles.out", "neo_hooke.rout", "linear.rout"):
    (folder / left).unlink(missing_ok=True)
with open(folder / "neo_hooke.csv", "w") as file:
    file.write(f"# {version}; tests/oracles/gland_neo_hooke.py; {len(cells)} elements of a quarter, {len(asked)} nodes compared\n")
    file.write("travel_mm,linear_n,neo_hooke_n,field_rms_mm,field_worst_mm\n")
    for by in MOVES:
        (linear_n, a), (large_n, b) = results["linear"][by], results["neo_hooke"][by]
        # As the report has it: nodes that move by more than 1 % of the travel.
        apart = [sum((x - y) ** 2 for x, y in zip(p, q)) ** 0.5 for p, q in zip(a, b) if sum(y * y for y in q) ** 0.5 > 0.01 * by]
        rms = (sum(d * d for d in apart) / len(apart)) ** 0.5
        file.write(f"{by},{linear_n:.6e},{large_n:.6e},{rms:.6e},{max(apart):.6e}\n")
        print(f"{by} mm: force {linear_n:.4f} N linear, {large_n:.4f} N neo-Hookean ({100 * (linear_n / large_n - 1):+.1f} %); "
              f"field {100 * rms / by:.2f} % of travel, RMS, worst {100 * max(apart) / by:.1f} %")
