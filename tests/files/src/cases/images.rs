//! Seeds in a CT, and words that named another fault than the file's.

use super::objects::{ball, put, put_images, save, save_ct, slice, structure_set};
use super::{Case, Right};
use dicom_dictionary_std::tags;
use std::path::Path;
use stylet_random::Random;

/// Places of seeds, in RAS and mm.
const SIX: [[f64; 3]; 6] = [
    [12.0, 10.0, -8.0],
    [-10.0, 8.0, -5.0],
    [0.0, -8.0, 0.0],
    [8.0, -12.0, 8.0],
    [-12.0, -10.0, 10.0],
    [-3.0, 14.0, 4.0],
];
const SLICES: i32 = 33;
const SLICE_MM: f64 = 1.5;
/// Columns and rows, 1 mm apart.
const SIDE: i32 = 64;
/// Sum of a seed above the tissue, in HU and voxels: the highest voxels have some 3000 HU.
const SIGNAL_HU: f64 = 45_000.0;
const BLUR_MM: f64 = 0.6;
const POINTS: usize = 2000;
const NOISE_HU: f64 = 12.0;

pub fn cases() -> Vec<Case> {
    [seeds(), words()].into_iter().flatten().collect()
}

fn normal(random: &mut Random) -> f64 {
    (-2.0 * (1.0 - random.unit()).ln()).sqrt() * (std::f64::consts::TAU * random.unit()).cos()
}

/// Writes a CT of seeds along z, each of a share of the usual signal, with dark and bright streaks around them.
fn save_seeds(folder: &Path, seeds: &[([f64; 3], f64)], streaks_hu: f64, modality: &str) {
    let folder = folder.join("ct");
    std::fs::create_dir(&folder).expect("a folder");
    let mut random = Random(11);
    let mut values: Vec<f64> = (0..SLICES * SIDE * SIDE)
        .map(|_| 40.0 + NOISE_HU * normal(&mut random))
        .collect();
    // Columns run to the left and rows to the back.
    let column = |mm: f64| -mm + f64::from(SIDE - 1) / 2.0;
    let level = |mm: f64| mm / SLICE_MM + f64::from(SLICES - 1) / 2.0;
    let at = |[i, j, k]: [i32; 3]| {
        ([i, j].iter().all(|n| (0..SIDE).contains(n)) && (0..SLICES).contains(&k))
            .then_some(((k * SIDE + j) * SIDE + i) as usize)
    };
    for ([x, y, z], share) in seeds {
        for _ in 0..POINTS {
            let blur = [(); 3].map(|()| BLUR_MM * normal(&mut random));
            let place = [
                column(x + blur[0]),
                column(y + blur[1]),
                level(z + blur[2] + 2.25 * random.signed()),
            ];
            if let Some(voxel) = at(place.map(|v| v.round() as i32)) {
                values[voxel] += share * SIGNAL_HU / POINTS as f64;
            }
        }
        for (j, i) in (0..SIDE).flat_map(|j| (0..SIDE).map(move |i| (j, i))) {
            let (right, back) = (f64::from(i) - column(*x), f64::from(j) - column(*y));
            let far = right.hypot(back);
            let streak = streaks_hu * (6.0 * back.atan2(right)).cos() * (-far / 12.0).exp();
            for k in 0..SLICES {
                if far > 1.5 && (f64::from(k) - level(*z)).abs() * SLICE_MM < 2.25 {
                    values[at([i, j, k]).expect("inside")] += streak;
                }
            }
        }
    }
    for (k, of_slice) in values.chunks((SIDE * SIDE) as usize).enumerate() {
        let z = (k as f64 - f64::from(SLICES - 1) / 2.0) * SLICE_MM;
        let stored: Vec<i16> = of_slice.iter().map(|v| v.round() as i16).collect();
        let mut image = slice(&format!("1.2.3.6.{}", k + 1), &format!("{z}"), &stored);
        put(&mut image, tags::MODALITY, modality);
        save(&folder.join(format!("{k:03}.dcm")), image);
    }
}

fn seeds() -> Vec<Case> {
    let kind = "Seeds in a CT";
    let listed = Right::Seeds(SIX.to_vec());
    let usual = || SIX.map(|place| (place, 1.0)).to_vec();
    let case = |file, commands, right, seeds: Vec<([f64; 3], f64)>, streaks: f64| {
        Case::new(kind, file, commands, right, move |folder| {
            save_seeds(folder, &seeds, streaks, "CT")
        })
        .shows(&["doubtful"])
    };
    let six = "find-seeds ct --count 6 --out out";
    let mut weak = usual();
    weak[4].1 = 0.7;
    let mut marker = usual();
    marker.push(([15.0, -2.0, -14.0], 3.2));
    vec![
        case("streaks of 400 HU", six, listed, usual(), 400.0)
            .before("one seed neither found nor listed, another one twice"),
        case("streaks of 800 HU", six, Right::Seeds(SIX.to_vec()), usual(), 800.0),
        case(
            "one seed of 0.7 of the signal, streaks of 300 HU",
            six,
            Right::Seeds(SIX.to_vec()),
            weak,
            300.0,
        ),
        case(
            "streaks of 400 HU, number not given",
            "find-seeds ct --out out",
            Right::Seeds(SIX.to_vec()),
            usual(),
            400.0,
        ),
        case(
            "a gold marker of 3.2 seeds, number not given",
            "find-seeds ct --out out",
            Right::Seeds(SIX.to_vec()),
            marker,
            0.0,
        )
        .before("three seeds for the marker"),
        Case::new(
            kind,
            "the same as MR",
            six,
            Right::Refused("Modality is \"MR\""),
            move |folder| save_seeds(folder, &usual(), 0.0, "MR"),
        )
        .before("read in \"HU\""),
    ]
}

