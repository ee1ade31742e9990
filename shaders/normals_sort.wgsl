// Stage `normals`, first part: the points go to their places.

@group(0) @binding(6) var<storage, read_write> survivors: array<Survivor>;
@group(0) @binding(8) var<storage, read_write> work: array<atomic<u32>>;
@group(0) @binding(9) var<storage, read_write> entries: array<Entry>;

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
        entries[place] = Entry(survivors[i].position, i | (survivors[i].is_near * NEAR));
    }
}
