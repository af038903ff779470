"""Five seeds left by a needle in the gland of the scene `paper`: where they rest, forces and motion, by another method.

    python3 seeds_at_rest.py [coarse] [fine]     writes the lines of these meshes, or of both, in seeds_at_rest.csv beside this
                                                 file (minutes, 3 GB; with numpy 2.4.6, scipy 1.17.1, pypardiso 0.4.7)

Body: gland_on_springs.py. Mesh `fine` has shorter pieces and steps as well.

Needle: a cylinder of its own radius, with friction spread over the surface of short pieces; its tip is an evenly loaded sphere of
that radius, which moves as a rigid one. Nearer to the surface than the pages' patch, what it moves itself is that at the patch's
radius: their near field is that of an endless medium (SURFACE_M of 0.7 mm shows what that leaves out). The hand moves in small
steps. In each, the friction of a piece follows a return mapping with a stiff spring: Newton's method with derivatives of the
clipped force, or bounded least squares where that goes in circles. What the tip reaches sticks where it is and begins without
force. The tip cuts at its force, stays, or draws back without force: each a root of y + u(y) = s. The membrane at the entry is a
spring from rest to its force and depth. Then seeds in a column, as docs/physics/seeds.md says, or on a strand.

Lines of the CSV: mesh, friction in N/m, toughness in J/m2, name, numbers. Offsets of seeds from plan in mm, deepest first; total
and tip force in N at 10, 20 and 30 mm, at the turn and before each later drop; displacement along the needle of the mean cell, and of
cells (numbers in the scene's grid), in mm at the turn. Units here: m, N. z along the needle from the entry.
"""
import pathlib
import sys
import time

import numpy as np
import scipy.interpolate
import scipy.linalg
import scipy.optimize
import scipy.special

from gland_on_springs import KELVIN, NEEDLE, POISSON, SHEAR, Body, gauss, kelvin

SEED, SEED_RADIUS = 4.5e-3, 0.4e-3
MEMBRANE_N, MEMBRANE_M = 5.6, 8e-3
WEDGE_N = np.pi * SHEAR * NEEDLE**2
SURFACE_M = 2.5e-3


class Line:
    """Compliance between pieces of the needle's shaft and its tip anywhere along it."""

    def __init__(self, body, piece_m):
        self.length_m = body.size_m
        self.m = int(round(body.size_m / piece_m))
        self.piece_m = body.size_m / self.m
        self.from_m = np.arange(self.m) * self.piece_m
        self.middle_m = self.from_m + self.piece_m / 2
        self.spline = scipy.interpolate.RectBivariateSpline(body.axis_m, body.axis_m, body.kernel, kx=3, ky=3)
        self.ends = body.axis_m[[0, -1]]
        inside = np.clip(self.middle_m, *self.ends)
        endless = np.array([self.shaft_by_shaft(n * self.piece_m) for n in range(self.m)])
        n = np.arange(self.m)
        self.shaft = endless[np.abs(n[:, None] - n)] + self.spline(inside, inside)
        self.shaft = 0.5 * (self.shaft + self.shaft.T)
        assert np.linalg.eigvalsh(self.shaft).min() > 0
        # The tip by places a quarter of its radius apart, with splines between.
        grid = np.arange(0, self.length_m + 1e-9, NEEDLE / 4)
        p, w = gauss(4, 2)
        table = np.zeros((len(grid), self.m))
        for q, weight in zip(p, w):
            at = self.middle_m + q * self.piece_m / 2
            table += weight / 2 * self.sphere(at[None, :] - grid[:, None], NEEDLE)
        table += self.spline(np.clip(grid, *self.ends), inside)
        own = (5 - 6 * POISSON) / (24 * np.pi * SHEAR * (1 - POISSON) * NEEDLE) + np.array([self.spline(a, a)[0, 0] for a in np.clip(grid, SURFACE_M, self.ends[1])])
        self.by_tip, self.own = scipy.interpolate.CubicSpline(grid, table), scipy.interpolate.CubicSpline(grid, own)

    def shaft_by_shaft(self, apart_m):
        """Mean over one piece of what a newton spread over another does, in an endless medium."""
        # Intervals that shrink towards where rings of both pieces are level, where the mean has a logarithm.
        grow = np.concatenate([-np.geomspace(1, 1e-8, 24), [0], np.geomspace(1e-8, 1, 24)]) * self.piece_m
        knots = np.union1d(grow, np.clip(grow - apart_m, -self.piece_m, self.piece_m))
        p, w = gauss(4)
        half = np.diff(knots)[:, None] / 2
        t = knots[:-1, None] + half * (p + 1)
        d2 = (apart_m + t) ** 2
        far2 = 4 * NEEDLE**2 + d2
        k, e = scipy.special.ellipkm1(d2 / far2), scipy.special.ellipe(1 - d2 / far2)
        ring = 2 / np.pi * ((3 - 4 * POISSON) * k + e) / np.sqrt(far2)
        return KELVIN * (half * w * ring * (self.piece_m - np.abs(t))).sum() / self.piece_m**2

    @staticmethod
    def sphere(z, radius):
        """What a newton on a sphere moves at the needle's surface so far along from its middle."""
        r2 = z**2 + NEEDLE**2
        r = np.sqrt(r2)
        beyond = (3 - 4 * POISSON) / r + z**2 / r**3 + radius**2 / 3 * (1 / r**3 - 3 * z**2 / r**5)
        return KELVIN * np.where(r < radius, (10 / 3 - 4 * POISSON) / radius, beyond)


