//! The matrix-free operator against a matrix made from shape functions and Gauss points, and against what it must keep.

use super::*;
use crate::tissue::fem::guess::shifted;
use crate::tissue::fem::hexahedron::Stiffness;
use crate::tissue::fem::smooth::Product;
use crate::tissue::fem::sweep::{Field, Planes, sweep, zeros};

/// Returns the matrix of 24 x 24 from the definition: sum over Gauss points of `B^T D B`, or with the volumetric part
/// of B averaged.
fn element_matrix(material: &Material, h: f64) -> [[f64; 24]; 24] {
    let (lambda, mu) = material.lame_pa();
    let g = 0.5 / 3.0_f64.sqrt();
    let points: [[f64; 3]; 8] =
        std::array::from_fn(|n| [0, 1, 2].map(|a| if n >> a & 1 == 1 { 0.5 + g } else { 0.5 - g }));
    let gradient = |corner: usize, point: [f64; 3]| {
        [0, 1, 2].map(|axis| {
            (0..3)
                .map(|a| {
                    let upper = corner >> a & 1 == 1;
                    match (a == axis, upper) {
                        (true, true) => 1.0 / h,
                        (true, false) => -1.0 / h,
                        (false, true) => point[a],
                        (false, false) => 1.0 - point[a],
                    }
                })
                .product::<f64>()
        })
    };
    let mean: [[f64; 3]; 8] =
        std::array::from_fn(|c| [0, 1, 2].map(|a| points.iter().map(|&p| gradient(c, p)[a]).sum::<f64>() / 8.0));
    // Strain of corner `c` moved along `a`, with its trace replaced by the mean one if asked.
    let strain = |c: usize, a: usize, point: [f64; 3]| {
        let d = gradient(c, point);
        let mut e = [[0.0; 3]; 3];
        for axis in 0..3 {
            e[a][axis] += 0.5 * d[axis];
            e[axis][a] += 0.5 * d[axis];
        }
        if material.integration == MEAN {
            (0..3).for_each(|axis| e[axis][axis] += (mean[c][a] - d[a]) / 3.0);
        }
        e
    };
    let trace = |e: [[f64; 3]; 3]| e[0][0] + e[1][1] + e[2][2];
    let mut matrix = [[0.0; 24]; 24];
    for point in points {
        let strains: [[[f64; 3]; 3]; 24] = std::array::from_fn(|n| strain(n / 3, n % 3, point));
        for (row, a) in matrix.iter_mut().zip(strains) {
            for (entry, b) in row.iter_mut().zip(strains) {
                let product: f64 = (0..9).map(|n| a[n / 3][n % 3] * b[n / 3][n % 3]).sum();
                *entry += (lambda * trace(a) * trace(b) + 2.0 * mu * product) * h.powi(3) / 8.0;
            }
        }
    }
    matrix
}

/// Returns `A x`, with all nodes free.
fn apply(model: &FemModel<f64>, x: &Field<f64>) -> Field<f64> {
    let level = &model.levels[0];
    let (mut x, mut q) = (x.clone(), zeros(level.grid.len()));
    let mut op = Product {
        q: &mut q,
        inverse_diagonal: &vec![1.0; level.grid.len()],
        dot: 0.0,
    };
    let mut work = Planes::new(level.grid.stride * level.grid.nodes[1]);
    sweep(level, &mut x, &mut work, 0..level.grid.nodes[2], &mut op);
    q
}

/// Makes a field on the nodes that touch an element, from their places in cells.
fn field(model: &FemModel<f64>, mut f: impl FnMut([f64; 3]) -> [f64; 3]) -> Field<f64> {
    let grid = &model.levels[0].grid;
    let mut x = zeros(grid.len());
    for node in (0..grid.len()).filter(|&node| model.part[node] != u32::MAX) {
        let value = f(grid.place(node).map(|c| c as f64));
        (0..3).for_each(|a| x[a][node] = value[a]);
    }
    x
}

fn random(model: &FemModel<f64>, seed: u64) -> Field<f64> {
    let mut random = Random(seed);
    field(model, |_| [random.signed(), random.signed(), random.signed()])
}

