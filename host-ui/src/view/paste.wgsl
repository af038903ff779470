// A finished picture, pixel for pixel.

// The window's texture takes linear light, not screen values.
override TAKES_LIGHT: bool;
// For a picture with fewer pixels than its place.
override ENLARGES: bool;

@group(0) @binding(0) var picture: texture_2d<f32>;
@group(0) @binding(1) var between: sampler;

struct Out {
    @builtin(position) clip: vec4<f32>,
    // From the upper left corner, 0 to 1.
    @location(0) at: vec2<f32>,
}

@vertex
fn paste_vertex(@builtin(vertex_index) index: u32) -> Out {
    // One triangle over the whole picture.
    let at = vec2(f32(i32(index & 1u) * 2), f32(i32(index >> 1u) * 2));
    return Out(vec4(2.0 * at.x - 1.0, 1.0 - 2.0 * at.y, 0.0, 1.0), at);
}

fn light_of(color: vec3<f32>) -> vec3<f32> {
    let high = pow((color + 0.055) / 1.055, vec3(2.4));
    return select(high, color / 12.92, color < vec3(0.04045));
}

fn texel(at: vec2<f32>) -> vec3<f32> {
    let last = vec2<f32>(textureDimensions(picture)) - 1.0;
    return textureLoad(picture, vec2<i32>(clamp(at, vec2(0.0), last)), 0).xyz;
}

@fragment
fn paste_fragment(in: Out) -> @location(0) vec4<f32> {
    var color: vec3<f32>;
    if (ENLARGES) {
        color = textureSampleLevel(picture, between, in.at, 0.0).xyz;
    } else {
        color = texel(in.at * vec2<f32>(textureDimensions(picture)));
    }
    if (TAKES_LIGHT) {
        return vec4(light_of(color), 1.0);
    }
    return vec4(color, 1.0);
}
