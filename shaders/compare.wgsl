// Stage `compare`: two images of one camera, pixel by pixel. See the CPU's stage.

@group(0) @binding(1) var<storage, read> pairs: array<Pair>;
@group(0) @binding(7) var<storage, read_write> views: array<View>;
@group(0) @binding(8) var<storage, read_write> work: array<atomic<u32>>;
@group(0) @binding(13) var<storage, read_write> layers: array<Layer>;
@group(0) @binding(14) var<storage, read_write> found: array<atomic<u32>>;

// The layers of one side in one pixel.
struct Column {
    begin: u32,
    end: u32,
    // A sheet seen from behind: what its layers face says nothing.
    is_turned: bool,
}

// What all pixels of a view share.
struct Look {
    params: Params,
    // Axes of the other views, in the frame of this one.
    others: array<vec3f, 2>,
    other_count: u32,
    middle_a: f32,
    middle_b: f32,
}

fn column(s: u32, pixel: u32) -> Column {
    return Column(
        atomicLoad(&work[begin_at(s, pixel)]),
        atomicLoad(&work[end_at(s, pixel)]),
        false,
    );
}

fn facing_of(c: Column, k: u32) -> i32 {
    return select(layers[k].facing, UNKNOWN, c.is_turned);
}

fn is_best_seen(look: ptr<function, Look>, normal: vec3f) -> bool {
    for (var k = 0u; k < (*look).other_count; k++) {
        if abs(dot((*look).others[k], normal)) > abs(normal.z) {
            return false;
        }
    }
    return true;
}

// Depth of the layer that continues `from` in a neighbouring pixel, or INFINITE.
fn continued(from_layer: u32, c: Column, thickness: f32) -> f32 {
    let depth = layers[from_layer].depth;
    var best = INFINITE;
    var nearest = INFINITE;
    for (var k = c.begin; k < c.end; k++) {
        let apart = abs(layers[k].depth - depth);
        if layers[k].facing == layers[from_layer].facing && !is_edge_on(layers[k].normal)
            && apart < nearest {
            nearest = apart;
            best = layers[k].depth;
        }
    }
    return select(INFINITE, best, nearest <= thickness);
}

// Whether a layer of `a` and one of `b` swap their order between two neighbouring pixels, or coincide.
fn swaps(look: ptr<function, Look>, a: Column, b: Column, a_next: Column, b_next: Column) -> bool {
    let thickness = (*look).params.thickness;
    for (var ka = a.begin; ka < a.end; ka++) {
        if is_edge_on(layers[ka].normal) {
            continue;
        }
        let next_a = continued(ka, a_next, thickness);
        if next_a == INFINITE {
            continue;
        }
        for (var kb = b.begin; kb < b.end; kb++) {
            let apart = layers[ka].depth - layers[kb].depth;
            if is_edge_on(layers[kb].normal) || abs(apart) > 2.0 * thickness {
                continue;
            }
            if !is_best_seen(look, layers[ka].normal) && !is_best_seen(look, layers[kb].normal) {
                continue;
            }
            let next_b = continued(kb, b_next, thickness);
            if next_b != INFINITE && apart * (next_a - next_b) <= 0.0 {
                return true;
            }
        }
    }
    return false;
}

// Where a pixel is in its image.
struct Place {
    at: vec2i,
    size: vec2i,
    // Of the image's first pixel.
    first: u32,
}

// Whether layer `k` of side `s` goes on at `p`. Beyond the image it is taken to.
fn goes_on(s: u32, k: u32, p: vec2i, place: Place, thickness: f32) -> bool {
    if any(p < vec2i(0)) || any(p >= place.size) {
        return true;
    }
    let next = column(s, place.first + u32(p.y * place.size.x + p.x));
    let depth = layers[k].depth;
    for (var n = next.begin; n < next.end; n++) {
        if abs(layers[n].depth - depth) <= thickness
            || (layers[n].near <= depth && depth <= layers[n].far) {
            return true;
        }
    }
    return false;
}

// Whether layer `k` of side `s` goes on in pixels on both sides of a line across `across`.
fn is_on_both_sides(across: vec2f, s: u32, k: u32, place: Place, thickness: f32) -> bool {
    let beside = BESIDE * length(across);
    var there = vec2<bool>(false);
    for (var dj = -1; dj <= 1; dj++) {
        for (var di = -1; di <= 1; di++) {
            if di == 0 && dj == 0 {
                continue;
            }
            let along = dot(across, vec2f(f32(di), f32(dj)));
            let side = vec2<bool>(along >= beside, -along >= beside);
            if any(side) && goes_on(s, k, place.at + vec2i(di, dj), place, thickness) {
                there = there | side;
            }
        }
    }
    return all(there);
}

