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
    // Depths between which a body lies, where its size says that it is one.
    is_body: bool,
    near: f32,
    far: f32,
    // The layer at which the surface ends in its rim, or NONE; at `far` where it is in front.
    rim: u32,
    is_in_front: bool,
}

// What all pixels of a view share.
struct Look {
    params: Params,
    // Axes of the other views, in the frame of this one.
    others: array<vec3f, 2>,
    other_count: u32,
    // Whether `a` is in front of `b`: these are on the other side of each other than the axis says.
    is_beyond: bool,
}

fn column(s: u32, pixel: u32) -> Column {
    var c: Column;
    c.begin = atomicLoad(&work[begin_at(s, pixel)]);
    c.end = atomicLoad(&work[end_at(s, pixel)]);
    c.rim = NONE;
    return c;
}

fn depth_of(c: Column, k: u32) -> f32 {
    return select(layers[k].depth, select(layers[k].near, layers[k].far, c.is_in_front), k == c.rim);
}

fn normal_of(c: Column, k: u32) -> vec3f {
    return select(layers[k].normal, vec3f(0.0, 0.0, 1.0), k == c.rim);
}

fn facing_of(c: Column, k: u32) -> i32 {
    return select(layers[k].facing, UNKNOWN, c.is_turned || k == c.rim);
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

// How much the normal of a layer counts for a body. A rim has none. See the CPU's.
fn share_of(c: Column, k: u32, side: f32) -> f32 {
    let agreement = layers[k].agreement;
    let is_edge = agreement * side * layers[k].normal.z > 0.0;
    return select(select(1.0, abs(agreement), is_edge), 0.0, k == c.rim);
}

// Whether layer `kf` of the body in front and `kb` of the other one face each other: see the CPU's.
fn opposed(front: Column, kf: u32, back: Column, kb: u32) -> bool {
    let n = facing_camera(normal_of(back, kb), -1.0);
    let m = facing_camera(normal_of(front, kf), 1.0);
    let is_edge_n = share_of(back, kb, -1.0) < 1.0;
    let is_edge_m = share_of(front, kf, 1.0) < 1.0;
    return (is_edge_n || n.z <= -FACING)
        && (is_edge_m || m.z >= FACING)
        && (is_edge_n || is_edge_m || dot(n, m) <= -FACING);
}

// Depth at which the ray entered the part of a body that it leaves through layer `last`.
fn entered_at(c: Column, last: u32, thickness: f32) -> f32 {
    let thin = depth_of(c, last) - thickness;
    for (var k = last; k > c.begin; k--) {
        let before = k - 1u;
        if is_edge_on(normal_of(c, before)) {
            continue;
        }
        let is_odd = facing_of(c, last) == EXIT && facing_of(c, before) != ENTRY;
        return select(depth_of(c, before), thin, is_odd);
    }
    let middle = select(thin, 0.5 * (c.near + c.far), c.is_body);
    return min(thin, select(middle, c.near, facing_of(c, last) == EXIT));
}

// Depth at which the ray leaves the part of a body that it enters through layer `first`.
fn left_at(c: Column, first: u32, thickness: f32) -> f32 {
    let thin = depth_of(c, first) + thickness;
    for (var behind = first + 1u; behind < c.end; behind++) {
        if is_edge_on(normal_of(c, behind)) {
            continue;
        }
        let is_odd = facing_of(c, first) == ENTRY && facing_of(c, behind) != EXIT;
        return select(depth_of(c, behind), thin, is_odd);
    }
    let middle = select(thin, 0.5 * (c.near + c.far), c.is_body);
    return max(thin, select(middle, c.far, facing_of(c, first) == ENTRY));
}

// Whether layer `k` of unknown facing is where the ray enters the surface, more of which comes before the ray leaves the
// other body. See the CPU's.
fn is_entered_at(c: Column, k: u32, left: f32) -> bool {
    if facing_of(c, k) != UNKNOWN {
        return false;
    }
    for (var before = c.begin; before < k; before++) {
        if !is_edge_on(normal_of(c, before)) {
            return false;
        }
    }
    return k + 1u < c.end && depth_of(c, min(k + 1u, c.end - 1u)) <= left;
}

// The same of where it is left, and more of which came after the ray entered the other body.
fn is_left_at(c: Column, k: u32, entered: f32) -> bool {
    if facing_of(c, k) != UNKNOWN {
        return false;
    }
    for (var behind = k + 1u; behind < c.end; behind++) {
        if !is_edge_on(normal_of(c, behind)) {
            return false;
        }
    }
    return k > c.begin && depth_of(c, max(k, c.begin + 1u) - 1u) >= entered;
}

// Whether one way out of an overlap is so much longer than the other that the other one counts.
fn is_far_longer(way: f32, other: f32, thickness: f32) -> bool {
    return way > FARTHEST * max(other, thickness);
}

// The layer of the body at the back that meets layer `kf` of the one in front, or NONE.
fn met_by(look: ptr<function, Look>, front: Column, back: Column, kf: u32, is_other_side: bool) -> u32 {
    let thickness = (*look).params.thickness;
    let entered = entered_at(front, kf, thickness);
    for (var kb = back.begin; kb < back.end; kb++) {
        let left = left_at(back, kb, thickness);
        // Where two rims cross, neither tells a normal.
        let are_rims = kf == front.rim && kb == back.rim;
        if facing_of(back, kb) == EXIT || is_edge_on(normal_of(back, kb)) || entered > left || are_rims {
            continue;
        }
        let depth = depth_of(front, kf) - depth_of(back, kb);
        let is_sure = facing_of(front, kf) == EXIT && facing_of(back, kb) == ENTRY;
        let other_way = left - entered;
        let is_too_far = is_sure && is_far_longer(depth, other_way, thickness);
        let is_opposed = opposed(front, kf, back, kb);
        let is_within = depth > 0.0
            && ((facing_of(back, kb) == ENTRY && is_entered_at(front, kf, left))
                || (facing_of(front, kf) == EXIT && is_left_at(back, kb, entered)));
        let is_met = select(
            (depth <= thickness || (is_opposed && !is_too_far)) && !is_within,
            depth <= thickness && (depth <= 0.0 || is_far_longer(other_way, depth, thickness)),
            is_other_side,
        );
        if is_met {
            return kb;
        }
    }
    return NONE;
}

// Contacts in a pixel, where the ray leaves the body in front and enters the one at the back. The body in front is `b`,
// or `a` on the other side of it, as in a slot.
fn contact_pixels(
    look: ptr<function, Look>,
    front: Column,
    back: Column,
    is_other_side: bool,
    view: u32,
    pixel: vec2i,
) {
    let pair = view / MAX_VIEWS;
    let is_a_in_front = is_other_side || (*look).is_beyond;
    for (var kf = front.begin; kf < front.end; kf++) {
        if facing_of(front, kf) == ENTRY || is_edge_on(normal_of(front, kf)) {
            continue;
        }
        let kb = met_by(look, front, back, kf, is_other_side);
        if kb == NONE {
            continue;
        }
        // Outward unit normals in the view frame: the ray leaves the body in front and enters the other.
        let normal_back = facing_camera(normal_of(back, kb), -1.0);
        let normal_front = facing_camera(normal_of(front, kf), 1.0);
        let normal = unit_or(normal_back - normal_front, vec3f(0.0, 0.0, -1.0));
        let gap = (depth_of(back, kb) - depth_of(front, kf)) * abs(normal.z);
        if !is_best_seen(look, normal) {
            continue;
        }
        if gap > (*look).params.prediction {
            atomicMax(&found[pair * PAIR_WORDS + GAP], ordered(-gap));
            // It is no contact, but tells other views how deep theirs can be.
            let seen = min((*look).params.thickness, 2.0 * (*look).params.prediction);
            if is_other_side || ((*look).other_count == 0u && gap > seen) {
                continue;
            }
        }
        let slot = atomicAdd(&work[CONTACTS], 1u);
        if slot >= batch.contacts {
            continue;
        }
        let at = batch.pairs * PAIR_WORDS + slot * CONTACT_WORDS;
        let depth_a = select(depth_of(back, kb), depth_of(front, kf), is_a_in_front);
        let depth_b = select(depth_of(front, kf), depth_of(back, kb), is_a_in_front);
        atomicStore(&found[at], view);
        atomicStore(&found[at + CONTACT_PIXEL], u32(pixel.x));
        atomicStore(&found[at + CONTACT_PIXEL + 1u], u32(pixel.y));
        atomicStore(&found[at + CONTACT_DEPTHS], bitcast<u32>(depth_a));
        atomicStore(&found[at + CONTACT_DEPTHS + 1u], bitcast<u32>(depth_b));
        atomicStore(&found[at + CONTACT_GAP], bitcast<u32>(gap));
        let shortened_back = share_of(back, kb, -1.0) * normal_back;
        let shortened_front = share_of(front, kf, 1.0) * normal_front;
        let shortened_a = select(shortened_back, shortened_front, is_a_in_front);
        let shortened_b = select(shortened_front, shortened_back, is_a_in_front);
        for (var k = 0u; k < 3u; k++) {
            atomicStore(&found[at + CONTACT_NORMALS + k], bitcast<u32>(shortened_a[k]));
            atomicStore(&found[at + CONTACT_NORMALS + 3u + k], bitcast<u32>(shortened_b[k]));
        }
    }
}

// Whether `b` is on the other side of `a` than the axis says, if nothing but a guess told that. See the CPU's `WaysOut`.
fn is_beyond(pair: u32, view: u32) -> bool {
    let facts = &pairs[pair].sides;
    let is_oriented = (((*facts)[0].flags | (*facts)[1].flags) & ORIENTED) != 0u;
    let at = pair * PAIR_WORDS + WAYS + view % MAX_VIEWS * VIEW_WAYS + FACE_WAYS;
    let back = atomicLoad(&found[at]);
    if is_oriented || pairs[pair].policy == FIXED_VIEW || pairs[pair].has_last != 0u || back == 0u {
        return false;
    }
    let way_on = unordered(atomicLoad(&found[at + 1u]));
    let moved = moved_along(pairs[pair].motion, views[view].axis);
    return unordered(back) > FARTHEST * max(way_on, moved) + pairs[pair].params.thickness;
}

// The column with what is known of its side.
fn of_side(c: Column, s: u32, view: u32) -> Column {
    var known = c;
    known.is_body = (views[view].flags & (BODY << s)) != 0u;
    known.near = select(-INFINITE, views[view].near[s], known.is_body);
    known.far = select(INFINITE, views[view].far[s], known.is_body);
    return known;
}

// The column of side `s` as the body that rays leave where they enter the other one, or the other way round.
fn met_column(c: Column, s: u32, is_in_front: bool, from_behind: bool, place: Place, view: u32) -> Column {
    var column = c;
    column.is_in_front = is_in_front;
    let outermost = select(c.begin, c.end - 1u, is_in_front);
    if is_rim(s, outermost, is_in_front, place, view) {
        column.rim = outermost;
    }
    column.is_turned = from_behind;
    for (var k = c.begin; k < c.end; k++) {
        let is_met = k != column.rim && layers[k].facing == met_facing(is_in_front);
        column.is_turned = column.is_turned && !is_met;
    }
    return column;
}

@compute @workgroup_size(256)
fn compare(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let k = group_index(group) * GROUP + lane;
    if k >= min(atomicLoad(&work[PIXELS]), batch.pixels)
        || atomicLoad(&work[LAYERS]) > batch.layers {
        return;
    }
    let view = view_of(k, false);
    let in_image = k - views[view].first_pixel;
    if in_image >= views[view].pixel_count {
        return;
    }
    let pair = view / MAX_VIEWS;
    let flags = views[view].flags;
    var look: Look;
    look.params = pairs[pair].params;
    if (flags & IS_FURTHER) == 0u {
        look.is_beyond = is_beyond(pair, view);
        if in_image == 0u && look.is_beyond {
            atomicStore(&found[pair * PAIR_WORDS + BEYOND + view % MAX_VIEWS], 1u);
        }
    }
    var a = column(0u, k);
    var b = column(1u, k);
    if a.begin == a.end || b.begin == b.end {
        return;
    }
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
    let place = Place(vec2i(pixel), vec2i(size), k - in_image);
    if atomicLoad(&found[pair * PAIR_WORDS + CROSSINGS]) < CROSSED {
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
    a = of_side(a, 0u, view);
    b = of_side(b, 1u, view);
    let behind = (vec2u(flags) & vec2u(FROM_BEHIND, FROM_BEHIND << 1u)) != vec2u();
    let at = views[view].rect_origin + vec2i(pixel);
    let is_a_in_front = look.is_beyond;
    let met_a = met_column(a, 0u, is_a_in_front, behind.x, place, view);
    let met_b = met_column(b, 1u, !is_a_in_front, behind.y, place, view);
    if is_a_in_front {
        contact_pixels(&look, met_a, met_b, false, view, at);
    } else {
        contact_pixels(&look, met_b, met_a, false, view, at);
    }
    let facts = &pairs[pair].sides;
    if ((*facts)[0].flags & (*facts)[1].flags & ORIENTED) != 0u {
        let front = met_column(a, 0u, true, false, place, view);
        let back = met_column(b, 1u, false, false, place, view);
        contact_pixels(&look, front, back, true, view, at);
    }
}
