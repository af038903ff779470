// The echoes of one plane of a probe, from tissue to decibels, on a grid of beams and depths: beam
// l, sample k in column l, row k. Order of the passes: rest_map, echo, beam, axial, lateral.
// plane.rs and docs/imaging.md explain each number.

struct Shot {
    // Centre of the array on the probe's axis; in w, 0 for a sector, 1 for parallel beams.
    origin_m: vec4<f32>,
    // To the right of the picture; in w, the radius of the probe (m).
    right: vec4<f32>,
    // Along the middle beam; in w, the depth (m).
    up: vec4<f32>,
    // Across the plane; in w, half the angle (rad) or half the length (m) of the fan.
    normal: vec4<f32>,
    // Beams, samples, slices across the plane, cells between points where the material point is
    // found.
    counts: vec4<f32>,
    // Spread along the beam (m), smallest spread across it (m), spread across it per depth, loss of marks per sample.
    spread: vec4<f32>,
    // Spread across the plane at its focus (m), depth of the focus (m), depth over which it widens (m), MHz.
    thickness: vec4<f32>,
    // Gain with depth (dB/m), gain (dB), brightness of an edge, texture of soft tissue (dB).
    gain: vec4<f32>,
    volume_corner_m: vec4<f32>,
    volume_size_m: vec4<f32>,
    nodes_corner_m: vec4<f32>,
    nodes_size_m: vec4<f32>,
    // Scatterers per m along each axis.
    scatterers: vec4<f32>,
}

override STEPS: i32;
override SEEN_M: f32;
// Values of a full texel: dB per cm and MHz, MRayl.
override LARGEST_LOSS: f32;
override LARGEST_IMPEDANCE: f32;
// Decibels from black to white, and the brightness whose mean echo is 0 dB.
override RANGE_DB: f32;
override ZERO_BRIGHTNESS: f32;
// Distance between points with independent texture (m), and the loss below which texture fades.
override PATCH_M: f32;
override SOFT_LOSS: f32;

@group(0) @binding(0) var<uniform> shot: Shot;
@group(0) @binding(1) var tissues: texture_3d<f32>;
@group(0) @binding(2) var nodes: texture_3d<f32>;
@group(0) @binding(3) var clamped: sampler;
@group(0) @binding(4) var<storage, read> marks: array<vec2<f32>>;
// For each sample, the power of its sum of echoes, beyond that of its weights.
@group(0) @binding(5) var<storage, read> powers: array<f32>;
// Output of the previous pass and of this one, by beam and sample. They are textures because Mesa's
// software driver reads eight of those at once, but buffers word by word.
@group(0) @binding(6) var before: texture_2d<f32>;
@group(0) @binding(7) var after: texture_storage_2d<rgba32float, write>;
@group(0) @binding(8) var levels_db: texture_storage_2d<r32float, write>;

// Slices extend this many spreads to both sides.
const REACH: f32 = 2.0;
// Neighbours that are computed together, as in passes.rs: they share their inputs.
const AT_ONCE: i32 = 4;

fn depth_of(sample: f32) -> f32 {
    return sample * shot.up.w / (shot.counts.y - 1.0);
}

fn thickness_of(depth_m: f32) -> f32 {
    let x = (depth_m - shot.thickness.y) / shot.thickness.z;
    return shot.thickness.x * sqrt(1.0 + x * x);
}

// A beam in the plane: its point at depth r from the axis is its start plus r times its direction.
struct Beam {
    start_m: vec3<f32>,
    along: vec3<f32>,
}

fn beam_of(line: f32) -> Beam {
    let across = shot.normal.w * (2.0 * line / (shot.counts.x - 1.0) - 1.0);
    if (shot.origin_m.w > 0.5) {
        return Beam(shot.origin_m.xyz + across * shot.right.xyz, shot.up.xyz);
    }
    return Beam(shot.origin_m.xyz, cos(across) * shot.up.xyz + sin(across) * shot.right.xyz);
}

