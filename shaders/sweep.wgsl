// Stage `sweep`: the fragments of each pixel become layers. See the CPU's stage.

@group(0) @binding(1) var<storage, read> pairs: array<Pair>;
@group(0) @binding(7) var<storage, read_write> views: array<View>;
@group(0) @binding(8) var<storage, read_write> work: array<atomic<u32>>;
@group(0) @binding(11) var<storage, read_write> splats: array<Splat>;
@group(0) @binding(12) var<storage, read_write> fragments: array<vec2u>;
@group(0) @binding(13) var<storage, read_write> layers: array<Layer>;
@group(0) @binding(14) var<storage, read_write> found: array<atomic<u32>>;

// Most fragments of a pixel that one thread sorts; pairs with more are left to the CPU.
const MOST_FRAGMENTS: u32 = 1024u;

var<workgroup> total: atomic<u32>;
var<workgroup> base: u32;

fn sift(begin: u32, start: u32, count: u32) {
    var root = start;
    let value = fragments[begin + root];
    // Ends: a child comes after its root, and roots come before `count`.
    loop {
        var child = 2u * root + 1u;
        if child >= count {
            break;
        }
        if child + 1u < count && fragments[begin + child].x < fragments[begin + child + 1u].x {
            child++;
        }
        if fragments[begin + child].x <= value.x {
            break;
        }
        fragments[begin + root] = fragments[begin + child];
        root = child;
    }
    fragments[begin + root] = value;
}

fn sort_fragments(begin: u32, count: u32) {
    if count <= 24u {
        for (var i = 1u; i < count; i++) {
            let value = fragments[begin + i];
            var k = i;
            // Ends: `k` falls.
            while k > 0u {
                let before = fragments[begin + k - 1u];
                if before.x <= value.x {
                    break;
                }
                fragments[begin + k] = before;
                k--;
            }
            fragments[begin + k] = value;
        }
        return;
    }
    for (var start = count / 2u; start > 0u; start--) {
        sift(begin, start - 1u, count);
    }
    for (var end = count - 1u; end > 0u; end--) {
        let last = fragments[begin + end];
        fragments[begin + end] = fragments[begin];
        fragments[begin] = last;
        sift(begin, 0u, end);
    }
}

fn depth_of(key: u32) -> u32 {
    return key & ((1u << DEPTH_BITS) - 2u);
}

fn is_same_layer(key: u32, next: u32, merge_steps: u32) -> bool {
    let is_steep = ((key | next) & 1u) > 0u;
    let apart = select(merge_steps, max(merge_steps, DEPTH_STEPS), is_steep);
    return key >> DEPTH_BITS == next >> DEPTH_BITS && depth_of(next) - depth_of(key) <= apart;
}

fn weight_of(f: vec2u) -> u32 {
    return f.y & ((1u << WEIGHT_BITS) - 1u);
}

fn splat_of(f: vec2u) -> u32 {
    return f.y >> WEIGHT_BITS;
}

// In steps.
fn normal_of(splat: u32) -> vec3i {
    let xy = splats[splat].normal_xy;
    return vec3i(i32(xy << 16u) >> 16u, i32(xy) >> 16u, i32(splats[splat].normal_z));
}

// Whether the first of two fragments is the lighter one; of like ones, the one that comes first by
// its key, normal and place: fragments come in any order.
fn is_lighter(f: vec2u, g: vec2u) -> bool {
    if weight_of(f) != weight_of(g) {
        return weight_of(f) < weight_of(g);
    }
    if f.x != g.x {
        return f.x < g.x;
    }
    let n = normal_of(splat_of(f));
    let m = normal_of(splat_of(g));
    for (var k = 0u; k < 3u; k++) {
        if n[k] != m[k] {
            return n[k] < m[k];
        }
    }
    let c = splats[splat_of(f)].centre;
    let d = splats[splat_of(g)].centre;
    return select(c.y < d.y, c.x < d.x, c.x != d.x);
}

// Weighted sums over fragments: of depths above a first one 48 bits, in words of 16 and 32; of normals 44, in
// words of 12 and 32.
struct Sum {
    weight: u32,
    depth_low: u32,
    depth_high: u32,
    normal_low: vec3i,
    normal_high: vec3i,
}