fn dot(a: &Field<f64>, b: &Field<f64>) -> f64 {
    a.iter()
        .zip(b)
        .map(|(a, b)| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>())
        .sum()
}

fn largest(a: &Field<f64>) -> f64 {
    a.iter().flatten().fold(0.0, |m, v| v.abs().max(m))
}

fn irregular() -> (Arc<Lattice>, FemModel<f64>) {
    let lattice = lattice_of(&test_bodies::speckle(3));
    let model = FemModel::new(&lattice, &two_materials(&lattice, 50.0, 0.0)).expect("valid");
    (lattice, model)
}

#[test]
fn sweep_is_the_sum_of_the_element_matrices() {
    let (lattice, model) = irregular();
    let settings = two_materials(&lattice, 50.0, 0.0);
    let matrices = settings.structures.iter().map(|structure| match structure {
        Structure::Elastic(material) => element_matrix(material, lattice.spacing_m),
        Structure::Fixed => unreachable!("both are elastic"),
    });
    let matrices: Vec<_> = matrices.collect();
    let x = random(&model, 1);
    let grid = &model.levels[0].grid;
    let mut expected: Field<f64> = zeros(grid.len());
    for element in 0..lattice.element_count() as u32 {
        let cell = lattice.cell(element);
        let node = |c: usize| grid.index([0, 1, 2].map(|a| cell[a] - model.low_cell[a] + (c >> a & 1)));
        let matrix = &matrices[usize::from(settings.structure_of[element as usize])];
        for row in 0..24 {
            let force: f64 = (0..24).map(|n| matrix[row][n] * x[n % 3][node(n / 3)]).sum();
            expected[row % 3][node(row / 3)] += force;
        }
    }
    let mut difference = apply(&model, &x);
    for (d, e) in difference.iter_mut().zip(&expected) {
        d.iter_mut().zip(e).for_each(|(d, e)| *d -= e);
    }
    assert!(
        largest(&difference) < 1e-12 * largest(&expected),
        "{}",
        largest(&difference)
    );
}

#[test]
fn diagonal_and_bound_are_those_of_the_element_matrix() {
    for material in [material(0.3, FULL), material(0.45, MEAN), material(0.499, MEAN)] {
        let matrix = element_matrix(&material, 1e-3);
        let stiffness = Stiffness::of(&material, 1e-3);
        assert!((stiffness.diagonal() / matrix[0][0] - 1.0).abs() < 1e-12);
        let matrix = nalgebra::DMatrix::from_fn(24, 24, |i, j| matrix[i][j]);
        let eigenvalues = matrix.symmetric_eigenvalues();
        assert!((stiffness.largest_eigenvalue() / eigenvalues.max() - 1.0).abs() < 1e-9);
        let soft = eigenvalues.iter().filter(|&&e| e < 1e-9 * eigenvalues.max()).count();
        assert_eq!(soft, 6, "rigid motions and no other cost nothing");
    }
}

#[test]
fn operator_is_symmetric_and_positive() {
    let (_, model) = irregular();
    let (x, y) = (random(&model, 1), random(&model, 2));
    let (ax, ay) = (apply(&model, &x), apply(&model, &y));
    let (left, right) = (dot(&y, &ax), dot(&x, &ay));
    assert!((left - right).abs() < 1e-12 * dot(&x, &ax), "{left} {right}");
    assert!(dot(&x, &ax) > 0.0);
}

#[test]
fn rigid_motions_cost_no_energy() {
    let (_, model) = irregular();
    let stiff = largest(&apply(&model, &random(&model, 1)));
    let motions: [fn([f64; 3]) -> [f64; 3]; 6] = [
        |_| [1.0, 0.0, 0.0],
        |_| [0.0, 1.0, 0.0],
        |_| [0.0, 0.0, 1.0],
        |[x, y, _]| [-y, x, 0.0],
        |[x, _, z]| [z, 0.0, -x],
        |[_, y, z]| [0.0, -z, y],
    ];
    for motion in motions {
        let forces = apply(&model, &field(&model, motion));
        assert!(largest(&forces) < 1e-12 * stiff, "{}", largest(&forces));
    }
}

