// Stage `normals`, second part: planes of the points that are modelled. Threads take the points in
// the order of their cells, so that neighbours read the same ones.

@group(0) @binding(1) var<storage, read> pairs: array<Pair>;
@group(0) @binding(6) var<storage, read_write> survivors: array<Survivor>;
@group(0) @binding(7) var<storage, read_write> views: array<View>;
@group(0) @binding(8) var<storage, read_write> work: array<atomic<u32>>;
@group(0) @binding(9) var<storage, read_write> entries: array<Entry>;
@group(0) @binding(15) var<storage, read_write> groups: array<u32>;
@group(0) @binding(17) var<storage, read_write> planes: array<Plane>;

@compute @workgroup_size(256)
fn normals(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    // No plane depends on the images, and they take one workgroup: this saves a dispatch.
    if group_index(group) == 0u {
        place_images(lane);
    }
    let k = group_index(group) * GROUP + lane;
    let fits = atomicLoad(&work[TILES]) <= batch.tiles && atomicLoad(&work[SURVIVORS]) <= batch.survivors;
    if !fits || k >= min(atomicLoad(&work[ENTRIES]), arrayLength(&entries)) {
        return;
    }
    let i = entries[k].id & ~NEAR;
    let side = survivors[i].side;
    let pixel_size = pairs[side / 2u].params.pixel_size;
    var is_needed = false;
    for (var v = 0u; v < MAX_VIEWS; v++) {
        let view = side / 2u * MAX_VIEWS + v;
        if views[view].exists != DRAWN {
            continue;
        }
        is_needed = is_needed || is_modelled(view, position_in(view, i), pixel_size);
    }
    var plane: Plane;
    plane.variance = INFINITE;
    if is_needed {
        plane = bare_plane(side, entries[k].position, false);
        plane.is_needed = 1u - plane.stands_out;
    }
    planes[i] = plane;
}
