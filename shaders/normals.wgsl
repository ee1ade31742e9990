// Stage `normals`: the culled points of clouds without normals, sorted into cells, for
// `bare_normal.wgsl`. `zone` has counted them.

@group(0) @binding(2) var<storage, read> sides: array<Side>;
@group(0) @binding(6) var<storage, read_write> survivors: array<Survivor>;
@group(0) @binding(8) var<storage, read_write> work: array<atomic<u32>>;
@group(0) @binding(9) var<storage, read_write> entries: array<u32>;

var<workgroup> total: atomic<u32>;
var<workgroup> base: u32;

// Counts of cells become the places of their points.
@compute @workgroup_size(256)
fn normals_alloc(
    @builtin(workgroup_id) group: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let cell = group_index(group) * GROUP + lane;
    let exists = cell < batch.cells;
    var count = 0u;
    if exists {
        count = atomicLoad(&work[batch.cells_at + batch.cells + cell]);
    }
    let own = atomicAdd(&total, count);
    workgroupBarrier();
    if lane == 0u {
        base = atomicAdd(&work[ENTRIES], atomicLoad(&total));
    }
    workgroupBarrier();
    if exists {
        atomicStore(&work[batch.cells_at + cell], base + own);
        atomicStore(&work[batch.cells_at + batch.cells + cell], base + own);
    }
}

@compute @workgroup_size(256)
fn normals_sort(
    @builtin(workgroup_id) group: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = group_index(group) * GROUP + lane;
    if i >= min(atomicLoad(&work[SURVIVORS]), batch.survivors) || survivors[i].cell == NONE {
        return;
    }
    let place = atomicAdd(&work[batch.cells_at + batch.cells + survivors[i].cell], 1u);
    if place < arrayLength(&entries) {
        entries[place] = i;
    }
}
