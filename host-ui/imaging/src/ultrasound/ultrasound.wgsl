// The echoes of one plane of a probe, from tissue to decibels, on a grid of beams and depths: beam l, sample k at k * lines + l.
// In this order: rest_map, echo, beam, axial, lateral. What each number means stands in plane.rs and docs/imaging.md.

struct Shot {
    // Middle of the array on the probe's axis; beside it 0 for a sector, 1 for parallel beams.
    origin_m: vec4<f32>,
    // To the right of the picture; beside it the radius of the probe (m).
    right: vec4<f32>,
    // Along the middle beam; beside it the depth (m).
    up: vec4<f32>,
    // Across the plane; beside it half the angle (rad) or half the length (m) of the fan.
    normal: vec4<f32>,
    // Beams, samples, slices across the plane, cells between places where the material point is sought.
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
    // Scatterers per m along each axis, and the largest amplitude that is kept of one.
    scatterers: vec4<f32>,
}

override STEPS: i32;
override SEEN_M: f32;
// What the largest value of a texel stands for: dB per cm and MHz, MRayl.
override LARGEST_LOSS: f32;
override LARGEST_IMPEDANCE: f32;
// Decibels from black to white, and the brightness whose mean echo is 0 dB.
override RANGE_DB: f32;
override ZERO_BRIGHTNESS: f32;
// Distance between places of which each has a texture of its own (m), and the loss below which texture fades.
override PATCH_M: f32;
override SOFT_LOSS: f32;

@group(0) @binding(0) var<uniform> shot: Shot;
@group(0) @binding(1) var tissues: texture_3d<f32>;
@group(0) @binding(2) var nodes: texture_3d<f32>;
@group(0) @binding(3) var clamped: sampler;
@group(0) @binding(4) var<storage, read> grains: array<u32>;
@group(0) @binding(5) var<storage, read> marks: array<vec2<f32>>;
@group(0) @binding(6) var<storage, read_write> shifts_m: array<vec4<f32>>;
@group(0) @binding(7) var<storage, read_write> near: array<vec4<f32>>;
@group(0) @binding(8) var<storage, read_write> far: array<vec4<f32>>;
@group(0) @binding(9) var<storage, read_write> levels_db: array<f32>;
// Of each sample: power of its sum of echoes, beyond that of its weights.
@group(0) @binding(10) var<storage, read> powers: array<f32>;

// Slices reach so many spreads to both sides.
const REACH: f32 = 2.0;

fn depth_of(sample: f32) -> f32 {
    return sample * shot.up.w / (shot.counts.y - 1.0);
}

fn thickness_of(depth_m: f32) -> f32 {
    let x = (depth_m - shot.thickness.y) / shot.thickness.z;
    return shot.thickness.x * sqrt(1.0 + x * x);
}

// In the plane.
fn place_of(line: f32, sample: f32) -> vec3<f32> {
    let across = shot.normal.w * (2.0 * line / (shot.counts.x - 1.0) - 1.0);
    let r = shot.right.w + depth_of(sample);
    if (shot.origin_m.w > 0.5) {
        return shot.origin_m.xyz + r * shot.up.xyz + across * shot.right.xyz;
    }
    return shot.origin_m.xyz + r * (cos(across) * shot.up.xyz + sin(across) * shot.right.xyz);
}

fn displacement_m(rest_m: vec3<f32>) -> vec3<f32> {
    let at = (rest_m - shot.nodes_corner_m.xyz) / shot.nodes_size_m.xyz;
    return textureSampleLevel(nodes, clamped, at, 0.0).xyz;
}

// How far what lies at a place now is from where it was at rest, at the edges of cells of the grid, at both ends of the slices.
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
    let place_m = place_of(f32(id.x * cell), sample) + e * shot.normal.xyz;
    var rest_m = place_m;
    for (var step = 0; step < STEPS; step++) {
        let next_m = place_m - displacement_m(rest_m);
        let moved_m = abs(next_m - rest_m);
        rest_m = next_m;
        if (max(moved_m.x, max(moved_m.y, moved_m.z)) < SEEN_M) {
            break;
        }
    }
    shifts_m[(id.z * rows + id.y) * columns + id.x] = vec4(place_m - rest_m, 0.0);
}

fn shift_m(line: u32, sample: u32, side: u32) -> vec3<f32> {
    let cell = u32(shot.counts.w);
    let columns = (u32(shot.counts.x) - 1u) / cell + 2u;
    let rows = (u32(shot.counts.y) - 1u) / cell + 2u;
    let at = (side * rows + sample / cell) * columns + line / cell;
    let x = f32(line % cell) / f32(cell);
    let y = f32(sample % cell) / f32(cell);
    let low = mix(shifts_m[at].xyz, shifts_m[at + 1u].xyz, x);
    return mix(low, mix(shifts_m[at + columns].xyz, shifts_m[at + columns + 1u].xyz, x), y);
}

// Two scatterers beside each other along x. Where a row begins among those that are kept is a hash of its place, so that no pattern
// repeats.
fn pair(cell: vec3<i32>) -> vec4<f32> {
    let mixed = (u32(cell.y) * 0x9E3779B1u) ^ (u32(cell.z) * 0x85EBCA77u);
    let row = (mixed ^ (mixed >> 15u)) * 0x2C1B3C6Du;
    return unpack4x8snorm(grains[((row >> 12u) + u32(cell.x)) & 0x1FFFFu]);
}