class Needle:
    STIFF = 1e5  # N/m of the spring that stands for sticking

    def __init__(self, line, friction, toughness):
        self.line, self.friction = line, friction
        self.cut_n, self.track_n = 2 * NEEDLE * toughness + WEDGE_N, WEDGE_N
        self.f, self.u, self.s = np.zeros(line.m), np.zeros(line.m), -1e-3
        self.guess, self.fallbacks = self.f, 0
        self.y, self.tip_n, self.track_m, self.is_open = 0.0, 0.0, 0.0, False

    def shaft(self, s, y, tip_n):
        """Forces of all pieces with the tip at y under a force, after a motion of the hand to s; and what they move."""
        covered = np.clip((y - self.line.from_m) / self.line.piece_m, 0, 1)
        by_tip = tip_n * self.line.by_tip(y)
        most = self.friction * self.line.piece_m * covered
        # What the tip reaches sticks where it is, and begins without force.
        f = np.where(self.line.from_m < self.y, np.clip(self.guess, -most, most), 0.0)
        n = np.flatnonzero((covered > 0) & (self.line.from_m < self.y))
        if len(n):
            w = self.line.shaft[np.ix_(n, n)]
            f[n] = self.mapped(w, self.f[n] + self.STIFF * (s - self.s + self.u[n] - by_tip[n]), most[n], f[n])
        self.guess = f
        return f, self.line.shaft @ f + by_tip

    def mapped(self, w, start, most, f):
        for _ in range(30):
            trial = start - self.STIFF * (w @ f)
            clipped = np.clip(trial, -most, most)
            if np.abs(f - clipped).max() < 1e-10:
                return f
            sticks = np.abs(trial) < most
            f, i, o = clipped, np.flatnonzero(sticks), np.flatnonzero(~sticks)
            if len(i):
                right = start[i] - self.STIFF * (w[np.ix_(i, o)] @ f[o])
                f[i] = np.linalg.solve(np.eye(len(i)) + self.STIFF * w[np.ix_(i, i)], right)
        factor = np.linalg.cholesky(w + np.eye(len(w)) / self.STIFF)
        wanted = scipy.linalg.solve_triangular(factor, start / self.STIFF, lower=True)
        self.fallbacks += 1
        return scipy.optimize.lsq_linear(factor.T, wanted, (-most - 1e-15, most + 1e-15), method="bvls", tol=1e-14).x

    def gap(self, s, y, tip_n):
        f, _ = self.shaft(s, y, tip_n)
        return y + f @ self.line.by_tip(y) + tip_n * self.line.own(y) - s

    def move(self, s):
        """A small motion of the hand to s."""
        if not self.is_open:
            force = MEMBRANE_N * s / MEMBRANE_M
            if s < MEMBRANE_M:
                self.tip_n, self.s = max(force, 0.0), s
                return
            self.is_open, self.s = True, s
        limit = self.cut_n if self.y >= self.track_m - 1e-12 else self.track_n
        hold = lambda force: self.gap(s, self.y, force)
        y = self.y
        if hold(limit) < 0:
            self.tip_n = limit
            # By pieces, as each begins where the tip reaches it.
            while y + self.line.piece_m < self.line.length_m and self.gap(s, y + self.line.piece_m, limit) < 0:
                y += self.line.piece_m
                self.f, self.u = self.shaft(s, y, limit)
                self.y, self.s = y, s
            y = self.root(lambda y: self.gap(s, y, limit), y, 1)
            if limit == self.track_n and y > self.track_m:
                raise RuntimeError("the tip meets the end of its track: steps are too long")
        elif hold(0.0) > 0:
            self.tip_n = 0.0
            y = self.root(lambda y: self.gap(s, y, 0.0), y, -1)
        else:
            self.tip_n = scipy.optimize.brentq(hold, 0.0, limit, xtol=1e-12)
        self.f, self.u = self.shaft(s, y, self.tip_n)
        self.y, self.s, self.track_m = y, s, max(self.track_m, y)

    def root(self, of, y, sign):
        """The first root beyond y on this side."""
        before, step = y, 0.05e-3
        while True:
            after = before + sign * step
            if after <= 0:
                return 0.0
            if after >= self.line.length_m:
                return self.line.length_m
            if sign * of(after) >= 0:
                return scipy.optimize.brentq(of, min(before, after), max(before, after), xtol=1e-9)
            before, step = after, min(2 * step, 0.5e-3)


