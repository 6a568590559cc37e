// A texture over the pass's viewport, each texel as it is.

@group(0) @binding(0) var picture: texture_2d<f32>;

struct Place {
    @builtin(position) position: vec4<f32>,
    // From the upper left corner, in pictures.
    @location(0) share: vec2<f32>,
}

@vertex
fn vertex(@builtin(vertex_index) i: u32) -> Place {
    // One triangle that covers the viewport.
    let p = vec2<f32>(f32(i32(i & 1u) * 4 - 1), f32(i32(i >> 1u) * 4 - 1));
    return Place(vec4<f32>(p, 0.0, 1.0), vec2<f32>(0.5 + 0.5 * p.x, 0.5 - 0.5 * p.y));
}

fn texel(share: vec2<f32>) -> vec4<f32> {
    let size = vec2<i32>(textureDimensions(picture));
    let place = vec2<i32>(share * vec2<f32>(size));
    return textureLoad(picture, clamp(place, vec2<i32>(0), size - 1), 0);
}

@fragment
fn fragment(in: Place) -> @location(0) vec4<f32> {
    return texel(in.share);
}

// For a target that encodes linear light.
@fragment
fn decoded_fragment(in: Place) -> @location(0) vec4<f32> {
    let s = texel(in.share);
    let linear = select(pow((s.rgb + 0.055) / 1.055, vec3<f32>(2.4)), s.rgb / 12.92, s.rgb <= vec3<f32>(0.04045));
    return vec4<f32>(linear, s.a);
}
