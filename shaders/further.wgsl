// Stage `further`: spare views, where the way out of the others asks for them, see the CPU's `asks_for_spare`; and where all
// directions are asked about and the views so far show no crossing, views across them, until axes span all directions, see
// `further_axes`. They are drawn in a second round of the stages from `columns` on, in the buffers of the first one, whose
// views are not drawn again.

@group(0) @binding(1) var<storage, read> pairs: array<Pair>;
@group(0) @binding(7) var<storage, read_write> views: array<View>;
@group(0) @binding(8) var<storage, read_write> work: array<atomic<u32>>;
@group(0) @binding(14) var<storage, read_write> found: array<atomic<u32>>;

// Whether the least way out of the first `count` views may be far longer than that of spare ones.
fn asks_for_spare(pair: u32, count: u32) -> bool {
    var least = INFINITE;
    for (var v = 0u; v < count; v++) {
        let at = pair * PAIR_WORDS;
        let is_beyond = min(atomicLoad(&found[at + BEYOND + v]), 1u);
        let way = atomicLoad(&found[at + WAYS + v * VIEW_WAYS + ALL_WAYS + is_beyond]);
        least = min(least, select(unordered(way), INFINITE, way == 0u));
    }
    let moved = moved_along(pairs[pair].motion, views[pair * MAX_VIEWS].axis);
    return least != INFINITE && least > FARTHEST * moved + pairs[pair].params.thickness;
}

@compute @workgroup_size(256)
fn further(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let pair = group_index(group) * GROUP + lane;
    if pair == 0u {
        // What this round counts anew.
        for (var k = TILES; k <= LAYERS; k++) {
            atomicStore(&work[k], 0u);
        }
        atomicStore(&work[FRAGMENTS_WRAPPED], 0u);
    }
    if pair >= batch.pairs {
        return;
    }
    let first = pair * MAX_VIEWS;
    var count = min(atomicLoad(&found[pair * PAIR_WORDS + VIEWS]), MAX_VIEWS);
    for (var v = 0u; v < count; v++) {
        views[first + v].exists = KNOWN;
    }
    if asks_for_spare(pair, count) {
        let spare = min(atomicLoad(&found[pair * PAIR_WORDS + SPARE]), MAX_VIEWS - count);
        for (var v = count; v < count + spare; v++) {
            views[first + v].exists = DRAWN;
        }
        count += spare;
    }
    let is_wanted = pairs[pair].policy == ALL_DIRECTIONS
        && atomicLoad(&found[pair * PAIR_WORDS + CROSSINGS]) < CROSSED;
    if !is_wanted || count == 0u {
        return;
    }
    if count == 1u {
        views[first + 1u] = view_along(views[first].view_x.xyz);
        views[first + 2u] = view_along(views[first].view_y.xyz);
    } else if count == 2u {
        let across = cross(views[first].axis, views[first + 1u].axis);
        views[first + 2u] = view_along(unit_or(across, views[first].view_x.xyz));
    }
    for (var v = count; v < MAX_VIEWS; v++) {
        views[first + v].flags = IS_FURTHER;
    }
}
