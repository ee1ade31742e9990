// Stage `compare`, first half: how far the surfaces have to be moved along a view's axis to be apart. See the CPU's `ways_out`.

@group(0) @binding(7) var<storage, read_write> views: array<View>;
@group(0) @binding(8) var<storage, read_write> work: array<atomic<u32>>;
@group(0) @binding(13) var<storage, read_write> layers: array<Layer>;
@group(0) @binding(14) var<storage, read_write> found: array<atomic<u32>>;

// Of this workgroup's pixels, which are of one view, as ordered numbers.
var<workgroup> ways: array<atomic<u32>, VIEW_WAYS>;

// The nearest and the farthest depth of the layers of side `s` in a pixel that face the view, or of all. INFINITE without any.
fn span(s: u32, pixel: u32, are_faces: bool) -> vec2f {
    var depths = vec2f(INFINITE, -INFINITE);
    let end = atomicLoad(&work[end_at(s, pixel)]);
    for (var k = atomicLoad(&work[begin_at(s, pixel)]); k < end; k++) {
        if are_faces && is_edge_on(layers[k].normal) {
            continue;
        }
        depths = vec2f(select(depths.x, layers[k].near, depths.x == INFINITE), layers[k].far);
    }
    return depths;
}

// Back, then on.
fn lengthen(at: u32, a: vec2f, b: vec2f) {
    if a.x != INFINITE && b.x != INFINITE {
        atomicMax(&ways[at], ordered(b.y - a.x));
        atomicMax(&ways[at + 1u], ordered(a.y - b.x));
    }
}

@compute @workgroup_size(256)
fn ways_out(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let first = group_index(group) * GROUP;
    let are_drawn = first < min(atomicLoad(&work[PIXELS]), batch.pixels)
        && atomicLoad(&work[LAYERS]) <= batch.layers;
    let view = view_of(first, false);
    let k = first + lane;
    if are_drawn && k - views[view].first_pixel < views[view].pixel_count {
        lengthen(ALL_WAYS, span(0u, k, false), span(1u, k, false));
        lengthen(FACE_WAYS, span(0u, k, true), span(1u, k, true));
    }
    workgroupBarrier();
    if are_drawn && lane < VIEW_WAYS {
        let at = view / MAX_VIEWS * PAIR_WORDS + WAYS + view % MAX_VIEWS * VIEW_WAYS;
        atomicMax(&found[at + lane], atomicLoad(&ways[lane]));
    }
}