fn place_of(beam: Beam, sample: f32) -> vec3<f32> {
    return beam.start_m + (shot.right.w + depth_of(sample)) * beam.along;
}

fn displacement_m(rest_m: vec3<f32>) -> vec3<f32> {
    let at = (rest_m - shot.nodes_corner_m.xyz) / shot.nodes_size_m.xyz;
    return textureSampleLevel(nodes, clamped, at, 0.0).xyz;
}

fn kept_at(at: vec2<u32>) -> vec4<f32> {
    return textureLoad(before, at, 0);
}

// Displacement of the tissue from rest, at the edges of cells of the grid, at both ends of the
// slices: one end below the other in a corner of the texture, which has more columns and rows than
// both.
@compute @workgroup_size(64)
fn rest_map(@builtin(global_invocation_id) id: vec3<u32>) {
    let cell = u32(shot.counts.w);
    let columns = (u32(shot.counts.x) - 1u) / cell + 2u;
    let rows = (u32(shot.counts.y) - 1u) / cell + 2u;
    if (id.x >= columns || id.y >= rows) {
        return;
    }
    let sample = f32(id.y * cell);
    let e = (f32(id.z) * 2.0 - 1.0) * REACH * thickness_of(depth_of(sample));
    let place_m = place_of(beam_of(f32(id.x * cell)), sample) + e * shot.normal.xyz;
    var rest_m = place_m;
    for (var step = 0; step < STEPS; step++) {
        let next_m = place_m - displacement_m(rest_m);
        let moved_m = abs(next_m - rest_m);
        rest_m = next_m;
        if (max(moved_m.x, max(moved_m.y, moved_m.z)) < SEEN_M) {
            break;
        }
    }
    textureStore(after, vec2(id.x, id.z * rows + id.y), vec4(place_m - rest_m, 0.0));
}

fn shift_m(at: vec2<u32>, x: f32) -> vec3<f32> {
    return mix(kept_at(at).xyz, kept_at(at + vec2(1u, 0u)).xyz, x);
}

// Two parts of a scatterer's echo, from a hash of its position (the finaliser of MurmurHash3), so
// that none repeats. They are uniformly distributed, which their sums do not show. A row has a hash
// of its own.
fn scatterer(row: u32, x: i32) -> vec2<f32> {
    var h = row + u32(x) * 0x9E3779B1u;
    h = (h ^ (h >> 16u)) * 0x85EBCA6Bu;
    h = (h ^ (h >> 13u)) * 0xC2B2AE35u;
    return unpack2x16snorm(h ^ (h >> 16u));
}

// Interpolates between the scatterers of a grid, in its steps; of mean power 1 everywhere, because
// a uniform distribution over -1 to 1 has a variance of a third.
fn scattering(at: vec3<f32>) -> vec2<f32> {
    let low = floor(at);
    let b = at - low;
    let a = 1.0 - b;
    let i = vec3<i32>(low);
    let y = vec2(u32(i.y), u32(i.y) + 1u) * 0x27D4EB2Fu;
    let z = vec2(u32(i.z), u32(i.z) + 1u) * 0x165667B1u;
    let weights = vec4(a.y * a.z, b.y * a.z, a.y * b.z, b.y * b.z);
    let rows = y.xyxy ^ z.xxyy;
    var near = weights.x * scatterer(rows.x, i.x);
    var far = weights.x * scatterer(rows.x, i.x + 1);
    for (var n = 1; n < 4; n++) {
        near += weights[n] * scatterer(rows[n], i.x);
        far += weights[n] * scatterer(rows[n], i.x + 1);
    }
    let power = a * a + b * b;
    return (near * a.x + far * b.x) * sqrt(1.5) * inverseSqrt(power.x * power.y * power.z);
}