fn add(sum: ptr<function, Sum>, f: vec2u, first_depth: u32) {
    let w = weight_of(f);
    let above_first = depth_of(f.x) - first_depth;
    (*sum).weight += w;
    (*sum).depth_low += w * (above_first & 0xffffu);
    (*sum).depth_high += w * (above_first >> 16u) + ((*sum).depth_low >> 16u);
    (*sum).depth_low &= 0xffffu;
    (*sum).normal_low += i32(w) * normal_of(splat_of(f));
    (*sum).normal_high += (*sum).normal_low >> vec3u(12u);
    (*sum).normal_low &= vec3i(0xfff);
}

fn normal_sum(sum: Sum) -> vec3f {
    return vec3f(sum.normal_high) * 4096.0 + vec3f(sum.normal_low);
}

// Square of the length of the mean of the unit normals.
fn agreement_squared(sum: Sum) -> f32 {
    let mean = normal_sum(sum) / (NORMAL_STEPS * f32(sum.weight));
    return dot(mean, mean);
}

fn is_on_face(splat: u32, face: u32) -> bool {
    let cosine = f32(dot(normal_of(face), normal_of(splat)));
    return cosine >= SAME_FACE * (NORMAL_STEPS * NORMAL_STEPS);
}

// The splats of the heaviest fragments of each face, the heaviest first.
struct Faces {
    splats: vec3u,
    count: u32,
}

fn faces_of(start: u32, end: u32) -> Faces {
    var faces: Faces;
    // Ends: `count` rises, or nothing is left.
    while faces.count < MOST_FACES {
        var heaviest = end;
        for (var k = start; k < end; k++) {
            let splat = splat_of(fragments[k]);
            var is_left = true;
            for (var face = 0u; face < faces.count; face++) {
                is_left = is_left && !is_on_face(splat, faces.splats[face]);
            }
            if is_left && (heaviest == end || is_lighter(fragments[heaviest], fragments[k])) {
                heaviest = k;
            }
        }
        if heaviest == end {
            break;
        }
        faces.splats[faces.count] = splat_of(fragments[heaviest]);
        faces.count++;
    }
    return faces;
}

// 1 at an edge, -1 in a groove.
fn sign_of_bend(start: u32, end: u32, face: u32) -> f32 {
    var bend = 0;
    for (var k = start; k < end; k++) {
        let splat = splat_of(fragments[k]);
        let aside = splats[splat].centre - splats[face].centre;
        let most = vec2f(MOST_ASIDE);
        let turn = (normal_of(splat) - normal_of(face)).xy >> vec2u(BEND_SHIFT);
        bend += dot(vec2i(round(BEND_STEPS * clamp(aside, -most, most))), turn);
    }
    return select(1.0, -1.0, bend < 0);
}

fn sum_of_face(start: u32, end: u32, face: u32) -> Sum {
    var sum: Sum;
    for (var k = start; k < end; k++) {
        if is_on_face(splat_of(fragments[k]), face) {
            add(&sum, fragments[k], depth_of(fragments[start].x));
        }
    }
    return sum;
}

// Above that of the first fragment, in steps.
fn mean_depth(sum: Sum) -> f32 {
    return (f32(sum.depth_high) * 65536.0 + f32(sum.depth_low)) / f32(sum.weight);
}

// Sum over the fragments on the face that the ray meets: see the CPU's.
fn sum_of_face_met(start: u32, end: u32, faces: Faces, bend: f32, weight: u32) -> Sum {
    let towards_camera = select(1.0, -1.0, normal_of(faces.splats[0]).z > 0);
    var met = sum_of_face(start, end, faces.splats[0]);
    for (var face = 1u; face < faces.count; face++) {
        let sum = sum_of_face(start, end, faces.splats[face]);
        let inwards = towards_camera * bend * (mean_depth(sum) - mean_depth(met));
        if f32(sum.weight) >= LEAST_OF_LAYER * f32(weight) && inwards > 0.0 {
            met = sum;
        }
    }
    return met;
}

