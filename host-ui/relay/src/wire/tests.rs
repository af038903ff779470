use super::*;
use stylet_shm_schema::{GridInfo, SeedPose, SnapshotHeader, Vertex};

/// A scene of `vertices` in a row, 1 mm apart, and a grid of `nodes`.
fn scene(vertices: u32, nodes: u32) -> Rest {
    let mut header = SceneHeader::zeroed();
    (header.session_id, header.generation, header.vertex_count) = (3, 2, vertices);
    header.nodes = GridInfo {
        dims: [nodes, 1, 1],
        ..GridInfo::default()
    };
    let words: Vec<u32> = (0..vertices)
        .flat_map(|i| [1e-3 * i as f32, 0.05, 0.1].map(f32::to_bits))
        .collect();
    Rest::of_scene(&header, &words)
}

/// Displaces each position differently by up to `most_m`.
fn snapshot(vertices: u32, nodes: u32, most_m: f32) -> (SnapshotHeader, Vec<Vertex>) {
    let mut header = SnapshotHeader::zeroed();
    (header.session_id, header.scene_generation) = (3, 2);
    (header.vertex_count, header.node_count) = (vertices, nodes);
    (header.tissue_tick, header.seed_count, header.left_count) = (77, 2, 1);
    header.seeds[1] = SeedPose {
        position_m: [0.01, 0.02, 0.03],
        axis: [0.0, 0.0, 1.0],
        dropped_at_m: [0.01, 0.02, 0.031],
    };
    header.left[0].number = 9;
    let place = |i: u32| {
        let rest = if i < vertices {
            [1e-3 * i as f32, 0.05, 0.1]
        } else {
            [0.0; 3]
        };
        let share = |a: usize| ((i as usize * 7 + a * 13) % 101) as f32 / 101.0 - 0.5;
        Vertex {
            position_m: [0, 1, 2].map(|a| rest[a] + 2.0 * most_m * share(a)),
        }
    };
    (header, (0..vertices + nodes).map(place).collect())
}

fn largest_error_m(a: &[Vertex], b: &[Vertex]) -> f32 {
    let pairs = a
        .iter()
        .zip(b)
        .flat_map(|(a, b)| (0..3).map(|i| (a.position_m[i] - b.position_m[i]).abs()));
    pairs.fold(0.0, f32::max)
}

#[test]
fn a_small_snapshot_survives_but_for_the_error_of_half_floats() {
    let rest = scene(2000, 500);
    for (most_m, bound_m) in [(15.6e-3, 3.9e-6), (31e-3, 7.7e-6), (1e-3, 0.49e-6)] {
        let (header, vertices) = snapshot(2000, 500, most_m);
        let body = Thin::of(&rest, &header, &vertices)
            .expect("of this scene")
            .with_places(0, MAX_THIN_BYTES);
        assert!(body.len() < MAX_THIN_BYTES);
        let (back, places) = decode_snapshot(&rest, &mut Displacements::default(), &body)
            .expect("valid")
            .expect("of this scene");
        assert_eq!(
            bytemuck::bytes_of(&back),
            bytemuck::bytes_of(&header),
            "seeds and needles are whole"
        );
        let error_m = largest_error_m(&vertices, &places);
        assert!(error_m <= bound_m && error_m > 0.0, "{error_m} m for {most_m} m");
    }
}

#[test]
fn a_large_snapshot_is_shared_among_messages_and_whole_after_them() {
    let rest = scene(12_000, 8192);
    let (mut header, vertices) = snapshot(12_000, 8192, 10e-3);
    let mut known = Displacements::default();
    let mut last = Vec::new();
    let stride = (20_192_usize * 6).div_ceil(MAX_THIN_BYTES - 2000);
    for number in 0..stride as u64 {
        header.time_ns += 30_000_000;
        let body = Thin::of(&rest, &header, &vertices)
            .expect("of this scene")
            .with_places(number, MAX_THIN_BYTES);
        assert!(body.len() <= MAX_THIN_BYTES, "{} bytes", body.len());
        last = decode_snapshot(&rest, &mut known, &body)
            .expect("valid")
            .expect("of this scene")
            .1;
        let whole = largest_error_m(&vertices, &last) < 4e-6;
        assert_eq!(whole, number + 1 == stride as u64, "message {number} of {stride}");
    }
    assert_eq!(last.len(), vertices.len());
}

