//! Contours that are there twice, of one number, of a point, or beyond the images.

use super::objects::{Contour, ball, put_images, save, save_ct, structure_set, volume_cc};
use super::{Case, Right};
use std::path::Path;

const TARGET_MM: f64 = 14.5;
const RECTUM: [f64; 3] = [0.0, 30.0, 0.0];
const RECTUM_MM: f64 = 12.0;
const DOSE: &str = "dose --source source --seeds seeds.csv --structures rs.dcm --out out";
const VOLUMES: &[&str] = &["Prostate (", "Rectum ("];

fn prostate() -> Vec<Contour> {
    ball([0.0; 3], TARGET_MM)
}

fn rectum() -> Vec<Contour> {
    ball(RECTUM, RECTUM_MM)
}

fn both() -> Vec<(&'static str, f64)> {
    vec![("Prostate", volume_cc(&prostate())), ("Rectum", volume_cc(&rectum()))]
}

fn save_set(folder: &Path, structures: &[(&str, &str, Vec<Contour>)]) {
    save(&folder.join("rs.dcm"), structure_set(structures));
    std::fs::write(folder.join("seeds.csv"), "x_mm,y_mm,z_mm,strength_u\n0,0,0,0.5\n").expect("written");
}

/// Makes a prostate of changed contours, and a rectum.
fn prostate_of(change: impl Fn(Vec<Contour>) -> Vec<Contour> + 'static) -> impl Fn(&Path) {
    move |folder| {
        save_set(
            folder,
            &[("1", "Prostate", change(prostate())), ("2", "Rectum", rectum())],
        )
    }
}

fn moved(contour: &Contour, by: f64) -> Contour {
    contour.iter().map(|p| [p[0] + by, p[1], p[2]]).collect()
}

pub fn cases() -> Vec<Case> {
    [twice(), numbers(), stray(), beyond()].into_iter().flatten().collect()
}

fn twice() -> Vec<Case> {
    let kind = "The same contour twice";
    let right = |words: &'static [&'static str]| Right::Volumes(words, both());
    let case = |file, words, make: Box<dyn Fn(&Path)>| Case::new(kind, file, DOSE, right(words), make).shows(VOLUMES);
    let doubled =
        |c: Vec<Contour>, copy: &dyn Fn(&Contour) -> Contour| c.iter().flat_map(|c| [c.clone(), copy(c)]).collect();
    vec![
        case(
            "each contour again, 0.002 mm apart",
            &["twice"],
            Box::new(prostate_of(move |c| doubled(c, &|c| moved(c, 0.002)))),
        )
        .before("0.00 cc, D90 4.05 Gy"),
        case(
            "each again with a corner in the middle of each side, from another corner, the other way round",
            &["twice"],
            Box::new(prostate_of(move |c| {
                doubled(c, &|c| {
                    let next = c.iter().skip(1).chain(c.first());
                    let middle = |(a, b): (&[f64; 3], &[f64; 3])| [*a, [0, 1, 2].map(|n| (a[n] + b[n]) / 2.0)];
                    let mut copy: Contour = c.iter().zip(next).flat_map(middle).collect();
                    copy.rotate_left(17);
                    copy.reverse();
                    copy
                })
            })),
        ),
        case(
            "three times, 0.01 mm apart",
            &["twice"],
            Box::new(prostate_of(|c| {
                c.iter()
                    .flat_map(|c| [0.0, 0.01, 0.02].map(|by| moved(c, by)))
                    .collect()
            })),
        ),
        case(
            "one plane three times, the copies with coordinates of 0.1 mm",
            &["twice"],
            Box::new(prostate_of(|mut c| {
                let rounded: Contour = c[3].iter().map(|p| p.map(|v| (v * 10.0).round() / 10.0)).collect();
                c.extend([rounded.clone(), rounded]);
                c
            })),
        ),
    ]
}