// Returns how much a material point is brighter than its tissue. Fluids do not absorb and have no
// texture.
fn texture_db(rest_m: vec3<f32>, loss: f32) -> f32 {
    if (shot.gain.w == 0.0) {
        return 0.0;
    }
    // One of two parts of an echo has half of its power.
    return shot.gain.w * min(loss / SOFT_LOSS, 1.0) * sqrt(2.0) * scattering(rest_m / PATCH_M).x;
}

// Returns the echo of a sample of a beam: two parts, attenuation, impedance. Its material points
// lie this far from it at both ends of the slices.
fn sent_back(beam: Beam, sample: f32, before_m: vec3<f32>, behind_m: vec3<f32>) -> vec4<f32> {
    let place_m = place_of(beam, sample);
    let thick_m = thickness_of(depth_of(sample));
    let middle_m = place_m - 0.5 * (before_m + behind_m);
    let at = (middle_m - shot.volume_corner_m.xyz) / shot.volume_size_m.xyz;
    let tissue = textureSampleLevel(tissues, clamped, at, 0.0);
    var sum = vec2(0.0);
    var power = 0.0;
    let slices = i32(shot.counts.z);
    for (var slice = 0; slice < slices; slice++) {
        let part = f32(slice) / f32(slices - 1);
        let e = REACH * (2.0 * part - 1.0);
        let weight = exp(-0.5 * e * e);
        let rest_m = place_m + e * thick_m * shot.normal.xyz - mix(before_m, behind_m, part);
        sum += weight * scattering(rest_m * shot.scatterers.xyz);
        power += weight * weight;
    }
    let echo_db = (tissue.x - ZERO_BRIGHTNESS) * RANGE_DB + texture_db(middle_m, tissue.y * LARGEST_LOSS);
    let strength = select(0.0, pow(10.0, echo_db / 20.0), tissue.x > 0.0);
    return vec4(sum * strength * inverseSqrt(power), tissue.y * LARGEST_LOSS, tissue.z * LARGEST_IMPEDANCE);
}

// Four samples of a beam, between the same points of the map, whose cells are a multiple of four.
@compute @workgroup_size(64)
fn echo(@builtin(global_invocation_id) id: vec3<u32>) {
    let lines = u32(shot.counts.x);
    let samples = u32(shot.counts.y);
    if (id.x >= lines) {
        return;
    }
    let cell = u32(shot.counts.w);
    let rows = (samples - 1u) / cell + 2u;
    let first = u32(AT_ONCE) * id.y;
    let at = vec2(id.x / cell, first / cell);
    let x = f32(id.x % cell) / f32(cell);
    let beam = beam_of(f32(id.x));
    let above_before_m = shift_m(at, x);
    let below_before_m = shift_m(at + vec2(0u, 1u), x);
    let above_behind_m = shift_m(at + vec2(0u, rows), x);
    let below_behind_m = shift_m(at + vec2(0u, rows + 1u), x);
    for (var k = first; k < min(first + u32(AT_ONCE), samples); k++) {
        let y = f32(k % cell) / f32(cell);
        let before_m = mix(above_before_m, below_before_m, y);
        let behind_m = mix(above_behind_m, below_behind_m, y);
        textureStore(after, vec2(id.x, k), sent_back(beam, f32(k), before_m, behind_m));
    }
}

// One beam: remaining sound, edges, marks of metal and their shadow.
@compute @workgroup_size(16)
fn beam(@builtin(global_invocation_id) id: vec3<u32>) {
    let lines = u32(shot.counts.x);
    let samples = u32(shot.counts.y);
    if (id.x >= lines) {
        return;
    }
    let step_cm = 100.0 * depth_of(1.0);
    var lost_db = 0.0;
    var impedance = kept_at(vec2(id.x, 0u)).w;
    for (var k = 0u; k < samples; k++) {
        let here = kept_at(vec2(id.x, k));
        let mark = marks[k * lines + id.x];
        let left = pow(10.0, -0.1 * lost_db);
        let edge = 0.5 * abs(log(here.w / impedance)) * shot.gain.z;
        textureStore(after, vec2(id.x, k), vec4(here.xy * left, (edge + mark.x) * left, 0.0));
        lost_db += here.z * shot.thickness.w * step_cm + mark.y;
        impedance = here.w;
    }
}

