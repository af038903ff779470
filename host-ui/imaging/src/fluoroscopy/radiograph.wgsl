// One ray for each pixel: its attenuation in the cells along its path through the body at rest.
// Between points where the material point is found the path is straight, and on each straight piece
// every cell counts by its length.

struct Shot {
    // Source (m), and the largest displacement along an axis (m).
    source_m: vec4<f32>,
    // Centre of the detector (m), and the edge of a pixel (m).
    detector_m: vec4<f32>,
    // To the right and up on the detector, each with its count of pixels.
    right: vec4<f32>,
    up: vec4<f32>,
    // Lower corner of the cells (m), and their edge (m).
    corner_m: vec4<f32>,
    // Cells along each axis, and the length of a piece (m).
    dims: vec4<f32>,
    nodes_corner_m: vec4<f32>,
    nodes_size_m: vec4<f32>,
}

override STEPS: i32;
override SEEN_M: f32;

@group(0) @binding(0) var<uniform> shot: Shot;
@group(0) @binding(1) var nodes: texture_3d<f32>;
@group(0) @binding(2) var clamped: sampler;
@group(0) @binding(3) var<storage, read> loss_per_m: array<f32>;
@group(0) @binding(4) var<storage, read> metal: array<f32>;
@group(0) @binding(5) var<storage, read_write> transmission: array<f32>;

fn displacement_m(rest_m: vec3<f32>) -> vec3<f32> {
    let at = (rest_m - shot.nodes_corner_m.xyz) / shot.nodes_size_m.xyz;
    return textureSampleLevel(nodes, clamped, at, 0.0).xyz;
}

// Starts from the displacement of the previous piece.
fn shift_of(place_m: vec3<f32>, before_m: vec3<f32>) -> vec3<f32> {
    var shift_m = before_m;
    for (var step = 0; step < STEPS; step++) {
        let next_m = displacement_m(place_m - shift_m);
        let moved_m = abs(next_m - shift_m);
        shift_m = next_m;
        if (max(moved_m.x, max(moved_m.y, moved_m.z)) < SEEN_M) {
            break;
        }
    }
    return shift_m;
}

// Sum of attenuation over a straight piece between two places (cells), each cell by its share of
// the piece.
fn loss_between(start: vec3<f32>, end: vec3<f32>) -> f32 {
    let way = end - start;
    let forward = way >= vec3(0.0);
    let dims = vec3<i32>(shot.dims.xyz);
    var cell = vec3<i32>(floor(start));
    let inverse = 1.0 / select(way, vec3(1e-9), abs(way) < vec3(1e-9));
    let step = select(vec3(-1), vec3(1), forward);
    let width = abs(inverse);
    var next = (vec3<f32>(cell) + select(vec3(0.0), vec3(1.0), forward) - start) * inverse;
    next = select(next, vec3(2.0), abs(way) < vec3(1e-9));
    var at = 0.0;
    var sum = 0.0;
    for (var n = 0; n < 64; n++) {
        let leaves = min(1.0, min(next.x, min(next.y, next.z)));
        let inside = all(cell >= vec3(0)) && all(cell < dims);
        if (inside) {
            sum += (leaves - at) * loss_per_m[(cell.z * dims.y + cell.y) * dims.x + cell.x];
        }
        at = leaves;
        if (leaves >= 1.0) {
            break;
        }
        if (next.x <= next.y && next.x <= next.z) {
            cell.x += step.x;
            next.x += width.x;
        } else if (next.y <= next.z) {
            cell.y += step.y;
            next.y += width.y;
        } else {
            cell.z += step.z;
            next.z += width.z;
        }
    }
    return sum;
}

@compute @workgroup_size(8, 8)
fn radiograph(@builtin(global_invocation_id) id: vec3<u32>) {
    let pixels = vec2(shot.right.w, shot.up.w);
    if (id.x >= u32(pixels.x) || id.y >= u32(pixels.y)) {
        return;
    }
    let on_detector = (vec2<f32>(id.xy) + 0.5 - 0.5 * pixels) * shot.detector_m.w;
    let pixel_m = shot.detector_m.xyz + on_detector.x * shot.right.xyz - on_detector.y * shot.up.xyz;
    let way_m = pixel_m - shot.source_m.xyz;
    let length_m = length(way_m);
    let along = way_m / length_m;
    // The box that may contain the deformed body.
    let low_m = shot.corner_m.xyz - shot.source_m.w;
    let high_m = shot.corner_m.xyz + shot.dims.xyz * shot.corner_m.w + shot.source_m.w;
    let inverse = 1.0 / select(along, vec3(1e-9), abs(along) < vec3(1e-9));
    let a = (low_m - shot.source_m.xyz) * inverse;
    let b = (high_m - shot.source_m.xyz) * inverse;
    let near = min(a, b);
    let far = max(a, b);
    let first_m = max(0.0, max(near.x, max(near.y, near.z)));
    let last_m = min(length_m, min(far.x, min(far.y, far.z)));
    var lost = metal[id.y * u32(pixels.x) + id.x];
    if (last_m > first_m) {
        let pieces = u32(ceil((last_m - first_m) / shot.dims.w));
        let piece_m = (last_m - first_m) / f32(pieces);
        var place_m = shot.source_m.xyz + first_m * along;
        var shift_m = shift_of(place_m, vec3(0.0));
        var start = (place_m - shift_m - shot.corner_m.xyz) / shot.corner_m.w;
        for (var n = 1u; n <= pieces; n++) {
            place_m = shot.source_m.xyz + (first_m + piece_m * f32(n)) * along;
            shift_m = shift_of(place_m, shift_m);
            let end = (place_m - shift_m - shot.corner_m.xyz) / shot.corner_m.w;
            lost += piece_m * loss_between(start, end);
            start = end;
        }
    }
    transmission[id.y * u32(pixels.x) + id.x] = exp(-lost);
}
