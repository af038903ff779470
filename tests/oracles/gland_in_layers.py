"""Motion of the gland of the scene `paper` in a shell of soft tissue whose outside is fixed, by a newton along the needle's line.

    python3 gland_in_layers.py     writes gland_in_layers.csv; needs numpy, scipy and pypardiso

Body: the cells of the scene, E 17 kPa, nu 0.49, small strain. Around it, every cell whose centre is at most THICKNESS from the nearest
cell's centre (their distance is measured between centres, less half a cell): E 5 kPa, nu 0.49, perfectly bonded. Nodes of the shell's
outside do not move. Beside it the same gland on springs to rest, per area. Elements: the cells of half of the gland, which is symmetric,
with 8 nodes and one dilatation each. The load is on the needle's axis, or spread evenly over all nodes of the gland by volume.

Units: m, N. x from the plane of symmetry, y from the needle, z along it from the entry.
"""
import itertools
import pathlib
import sys
import time

import numpy as np
import pypardiso
import scipy.ndimage
import scipy.sparse as sparse

from gland_on_springs import H, POISSON, YOUNG, cells_of_gland, gauss

THICKNESS, FAT = 20e-3, 5e3
CORNERS = np.array(list(itertools.product((0, 1), repeat=3)))


def stiffness(edges, young, poisson=POISSON):
    """Stiffness of a brick whose dilatation is its mean."""
    shear, bulk = young / 2 / (1 + poisson), young / 3 / (1 - 2 * poisson)
    p, w = gauss(3)
    matrix, mean = np.zeros((24, 24)), np.zeros(24)
    deviator = np.diag([2.0, 2, 2, 1, 1, 1])
    deviator[:3, :3] -= 2 / 3
    for (x, a), (y, b), (z, c) in itertools.product(zip(p, w), repeat=3):
        sides = 2 * CORNERS - 1
        f = 0.5 * (1 + sides * np.array([x, y, z]))
        d = 0.5 * sides * 2 / edges
        slope = np.stack([d[:, 0] * f[:, 1] * f[:, 2], f[:, 0] * d[:, 1] * f[:, 2], f[:, 0] * f[:, 1] * d[:, 2]], 1)
        strain = np.zeros((6, 24))
        for n in range(3):
            strain[n, n::3] = slope[:, n]
        for row, (n, m) in enumerate([(0, 1), (1, 2), (2, 0)], 3):
            strain[row, n::3], strain[row, m::3] = slope[:, m], slope[:, n]
        weight = a * b * c * edges.prod() / 8
        matrix += weight * shear * strain.T @ deviator @ strain
        mean += weight * slope.ravel()
    return matrix + bulk * np.outer(mean, mean) / edges.prod()


