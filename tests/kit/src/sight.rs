//! Colours as people with a colour blindness see them.

pub type Matrix = [[f64; 3]; 3];

/// Normal sight, deuteranopia and protanopia in linear sRGB (Machado, Oliveira and Fernandes 2009, table 1 at severity 1).
pub const SIGHTS: [(&str, Matrix); 3] = [
    ("normal", [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
    (
        "deuteranopia",
        [
            [0.367_322, 0.860_646, -0.227_968],
            [0.280_085, 0.672_501, 0.047_413],
            [-0.011_820, 0.042_940, 0.968_881],
        ],
    ),
    (
        "protanopia",
        [
            [0.152_286, 1.052_583, -0.204_868],
            [0.114_503, 0.786_281, 0.099_216],
            [-0.003_882, -0.048_116, 1.051_998],
        ],
    ),
];

/// Returns the linear sRGB of a colour, from 0 to 1.
pub fn linear(color: [u8; 3]) -> [f64; 3] {
    color.map(|c| match f64::from(c) / 255.0 {
        c if c <= 0.040_45 => c / 12.92,
        c => ((c + 0.055) / 1.055).powf(2.4),
    })
}

/// Returns how this sight sees a linear colour.
pub fn seen(color: [f64; 3], sight: &Matrix) -> [f64; 3] {
    times(sight, color).map(|c| c.clamp(0.0, 1.0))
}

/// Returns L*, a*, b* (CIE 1976, D65) of a linear colour.
pub fn lab(color: [f64; 3]) -> [f64; 3] {
    let to_xyz = [
        [0.4124, 0.3576, 0.1805],
        [0.2126, 0.7152, 0.0722],
        [0.0193, 0.1192, 0.9505],
    ];
    let [x, y, z] = times(&to_xyz, color);
    let f = |t: f64| {
        if t > 0.008_856 {
            t.cbrt()
        } else {
            7.787 * t + 16.0 / 116.0
        }
    };
    let [x, y, z] = [f(x / 0.950_47), f(y), f(z / 1.088_83)];
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// Returns the distance of two colours in L*, a*, b*.
pub fn apart(a: [f64; 3], b: [f64; 3]) -> f64 {
    let (a, b) = (lab(a), lab(b));
    (0..3).map(|c| (a[c] - b[c]).powi(2)).sum::<f64>().sqrt()
}

fn times(matrix: &Matrix, v: [f64; 3]) -> [f64; 3] {
    matrix.map(|row| row.iter().zip(v).map(|(a, b)| a * b).sum())
}