/// Patch test: a linear displacement has no force on any node inside, and the energy of its strain.
#[test]
fn uniform_strain_is_exact_on_an_irregular_body() {
    let lattice = lattice_of(&test_bodies::with_hole());
    for integration in [FULL, MEAN] {
        let material = material(0.45, integration);
        let model = FemModel::<f64>::new(&lattice, &FemSettings::homogeneous(material, 0.0)).expect("valid");
        let h = lattice.spacing_m;
        let strain = [[0.02, 0.01, -0.005], [0.01, -0.03, 0.004], [-0.005, 0.004, 0.01]];
        let x = field(&model, |p| {
            strain.map(|row| h * (row[0] * p[0] + row[1] * p[1] + row[2] * p[2]))
        });
        let forces = apply(&model, &x);
        let (lambda, mu) = material.lame_pa();
        let squares: f64 = strain.iter().flatten().map(|e| e * e).sum();
        let trace: f64 = (0..3).map(|a| strain[a][a]).sum();
        let energy_j = (0.5 * lambda * trace * trace + mu * squares) * lattice.volume_m3();
        assert!((0.5 * dot(&x, &forces) / energy_j - 1.0).abs() < 1e-12);
        for node in (0..model.levels[0].grid.len()).filter(|&node| is_inside(&model, node)) {
            assert!((0..3).all(|a| forces[a][node].abs() < 1e-12 * largest(&forces)));
        }
    }
}

fn is_inside(model: &FemModel<f64>, node: usize) -> bool {
    let grid = &model.levels[0].grid;
    let place = grid.place(node);
    (0..8).all(|c| {
        let cell = [0, 1, 2].map(|a| place[a].wrapping_sub(c >> a & 1));
        (0..3).all(|a| cell[a] < grid.nodes[a]) && model.is_cell[grid.index(cell)]
    })
}

/// Place by place, in bodies that fill their box and in ones that do not, by every step that a patch makes.
#[test]
fn a_field_moved_along_is_each_nodes_neighbour_or_its_own() {
    let mut random = Random(7);
    let holey = Labels {
        dims: [9, 7, 6],
        spacing_m: 1e-3,
        cells: (0..9 * 7 * 6).map(|_| u8::from(random.unit() < 0.7)).collect(),
        structures: Vec::new(),
    };
    // The lowest lines of the gland's box are empty.
    let gland = Scene::builtin("paper").expect("built in").lattice;
    for lattice in [block([20, 5, 4], 1e-3), lattice_of(&holey), gland] {
        let model = FemModel::<f64>::new(&lattice, &FemSettings::homogeneous(material(0.3, FULL), 1e5)).unwrap();
        let level = &model.levels[0];
        let is_node = |n: usize| level.inverse_diagonal[n] != 0.0;
        let u: Vec<f64> = (0..zeros::<f64>(level.grid.len())[0].len())
            .map(|n| {
                if n < level.grid.len() && is_node(n) {
                    random.unit()
                } else {
                    0.0
                }
            })
            .collect();
        for step in 0..125 {
            let by = [step % 5, step / 5 % 5, step / 25].map(|n| n as isize - 2);
            let mut moved = vec![0.0; u.len()];
            shifted(level.simd, level, by, &u, &mut moved);
            for node in (0..level.grid.len()).filter(|&n| is_node(n)) {
                let place = level.grid.place(node);
                let inside = |a: usize| {
                    let n = place[a].checked_add_signed(-by[a]);
                    n.filter(|&n| n < level.grid.nodes[a])
                };
                let from = inside(0)
                    .zip(inside(1))
                    .zip(inside(2))
                    .map(|((i, j), k)| level.grid.index([i, j, k]));
                let expected = u[from.filter(|&n| is_node(n)).unwrap_or(node)];
                assert_eq!(moved[node], expected, "{by:?} at {place:?}");
            }
        }
    }
}