class Half:
    """Half of the gland, x from the plane of symmetry, in so many cells of empty room on the other five sides."""

    def __init__(self, thickness=THICKNESS):
        full = cells_of_gland()
        used = np.argwhere(full)
        low, high = used.min(0), used.max(0) + 1
        gland = full[low[0] : high[0], low[1] : high[1], low[2] : high[2]]
        room = int(np.ceil(thickness / H)) + 1
        gland = np.pad(gland, room)
        middle_x = gland.shape[0] // 2
        assert (gland == gland[::-1]).all() and gland.shape[0] % 2
        distance = scipy.ndimage.distance_transform_edt(~gland) - 0.5
        self.distance_m = distance[middle_x:] * H
        self.gland = gland[middle_x:]
        self.cells = self.distance_m <= thickness
        # The first row of cells is cut by the plane of symmetry.
        x = np.concatenate([[0.0], np.arange(self.gland.shape[0]) + 0.5])
        middle_y = 0.5 * (low[1] + high[1])
        y = np.arange(gland.shape[1] + 1) - room - (31 - low[1])
        z = np.arange(gland.shape[2] + 1) - room
        self.lines = [x * H, y * H, z * H]
        self.nodes = np.array([len(l) for l in self.lines])

    def elements(self, cells):
        """Nodes of each cell."""
        at = np.argwhere(cells)
        return np.ravel_multi_index((at[:, None, :] + CORNERS).reshape(-1, 3).T, self.nodes).reshape(len(at), 8)

    def matrix(self, cells, young):
        """Stiffness of these cells on all nodes of the box; `young` of each."""
        nodes, at = self.elements(cells), np.argwhere(cells)
        values = np.zeros((len(nodes), 576))
        for is_cut in (False, True):
            which = (at[:, 0] == 0) == is_cut
            values[which] = stiffness(H * np.array([0.5 if is_cut else 1, 1, 1]), 1.0).ravel()
        values *= np.broadcast_to(young, len(nodes))[:, None]
        dofs = (3 * nodes[:, :, None] + np.arange(3)).reshape(len(nodes), 24)
        size = 3 * self.nodes.prod()
        return sparse.coo_matrix((values.ravel(), (np.repeat(dofs, 24, 1).ravel(), np.tile(dofs, (1, 24)).ravel())), (size, size)).tocsr()

    def area_m2(self):
        """Share of each node in the outer faces of the gland."""
        area = np.zeros(self.nodes.prod())
        padded = np.pad(self.gland, 1)
        padded[0] = padded[1]
        for axis, side in itertools.product(range(3), (0, 1)):
            beyond = np.roll(padded, 1 - 2 * side, axis)[1:-1, 1:-1, 1:-1]
            at = np.argwhere(self.gland & ~beyond)
            corners = CORNERS[CORNERS[:, axis] == side]
            nodes = np.ravel_multi_index((at[:, None, :] + corners).reshape(-1, 3).T, self.nodes)
            share = np.ones(len(at)) if axis == 0 else np.where(at[:, 0] == 0, 0.5, 1.0)
            np.add.at(area, nodes, np.repeat(share, 4) * H * H / 4)
        return area

    def volume_m3(self):
        """Share of each node in the gland."""
        volume = np.zeros(self.nodes.prod())
        share = np.where(np.argwhere(self.gland)[:, 0] == 0, 0.5, 1.0)
        np.add.at(volume, self.elements(self.gland).ravel(), np.repeat(share, 8) * H**3 / 8)
        return volume

    def places_m(self):
        return np.stack(np.meshgrid(*self.lines, indexing="ij"), 3).reshape(-1, 3)

    def free(self, cells, fixed=None):
        """Unknowns of the nodes of these cells, without those across the plane of symmetry and those that are fixed."""
        free = np.zeros((self.nodes.prod(), 3), bool)
        free[np.unique(self.elements(cells))] = True
        free[self.places_m()[:, 0] < 1e-9, 0] = False
        if fixed is not None:
            free[fixed] = False
        return free.ravel()

    def outside(self):
        """Nodes of the shell that a cell beyond it has as well."""
        beyond = ~self.cells
        return np.intersect1d(np.unique(self.elements(self.cells)), np.unique(self.elements(beyond)))


class Solver:
    def __init__(self, matrix, free):
        self.free, self.size = free, len(free)
        self.upper = sparse.triu(matrix[free][:, free], format="csr")
        self.solver = pypardiso.PyPardisoSolver(mtype=2)
        self.solver.factorize(self.upper)

    def __call__(self, loads):
        u = np.zeros(loads.shape)
        right = np.asfortranarray(loads[:, self.free].T)
        u[:, self.free] = np.atleast_2d(self.solver.solve(self.upper, right).T)
        return u

    def close(self):
        self.solver.free_memory(everything=True)


def loads_of(half):
    """A newton along z at nodes of the axis at five depths, then spread over the gland along y and z; half of it on this half."""
    places, volume = half.places_m(), half.volume_m3()
    on_axis = np.flatnonzero((np.abs(places[:, 0]) < 1e-9) & (np.abs(places[:, 1]) < 1e-9) & (volume > 0))
    depth = places[on_axis, 2]
    wanted = np.array([4, 13, 22, 31, 40]) * 1e-3
    at = [on_axis[np.argmin(np.abs(depth - w))] for w in wanted]
    loads = np.zeros((len(at) + 2, 3 * len(places)))
    for row, node in enumerate(at):
        loads[row, 3 * node + 2] = 0.5
    loads[-2, 1::3] = 0.5 * volume / volume.sum()
    loads[-1, 2::3] = 0.5 * volume / volume.sum()
    return places[at, 2], loads


