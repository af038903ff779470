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

/// Each place is displaced by up to `most_m`, each differently.
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
        let body = encode_snapshot(&rest, &header, &vertices, 0, MAX_THIN_BYTES).expect("of this scene");
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
    let (header, vertices) = snapshot(12_000, 8192, 10e-3);
    let mut known = Displacements::default();
    let mut last = Vec::new();
    let stride = (20_192_usize * 6).div_ceil(MAX_THIN_BYTES - 2000);
    for number in 0..stride as u64 {
        let body = encode_snapshot(&rest, &header, &vertices, number, MAX_THIN_BYTES).expect("of this scene");
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

#[test]
fn a_snapshot_of_another_scene_and_one_of_wrong_lengths_are_not_taken() {
    let rest = scene(100, 0);
    let (header, vertices) = snapshot(100, 0, 1e-3);
    let body = encode_snapshot(&rest, &header, &vertices, 0, MAX_THIN_BYTES).expect("of this scene");
    let other = scene(101, 0);
    assert!(encode_snapshot(&other, &header, &vertices, 0, MAX_THIN_BYTES).is_none());
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
    assert!(upload(&[0xff; 8000]).is_err() && super::scene(&[0xff; 40_000]).is_err());
}
