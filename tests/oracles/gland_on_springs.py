"""Motion of the gland of the scene `paper` by a newton along its axis, for `seeds_at_rest.py`.

Body: the cells of the scene, E 17 kPa, nu 0.49, small strain, springs to rest of 250 kPa/m on the area of every outer face. What a newton
moves is Kelvin's solution in an endless medium, in closed form, plus a correction by finite elements that brings the outside to its
springs. The correction is smooth, so no mesh has to resolve the needle. Elements: the cells of half of the gland, which is symmetric;
8 nodes and one dilatation in mesh `coarse`, 20 nodes and a dilatation that is linear in each in mesh `fine`.

Units: m, N. x from the plane of symmetry, y from the needle, z along it from the entry.
"""
import itertools
import time

import numpy as np
import pypardiso
import scipy.sparse as sparse

H, YOUNG, POISSON, SPRING = 1.3641e-3, 17e3, 0.49, 250e3
SHEAR, BULK = YOUNG / 2 / (1 + POISSON), YOUNG / 3 / (1 - 2 * POISSON)
NEEDLE = 0.635e-3
KELVIN = 1 / (16 * np.pi * SHEAR * (1 - POISSON))


# The body: cells of the scene, as in rt-core/sim/src/scene/builtin/paper.rs.
def cells_of_gland():
    z = (np.arange(176) + 0.5 - 88)[None, None, :]
    y = (np.arange(62) + 0.5 - 31)[None, :, None]
    x = (np.arange(107) + 0.5 - 53.5)[:, None, None]
    along = z / 17.33
    wide = 1 + 0.16 * along
    high = np.where(y < 0, 11.49, 15.05)
    with np.errstate(invalid="ignore"):
        across = np.abs(x / (wide * 18.27)) ** 2.2 + np.abs(y / (wide * high)) ** 2.2
        return across <= 1 - np.abs(along) ** 2.2


# Nodes of an element, by mesh: its corners, and the middles of its edges.
NODES = {most: [p for p in itertools.product((-1, 0, 1), repeat=3) if sum(c == 0 for c in p) <= n] for n, most in enumerate(("coarse", "fine"))}


