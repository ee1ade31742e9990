// Stage `normals`, first part: places for the points of clouds without normals in the order of cells
// of the neighbourhood's size. `zone` has counted them.

@group(0) @binding(8) var<storage, read_write> work: array<atomic<u32>>;

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