/// Outlines were ragged while tissue moved fast: each message moved only every n-th position.
#[test]
fn places_between_those_that_a_message_holds_move_with_them() {
    let sides = [20_u32, 24, 25];
    let (vertices, spacing_m) = (sides.iter().product::<u32>(), 2.5e-3_f32);
    let place_m =
        |i: u32| [i % sides[0], i / sides[0] % sides[1], i / sides[0] / sides[1]].map(|n| spacing_m * n as f32);
    let mut header = SceneHeader::zeroed();
    (header.session_id, header.generation, header.vertex_count) = (3, 2, vertices);
    let words: Vec<u32> = (0..vertices).flat_map(|i| place_m(i).map(f32::to_bits)).collect();
    let rest = Rest::of_scene(&header, &words);
    // Tissue around a needle along z that is drawn out at 100 mm/s: up to 5 mm with it, less with the distance.
    let moved_z_m = |at: [f32; 3], time_s: f32| {
        let [x, y] = [at[0] - 0.02, at[1] - 0.03];
        let along = at[2] - 0.05 + 0.1 * time_s;
        -5e-3 * (-(x * x + y * y + along * along) / (2.0 * 0.012 * 0.012)).exp()
    };
    let (mut known, mut kept) = (Displacements::default(), vec![Vertex::default(); vertices as usize]);
    let (mut drawn_m, mut as_before_m) = (0.0_f32, 0.0_f32);
    for number in 0..20_u64 {
        let (mut header, _) = snapshot(vertices, 0, 0.0);
        header.time_ns = 30_000_000 * (number + 1);
        let truth: Vec<Vertex> = (0..vertices)
            .map(|i| {
                let at = place_m(i);
                let position_m = [at[0], at[1], at[2] + moved_z_m(at, 0.03 * number as f32)];
                Vertex { position_m }
            })
            .collect();
        let body = Thin::of(&rest, &header, &truth)
            .expect("of this scene")
            .with_places(number, 20_000);
        let (_, shown) = decode_snapshot(&rest, &mut known, &body)
            .expect("valid")
            .expect("of this scene");
        let stride = vertices.div_ceil(20_000 / 6) as usize;
        assert_eq!(stride, 4);
        let phase = number as usize % stride;
        (phase..vertices as usize)
            .step_by(stride)
            .for_each(|i| kept[i] = truth[i]);
        if number as usize > 2 * stride {
            drawn_m = drawn_m.max(largest_error_m(&truth, &shown));
            as_before_m = as_before_m.max(largest_error_m(&truth, &kept));
        }
    }
    assert!(as_before_m > 1e-3, "{as_before_m} m: too slow to show anything");
    assert!(
        drawn_m < 0.35 * as_before_m,
        "{drawn_m} m, {as_before_m} m where they stand still between"
    );
}

#[test]
fn a_snapshot_without_positions_needs_known_ones() {
    let rest = scene(3000, 5000);
    let (mut header, vertices) = snapshot(3000, 5000, 10e-3);
    let thin = Thin::of(&rest, &header, &vertices).expect("of this scene");
    let mut known = Displacements::default();
    let still = thin.without_places();
    assert!(still.len() < 2000, "{} bytes", still.len());
    assert_eq!(decode_snapshot(&rest, &mut known, &still).expect("valid"), None);
    let stride = thin.stride(MAX_THIN_BYTES);
    assert!(stride > 1);
    let mut last = None;
    for number in 0..stride as u64 {
        let body = thin.with_places(number, MAX_THIN_BYTES);
        last = decode_snapshot(&rest, &mut known, &body).expect("valid");
    }
    header.time_ns += 1_000_000_000;
    header.max_displacement_m = 0.05;
    let later = Thin::of(&rest, &header, &vertices).expect("of this scene");
    assert_eq!(later.fingerprint(), thin.fingerprint());
    let decoded = decode_snapshot(&rest, &mut known, &later.without_places()).expect("valid");
    let (shown, places) = decoded.expect("of this scene");
    assert_eq!((shown.time_ns, shown.max_displacement_m), (header.time_ns, 0.05));
    assert_eq!(Some(&places), last.as_ref().map(|(_, places)| places));
    let mut moved = vertices.clone();
    moved[7].position_m[0] += 1e-3;
    let moved = Thin::of(&rest, &header, &moved).expect("of this scene");
    assert_ne!(moved.fingerprint(), thin.fingerprint());
}