// Weighted sums around four neighbours: of both parts of the echoes, of bright lines, of squared weights and of weights.
struct Sums {
    real: vec4<f32>,
    imaginary: vec4<f32>,
    edge: vec4<f32>,
    power: vec4<f32>,
    whole: vec4<f32>,
}

// Sums from a texel on along `step`, with the number of texels in that direction; `from_edge` is
// the index of the first of the four among them.
fn sums_of_four(at: vec2<i32>, step: vec2<i32>, from_edge: i32, size: i32, spread: f32, reach: i32) -> Sums {
    var sums = Sums();
    var weight = vec4(0.0);
    for (var j = -reach; j <= reach + 3; j++) {
        // An element j from the first is j - 1 from the second.
        let x = f32(j) / spread;
        weight = vec4(select(0.0, exp(-0.5 * x * x), abs(j) <= reach), weight.xyz);
        let n = from_edge + j;
        if (n >= 0 && n < size) {
            let here = kept_at(vec2<u32>(at + j * step));
            sums.real += weight * here.x;
            sums.imaginary += weight * here.y;
            sums.edge += weight * here.z;
            sums.power += weight * weight;
            sums.whole += weight;
        }
    }
    return sums;
}

// The pulse, over four samples of a beam. Echoes of scatterers keep their mean power, bright lines
// keep their height where they are long across the beam.
@compute @workgroup_size(64)
fn axial(@builtin(global_invocation_id) id: vec3<u32>) {
    let samples = i32(shot.counts.y);
    if (id.x >= u32(shot.counts.x)) {
        return;
    }
    let spread = shot.spread.x / depth_of(1.0);
    let at = vec2(i32(id.x), AT_ONCE * i32(id.y));
    let sums = sums_of_four(at, vec2(0, 1), at.y, samples, spread, i32(ceil(3.0 * spread)));
    let root = inverseSqrt(sums.power);
    for (var i = 0; i < min(AT_ONCE, samples - at.y); i++) {
        let kept = vec4(sums.real[i] * root[i], sums.imaginary[i] * root[i], sums.edge[i], 0.0);
        textureStore(after, at + vec2(0, i), kept);
    }
}

// Four beams, wider with depth; then the envelope in dB.
@compute @workgroup_size(16, 4)
fn lateral(@builtin(global_invocation_id) id: vec3<u32>) {
    let lines = i32(shot.counts.x);
    let at = vec2(AT_ONCE * i32(id.x), i32(id.y));
    if (at.x >= lines || id.y >= u32(shot.counts.y)) {
        return;
    }
    let depth_m = depth_of(f32(id.y));
    let r = select(shot.right.w + depth_m, 1.0, shot.origin_m.w > 0.5);
    let pitch_m = r * 2.0 * shot.normal.w / (shot.counts.x - 1.0);
    let spread = max(max(shot.spread.y, shot.spread.z * depth_m) / pitch_m, 0.1);
    let sums = sums_of_four(at, vec2(1, 0), at.x, lines, spread, min(i32(ceil(2.7 * spread)), 40));
    let bright = sums.edge / sums.whole;
    let square = sums.real * sums.real + sums.imaginary * sums.imaginary;
    let echo = square / (sums.power * powers[id.y]) + bright * bright;
    let level_db = 10.0 * log(max(echo, vec4(1e-20))) / log(10.0) + shot.gain.x * depth_m + shot.gain.y;
    for (var i = 0; i < min(AT_ONCE, lines - at.x); i++) {
        textureStore(levels_db, at + vec2(i, 0), vec4(level_db[i], 0.0, 0.0, 0.0));
    }
}
