// Scan conversion from beams and depths to the picture, black outside the beams.

struct Scan {
    // Size of the picture in pixels, size of a pixel (m), height of its lower edge over the probe's axis (m).
    picture: vec4<f32>,
    // 0 for a sector, 1 for parallel beams; radius of the probe (m), depth (m), half the angle (rad) or the length (m).
    fan: vec4<f32>,
    // Beams, samples, decibels of white and from black to white.
    levels: vec4<f32>,
}

@group(0) @binding(0) var<uniform> scan: Scan;
@group(0) @binding(1) var levels_db: texture_2d<f32>;

@vertex
fn scan_vertex(@builtin(vertex_index) index: u32) -> @builtin(position) vec4<f32> {
    return vec4(f32(index & 1u) * 4.0 - 1.0, f32(index >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}

fn level_of(line: u32, sample: u32) -> f32 {
    return textureLoad(levels_db, vec2(line, sample), 0).x;
}

@fragment
fn scan_fragment(@builtin(position) at: vec4<f32>) -> @location(0) vec4<f32> {
    let x = (at.x - 0.5 * scan.picture.x) * scan.picture.z;
    let y = (scan.picture.y - at.y) * scan.picture.z + scan.picture.w;
    let is_linear = scan.fan.x > 0.5;
    let r = select(length(vec2(x, y)), y, is_linear);
    let across = select(atan2(x, y), x, is_linear);
    let line = 0.5 * (across / scan.fan.w + 1.0) * (scan.levels.x - 1.0);
    let sample = (r - scan.fan.y) / scan.fan.z * (scan.levels.y - 1.0);
    if (abs(across) > scan.fan.w || sample < 0.0 || sample > scan.levels.y - 1.0) {
        return vec4(0.0, 0.0, 0.0, 1.0);
    }
    let lines = u32(scan.levels.x);
    let l = min(u32(line), lines - 2u);
    let k = min(u32(sample), u32(scan.levels.y) - 2u);
    let b = vec2(line - f32(l), sample - f32(k));
    let low = mix(level_of(l, k), level_of(l + 1u, k), b.x);
    let level_db = mix(low, mix(level_of(l, k + 1u), level_of(l + 1u, k + 1u), b.x), b.y);
    let grey = clamp(1.0 - (scan.levels.z - level_db) / scan.levels.w, 0.0, 1.0);
    return vec4(grey, grey, grey, 1.0);
}