// The layer of the fragments from `start` to before `end`.
fn layer_of(start: u32, end: u32, oriented: bool, knows_faces: bool, view: u32) -> Layer {
    let first_depth = depth_of(fragments[start].x);
    var sum: Sum;
    for (var k = start; k < end; k++) {
        add(&sum, fragments[k], first_depth);
    }
    var agreement = 1.0;
    if knows_faces && agreement_squared(sum) < CREASED {
        let faces = faces_of(start, end);
        let bend = sign_of_bend(start, end, faces.splats[0]);
        agreement = sqrt(agreement_squared(sum)) * bend;
        sum = sum_of_face_met(start, end, faces, bend, sum.weight);
    }
    let class_of_run = fragments[start].x >> DEPTH_BITS;
    let step = pairs[view / MAX_VIEWS].depth_step;
    let zero = views[view].depth_zero;
    var layer: Layer;
    layer.near = zero + f32(first_depth) * step;
    layer.far = zero + f32(depth_of(fragments[end - 1u].x)) * step;
    layer.depth = zero + (f32(first_depth) + mean_depth(sum)) * step;
    layer.agreement = agreement;
    layer.normal = unit_or(normal_sum(sum), vec3f(0.0, 0.0, -1.0));
    layer.facing = select(UNKNOWN, EXIT, class_of_run == 1u && oriented);
    layer.facing = select(layer.facing, ENTRY, class_of_run == 0u);
    return layer;
}

// Writes the layers of a pixel, in order of depth, then of facing.
fn write_layers(begin: u32, end: u32, first_layer: u32, view: u32, s: u32) {
    let merge_steps = pairs[view / MAX_VIEWS].sides[s].merge_steps;
    let flags = pairs[view / MAX_VIEWS].sides[s].flags;
    let oriented = (flags & (HAS_NORMALS | ORIENTED)) == (HAS_NORMALS | ORIENTED);
    // Estimated ones are sharpened.
    let knows_faces = oriented || (flags & HAS_NORMALS) == 0u;
    var slot = first_layer;
    var start = begin;
    for (var i = begin; i < end; i++) {
        let is_last = i + 1u == end;
        if is_last || !is_same_layer(fragments[i].x, fragments[min(i + 1u, end - 1u)].x, merge_steps) {
            let layer = layer_of(start, i + 1u, oriented, knows_faces, view);
            var place = slot;
            // Ends: `place` falls.
            while place > first_layer {
                let before = layers[place - 1u];
                let is_behind = before.depth > layer.depth
                    || (before.depth == layer.depth && before.facing > layer.facing);
                if !is_behind {
                    break;
                }
                layers[place] = before;
                place--;
            }
            layers[place] = layer;
            slot++;
            start = i + 1u;
        }
    }
}

@compute @workgroup_size(256)
fn sweep(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let k = group_index(group) * GROUP + lane;
    let pixels = min(atomicLoad(&work[PIXELS]), batch.pixels);
    let fits = atomicLoad(&work[FRAGMENTS]) <= batch.fragments
        && atomicLoad(&work[SPLATS]) <= batch.splats;
    let s = k / max(pixels, 1u);
    let pixel = k - s * pixels;
    let exists = k < 2u * pixels;
    var begin = 0u;
    var end = 0u;
    var view = 0u;
    var count = 0u;
    if exists {
        view = view_of(pixel, false);
        begin = atomicLoad(&work[begin_at(s, pixel)]);
        end = atomicLoad(&work[end_at(s, pixel)]);
        let is_crowded = end - begin > MOST_FRAGMENTS;
        if fits && is_crowded {
            atomicStore(&found[view / MAX_VIEWS * PAIR_WORDS + CROWDED], 1u);
        }
        // Where not all fragments are there, no pixel has layers: later stages would take what is left of others for some.
        if !fits || is_crowded {
            end = begin;
        }
    }
    let merge_steps = pairs[view / MAX_VIEWS].sides[s].merge_steps;
    if end > begin {
        sort_fragments(begin, end - begin);
        count = 1u;
        for (var i = begin + 1u; i < end; i++) {
            if !is_same_layer(fragments[i - 1u].x, fragments[i].x, merge_steps) {
                count++;
            }
        }
    }
    let own = atomicAdd(&total, count);
    workgroupBarrier();
    if lane == 0u {
        base = atomicAdd(&work[LAYERS], atomicLoad(&total));
    }
    workgroupBarrier();
    let first_layer = base + own;
    let fitting = first_layer + count <= batch.layers;
    if exists {
        atomicStore(&work[begin_at(s, pixel)], first_layer);
        atomicStore(&work[end_at(s, pixel)], select(first_layer, first_layer + count, fitting));
    }
    if exists && fitting && count > 0u {
        write_layers(begin, end, first_layer, view, s);
    }
}