/// Makes a series whose slices lie at these heights.
fn series(heights: impl Fn(f64) -> String + 'static) -> impl Fn(&Path) {
    move |folder| {
        let folder = folder.join("ct");
        std::fs::create_dir(&folder).expect("a folder");
        for n in 0..12 {
            let z = heights(f64::from(n) * 1.25);
            save(
                &folder.join(format!("{n:03}.dcm")),
                slice(&format!("1.2.3.6.{}", n + 1), &z, &[]),
            );
        }
    }
}

/// Declares a file as deflated, of which no reader here needs more than the declaration.
fn deflate(path: &Path) {
    let bytes = std::fs::read(path).expect("written");
    let (plain, deflated) = (
        b"1.2.840.10008.1.2.1\0".as_slice(),
        b"1.2.840.10008.1.2.1.99".as_slice(),
    );
    let at = bytes
        .windows(plain.len())
        .position(|window| window == plain)
        .expect("a syntax");
    let mut changed = [&bytes[..at], deflated, &bytes[at + plain.len()..]].concat();
    let lengthened = |changed: &mut Vec<u8>, at: usize| changed[at] += 2;
    lengthened(&mut changed, at - 2);
    // The length of the group is the value of the first element after "DICM".
    lengthened(&mut changed, 128 + 4 + 8);
    std::fs::write(path, changed).expect("written");
}

fn words() -> Vec<Case> {
    let kind = "Words";
    let find = "find-seeds ct --out out";
    let labels = |folder: &Path, values: [i16; 8]| {
        let head = "NRRD0004\ntype: short\ndimension: 3\nsizes: 2 2 2\nencoding: raw\nendian: little\nspace: left-posterior-superior\n\
                    space directions: (1,0,0) (0,1,0) (0,0,1)\nspace origin: (0,0,0)\n\n";
        let bytes = [head.as_bytes(), &values.map(i16::to_le_bytes).concat()].concat();
        std::fs::write(folder.join("labels.nrrd"), bytes).expect("written");
    };
    let scene = |folder: &Path, structure: &str| {
        save(
            &folder.join("rs.dcm"),
            structure_set(&[("1", "Prostate", ball([0.0; 3], 14.5))]),
        );
        let text = format!("[volume]\nfile = \"rs.dcm\"\n[[structure]]\nname = \"Prostate\"\n{structure}\n");
        std::fs::write(folder.join("scene.toml"), text).expect("written");
    };
    vec![
        Case::new(
            kind,
            "slices every 1.25 mm, positions rounded to 0.1 mm",
            "convert rs.dcm labels.nrrd",
            Right::Says(&["even distances of 1.250 mm"]),
            |folder| {
                let mut set = structure_set(&[("1", "Prostate", ball([0.0; 3], 14.5))]);
                let rounded = |k: i32| (f64::from(k) * 12.5).round() / 10.0;
                put_images(&mut set, &save_ct(folder, &(-12..=12).map(rounded).collect::<Vec<_>>()));
                save(&folder.join("rs.dcm"), set);
            },
        )
        .before("\"some are missing or there twice\""),
        Case::new(
            kind,
            "the same, the last one rounded too",
            find,
            Right::Refused("rounded"),
            series(|z| format!("{z:.1}")),
        ),
        Case::new(
            kind,
            "positions rounded to 1 mm",
            find,
            Right::Refused("distances differ"),
            series(|z| format!("{z:.0}")),
        ),
        Case::new(
            kind,
            "one slice missing",
            find,
            Right::Refused("missing"),
            series(|z| format!("{}", if z > 6.0 { z + 1.25 } else { z })),
        ),
        Case::new(
            kind,
            "one slice twice",
            find,
            Right::Refused("twice"),
            series(|z| format!("{}", if z == 5.0 { 3.75 } else { z })),
        ),
        Case::new(
            kind,
            "a deflated series",
            find,
            Right::Refused("1.2.840.10008.1.2.1.99"),
            |folder| {
                series(|z| format!("{z}"))(folder);
                (0..12).for_each(|n| deflate(&folder.join(format!("ct/{n:03}.dcm"))));
            },
        )
        .before("\"holds no image series\""),
        Case::new(
            kind,
            "a label of -1",
            "convert labels.nrrd labels.mha",
            Right::Refused("-1"),
            move |folder| labels(folder, [-1, 1, 1, 0, 2, 2, 1, 0]),
        )
        .before("background"),
        Case::new(
            kind,
            "a label of 300",
            "convert labels.nrrd labels.mha",
            Right::Refused("300"),
            move |folder| labels(folder, [300, 1, 1, 0, 2, 2, 1, 0]),
        ),
        Case::new(
            kind,
            "Poisson's ratio 0.4995",
            "scene check scene.toml",
            Right::Refused("poisson"),
            move |folder| scene(folder, "poisson = 0.4995"),
        )
        .before("passed, and refused by the core"),
        Case::new(
            kind,
            "every structure fixed",
            "scene check scene.toml",
            Right::Refused("fixed"),
            move |folder| scene(folder, "fixed = true"),
        )
        .before("passed, and refused by the core"),
        Case::new(
            kind,
            "images that the structure set does not name, of the series that it names",
            "convert rs.dcm labels.nrrd",
            Right::Says(&["images"]),
            |folder| {
                let mut set = structure_set(&[("1", "Prostate", ball([0.0; 3], 14.5))]);
                put_images(&mut set, &["1.2.3.99.1".to_owned(), "1.2.3.99.2".to_owned()]);
                save(&folder.join("rs.dcm"), set);
                save_ct(folder, &[-2.5, 0.0, 2.5]);
            },
        ),
    ]
}
