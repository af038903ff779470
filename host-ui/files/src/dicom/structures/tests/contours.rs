//! Contours as programs export them by mistake: copies, partial overlaps, stray points, one number
//! or one name for two structures, two frames, contours beyond the images.

use super::super::super::write::string;
use super::*;

const KIND: &str = "CLOSED_PLANAR";
/// Beside every centre and edge of a voxel, or errors of all quadrants would add up.
const MIDDLE: [f64; 2] = [15.17, 15.08];
const RADIUS: f64 = 10.0;

fn slices() -> Grid {
    grid([60, 60, 8], [0.5, 0.5, 2.0])
}

/// Returns a circle of so many corners, in mm of the slice.
fn polygon(slice: f64, [x, y]: [f64; 2], radius: f64, corners: u32) -> Vec<Vector3<f64>> {
    let grid = slices();
    let corner = |i: u32| {
        let t = f64::from(i) / f64::from(corners) * 2.0 * PI;
        grid.frame
            .place_m([(x + radius * t.cos()) * 2.0, (y + radius * t.sin()) * 2.0, slice])
    };
    (0..corners).map(corner).collect()
}

/// Returns contours in six planes.
fn body(of_plane: impl Fn(f64) -> Vec<Vec<Vector3<f64>>>) -> Vec<Vec<Vector3<f64>>> {
    (1..7).flat_map(|k| of_plane(f64::from(k))).collect()
}

fn read(structures: &[Drawing]) -> StructureSet {
    StructureSet::of(&object(structures)).unwrap_or_else(|why| panic!("{why}"))
}

fn refused(object: &Object) -> String {
    StructureSet::of(object).unwrap_err().to_string()
}

/// Returns the volume as voxels and as a solid, which must agree, and the notes.
fn volume(contours: Vec<Vec<Vector3<f64>>>, kind: &str) -> (f64, String) {
    let set = read(&[(1, "Prostate", kind, contours)]);
    let solid = set.solids().unwrap().remove(0);
    let notes = set.notes.join("; ");
    let v = set.voxels(Some(slices())).unwrap();
    let mm3 = volume_mm3(&v, 1);
    let inside = (0..v.labels.len()).filter(|n| {
        let at = [n % 60, n / 60 % 60, n / 3600].map(|i| i as f64);
        solid.contains(v.frame.place_m(at).into())
    });
    let of_solid = inside.count() as f64 * 0.5;
    assert!(
        (of_solid / mm3 - 1.0).abs() < 0.02,
        "{of_solid} as a solid, {mm3} mm3 as voxels"
    );
    (mm3, notes)
}

fn near(found: f64, expected: f64) {
    assert!((found / expected - 1.0).abs() < 0.01, "{found} and not {expected} mm3");
}

/// Guards against a contour that was there twice, 0.002 mm apart or with other corners, which left
/// 0.00 cc of 7.06 cc.
#[test]
fn a_copy_of_a_contour_counts_once() {
    let single = PI * RADIUS * RADIUS * 12.0;
    let copies: [&dyn Fn(f64) -> Vec<Vector3<f64>>; 5] = [
        &|k| polygon(k, [MIDDLE[0] + 0.002, MIDDLE[1]], RADIUS, 120),
        &|k| polygon(k, MIDDLE, RADIUS, 83),
        &|k| polygon(k, MIDDLE, RADIUS + 0.01, 120),
        &|k| polygon(k, MIDDLE, RADIUS - 0.01, 240),
        &|k| polygon(k + 0.01, MIDDLE, RADIUS, 120).into_iter().rev().collect(),
    ];
    for copy in copies {
        for kind in [KIND, "CLOSEDPLANAR_XOR"] {
            let (mm3, notes) = volume(body(|k| vec![polygon(k, MIDDLE, RADIUS, 120), copy(k)]), kind);
            near(mm3, single);
            assert!(notes.contains("6 of its contours are there twice"), "{notes}");
        }
    }
    // Three times is once, too.
    let three = body(|k| (0..3).map(|n| polygon(k, MIDDLE, RADIUS, 100 + n)).collect());
    near(volume(three, KIND).0, single);
}