def column(front, y, track, friction, toughness):
    """Fronts of the seeds in one track, deepest first, after one more is held at y: docs/physics/seeds.md."""
    front = list(front)
    p = SEED / (2 * SEED_RADIUS)
    compliance = (np.log(p) - 0.207 + 0.980 / p - 0.133 / p**2) / (2 * np.pi * SHEAR * SEED)
    slides = friction * SEED * SEED_RADIUS / NEEDLE * compliance
    cuts = np.pi * 2 * SEED_RADIUS * toughness * compliance

    def places(by):
        """The seeds ahead when the nearest one slides on by so much."""
        moved, least = front.copy(), -np.inf
        for n in reversed(range(len(front))):
            moved[n] = max(front[n], least, front[n] + by if n == len(front) - 1 else -np.inf)
            least = moved[n] + SEED
        return moved

    def missing(by):
        moved = places(by)
        pushed = [n for n in range(len(front)) if moved[n] > front[n] + 1e-15 or n == len(front) - 1]
        # Seeds that touch the last pushed one are pushed as well.
        while pushed[0] > 0 and moved[pushed[0] - 1] - moved[pushed[0]] <= SEED + 1e-9:
            pushed.insert(0, pushed[0] - 1)
        at_end = moved[pushed[0]] >= track - 1e-9
        return y + SEED - moved[-1] - slides - (cuts / len(pushed) if at_end else 0.0)

    if front:
        if missing(0.0) > 0:
            low, high = 0.0, SEED + 20e-3
            for _ in range(60):
                middle = 0.5 * (low + high)
                low, high = (middle, high) if missing(middle) > 0 else (low, middle)
            front = places(high)
        y = min(y, front[-1] - SEED)
    return front + [y]


def run(line, body, friction, toughness, step_m, centres):
    """The procedure; returns a dictionary of what it shows."""
    needle = Needle(line, friction, toughness)
    drops = [(0.8 - 0.15 * n) * body.size_m for n in range(5)]
    out = {"forces": [], "material": [], "loose": [], "strand": []}

    def go(to):
        count = max(1, int(np.ceil(abs(to - needle.s) / step_m)))
        for s in np.linspace(needle.s, to, count + 1)[1:]:
            needle.move(s)

    def note(name):
        out["forces"].append((name, needle.s, needle.f.sum() + needle.tip_n, needle.tip_n, needle.y))

    turn = drops[0] + SEED / 2
    for s in (10e-3, 20e-3, 30e-3):
        go(s)
        note("in")
    go(turn)
    note("in")
    out["gland"] = motion(body, line, needle, centres)
    fronts = []
    for n, drop in enumerate(drops):
        if n:
            go(drop + SEED / 2)
            note("out")
        out["material"].append(needle.y)
        fronts = column(fronts, needle.y, needle.track_m, friction, toughness)
    off = np.array(drops)
    out["loose"] = np.array(fronts) - SEED / 2 - off
    own = np.array(out["material"]) - SEED / 2
    behind = off[0] - off
    out["strand"] = (own + behind).mean() - behind - off
    out["fallbacks"] = needle.fallbacks
    return out


