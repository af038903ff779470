//! Interpolates positions that a message omits: until they are received themselves, they move with their neighbours.
//!
//! The displacements of received positions since their last reception, and the times between, are spread to the corners
//! of a lattice, with the weights by which it is read there (normalised convolution, Knutsson and Westin 1993). Without
//! motion nothing is added.

/// Bounding box of all positions at rest, m.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Bounds {
    lower: [f32; 3],
    upper: [f32; 3],
}

impl Bounds {
    pub fn of(places_m: &[[f32; 3]]) -> Self {
        let first = places_m.first().copied().unwrap_or_default();
        let both = |f: fn(f32, f32) -> f32| places_m.iter().fold(first, |a, b| [0, 1, 2].map(|i| f(a[i], b[i])));
        Self {
            lower: both(f32::min),
            upper: both(f32::max),
        }
    }
}

/// Most corners along an axis.
const MOST_CORNERS: f32 = 64.0;

/// Displacements with times on a lattice about as fine as the positions in a message.
pub(super) struct Lattice {
    lower_m: [f32; 3],
    per_m: f32,
    corners: [usize; 3],
    /// Weighted sums, and the weights.
    sums: Vec<[f32; 5]>,
    has_moved: bool,
}

impl Lattice {
    /// Returns a lattice for that many positions within `bounds`.
    pub fn new(bounds: &Bounds, places: usize) -> Self {
        let extent_m = [0, 1, 2].map(|i| bounds.upper[i] - bounds.lower[i]);
        let longest_m = extent_m.into_iter().fold(0.0, f32::max);
        let volume_m3: f32 = extent_m.iter().product();
        let cell_m = (volume_m3 / places.max(1) as f32).cbrt().max(longest_m / MOST_CORNERS);
        // A scene without an extent has one corner, as does one with positions that are not numbers.
        let per_m = Some(1.0 / cell_m).filter(|per_m| per_m.is_finite()).unwrap_or(0.0);
        let corners = extent_m.map(|extent_m| (extent_m * per_m).clamp(0.0, MOST_CORNERS) as usize + 2);
        Self {
            lower_m: bounds.lower,
            per_m,
            corners,
            sums: vec![[0.0; 5]; corners.iter().product()],
            has_moved: false,
        }
    }

    /// True if any displacement was not 0; otherwise there is nothing to read.
    pub fn has_moved(&self) -> bool {
        self.has_moved
    }

    /// Returns the eight corners around a position, with their weights.
    #[inline]
    fn around(&self, place_m: [f32; 3]) -> [(usize, f32); 8] {
        let (mut low, mut share) = ([0; 3], [0.0; 3]);
        for i in 0..3 {
            let at = (place_m[i] - self.lower_m[i]) * self.per_m;
            low[i] = (at as usize).min(self.corners[i] - 2);
            share[i] = (at - low[i] as f32).clamp(0.0, 1.0);
        }
        let [nx, ny, _] = self.corners;
        let first = low[0] + nx * (low[1] + ny * low[2]);
        let [x, y, z] = share;
        let (left, right) = (1.0 - x, x);
        let [near, near_up, far, far_up] = [(1.0 - y) * (1.0 - z), y * (1.0 - z), (1.0 - y) * z, y * z];
        [
            (first, left * near),
            (first + 1, right * near),
            (first + nx, left * near_up),
            (first + nx + 1, right * near_up),
            (first + nx * ny, left * far),
            (first + nx * ny + 1, right * far),
            (first + nx * (ny + 1), left * far_up),
            (first + nx * (ny + 1) + 1, right * far_up),
        ]
    }

    /// Adds a received position: a displacement, m, in a time, s.
    pub fn add(&mut self, place_m: [f32; 3], [x, y, z, time_s]: [f32; 4]) {
        self.has_moved |= x != 0.0 || y != 0.0 || z != 0.0;
        for (corner, weight) in self.around(place_m) {
            let sum = &mut self.sums[corner];
            let values = [x, y, z, time_s, 1.0];
            (0..5).for_each(|i| sum[i] += weight * values[i]);
        }
    }

    /// Interpolates at any position; 0 without neighbours.
    pub fn at(&self, place_m: [f32; 3]) -> [f32; 4] {
        let mut total = [0.0_f32; 5];
        for (corner, weight) in self.around(place_m) {
            (0..5).for_each(|i| total[i] += weight * self.sums[corner][i]);
        }
        match total[4] > 1e-6 {
            true => [0, 1, 2, 3].map(|i| total[i] / total[4]),
            false => [0.0; 4],
        }
    }
}
