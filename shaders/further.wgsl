// Stage `further`: where all directions are asked about and the views so far show no crossing, views across
// them, until axes span all directions. See the CPU's `further_axes`. They are drawn in a second round
// of the stages from `columns` on, in the buffers of the first one, whose views are not drawn again.

@group(0) @binding(1) var<storage, read> pairs: array<Pair>;
@group(0) @binding(7) var<storage, read_write> views: array<View>;
@group(0) @binding(8) var<storage, read_write> work: array<atomic<u32>>;
@group(0) @binding(14) var<storage, read_write> found: array<atomic<u32>>;

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
    let count = min(atomicLoad(&found[pair * PAIR_WORDS + VIEWS]), MAX_VIEWS);
    for (var v = 0u; v < count; v++) {
        views[first + v].exists = KNOWN;
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