// Whether layer `other` of side `s` lies well within the layer `wall` and goes on on both sides of it.
fn is_through(wall: u32, other: u32, s: u32, place: Place, thickness: f32) -> bool {
    let rim = 0.5 * thickness;
    let depth = layers[other].depth;
    return abs(dot(layers[wall].normal, layers[other].normal)) < SAME_FACE
        && layers[wall].near + rim < depth && depth < layers[wall].far - rim
        && is_on_both_sides(layers[wall].normal.xy, s, other, place, thickness);
}

// Whether a layer of one lies well within a thick layer of the other, a wall seen edge-on, to which it
// is not parallel, and goes on on both sides of it.
fn pierces(a: Column, b: Column, place: Place, thickness: f32) -> bool {
    for (var ka = a.begin; ka < a.end; ka++) {
        for (var kb = b.begin; kb < b.end; kb++) {
            if is_through(ka, kb, 1u, place, thickness) || is_through(kb, ka, 0u, place, thickness) {
                return true;
            }
        }
    }
    return false;
}

fn facing_camera(normal: vec3f, sign: f32) -> vec3f {
    return select(normal, -normal, normal.z * sign < 0.0);
}

// How much the normal of a layer counts for a body. See the CPU's.
fn share_of(k: u32, side: f32) -> f32 {
    let agreement = layers[k].agreement;
    let is_edge = agreement * side * layers[k].normal.z > 0.0;
    return select(1.0, abs(agreement), is_edge);
}

fn opposed(entry: vec3f, leaving: vec3f) -> bool {
    let n = facing_camera(entry, -1.0);
    let m = facing_camera(leaving, 1.0);
    return n.z <= -FACING && m.z >= FACING && dot(n, m) <= -FACING;
}

// Depth at which the ray entered the part of a body that it leaves through layer `last`.
fn entered_at(c: Column, last: u32, middle: f32, thickness: f32) -> f32 {
    let thin = layers[last].depth - thickness;
    for (var k = last; k > c.begin; k--) {
        let before = k - 1u;
        if is_edge_on(layers[before].normal) {
            continue;
        }
        let is_odd = facing_of(c, last) == EXIT && layers[before].facing != ENTRY;
        return select(layers[before].depth, thin, is_odd);
    }
    return select(min(thin, middle), -INFINITE, facing_of(c, last) == EXIT);
}

// Depth at which the ray leaves the part of a body that it enters through layer `first`.
fn left_at(c: Column, first: u32, middle: f32, thickness: f32) -> f32 {
    let thin = layers[first].depth + thickness;
    for (var behind = first + 1u; behind < c.end; behind++) {
        if is_edge_on(layers[behind].normal) {
            continue;
        }
        let is_odd = facing_of(c, first) == ENTRY && layers[behind].facing != EXIT;
        return select(layers[behind].depth, thin, is_odd);
    }
    return select(max(thin, middle), INFINITE, facing_of(c, first) == ENTRY);
}

// The layer of `a` that meets layer `kb` of `b`, or NONE.
fn met_by(look: ptr<function, Look>, a: Column, b: Column, kb: u32) -> u32 {
    let thickness = (*look).params.thickness;
    let entered = entered_at(b, kb, (*look).middle_b, thickness);
    for (var ka = a.begin; ka < a.end; ka++) {
        if facing_of(a, ka) == EXIT || is_edge_on(layers[ka].normal)
            || entered > left_at(a, ka, (*look).middle_a, thickness) {
            continue;
        }
        if layers[kb].depth - layers[ka].depth <= thickness
            || opposed(layers[ka].normal, layers[kb].normal) {
            return ka;
        }
    }
    return NONE;
}