// Between the scatterers of a grid, in its steps; of the same mean power everywhere.
fn scattering(at: vec3<f32>) -> vec2<f32> {
    let low = floor(at);
    let b = at - low;
    let a = 1.0 - b;
    let i = vec3<i32>(low);
    let bottom = pair(i) * a.y + pair(i + vec3(0, 1, 0)) * b.y;
    let top = pair(i + vec3(0, 0, 1)) * a.y + pair(i + vec3(0, 1, 1)) * b.y;
    let both = bottom * a.z + top * b.z;
    let power = a * a + b * b;
    return (both.xy * a.x + both.zw * b.x) * shot.scatterers.w * inverseSqrt(power.x * power.y * power.z);
}

// By how much a material point is brighter than its tissue. Fluids take no sound and have no texture.
fn texture_db(rest_m: vec3<f32>, loss: f32) -> f32 {
    if (shot.gain.w == 0.0) {
        return 0.0;
    }
    // One of two parts of an echo has half of its power.
    return shot.gain.w * min(loss / SOFT_LOSS, 1.0) * sqrt(2.0) * scattering(rest_m / PATCH_M).x;
}

@compute @workgroup_size(64)
fn echo(@builtin(global_invocation_id) id: vec3<u32>) {
    let lines = u32(shot.counts.x);
    if (id.x >= lines) {
        return;
    }
    let place_m = place_of(f32(id.x), f32(id.y));
    let thick_m = thickness_of(depth_of(f32(id.y)));
    let before_m = shift_m(id.x, id.y, 0u);
    let behind_m = shift_m(id.x, id.y, 1u);
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
    near[id.y * lines + id.x] = vec4(sum * strength * inverseSqrt(power), tissue.y * LARGEST_LOSS, tissue.z * LARGEST_IMPEDANCE);
}

// One beam: what is left of the sound, edges that it meets, marks of metal and their shadow.
@compute @workgroup_size(64)
fn beam(@builtin(global_invocation_id) id: vec3<u32>) {
    let lines = u32(shot.counts.x);
    let samples = u32(shot.counts.y);
    if (id.x >= lines) {
        return;
    }
    let step_cm = 100.0 * depth_of(1.0);
    var lost_db = 0.0;
    var before = near[id.x].w;
    for (var k = 0u; k < samples; k++) {
        let n = k * lines + id.x;
        let here = near[n];
        let mark = marks[n];
        let left = pow(10.0, -0.1 * lost_db);
        let edge = 0.5 * abs(log(here.w / before)) * shot.gain.z;
        far[n] = vec4(here.xy * left, (edge + mark.x) * left, 0.0);
        lost_db += here.z * shot.thickness.w * step_cm + mark.y;
        before = here.w;
    }
}

// The pulse. Echoes of scatterers keep their mean power, bright lines their height where they are long across the beam.
@compute @workgroup_size(64)
fn axial(@builtin(global_invocation_id) id: vec3<u32>) {
    let lines = u32(shot.counts.x);
    if (id.x >= lines) {
        return;
    }
    let spread = shot.spread.x / depth_of(1.0);
    let reach = i32(ceil(3.0 * spread));
    var sum = vec3(0.0);
    var power = 0.0;
    for (var j = -reach; j <= reach; j++) {
        let x = f32(j) / spread;
        let weight = exp(-0.5 * x * x);
        let k = i32(id.y) + j;
        if (k >= 0 && k < i32(shot.counts.y)) {
            sum += weight * far[u32(k) * lines + id.x].xyz;
            power += weight * weight;
        }
    }
    near[id.y * lines + id.x] = vec4(sum.xy * inverseSqrt(power), sum.z, 0.0);
}

// The beam, wider with depth; then the envelope in dB.
@compute @workgroup_size(64)
fn lateral(@builtin(global_invocation_id) id: vec3<u32>) {
    let lines = u32(shot.counts.x);
    if (id.x >= lines) {
        return;
    }
    let depth_m = depth_of(f32(id.y));
    let r = select(shot.right.w + depth_m, 1.0, shot.origin_m.w > 0.5);
    let pitch_m = r * 2.0 * shot.normal.w / (shot.counts.x - 1.0);
    let spread = max(max(shot.spread.y, shot.spread.z * depth_m) / pitch_m, 0.1);
    let reach = min(i32(ceil(2.7 * spread)), 40);
    var sum = vec3(0.0);
    var power = 0.0;
    var whole = 0.0;
    for (var j = -reach; j <= reach; j++) {
        let x = f32(j) / spread;
        let weight = exp(-0.5 * x * x);
        let l = i32(id.x) + j;
        if (l >= 0 && l < i32(lines)) {
            sum += weight * near[id.y * lines + u32(l)].xyz;
            power += weight * weight;
            whole += weight;
        }
    }
    let bright = sum.z / whole;
    let echo = dot(sum.xy, sum.xy) / (power * powers[id.y]) + bright * bright;
    levels_db[id.y * lines + id.x] = 10.0 * log(max(echo, 1e-20)) / log(10.0) + shot.gain.x * depth_m + shot.gain.y;
}