/// Guards against the overlap of two contours that was a hole without a word.
#[test]
fn contours_that_overlap_in_part_are_one_body() {
    let (r, apart) = (6.0_f64, 7.0_f64);
    let two = || {
        body(|k| {
            [-0.5, 0.5]
                .map(|side| polygon(k, [MIDDLE[0] + side * apart, MIDDLE[1]], r, 400))
                .to_vec()
        })
    };
    let half = apart / 2.0;
    let lens = 2.0 * r * r * (half / r).acos() - half * (4.0 * r * r - apart * apart).sqrt();
    let (mm3, notes) = volume(two(), KIND);
    near(mm3, (2.0 * PI * r * r - lens) * 12.0);
    assert!(
        notes.contains("overlap in part") && notes.contains(&format!("{:.2} cc", lens * 12e-3)),
        "{notes}"
    );
    // That the overlap is a hole, the file may say.
    let (mm3, notes) = volume(two(), "CLOSEDPLANAR_XOR");
    near(mm3, (2.0 * PI * r * r - 2.0 * lens) * 12.0);
    assert_eq!(notes, "");
    // An outline that was drawn again, 0.6 mm aside.
    let again = body(|k| {
        vec![
            polygon(k, MIDDLE, RADIUS, 200),
            polygon(k, [MIDDLE[0] + 0.6, MIDDLE[1]], RADIUS, 200),
        ]
    });
    let (mm3, notes) = volume(again, KIND);
    near(mm3, (PI * RADIUS * RADIUS + 2.0 * RADIUS * 0.6) * 12.0);
    assert!(notes.contains("overlap in part"), "{notes}");
}

#[test]
fn a_hole_stays_a_hole_and_a_thin_wall_is_reported() {
    let ring = |inner: f64| body(|k| vec![polygon(k, MIDDLE, RADIUS, 200), polygon(k, MIDDLE, inner, 200)]);
    let of = |inner: f64| PI * (RADIUS * RADIUS - inner * inner) * 12.0;
    let (mm3, notes) = volume(ring(7.0), KIND);
    near(mm3, of(7.0));
    assert_eq!(notes, "");
    // A wall of 0.3 mm is rather a second outline.
    let notes = read(&[(1, "Rectum", KIND, ring(9.7))]).notes.join("; ");
    assert!(notes.contains("a wall of only 0.3"), "{notes}");
    // A lumen that reaches a little out of its wall.
    let out = body(|k| {
        vec![
            polygon(k, MIDDLE, RADIUS, 400),
            polygon(k, [MIDDLE[0] + 3.4, MIDDLE[1]], 7.0, 400),
        ]
    });
    let (mm3, notes) = volume(out, KIND);
    assert!(mm3 < of(6.0), "{mm3} mm3");
    assert!(notes.contains("taken as a hole"), "{notes}");
}

#[test]
fn a_number_for_two_structures_is_refused_and_a_name_is_reported() {
    let one = || body(|k| vec![polygon(k, MIDDLE, RADIUS, 60)]);
    let other = || body(|k| vec![polygon(k, MIDDLE, 4.0, 60)]);
    let why = refused(&object(&[(1, "Prostate", KIND, one()), (1, "Rectum", KIND, other())]));
    assert!(why.contains("1 is given twice, to Prostate and to Rectum"), "{why}");
    let set = read(&[(1, "Prostate", KIND, one()), (2, "prostate", KIND, other())]);
    assert!(
        set.notes.join("; ").contains("2 structures are called Prostate"),
        "{:?}",
        set.notes
    );
    // One structure in two items is one structure.
    let mut split = object(&[(1, "Prostate", KIND, one()), (2, "Rectum", KIND, other())]);
    let items_of = |split: &Object| items(&split.data, tags::ROI_CONTOUR_SEQUENCE).to_vec();
    let mut drawn = items_of(&split);
    drawn[1].put(string(tags::REFERENCED_ROI_NUMBER, "1"));
    split
        .data
        .put(super::super::super::write::sequence(tags::ROI_CONTOUR_SEQUENCE, drawn));
    let set = StructureSet::of(&split).unwrap();
    assert_eq!((set.structures.len(), set.structures[0].contours.len()), (1, 12));
    assert!(set.notes.join("; ").contains("in several items"), "{:?}", set.notes);
}

