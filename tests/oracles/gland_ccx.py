"""A gland on its foundation, solved by CalculiX (Debian: calculix-ccx 2.20; its C3D8 is fully integrated, see gland_bbar.py).

    python3 gland_ccx.py [folder for the results, by default that of the tests that read them]

writes the input files, runs ccx on them, and keeps what the tests compare with:

  gland_linear.csv   1 N along z on the element at the apex end of the axis, an eighth at each of its nodes: displacements, mm
  gland_moved.csv    that element moved by 4 and 8 mm along z, linear and neo-Hookean with large displacements: force, displacements

Body: cells of 2.2 mm whose centre is inside an ellipsoid of 10 x 8 x 11 cells; E 17 kPa, nu 0.49; springs to rest of 250 kPa/m on
all free faces, a quarter of each face at each of its nodes. Units in the files: mm, N, MPa.
"""
import pathlib
import re
import subprocess
import sys
import tempfile

HALF = (10, 8, 11)
H = 2.2
YOUNG, POISSON = 17e-3, 0.49
FOUNDATION = 2.5e-4  # N/mm^3, which is 250 kPa/m
AT = (10, 8, 2)

cells = [
    (i, j, k)
    for k in range(2 * HALF[2])
    for j in range(2 * HALF[1])
    for i in range(2 * HALF[0])
    if sum(((c + 0.5 - n) / n) ** 2 for c, n in zip((i, j, k), HALF)) <= 1.0
]
known = set(cells)
CORNERS = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
nodes, quarters = {}, {}
for cell in cells:
    for corner in CORNERS:
        nodes.setdefault(tuple(a + b for a, b in zip(cell, corner)), 0)
for n, place in enumerate(sorted(nodes, key=lambda p: p[::-1])):
    nodes[place] = n + 1
for cell in cells:
    for axis in range(3):
        for side in (0, 1):
            beyond = list(cell)
            beyond[axis] += 2 * side - 1
            if tuple(beyond) not in known:
                for corner in CORNERS:
                    if corner[axis] == side:
                        place = tuple(a + b for a, b in zip(cell, corner))
                        quarters[place] = quarters.get(place, 0) + 1
