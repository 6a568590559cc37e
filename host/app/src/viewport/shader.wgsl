// Parts, edges, ghosts and arrows. Colours come in as sRGB, are lit in linear light and go out as sRGB,
// because the window blends and shows textures as they are.

struct Globals {
    // Directions in world space, towards the light or the viewer; w unused.
    key: vec4<f32>,
    fill: vec4<f32>,
    viewer: vec4<f32>,
    // Picture in pixels (x, y), line width in pixels (z), depth shift of lines (w), see `lines_vertex`.
    screen: vec4<f32>,
    top: vec4<f32>,
    bottom: vec4<f32>,
}

struct Draw {
    to_clip: mat4x4<f32>,
    to_world: mat4x4<f32>,
    // Part's colour, sRGB, and opacity.
    color: vec4<f32>,
    // Mixed in: sRGB, and how much.
    tint: vec4<f32>,
    // Of lines: sRGB, and opacity.
    line: vec4<f32>,
    // Faces lit up: up to 8 ids, unused ones 0xffffffff.
    lit_a: vec4<u32>,
    lit_b: vec4<u32>,
    // Faces that are guided onto another part's, likewise.
    mates_a: vec4<u32>,
    mates_b: vec4<u32>,
    // Edges lit up: two in each, by the faces that meet there, smaller id first; unused ones are no edge's.
    lit_edges: array<vec4<u32>, 4>,
    // Plane of the section in the shape's frame: normal and offset. What is above is not drawn.
    cut: vec4<f32>,
    // Of areas: unit vector across the hatching (x, y), its spacing, mm (z). Of lines: height up to which they are drawn (w).
    hatch: vec4<f32>,
}

@group(0) @binding(0) var<uniform> globals: Globals;
@group(1) @binding(0) var<uniform> draw: Draw;

const LIT: vec3<f32> = vec3<f32>(1.0, 0.36, 0.24);
// Of edges: nearly white, to be told from a lit face beside them and from the edges of the part in hand.
const LIT_EDGE: vec3<f32> = vec3<f32>(1.0, 0.95, 0.90);
const MATES: vec3<f32> = vec3<f32>(0.22, 0.80, 0.65);

// Both without powers, which a software renderer computes one by one: polynomials in s, and in the roots of l, within 0.3 and 0.1 of the 255 steps of a
// colour.
fn linear(s: vec3<f32>) -> vec3<f32> {
    let curve = 0.00154996 + s * (0.01418183 + s * (0.65626015 + s * 0.33056951));
    return select(curve, s / 12.92, s <= vec3<f32>(0.04045));
}

fn encoded(l: vec3<f32>) -> vec3<f32> {
    let c = clamp(l, vec3<f32>(0.0), vec3<f32>(1.0));
    let root = sqrt(c);
    let curve = 0.83374238 * root + 0.29812116 * sqrt(root) - 0.05531705 * c - 0.07690711;
    return select(curve, 12.92 * c, c <= vec3<f32>(0.0031308));
}

// Background ---------------------------------------------------------------------------------------------------

struct Sky {
    @builtin(position) position: vec4<f32>,
    @location(0) height: f32,
}

@vertex
fn sky_vertex(@builtin(vertex_index) i: u32) -> Sky {
    // One triangle that covers the picture.
    let p = vec2<f32>(f32(i32(i & 1u) * 4 - 1), f32(i32(i >> 1u) * 4 - 1));
    return Sky(vec4<f32>(p, 1.0, 1.0), 0.5 * (p.y + 1.0));
}

@fragment
fn sky_fragment(in: Sky) -> @location(0) vec4<f32> {
    return vec4<f32>(mix(globals.bottom.rgb, globals.top.rgb, in.height), 1.0);
}

// Solids -------------------------------------------------------------------------------------------------------

struct Solid {
    @builtin(position) position: vec4<f32>,
    @location(0) normal: vec3<f32>,
    @location(1) color: vec4<f32>,
    @location(2) @interpolate(flat) face: u32,
    // Height above the plane of the section, mm.
    @location(3) height: f32,
    // Position in the shape's frame.
    @location(4) place: vec3<f32>,
}

@vertex
fn solid_vertex(
    @location(0) position: vec3<f32>,
    @location(1) normal: vec3<f32>,
    @location(2) color: vec4<f32>,
    @location(3) face: u32,
) -> Solid {
    var out: Solid;
    out.position = draw.to_clip * vec4<f32>(position, 1.0);
    out.normal = (draw.to_world * vec4<f32>(normal, 0.0)).xyz;
    out.color = color;
    out.face = face;
    out.height = dot(draw.cut.xyz, position) + draw.cut.w;
    out.place = position;
    return out;
}

@fragment
fn solid_fragment(in: Solid) -> @location(0) vec4<f32> {
    if in.height > 0.0 {
        discard;
    }
    var n = normalize(in.normal);
    // Shells may be open: the back of a face is lit like its front.
    if dot(n, globals.viewer.xyz) < 0.0 {
        n = -n;
    }
    var base = linear(mix(draw.color.rgb, in.color.rgb, in.color.a));
    base = mix(base, linear(draw.tint.rgb), draw.tint.a);
    var alpha = draw.color.a;
    let lit = any(draw.lit_a == vec4<u32>(in.face)) || any(draw.lit_b == vec4<u32>(in.face));
    let mates = any(draw.mates_a == vec4<u32>(in.face)) || any(draw.mates_b == vec4<u32>(in.face));
    if mates && !lit {
        // Hatched, so that it is told from what touches without colour too; stripes as wide as three edges.
        let stripe = fract((in.position.x + in.position.y) / (8.0 * globals.screen.z));
        base = mix(base, linear(MATES), select(0.5, 0.85, stripe < 0.5));
        alpha = max(alpha, 0.6);
    }
    if lit {
        base = mix(base, linear(LIT), 0.8);
        alpha = max(alpha, 0.75);
    }
    let key = max(dot(n, globals.key.xyz), 0.0);
    let fill = max(dot(n, globals.fill.xyz), 0.0);
    let sky = 0.5 + 0.5 * n.z;
    var light = base * (0.20 + 0.10 * sky + 0.72 * key + 0.16 * fill);
    let half_way = normalize(globals.key.xyz + globals.viewer.xyz);
    let toward = max(dot(n, half_way), 0.0);
    let second = toward * toward;
    let fourth = second * second;
    let eighth = fourth * fourth;
    // To the power of 40.
    light += vec3<f32>(0.10) * eighth * eighth * eighth * eighth * eighth;
    if lit {
        light += 0.25 * linear(LIT);
    }
    return vec4<f32>(encoded(light), alpha);
}