/// Guards against structures of two frames of reference that were merged.
#[test]
fn structures_in_two_frames_are_refused() {
    let contours = || body(|k| vec![polygon(k, MIDDLE, RADIUS, 60)]);
    let both = [(1, "Prostate", KIND, contours()), (2, "Rectum", KIND, contours())];
    let with_frames = |frames: [&str; 2]| {
        let mut object = object(&both);
        object.data.remove_element(tags::FRAME_OF_REFERENCE_UID);
        let mut rois = items(&object.data, tags::STRUCTURE_SET_ROI_SEQUENCE).to_vec();
        for (roi, frame) in rois.iter_mut().zip(frames) {
            roi.put(string(tags::REFERENCED_FRAME_OF_REFERENCE_UID, frame));
        }
        object.data.put(super::super::super::write::sequence(
            tags::STRUCTURE_SET_ROI_SEQUENCE,
            rois,
        ));
        object
    };
    let why = refused(&with_frames(["1.2.3", "1.2.9"]));
    assert!(
        why.contains("two frames of reference: Prostate in 1.2.3, Rectum in 1.2.9"),
        "{why}"
    );
    assert!(StructureSet::of(&with_frames(["1.2.3", "1.2.3"])).is_ok());
    let mut contradicted = with_frames(["1.2.3", "1.2.3"]);
    contradicted.data.put(string(tags::FRAME_OF_REFERENCE_UID, "1.2.4"));
    assert!(
        refused(&contradicted).contains("the file in 1.2.4"),
        "{}",
        refused(&contradicted)
    );
}

/// Guards against the refusal of a whole file because of one point.
#[test]
fn a_stray_contour_is_left_out_with_a_note() {
    let whole = body(|k| vec![polygon(k, MIDDLE, RADIUS, 60)]);
    let corner = whole[0][0];
    for stray in [
        vec![],
        vec![corner],
        vec![corner, whole[0][9]],
        vec![corner, corner, corner],
        vec![corner, whole[0][9], corner],
    ] {
        let (mm3, notes) = volume([whole.clone(), vec![stray]].concat(), KIND);
        near(mm3, PI * RADIUS * RADIUS * 12.0);
        assert!(notes.contains("Prostate: 1 of its 7 contours left out"), "{notes}");
    }
    let only = object(&[(1, "Prostate", KIND, vec![vec![corner]])]);
    assert!(
        refused(&only).contains("fewer than three corners"),
        "{}",
        refused(&only)
    );
}

/// Guards against 13.33 cc of which 5.49 cc were left, because the images ended before the gland.
#[test]
fn contours_beyond_the_images_are_kept() {
    let all = slices();
    let drawn = || read(&[(1, "Prostate", KIND, body(|k| vec![polygon(k, MIDDLE, RADIUS, 60)]))]);
    let whole = drawn().voxels(Some(all.clone())).unwrap();
    for (dims, first) in [
        ([60, 60, 3], [0.0, 0.0, 2.0]),
        ([31, 60, 8], [0.0; 3]),
        ([20, 20, 2], [20.0, 25.0, 4.0]),
    ] {
        let mut frame = all.frame.clone();
        frame.origin_m = all.frame.place_m(first);
        let v = drawn().voxels(Some(Grid { dims, frame })).unwrap();
        near(volume_mm3(&v, 1), volume_mm3(&whole, 1));
        let notes = v.frame.warning.unwrap();
        assert!(
            notes.contains("reach beyond the images") && notes.contains("Prostate with "),
            "{notes}"
        );
        // On the same lattice.
        let off = all.frame.index_of(v.frame.origin_m).map(|at| (at - at.round()).abs());
        assert!(off.iter().all(|off| *off < 1e-6), "{off:?}");
    }
    assert_eq!(whole.frame.warning, None);
}

#[test]
fn attributes_that_contradict_contours_are_named() {
    let mut object = object(&[(1, "Prostate", KIND, body(|k| vec![polygon(k, MIDDLE, RADIUS, 60)]))]);
    let mut rois = items(&object.data, tags::ROI_CONTOUR_SEQUENCE).to_vec();
    let mut contours = items(&rois[0], tags::CONTOUR_SEQUENCE).to_vec();
    contours[2].put(string(tags::NUMBER_OF_CONTOUR_POINTS, "61"));
    rois[0].put(super::super::super::write::sequence(tags::CONTOUR_SEQUENCE, contours));
    object
        .data
        .put(super::super::super::write::sequence(tags::ROI_CONTOUR_SEQUENCE, rois));
    object.data.remove_element(tags::STRUCTURE_SET_ROI_SEQUENCE);
    let notes = StructureSet::of(&object).unwrap().notes.join("; ");
    assert!(
        notes.contains("NumberOfContourPoints") && notes.contains("StructureSetROISequence"),
        "{notes}"
    );
}
