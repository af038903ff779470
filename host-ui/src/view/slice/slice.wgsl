// One slice: for each place the material point that lies there now, and its grey in an image, or
// its brightness and grain as ultrasound. The material point is found at the corners of small cells
// of the picture, because displacements vary over millimetres.

// Most iterations of the fixed point, and the residual at which they end (m).
override STEPS: i32;
override SEEN_M: f32;

struct Slice {
    // Centre of the picture, and the vectors to its right and upper edge (m). The first also holds
    // the largest amplitude of grain, the last the largest level.
    middle_m: vec4<f32>,
    right_m: vec4<f32>,
    up_m: vec4<f32>,
    // Corner and size of the brightness volume and of the grid of displacements (m). The first also
    // holds the cells of the picture.
    volume_corner_m: vec4<f32>,
    volume_size_m: vec4<f32>,
    nodes_corner_m: vec4<f32>,
    nodes_size_m: vec4<f32>,
    // Rows: patient right, anterior, superior in the scene, each over the edge of the cube of grain.
    grain_x: vec4<f32>,
    grain_y: vec4<f32>,
    grain_z: vec4<f32>,
    // Rows: from the scene (m) to the voxels of the image, 0 to 1 from face to face.
    image_x: vec4<f32>,
    image_y: vec4<f32>,
    image_z: vec4<f32>,
}

@group(0) @binding(0) var<uniform> slice: Slice;
@group(0) @binding(1) var brightness: texture_3d<f32>;
@group(0) @binding(2) var nodes: texture_3d<f32>;
@group(0) @binding(3) var grain: texture_3d<f32>;
@group(0) @binding(4) var image: texture_3d<f32>;
@group(0) @binding(5) var clamped: sampler;
@group(0) @binding(6) var repeated: sampler;

struct Out {
    @builtin(position) clip: vec4<f32>,
    @location(0) rest_m: vec3<f32>,
}

fn displacement_m(rest_m: vec3<f32>) -> vec3<f32> {
    let at = (rest_m - slice.nodes_corner_m.xyz) / slice.nodes_size_m.xyz;
    return textureSampleLevel(nodes, clamped, at, 0.0).xyz;
}

fn brightness_at(rest_m: vec3<f32>) -> f32 {
    let at = (rest_m - slice.volume_corner_m.xyz) / slice.volume_size_m.xyz;
    return textureSampleLevel(brightness, clamped, at, 0.0).x;
}

// Black outside the image.
fn image_at(rest_m: vec3<f32>) -> f32 {
    let place = vec4(rest_m, 1.0);
    let at = vec3(dot(slice.image_x, place), dot(slice.image_y, place), dot(slice.image_z, place));
    let inside = all(at >= vec3(0.0)) && all(at <= vec3(1.0));
    return select(0.0, textureSampleLevel(image, clamped, at, 0.0).x, inside);
}

@vertex
fn slice_vertex(@builtin(vertex_index) index: u32) -> Out {
    let cells = vec2(u32(slice.volume_corner_m.w), u32(slice.volume_size_m.w));
    let cell = vec2((index / 6u) % cells.x, (index / 6u) / cells.x);
    // Two triangles: corners 0, 1, 2 and 2, 1, 3.
    let place = index % 6u;
    let corner = select(place, place - 2u + u32(place == 3u) - u32(place == 4u), place > 2u);
    let at = 2.0 * vec2<f32>(cell + vec2(corner & 1u, corner >> 1u)) / vec2<f32>(cells) - 1.0;
    let place_m = slice.middle_m.xyz + at.x * slice.right_m.xyz + at.y * slice.up_m.xyz;
    return Out(vec4(at, 0.0, 1.0), rest_of(place_m));
}

fn rest_of(place_m: vec3<f32>) -> vec3<f32> {
    var rest_m = place_m;
    // The count is not a uniform: Mesa's software driver would compile the shader again for each of
    // its values, and keep them all.
    for (var step = 0; step < STEPS; step++) {
        let next_m = place_m - displacement_m(rest_m);
        let moved_m = abs(next_m - rest_m);
        rest_m = next_m;
        if (max(moved_m.x, max(moved_m.y, moved_m.z)) < SEEN_M) {
            break;
        }
    }
    return rest_m;
}

// Two shaders, because a driver without a graphics card runs both sides of each condition.
@fragment
fn image_fragment(in: Out) -> @location(0) vec4<f32> {
    let grey = image_at(in.rest_m);
    return vec4(grey, grey, grey, 1.0);
}

@fragment
fn slice_fragment(in: Out) -> @location(0) vec4<f32> {
    let rest_m = in.rest_m;
    let here = brightness_at(rest_m);
    let cell = vec3(dot(slice.grain_x.xyz, rest_m), dot(slice.grain_y.xyz, rest_m), dot(slice.grain_z.xyz, rest_m));
    let amplitude = textureSampleLevel(grain, repeated, cell, 0.0).x * slice.middle_m.w;
    // A scanner shows the logarithm of the echo.
    let level = here * slice.up_m.w * (1.0 + 0.34 * log(amplitude + 0.09));
    let value = clamp(level, 0.0, 1.0);
    return vec4(value * 0.97, value * 0.985, value, 1.0);
}
