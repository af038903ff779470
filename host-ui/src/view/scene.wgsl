// Lit solids, plain lines and the translucent gland. Colours are gamma-encoded throughout, as egui blends them.

struct Scene {
    clip_from_scene: mat4x4<f32>,
    eye_m: vec4<f32>,
    light: vec4<f32>,
    // rgb and opacity of the surface.
    surface: vec4<f32>,
    // x: strength of the rim, y: how much the facing part fades.
    look: vec4<f32>,
    // Normal and offset of the section; the part in front of it is cut away.
    section: vec4<f32>,
}

@group(0) @binding(0) var<uniform> scene: Scene;

struct MarkOut {
    @builtin(position) clip: vec4<f32>,
    @location(0) place_m: vec3<f32>,
    @location(1) normal: vec3<f32>,
    @location(2) color: vec4<f32>,
}

@vertex
fn mark_vertex(@location(0) place_m: vec3<f32>, @location(1) normal: vec3<f32>, @location(2) color: vec4<f32>) -> MarkOut {
    return MarkOut(scene.clip_from_scene * vec4(place_m, 1.0), place_m, normal, color);
}

@fragment
fn mark_fragment(in: MarkOut) -> @location(0) vec4<f32> {
    // A line has no normal and is not lit.
    if dot(in.normal, in.normal) < 0.25 {
        return vec4(in.color.rgb, 1.0);
    }
    let n = normalize(in.normal);
    let to_eye = normalize(scene.eye_m.xyz - in.place_m);
    let diffuse = max(dot(n, scene.light.xyz), 0.0);
    let half_way = normalize(scene.light.xyz + to_eye);
    let gloss = pow(max(dot(n, half_way), 0.0), 40.0);
    let lit = in.color.rgb * (0.45 + 0.6 * diffuse) + vec3(0.35 * gloss);
    return vec4(min(lit, vec3(1.0)), 1.0);
}

struct SurfaceOut {
    @builtin(position) clip: vec4<f32>,
    @location(0) place_m: vec3<f32>,
    @location(1) normal: vec3<f32>,
}

@vertex
fn surface_vertex(@location(0) place_m: vec3<f32>, @location(1) normal: vec3<f32>) -> SurfaceOut {
    return SurfaceOut(scene.clip_from_scene * vec4(place_m, 1.0), place_m, normal);
}

// By products: a driver without a graphics card takes a logarithm and an exponential for `pow`.
fn power_28(x: f32) -> f32 {
    let x4 = (x * x) * (x * x);
    let x8 = x4 * x4;
    return x4 * x8 * (x8 * x8);
}

@fragment
fn surface_fragment(in: SurfaceOut, @builtin(front_facing) front: bool) -> @location(0) vec4<f32> {
    if dot(scene.section.xyz, in.place_m) > scene.section.w {
        discard;
    }
    let to_eye = normalize(scene.eye_m.xyz - in.place_m);
    var n = in.normal / max(length(in.normal), 1e-12);
    if !front {
        n = -n;
    }
    let facing = clamp(dot(n, to_eye), 0.0, 1.0);
    let beside = 1.0 - facing;
    let rim = beside * beside * sqrt(beside);
    let diffuse = max(dot(n, scene.light.xyz), 0.0);
    let half_way = normalize(scene.light.xyz + to_eye);
    let gloss = power_28(max(dot(n, half_way), 0.0));
    var color = scene.surface.rgb * (0.42 + 0.55 * diffuse) + scene.surface.rgb * rim * scene.look.x * 0.6 + vec3(0.14 * gloss);
    if !front {
        color *= 0.62;
    }
    let alpha = clamp(scene.surface.a * (1.0 - scene.look.y * facing) + rim * scene.look.x * 0.35 * scene.surface.a, 0.0, 1.0);
    // Premultiplied.
    return vec4(min(color, vec3(1.0)) * alpha, alpha);
}
