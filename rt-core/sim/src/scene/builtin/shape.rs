//! Solids that anatomy is drawn with; metres from the middle of the grid.

/// Lowest and highest corner of the box around a solid, m.
pub(super) type Bounds = [[f64; 3]; 2];

/// `|x/a|^n + |y/b|^n + |z/c|^n <= 1`: an ellipsoid for n = 2, a box with round edges for more.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rounded {
    pub centre_m: [f64; 3],
    pub half_m: [f64; 3],
    pub exponent: i32,
}

impl Rounded {
    pub fn contains(&self, place_m: [f64; 3]) -> bool {
        let part = |a: usize| {
            ((place_m[a] - self.centre_m[a]) / self.half_m[a])
                .abs()
                .powi(self.exponent)
        };
        part(0) + part(1) + part(2) <= 1.0
    }

    pub fn bounds_m(&self) -> Bounds {
        let side = |sign: f64| [0, 1, 2].map(|a| self.centre_m[a] + sign * self.half_m[a]);
        [side(-1.0), side(1.0)]
    }

    /// Returns the same solid without its outermost `wall_m`.
    pub fn inside(&self, wall_m: f64) -> Self {
        Self {
            half_m: self.half_m.map(|half| half - wall_m),
            ..*self
        }
    }
}

/// An elliptic tube along z whose lower end is half an ellipsoid.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tube {
    /// Axis in x and y.
    pub centre_m: [f64; 2],
    pub half_m: [f64; 2],
    /// Stretch from the tip of the round end to the open end.
    pub along_m: [f64; 2],
    pub round_end_m: f64,
}

impl Tube {
    pub fn contains(&self, [x, y, z]: [f64; 3]) -> bool {
        let [low, high] = self.along_m;
        let into_end = ((low + self.round_end_m - z) / self.round_end_m).max(0.0);
        let across =
            ((x - self.centre_m[0]) / self.half_m[0]).powi(2) + ((y - self.centre_m[1]) / self.half_m[1]).powi(2);
        z <= high && across + into_end.powi(2) <= 1.0
    }

    pub fn bounds_m(&self) -> Bounds {
        let corner = |sign: f64, z: f64| {
            let [x, y] = [0, 1].map(|a| self.centre_m[a] + sign * self.half_m[a]);
            [x, y, z]
        };
        [corner(-1.0, self.along_m[0]), corner(1.0, self.along_m[1])]
    }

    pub fn inside(&self, wall_m: f64) -> Self {
        Self {
            half_m: self.half_m.map(|half| half - wall_m),
            along_m: [self.along_m[0] + wall_m, self.along_m[1]],
            round_end_m: self.round_end_m - wall_m,
            ..*self
        }
    }
}

/// Everything within a radius of a straight line from one end to the other.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rod {
    pub ends_m: [[f64; 3]; 2],
    pub radius_m: f64,
}

impl Rod {
    pub fn contains(&self, place_m: [f64; 3]) -> bool {
        let [from, to] = self.ends_m;
        let along = [0, 1, 2].map(|a| to[a] - from[a]);
        let there = [0, 1, 2].map(|a| place_m[a] - from[a]);
        let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let share = (dot(along, there) / dot(along, along)).clamp(0.0, 1.0);
        let off = [0, 1, 2].map(|a| there[a] - share * along[a]);
        dot(off, off) <= self.radius_m.powi(2)
    }

    pub fn bounds_m(&self) -> Bounds {
        let [from, to] = self.ends_m;
        [
            [0, 1, 2].map(|a| from[a].min(to[a]) - self.radius_m),
            [0, 1, 2].map(|a| from[a].max(to[a]) + self.radius_m),
        ]
    }
}