class Body:
    """Finite elements on half of the gland; x from the plane of symmetry, y from the needle, z from the entry."""

    def __init__(self, kind):
        self.kind, self.nodes = kind, NODES[kind]
        full = cells_of_gland()
        used = np.argwhere(full)
        low, high = used.min(0), used.max(0) + 1
        self.count = len(used)
        self.cells = full[low[0] : high[0], low[1] : high[1], low[2] : high[2]]
        middle = 0.5 * (low + high)
        assert middle[0] == 53.5 and (self.cells == self.cells[::-1]).all()
        self.size_m = self.cells.shape[2] * H
        on_axis = self.cells[int(middle[0]) - low[0], int(middle[1] - 1e-9) - low[1]]
        assert on_axis.all()
        self.used, self.centres_m = used, (used + 0.5 - [middle[0], middle[1], low[2]]) * H
        # Lines of the grid along each axis, in cells; the needle's own are among them.
        faces = [np.arange(n + 1) - c for n, c in zip(self.cells.shape, [middle[0] - low[0], middle[1] - low[1], 0])]
        lines = [np.unique(np.concatenate([faces[0][faces[0] > 0], [0.0]])), np.union1d(faces[1], [0.0]), faces[2]]
        self.lines = lines
        mid = [0.5 * (a[1:] + a[:-1]) for a in lines]
        index = [np.floor(m - f[0]).astype(int) for m, f in zip(mid, faces)]
        self.filled = self.cells[np.ix_(*index)]
        self.steps = [np.diff(a) * H for a in lines]
        self.assemble()

    def assemble(self):
        elements = np.argwhere(self.filled)
        grid = 2 * np.array(self.filled.shape) + 1
        offsets = 1 + np.array(self.nodes)
        nodes = 2 * elements[:, None, :] + offsets
        flat = np.ravel_multi_index(nodes.reshape(-1, 3).T, grid).reshape(len(elements), -1)
        ids, connected = np.unique(flat, return_inverse=True)
        self.connected = connected.reshape(len(elements), -1)
        self.ids, self.grid = ids, grid
        size = 3 * len(ids)
        kinds = {}
        for n, e in enumerate(elements):
            edges = tuple(round(s[i], 12) for s, i in zip(self.steps, e))
            kinds.setdefault(edges, []).append(n)
        rows, columns, values = [], [], []
        for edges, members in kinds.items():
            block = self.stiffness(np.array(edges))
            dofs = (3 * self.connected[members][:, :, None] + np.arange(3)).reshape(len(members), -1)
            rows.append(np.repeat(dofs, dofs.shape[1], 1).ravel())
            columns.append(np.tile(dofs, (1, dofs.shape[1])).ravel())
            values.append(np.tile(block.ravel(), len(members)))
        # Outer faces, with their springs. The plane of symmetry is none.
        self.faces = []
        for axis, side in itertools.product(range(3), (0, 1)):
            beyond = np.zeros_like(self.filled)
            ahead, here = [slice(None)] * 3, [slice(None)] * 3
            ahead[axis], here[axis] = (slice(1, None), slice(None, -1)) if side else (slice(None, -1), slice(1, None))
            beyond[tuple(here)] = self.filled[tuple(ahead)]
            if axis == 0 and side == 0:
                beyond[0] = True
            for n in np.flatnonzero(~beyond[tuple(elements.T)]):
                self.faces.append((n, axis, side))
        self.quadrature(elements)
        q = self.face_shape
        blocks = SPRING * np.einsum("p,pi,pj->pij", self.face_weight, q, q)
        for a in range(3):
            dofs = 3 * self.connected[self.face_element] + a
            rows.append(np.repeat(dofs, dofs.shape[1], 1).ravel())
            columns.append(np.tile(dofs, (1, dofs.shape[1])).ravel())
            values.append(blocks.ravel())
        matrix = sparse.coo_matrix((np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), (size, size)).tocsr()
        places = np.array(np.unravel_index(ids, grid)).T
        self.node_m = np.stack([np.interp(places[:, a] / 2, np.arange(len(l)), l) * H for a, l in enumerate(self.lines)], 1)
        self.free = np.ones(size, bool)
        self.free[3 * np.flatnonzero(places[:, 0] == 0)] = False
        self.matrix = matrix[self.free][:, self.free]

    def quadrature(self, elements):
        shape, weight, place, normal, owner = [], [], [], [], []
        for n, axis, side in self.faces:
            e = elements[n]
            low = np.array([self.lines[a][e[a]] * H for a in range(3)])
            edge = np.array([self.steps[a][e[a]] for a in range(3)])
            middle = low + edge / 2
            # Where the needle comes near the surface, the load of Kelvin's solution is narrow.
            parts = 6 if axis == 2 and np.hypot(middle[0], middle[1]) < 4e-3 else 1
            points, weights = gauss(3, parts)
            local = np.zeros((len(points) ** 2, 3))
            others = [a for a in range(3) if a != axis]
            local[:, others[0]], local[:, others[1]] = np.repeat(points, len(points)), np.tile(points, len(points))
            local[:, axis] = 2 * side - 1
            shape.append(self.shapes(local)[0])
            weight.append(np.outer(weights, weights).ravel() * edge[others[0]] * edge[others[1]] / 4)
            place.append(low + (local + 1) / 2 * edge)
            normal.append(np.tile(np.eye(3)[axis] * (2 * side - 1), (len(local), 1)))
            owner.append(np.full(len(local), n))
        self.face_shape, self.face_weight = np.concatenate(shape), np.concatenate(weight)
        self.face_m, self.face_normal, self.face_element = np.concatenate(place), np.concatenate(normal), np.concatenate(owner)

    def corrections(self):
        """Solves for a newton along z spread on a ring of the needle's surface at each node of the axis."""
        on_axis = np.flatnonzero((np.abs(self.node_m[:, 0]) < 1e-9) & (np.abs(self.node_m[:, 1]) < 1e-9))
        on_axis = on_axis[np.argsort(self.node_m[on_axis, 2])]
        self.axis_m = self.node_m[on_axis, 2]
        inside = (self.axis_m > 0.3e-3) & (self.axis_m < self.size_m - 0.3e-3)
        on_axis, self.axis_m = on_axis[inside], self.axis_m[inside]
        loads = np.zeros((len(self.axis_m), self.free.size))
        spread_m2 = self.face_weight.sum()
        for n, z in enumerate(self.axis_m):
            pull = np.zeros((len(self.face_m), 3))
            for angle in (np.arange(8) + 0.5) * np.pi / 4:
                at = np.array([NEEDLE * np.cos(angle), NEEDLE * np.sin(angle), z])
                u, t = kelvin(self.face_m - at, self.face_normal)
                pull -= (t + SPRING * u) / 8
            each = self.face_weight[:, None, None] * self.face_shape[:, :, None] * pull[:, None, :]
            for a in range(3):
                np.add.at(loads[n], 3 * self.connected[self.face_element] + a, each[:, :, a])
        begun = time.time()
        solver = pypardiso.PyPardisoSolver(mtype=2)
        upper = sparse.triu(self.matrix, format="csr")
        solver.factorize(upper)
        v = np.zeros((len(self.axis_m), self.free.size))
        for first in range(0, len(v), 16):
            v[first : first + 16, self.free] = solver.solve(upper, np.asfortranarray(loads[first : first + 16, self.free].T)).T
        solver.free_memory(everything=True)
        left = np.abs(self.matrix @ v[0, self.free] - loads[0, self.free]).max() / np.abs(loads[0]).max()
        print(f"{self.filled.sum()} elements, {self.free.sum()} unknowns, outer area {2e6 * spread_m2:.0f} mm2, "
              f"{len(v)} loads in {time.time() - begun:.0f} s, residual {left:.1e}")
        v = v.reshape(len(v), -1, 3)
        kernel = v[:, on_axis, 2]
        print(f"correction along the axis symmetric to {np.abs(kernel - kernel.T).max() / np.abs(kernel).max():.1e}")
        self.kernel = 0.5 * (kernel + kernel.T)
        # What the springs carry of a newton.
        carried = [2 * SPRING * (self.face_weight * np.einsum("pi,pi->p", self.face_shape, v[n, self.connected[self.face_element], 2])).sum() for n in (5, len(v) // 2)]
        for n, c in zip((5, len(v) // 2), carried):
            u = np.mean([kelvin(self.face_m - [NEEDLE * np.cos(t), NEEDLE * np.sin(t), self.axis_m[n]], self.face_normal)[0][:, 2] for t in (np.arange(8) + 0.5) * np.pi / 4], 0)
            print(f"springs carry {c + 2 * SPRING * (self.face_weight * u).sum():.6f} N of 1 N")
        self.field = v
        return self

    def shapes(self, x):
        """Shape functions of an element and their slopes, at points between -1 and 1."""
        x = np.atleast_2d(x)
        n, slope = np.zeros((len(x), len(self.nodes))), np.zeros((len(x), len(self.nodes), 3))
        for i, p in enumerate(self.nodes):
            f = [(1 - x[:, a] ** 2) if p[a] == 0 else 0.5 * (1 + p[a] * x[:, a]) for a in range(3)]
            d = [-2 * x[:, a] if p[a] == 0 else np.full(len(x), 0.5 * p[a]) for a in range(3)]
            has_edges = self.kind == "fine" and 0 not in p
            g, gd = (x @ np.array(p) - 2, np.array(p, float)) if has_edges else (np.ones(len(x)), np.zeros(3))
            n[:, i] = f[0] * f[1] * f[2] * g
            slope[:, i, 0] = (d[0] * g + f[0] * gd[0]) * f[1] * f[2]
            slope[:, i, 1] = (d[1] * g + f[1] * gd[1]) * f[0] * f[2]
            slope[:, i, 2] = (d[2] * g + f[2] * gd[2]) * f[0] * f[1]
        return n, slope

    def stiffness(self, edges):
        """Stiffness of a brick; its dilatation is linear in it with 20 nodes, and constant with 8."""
        p, w = gauss(3)
        x = np.array(list(itertools.product(p, p, p)))
        w = np.array([a * b * c for a, b, c in itertools.product(w, w, w)]) * edges.prod() / 8
        slope = self.shapes(x)[1] * (2 / edges)
        dilatation = slope.reshape(len(x), -1)
        linear = np.column_stack([np.ones(len(x)), x]) if self.kind == "fine" else np.ones((len(x), 1))
        moment = np.einsum("p,pi,pj->ij", w, linear, dilatation)
        k = BULK * moment.T @ np.linalg.solve(np.einsum("p,pi,pj->ij", w, linear, linear), moment)
        strain = np.zeros((len(x), 6, 3 * len(self.nodes)))
        for a in range(3):
            strain[:, a, a::3] = slope[:, :, a]
        for row, (a, b) in enumerate([(0, 1), (1, 2), (2, 0)], 3):
            strain[:, row, a::3], strain[:, row, b::3] = slope[:, :, b], slope[:, :, a]
        deviator = np.diag([2.0, 2, 2, 1, 1, 1])
        deviator[:3, :3] -= 2 / 3
        return k + SHEAR * np.einsum("p,pai,ab,pbj->ij", w, strain, deviator, strain)

    def at_centres(self, field):
        """Values at centres of the scene's cells of the right half."""
        is_right = self.centres_m[:, 0] >= -1e-9
        right, self.right = self.centres_m[is_right], self.used[is_right]
        out = np.zeros((len(field), len(right), 3))
        which = [np.clip(np.searchsorted(l * H, right[:, a] + 1e-9, side="right") - 1, 0, len(l) - 2) for a, l in enumerate(self.lines)]
        number = -np.ones(self.filled.shape, int)
        number[tuple(np.argwhere(self.filled).T)] = np.arange(self.filled.sum())
        owner = number[tuple(which)]
        assert (owner >= 0).all()
        local = np.stack([2 * (right[:, a] - l[which[a]] * H) / self.steps[a][which[a]] - 1 for a, l in enumerate(self.lines)], 1)
        shape = self.shapes(local)[0]
        for n in range(len(field)):
            out[n] = np.einsum("pi,pia->pa", shape, field[n][self.connected[owner]])
        return right, out


def gauss(order, parts=1):
    p, w = np.polynomial.legendre.leggauss(order)
    starts = -1 + 2 * np.arange(parts) / parts
    return (starts[:, None] + (p + 1) / parts).ravel(), np.tile(w / parts, parts)


def kelvin(x, normal):
    """Displacement and traction of a newton along z at the origin of an endless medium."""
    r = np.linalg.norm(x, axis=1)[:, None]
    z, ez = x[:, 2:3], np.array([0.0, 0, 1])
    u = KELVIN * ((3 - 4 * POISSON) * ez / r + z * x / r**3)
    along = (x * normal).sum(1)[:, None]
    t = (1 - 2 * POISSON) * (ez * along + x * normal[:, 2:3] - normal * z) / r**3 + 3 * x * z * along / r**5
    return u, -t / (8 * np.pi * (1 - POISSON))