fn contact_pixels(look: ptr<function, Look>, a: Column, b: Column, view: u32, pixel: vec2i) {
    let pair = view / MAX_VIEWS;
    for (var kb = b.begin; kb < b.end; kb++) {
        if facing_of(b, kb) == ENTRY || is_edge_on(layers[kb].normal) {
            continue;
        }
        let ka = met_by(look, a, b, kb);
        if ka == NONE {
            continue;
        }
        // Outward unit normals in the view frame: the camera sees a from outside, b from inside.
        let normal_a = facing_camera(layers[ka].normal, -1.0);
        let normal_b = facing_camera(layers[kb].normal, 1.0);
        let normal = unit_or(normal_a - normal_b, vec3f(0.0, 0.0, -1.0));
        let gap = (layers[ka].depth - layers[kb].depth) * abs(normal.z);
        if !is_best_seen(look, normal) {
            continue;
        }
        if gap > (*look).params.prediction {
            atomicMax(&found[pair * PAIR_WORDS + GAP], ordered(-gap));
            continue;
        }
        let slot = atomicAdd(&work[CONTACTS], 1u);
        if slot >= batch.contacts {
            continue;
        }
        let at = batch.pairs * PAIR_WORDS + slot * CONTACT_WORDS;
        atomicStore(&found[at], view);
        atomicStore(&found[at + 1u], u32(pixel.x));
        atomicStore(&found[at + 2u], u32(pixel.y));
        atomicStore(&found[at + 3u], bitcast<u32>(layers[ka].depth));
        atomicStore(&found[at + 4u], bitcast<u32>(layers[kb].depth));
        atomicStore(&found[at + 5u], bitcast<u32>(gap));
        let shortened_a = share_of(ka, -1.0) * normal_a;
        let shortened_b = share_of(kb, 1.0) * normal_b;
        for (var k = 0u; k < 3u; k++) {
            atomicStore(&found[at + 6u + k], bitcast<u32>(shortened_a[k]));
            atomicStore(&found[at + 9u + k], bitcast<u32>(shortened_b[k]));
        }
    }
}

fn turned_from(c: Column, met: i32, from_behind: bool) -> Column {
    var is_turned = from_behind;
    for (var k = c.begin; k < c.end; k++) {
        is_turned = is_turned && layers[k].facing != met;
    }
    return Column(c.begin, c.end, is_turned);
}

@compute @workgroup_size(256)
fn compare(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let k = group_index(group) * GROUP + lane;
    if k >= min(atomicLoad(&work[PIXELS]), batch.pixels)
        || atomicLoad(&work[LAYERS]) > batch.layers {
        return;
    }
    let view = view_of_pixel(k);
    let in_image = k - views[view].first_pixel;
    if in_image >= views[view].pixel_count {
        return;
    }
    let a = column(0u, k);
    let b = column(1u, k);
    if a.begin == a.end || b.begin == b.end {
        return;
    }
    let pair = view / MAX_VIEWS;
    var look: Look;
    look.params = pairs[pair].params;
    let flags = views[view].flags;
    look.middle_a = select(-INFINITE, views[view].middles.x, (flags & MIDDLE_KNOWN) != 0u);
    look.middle_b = select(INFINITE, views[view].middles.y, (flags & (MIDDLE_KNOWN << 1u)) != 0u);
    for (var v = 0u; v < MAX_VIEWS; v++) {
        let other = pair * MAX_VIEWS + v;
        if other != view && views[other].exists != MISSING {
            let axis = views[other].axis;
            look.others[look.other_count] =
                turned(views[view].view_x, views[view].view_y, views[view].view_z, axis);
            look.other_count++;
        }
    }
    let size = views[view].rect_size;
    let pixel = vec2u(in_image % size.x, in_image / size.x);
    if atomicLoad(&found[pair * PAIR_WORDS + CROSSINGS]) < CROSSED {
        let place = Place(vec2i(pixel), vec2i(size), k - in_image);
        var crossings = PIERCED * u32(pierces(a, b, place, look.params.thickness));
        if pixel.x + 1u < size.x {
            crossings += SWAPPED
                * u32(swaps(&look, a, b, column(0u, k + 1u), column(1u, k + 1u)));
        }
        if pixel.y + 1u < size.y {
            crossings += SWAPPED
                * u32(swaps(&look, a, b, column(0u, k + size.x), column(1u, k + size.x)));
        }
        if crossings > 0u {
            atomicAdd(&found[pair * PAIR_WORDS + CROSSINGS], crossings);
        }
    }
    if (flags & IS_FURTHER) != 0u {
        return;
    }
    let turned_a = turned_from(a, ENTRY, (flags & FROM_BEHIND) != 0u);
    let turned_b = turned_from(b, EXIT, (flags & (FROM_BEHIND << 1u)) != 0u);
    contact_pixels(&look, turned_a, turned_b, view, views[view].rect_origin + vec2i(pixel));
}