def motion(body, line, needle, centres):
    """Displacement of the centres of cells of the right half with the needle as it is."""
    places, corrections = centres
    # The corrections of all loads add up at the nodes of the axis.
    weights = np.zeros(len(body.axis_m))
    for z, f in [*zip(line.middle_m, needle.f), (needle.y, needle.tip_n)]:
        z = np.clip(z, *line.ends)
        n = np.clip(np.searchsorted(body.axis_m, z) - 1, 0, len(body.axis_m) - 2)
        part = (z - body.axis_m[n]) / (body.axis_m[n + 1] - body.axis_m[n])
        weights[n] += f * (1 - part)
        weights[n + 1] += f * part
    u = np.einsum("n,npa->pa", weights, corrections)
    no_normal = np.zeros((len(places), 3))
    for z, f in [*zip(line.middle_m, needle.f), (needle.y, needle.tip_n)]:
        if f:
            for angle in (np.arange(8) + 0.5) * np.pi / 4:
                u += f / 8 * kelvin(places - [NEEDLE * np.cos(angle), NEEDLE * np.sin(angle), z], no_normal)[0]
    return u


CASES = [(friction, toughness) for toughness in (164.0, 388.0, 1175.4) for friction in (18.0, 80.0, 210.0)]
TABLE = "# Written by seeds_at_rest.py, which says what the columns are."


def results(body, mesh, piece_m, step_m, centres):
    lines, places = [], centres[0]
    often = np.where(places[:, 0] > 1e-9, 2, 1)
    shown = np.flatnonzero(np.hypot(places[:, 0], places[:, 1]) > 4e-3)[:: len(places) // 40]
    line = Line(body, piece_m)
    for friction, toughness in CASES:
        begun = time.process_time()
        out = run(line, body, friction, toughness, step_m, centres)
        add = lambda name, values, form=".4f": lines.append(
            f"{mesh},{friction:g},{toughness:g},{name}," + ",".join(format(v, form) for v in values)
        )
        add("loose_mm", 1e3 * out["loose"])
        add("strand_mm", 1e3 * out["strand"])
        add("material_mm", 1e3 * np.array(out["material"]))
        add("force_n", [f[2] for f in out["forces"]])
        add("tip_n", [f[3] for f in out["forces"]])
        add("mean_mm", [1e3 * (often * out["gland"][:, 2]).sum() / often.sum()])
        print("\n".join(lines[-6:]))
        print(f"  {out['fallbacks']} by least squares, {time.process_time() - begun:.1f} s", flush=True)
        for n in shown:
            add("cell", [*body.right[n], *1e3 * out["gland"][n]], ".5g")
    return lines


# Length of the pieces and of the steps of the hand.
MESHES = {"coarse": (0.75e-3, 0.5e-3), "fine": (0.2e-3, 0.2e-3)}

if __name__ == "__main__":
    path = pathlib.Path(__file__).parent / "seeds_at_rest.csv"
    for mesh in sys.argv[1:] or MESHES:
        body = Body(mesh)
        print(f"{mesh}: {body.count} cells, {1e3 * body.size_m:.4f} mm along the needle", flush=True)
        body.corrections()
        lines = results(body, mesh, *MESHES[mesh], body.at_centres(body.field))
        kept = path.read_text().splitlines() if path.exists() else []
        kept = [line for line in kept if line and not line.startswith((mesh, "#"))]
        path.write_text("\n".join([TABLE, *kept, *lines]) + "\n")