// Areas of a section: without scene light, as in a drawing, and hatched.
@fragment
fn area_fragment(in: Solid) -> @location(0) vec4<f32> {
    var base = linear(draw.color.rgb);
    base = mix(base, linear(draw.tint.rgb), draw.tint.a);
    let stripe = fract(dot(in.place.xy, draw.hatch.xy) / draw.hatch.z);
    let dark = abs(stripe - 0.5) < 0.11;
    return vec4<f32>(encoded(base * select(0.92, 0.38, dark)), 1.0);
}

// Glow: as much as the line of sight has of a shell, so that it fades towards its outline.
@fragment
fn glow_fragment(in: Solid) -> @location(0) vec4<f32> {
    let through = abs(dot(normalize(in.normal), globals.viewer.xyz));
    return vec4<f32>(draw.color.rgb, draw.color.a * through);
}

// What lies behind parts shines through them.
const SHINES_THROUGH: f32 = 0.6;

@fragment
fn hidden_glow_fragment(in: Solid) -> @location(0) vec4<f32> {
    let through = abs(dot(normalize(in.normal), globals.viewer.xyz));
    return vec4<f32>(draw.color.rgb, SHINES_THROUGH * draw.color.a * through);
}

// Arrows: no scene light, so that they read the same from everywhere.
@fragment
fn arrow_fragment(in: Solid) -> @location(0) vec4<f32> {
    let n = normalize(in.normal);
    let light = 0.62 + 0.38 * max(dot(n, globals.viewer.xyz), 0.0);
    return vec4<f32>(encoded(linear(draw.color.rgb) * light), draw.color.a);
}

// Edges --------------------------------------------------------------------------------------------------------

// An edge that touches is so many times as wide as others, and brought so many times as far forward, so as to lie over them.
const LIT_WIDER: f32 = 3.0;
const LIT_NEARER: f32 = 2.0;

struct Line {
    @builtin(position) position: vec4<f32>,
    @location(0) @interpolate(flat) color: vec4<f32>,
    // Height above the plane of the section, mm.
    @location(1) height: f32,
}

fn touches(faces: vec2<u32>) -> bool {
    for (var i = 0u; i < 4u; i++) {
        let two = draw.lit_edges[i];
        if all(two.xy == faces) || all(two.zw == faces) {
            return true;
        }
    }
    return false;
}

@vertex
fn lines_vertex(
    @builtin(vertex_index) i: u32,
    @location(0) a: vec3<f32>,
    @location(1) b: vec3<f32>,
    @location(2) faces: vec2<u32>,
) -> Line {
    let lit = touches(faces);
    var p = draw.to_clip * vec4<f32>(a, 1.0);
    var q = draw.to_clip * vec4<f32>(b, 1.0);
    // An end behind the eye is brought forward along the line.
    let nearest = 1e-4 * max(abs(p.w), abs(q.w));
    var heights = vec2<f32>(dot(draw.cut.xyz, a), dot(draw.cut.xyz, b)) + draw.cut.w - draw.hatch.w;
    if p.w < nearest && q.w > nearest {
        let part = (nearest - p.w) / (q.w - p.w);
        p = mix(p, q, part);
        heights.x = mix(heights.x, heights.y, part);
    } else if q.w < nearest && p.w > nearest {
        let part = (nearest - q.w) / (p.w - q.w);
        q = mix(q, p, part);
        heights.y = mix(heights.y, heights.x, part);
    }
    // Half the width to each side, in pixels across the line.
    var across = vec2<f32>(0.0, 1.0);
    let along = (q.xy / q.w - p.xy / p.w) * globals.screen.xy;
    if dot(along, along) > 1e-12 {
        across = normalize(vec2<f32>(-along.y, along.x));
    }
    let far_end = i == 1u || i == 2u || i == 4u;
    let side = select(-1.0, 1.0, i == 2u || i == 4u || i == 5u);
    var end = p;
    var height = heights.x;
    if far_end {
        end = q;
        height = heights.y;
    }
    let width = globals.screen.z * select(1.0, LIT_WIDER, lit);
    let shift = side * across * width / globals.screen.xy;
    // Depth is A + B/w. Brought a fraction e nearer to the eye a point has depth A + B/(w(1 - e)), about e·B/w less;
    // screen.w holds e·B, which is negative. Of parallel rays w is 1 and depth is linear: screen.w holds the shift for a distance like the target's.
    let nearer = globals.screen.w * select(1.0, LIT_NEARER, lit);
    let position = vec4<f32>(end.xy + shift * end.w, end.z + nearer, end.w);
    return Line(position, select(draw.line, vec4<f32>(LIT_EDGE, 1.0), lit), height);
}

@fragment
fn lines_fragment(in: Line) -> @location(0) vec4<f32> {
    if in.height > 0.0 {
        discard;
    }
    return in.color;
}