def shell(half, loads, thickness=THICKNESS, fat=FAT):
    young = np.where(half.gland, YOUNG, fat)[half.cells]
    solver = Solver(half.matrix(half.cells, young), half.free(half.cells, half.outside()))
    u = solver(loads)
    solver.close()
    return u


def on_springs(half, loads, springs_pa_per_m):
    size = 3 * half.nodes.prod()
    matrix = half.matrix(half.gland, YOUNG) + sparse.diags(np.repeat(springs_pa_per_m * half.area_m2(), 3))
    solver = Solver(matrix.tocsr(), half.free(half.gland))
    u = solver(loads)
    solver.close()
    return u


def at_centres(half, u, cells):
    """Displacement of the centres of cells of the box."""
    nodes = np.ravel_multi_index((np.array(cells)[:, None, :] + CORNERS).reshape(-1, 3).T, half.nodes).reshape(len(cells), 8)
    return u.reshape(len(u), -1, 3)[:, nodes].mean(2)


def main():
    half = Half()
    depths, loads = loads_of(half)
    names = [f"{d / H:.0f}" for d in depths] + ["even y", "even z"]
    print(half.gland.sum(), half.cells.sum(), "cells of the half,", f"{2e6 * half.area_m2().sum():.0f} mm2")
    weight = half.volume_m3() / half.volume_m3().sum()
    # Cells of the surface: the ends along each axis from a cell near the middle, and the corners between.
    gland = half.gland.copy()
    gland[0] = False
    at = np.argwhere(gland)
    middle = np.array([0, *at[:, 1:].mean(0)])
    ways = [w for w in itertools.product((0, 1), (-1, 0, 1), (-1, 0, 1)) if any(w)]
    cells = [at[np.argmax((at - middle) @ np.array(w) / np.linalg.norm(w) - 0.2 * np.linalg.norm(np.cross(at - middle, w), axis=1) / np.linalg.norm(w))] for w in ways]
    # In the scene: x from the cell in the middle, which is cut.
    low_z = np.argwhere(cells_of_gland())[:, 2].min()
    first = np.array([53, 31 + round(half.lines[1][0] / H), low_z + round(half.lines[2][0] / H)])
    begun = time.time()
    with open(pathlib.Path(__file__).with_suffix(".csv"), "w") as out:
        print("# Written by gland_in_layers.py: surroundings, load (depth in cells, or spread evenly), the gland's mean or a cell; mm/N", file=out)
        for name, u in (("shell", shell(half, loads)), ("springs", on_springs(half, loads, FAT / THICKNESS))):
            mean = np.einsum("n,lna->la", weight, u.reshape(len(loads), -1, 3))
            # Both halves together do not move to the side.
            mean[:, 0] = 0
            centres = at_centres(half, u, cells)
            for n, load in enumerate(names):
                row = lambda v: ",".join(f"{1e3 * c:.5f}" for c in v)
                print(f"{name},{load},mean,{row(mean[n])}", file=out)
                for cell, v in zip(cells, centres[n]):
                    # Near a load on a point, the answer is that of the mesh.
                    if n < len(depths) and np.linalg.norm([cell[0] * H, half.lines[1][cell[1]], half.lines[2][cell[2]] - depths[n]]) < 15e-3:
                        continue
                    place = " ".join(str(c) for c in cell + first)
                    print(f"{name},{load},{place},{row(v)}", file=out)
            print(name, f"{time.time() - begun:.0f} s", np.round(1e3 * mean[:, 1:], 4).tolist())


if __name__ == "__main__":
    main()