#[test]
fn a_snapshot_of_another_scene_and_one_of_wrong_lengths_are_not_taken() {
    let rest = scene(100, 0);
    let (header, vertices) = snapshot(100, 0, 1e-3);
    let body = Thin::of(&rest, &header, &vertices)
        .expect("of this scene")
        .with_places(0, MAX_THIN_BYTES);
    let other = scene(101, 0);
    assert!(Thin::of(&other, &header, &vertices).is_none());
    assert_eq!(
        decode_snapshot(&other, &mut Displacements::default(), &body).expect("valid"),
        None
    );
    for length in 0..body.len() {
        assert!(
            decode_snapshot(&rest, &mut Displacements::default(), &body[..length]).is_err(),
            "{length} bytes"
        );
    }
    let mut known = Displacements::default();
    // Counts that would reach beyond the body, and beyond memory.
    for at in 0..body.len() {
        for byte in [0x00, 0x7f, 0xff] {
            let mut bad = body.clone();
            bad[at] = byte;
            if let Ok(Some((header, vertices))) = decode_snapshot(&rest, &mut known, &bad) {
                assert!(stylet_shm_schema::check::snapshot(&header, &vertices).is_ok());
            }
        }
    }
}

#[test]
fn a_message_survives_and_bytes_of_others_are_refused() {
    let stamp = Stamp {
        run: 1,
        number: 2,
        sent_ns: 3,
        heard_ns: 4,
    };
    let bytes = encode(Kind::Again, stamp, &[&[1, 2], &[3]]);
    let message = decode(&bytes).expect("valid");
    assert_eq!(
        (message.kind, message.stamp, message.body),
        (Kind::Again, stamp, &[1, 2, 3][..])
    );
    assert!(decode(&bytes[..39]).is_err());
    assert_eq!(decode(&[0xff; 64]).unwrap_err(), Invalid("message of another version"));
    let mut unknown = bytes;
    unknown[4] = 99;
    assert_eq!(decode(&unknown).unwrap_err(), Invalid("kind of message"));
    assert!(one::<u64>(&[0; 7]).is_err());
    assert!(many::<u64>(&[0; 24], 2).is_err() && many::<u64>(&[0; 25], 9).is_err());
    assert!(part(&[0xff; 8000]).is_err() && super::scene(&[0xff; 40_000]).is_err());
}

#[test]
fn a_part_of_a_volume_lies_within_it_and_is_no_larger_than_one_may_be() {
    let mut header = UploadHeader::zeroed();
    header.dims = [100, 100, 10];
    let taken = |header: &UploadHeader, at: u64, count: usize| {
        let body = [bytemuck::bytes_of(header), &at.to_le_bytes(), &vec![7; count]].concat();
        part(&body).map(|(_, at, cells)| (at, cells.len())).ok()
    };
    assert_eq!(taken(&header, 0, PART_BYTES), Some((0, PART_BYTES)));
    assert_eq!(taken(&header, 99_999, 1), Some((99_999, 1)));
    for (at, count) in [(99_999, 2), (0, 0), (0, PART_BYTES + 1), (u64::MAX, 1)] {
        assert_eq!(taken(&header, at, count), None, "{at} {count}");
    }
    for dims in [[0, 9, 9], [u32::MAX; 3], [4096, 4096, 5]] {
        header.dims = dims;
        assert_eq!(taken(&header, 0, 1), None, "{dims:?}");
    }
}
