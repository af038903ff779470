//! The smoothest net whose vertices stay in their cubes and that encloses the volume of its cells.
//!
//! A vertex in its cube keeps the net between the middles of the cells inside and outside (Gibson
//! 1998), so a part of one cell's thickness cannot vanish. Gradient steps with momentum minimise
//! the bending of the net, clipped at the cubes.

use super::net::Net;

/// Number of steps; a slope of one cell in ten is smooth after about this many.
const STEPS: usize = 60;
/// Step of the gradient; more than a quarter diverges.
const STEP: f32 = 0.24;
/// Largest distance of a vertex from the middle of its cube, in cells. At a half, both sides of a
/// sheet could meet.
const REACH: f32 = 0.45;
/// Most rounds in which the net is pushed out until it encloses its cells.
const PUSHES: usize = 8;
/// Share of the push that a flat surface would need: a thin wire overshoots with all of it.
const PUSH: f64 = 0.7;

/// Relaxes a net as it comes from the cells.
pub fn relax(net: &mut Net) {
    let neighbours = Neighbours::of(net);
    let mut ahead = net.points.clone();
    let (mut once, mut twice) = (vec![[0.0; 3]; ahead.len()], vec![[0.0; 3]; ahead.len()]);
    let mut momentum = 1.0_f32;
    for _ in 0..STEPS {
        neighbours.bend(&ahead, &mut once);
        neighbours.bend(&once, &mut twice);
        let next = 0.5 * (1.0 + (1.0 + 4.0 * momentum * momentum).sqrt());
        let carried = (momentum - 1.0) / next;
        momentum = next;
        for (v, point) in net.points.iter_mut().enumerate() {
            let stepped = [0, 1, 2].map(|a| ahead[v][a] - STEP * twice[v][a]);
            let stepped = in_cube(stepped, net.cubes[v]);
            ahead[v] = [0, 1, 2].map(|a| stepped[a] + carried * (stepped[a] - point[a]));
            *point = stepped;
        }
    }
    for _ in 0..PUSHES {
        push(net);
    }
}

fn in_cube(point: [f32; 3], cube: [i32; 3]) -> [f32; 3] {
    [0, 1, 2].map(|a| {
        let middle = cube[a] as f32 + 0.5;
        point[a].clamp(middle - REACH, middle + REACH)
    })
}

/// Pushes the net along its normals towards the volume of its cells.
fn push(net: &mut Net) {
    let mut areas = vec![[0.0_f32; 3]; net.points.len()];
    let mut whole = 0.0_f64;
    for t in &net.triangles {
        let [a, b, c] = t.map(|v| net.points[v as usize]);
        let (u, w) = ([0, 1, 2].map(|i| b[i] - a[i]), [0, 1, 2].map(|i| c[i] - a[i]));
        let area = [
            u[1] * w[2] - u[2] * w[1],
            u[2] * w[0] - u[0] * w[2],
            u[0] * w[1] - u[1] * w[0],
        ];
        whole += f64::from(length(area)) / 2.0;
        for v in t {
            let sum = &mut areas[*v as usize];
            *sum = [0, 1, 2].map(|i| sum[i] + area[i]);
        }
    }
    if whole <= 0.0 {
        return;
    }
    let by = (PUSH * (net.cells as f64 - net.sixfold_volume() / 6.0) / whole) as f32;
    for ((point, cube), area) in net.points.iter_mut().zip(&net.cubes).zip(&areas) {
        let long = length(*area);
        if long > 0.0 {
            *point = in_cube([0, 1, 2].map(|i| point[i] + by * area[i] / long), *cube);
        }
    }
}

fn length(v: [f32; 3]) -> f32 {
    v.iter().map(|c| c * c).sum::<f32>().sqrt()
}

/// Vertices in cubes that share a face through which the net passes.
struct Neighbours {
    first_of: Vec<u32>,
    of: Vec<u32>,
}

impl Neighbours {
    fn of(net: &Net) -> Self {
        let is_beside = |a: u32, b: u32| {
            let [p, q] = [a, b].map(|v| net.cubes[v as usize]);
            (0..3).map(|i| (p[i] - q[i]).abs()).sum::<i32>() == 1
        };
        let edges = net.triangles.iter().flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)]);
        // The triangle on the other side has the edge in the other direction.
        let mut edges: Vec<(u32, u32)> = edges.filter(|&(a, b)| is_beside(a, b)).collect();
        edges.sort_unstable();
        edges.dedup();
        let mut first_of = vec![0_u32; net.points.len() + 1];
        for &(from, _) in &edges {
            first_of[from as usize + 1] += 1;
        }
        for v in 0..net.points.len() {
            first_of[v + 1] += first_of[v];
        }
        Self {
            first_of,
            of: edges.into_iter().map(|(_, to)| to).collect(),
        }
    }

    /// Computes the distance of each value from the mean of its neighbours.
    fn bend(&self, values: &[[f32; 3]], out: &mut [[f32; 3]]) {
        for (v, bend) in out.iter_mut().enumerate() {
            let beside = &self.of[self.first_of[v] as usize..self.first_of[v + 1] as usize];
            let mut sum = [0.0_f32; 3];
            for &n in beside {
                let value = values[n as usize];
                sum = [sum[0] + value[0], sum[1] + value[1], sum[2] + value[2]];
            }
            let share = 1.0 / beside.len().max(1) as f32;
            let own = if beside.is_empty() { [0.0; 3] } else { values[v] };
            *bend = [0, 1, 2].map(|a| own[a] - share * sum[a]);
        }
    }
}