assert AT in known
held = [nodes[tuple(a + b for a, b in zip(AT, corner))] for corner in CORNERS]
asked = sorted(nodes.values())[:: max(1, len(nodes) // 60)] + held


def model(material):
    lines = ["*NODE, NSET=ALL"]
    lines += [f"{n}, {x * H:.6f}, {y * H:.6f}, {z * H:.6f}" for (x, y, z), n in nodes.items()]
    lines.append("*ELEMENT, TYPE=C3D8, ELSET=GLAND")
    for n, cell in enumerate(cells):
        corners = [nodes[tuple(a + b for a, b in zip(cell, corner))] for corner in CORNERS]
        lines.append(", ".join(map(str, [n + 1] + corners)))
    lines += ["*MATERIAL, NAME=TISSUE", material, "*SOLID SECTION, ELSET=GLAND, MATERIAL=TISSUE"]
    number = len(cells)
    for count in sorted(set(quarters.values())):
        for direction in (1, 2, 3):
            lines.append(f"*ELEMENT, TYPE=SPRING1, ELSET=S{count}_{direction}")
            for place, quarter in quarters.items():
                if quarter == count:
                    number += 1
                    lines.append(f"{number}, {nodes[place]}")
            lines += [f"*SPRING, ELSET=S{count}_{direction}", f"{direction}", f"{count * FOUNDATION * H * H / 4:.12e}"]
    lines += ["*NSET, NSET=ASKED"] + [f"{n}," for n in asked] + ["*NSET, NSET=HELD"] + [f"{n}," for n in held]
    return lines


def run(name, lines, folder):
    (folder / f"{name}.inp").write_text("\n".join(lines) + "\n")
    done = subprocess.run(["ccx", "-i", name], cwd=folder, capture_output=True, text=True)
    if done.returncode != 0 or not (folder / f"{name}.dat").exists():
        sys.exit(done.stdout[-3000:])
    blocks, rows = [], None
    for line in (folder / f"{name}.dat").read_text().splitlines():
        if "for set" in line:
            rows = []
            blocks.append((line.split()[0], float(line.split()[-1]), rows))
        elif re.match(r"\s+\d+\s", line):
            fields = line.split()
            rows.append((int(fields[0]), *map(float, fields[1:4])))
        elif rows is not None and line.strip():
            rows.append((0, *map(float, line.split()[:3])))
    return blocks


def write(path, header, rows):
    place_of = {n: place for place, n in nodes.items()}
    with open(path, "w") as file:
        file.write(header)
        for n, *u in rows:
            file.write(",".join(map(str, place_of[n])) + "," + ",".join(f"{v:.7e}" for v in u) + "\n")


ELASTIC = f"*ELASTIC\n{YOUNG}, {POISSON}"
MU, BULK = YOUNG / (2 * (1 + POISSON)), YOUNG / (3 * (1 - 2 * POISSON))
NEO_HOOKE = f"*HYPERELASTIC, NEO HOOKE\n{MU / 2:.12e}, {2 / BULK:.12e}"
PRINT = ["*NODE PRINT, NSET=ASKED", "U", "*NODE PRINT, NSET=HELD, TOTALS=ONLY", "RF"]
version = subprocess.run(["ccx", "-v"], capture_output=True, text=True).stdout.strip()
out = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else pathlib.Path(__file__).parent)
with tempfile.TemporaryDirectory() as folder:
    folder = pathlib.Path(folder)
    load = ["*STEP", "*STATIC", "*CLOAD"] + [f"{n}, 3, 0.125" for n in held] + PRINT[:2] + ["*END STEP"]
    linear = run("load", model(ELASTIC) + load, folder)
    head = f"# {version}; tests/oracles/gland_ccx.py; {len(cells)} elements. Node in cells, displacement in mm for 1 N\n"
    write(out / "gland_linear.csv", head, linear[0][2])
    head = f"# {version}; tests/oracles/gland_ccx.py; {len(cells)} elements. Node in cells, displacement in mm\n"
    text = ""
    for by in (4, 8):
        results = []
        for name, material, step in (
            ("linear", ELASTIC, ["*STEP", "*STATIC"]),
            ("neo_hooke", NEO_HOOKE, ["*STEP, NLGEOM, INC=400", "*STATIC", "0.1, 1."]),
        ):
            move = ["*BOUNDARY"] + [f"HELD, 1, 2, 0.", f"HELD, 3, 3, {by}."]
            blocks = run(f"{name}_{by}", model(material) + step + move + PRINT + ["*END STEP"], folder)
            last = [b for b in blocks if b[1] == blocks[-1][1]]
            u = next(b[2] for b in last if b[0] == "displacements")
            force = next(b[2] for b in last if b[0] != "displacements")[-1][3]
            results.append((u, force))
            text += f"# {name} moved by {by} mm: force {force:.6e} N\n"
            write(folder / f"{name}_{by}.csv", "", u)
            text += "".join(f"{name},{by},{line}\n" for line in (folder / f"{name}_{by}.csv").read_text().splitlines())
        (a, fa), (b, fb) = results
        square = [sum((x - y) ** 2 for x, y in zip(p[1:], q[1:])) for p, q in zip(a, b)]
        rms = (sum(square) / len(square)) ** 0.5
        print(f"moved by {by} mm: force linear {fa:.4f} N, neo-Hookean {fb:.4f} N ({100 * (fa / fb - 1):+.2f} %); "
              f"difference of displacements, RMS over {len(square)} nodes, {100 * rms / by:.2f} % of travel")
    (out / "gland_moved.csv").write_text(head + text)