fn numbers() -> Vec<Case> {
    let kind = "Numbers and names that are there twice";
    let set = |of: &'static [(&'static str, &'static str)]| {
        move |folder: &Path| {
            let bodies = [prostate(), rectum(), ball([25.0, 0.0, 0.0], 8.0)];
            let all: Vec<_> = of
                .iter()
                .zip(bodies)
                .map(|((number, name), body)| (*number, *name, body))
                .collect();
            save_set(folder, &all);
        }
    };
    vec![
        Case::new(
            kind,
            "number 1 for Prostate and Rectum",
            DOSE,
            Right::Refused("ROINumber"),
            set(&[("1", "Prostate"), ("1", "Rectum")]),
        )
        .before("two structures \"Prostate\"; `dicom` wrote the rectum's contours as Prostate"),
        Case::new(
            kind,
            "two structures \"Prostate\"",
            DOSE,
            Right::Says(&["Prostate"]),
            set(&[("1", "Prostate"), ("2", "Prostate")]),
        )
        .before("nothing said which was the target")
        .shows(&["Prostate ("]),
        Case::new(
            kind,
            "numbers 3, 2 and 3 again",
            "convert rs.dcm labels.nrrd",
            Right::Refused("ROINumber"),
            set(&[("3", "Prostate"), ("2", "Rectum"), ("3", "Bladder")]),
        ),
        Case::new(
            kind,
            "Prostate and prostate",
            DOSE,
            Right::Says(&["prostate"]),
            set(&[("1", "prostate"), ("2", "Rectum"), ("3", "Prostate")]),
        )
        .shows(&["Prostate (", "prostate ("]),
        Case::new(
            kind,
            "number 1 also as 01",
            "scene check rs.dcm",
            Right::Refused("ROINumber"),
            set(&[("1", "Prostate"), ("01", "Rectum")]),
        ),
    ]
}

fn stray() -> Vec<Case> {
    let kind = "Stray contours";
    let case = |file, stray: fn() -> Contour| {
        let make = move |folder: &Path| {
            let mut with = rectum();
            with.push(stray());
            save_set(folder, &[("1", "Prostate", prostate()), ("2", "Rectum", with)]);
        };
        Case::new(kind, file, DOSE, Right::Volumes(&["left out"], both()), make).shows(VOLUMES)
    };
    vec![
        case("one contour of one point in Rectum", || vec![RECTUM]).before("the whole file refused"),
        case("one of two points", || vec![RECTUM, [3.0, 31.0, 0.0]]),
        case("one of three points on a line", || {
            (0..3).map(|n| [f64::from(n), 30.0 + f64::from(n), 5.0]).collect()
        }),
        case("one of four points in one place, above the others", || {
            vec![[1.0, 30.0, 40.0]; 4]
        }),
    ]
}

fn beyond() -> Vec<Case> {
    let kind = "Contours beyond the images";
    let commands =
        "convert rs.dcm labels.nrrd; dose --source source --seeds seeds.csv --structures labels.nrrd --out out";
    let case = |file, right, heights: fn() -> Vec<f64>, middle: [f64; 3]| {
        let make = move |folder: &Path| {
            let mut set = structure_set(&[("1", "Prostate", ball(middle, TARGET_MM))]);
            put_images(&mut set, &save_ct(folder, &heights()));
            save(&folder.join("rs.dcm"), set);
            std::fs::write(folder.join("seeds.csv"), "x_mm,y_mm,z_mm,strength_u\n0,0,0,0.5\n").expect("written");
        };
        Case::new(kind, file, commands, right, make).shows(&["Prostate ("])
    };
    let whole = || Right::Volumes(&["images"], vec![("Prostate", volume_cc(&prostate()))]);
    fn heights(from: i32, to: i32) -> Vec<f64> {
        (from..=to).map(|k| f64::from(k) * 2.5).collect()
    }
    vec![
        case("images from -5 to 5 mm", whole(), || heights(-2, 2), [0.0; 3])
            .before("5.49 cc for 13.33, in `convert` and `scene check`"),
        case("images of the lower half alone", whole(), || heights(-8, 0), [0.0; 3]),
        case(
            "images to one side: the body reaches 12 mm beyond their columns",
            whole(),
            || heights(-8, 8),
            [29.5, 0.0, 0.0],
        ),
        case("images wholly below the body", whole(), || heights(-30, -20), [0.0; 3]),
    ]
}
