// Stage `zone`: which of the culled points are near the other cloud; and how many points each cell
// of the grid holds in which `normals` looks for neighbours.

@group(0) @binding(1) var<storage, read> pairs: array<Pair>;
@group(0) @binding(6) var<storage, read_write> survivors: array<Survivor>;
@group(0) @binding(8) var<storage, read_write> work: array<atomic<u32>>;

var<workgroup> near_count: atomic<u32>;
var<workgroup> main_side: u32;

// Whether the cell or one of its neighbours is marked by the other side.
fn is_near(pair: u32, other: u32, position: vec3f) -> bool {
    let dims = pairs[pair].zone_dims;
    let own = grid_cell(position, pairs[pair].overlap_min, pairs[pair].zone_inv_cell, dims);
    let first = batch.zone_at + pairs[pair].zone_first + other * pairs[pair].zone_words;
    let low = max(own, vec3u(1u)) - 1u;
    let high = min(own + 1u, dims - 1u);
    for (var z = low.z; z <= high.z; z++) {
        for (var y = low.y; y <= high.y; y++) {
            let row = first + (z * dims.y + y) * pairs[pair].zone_row_words;
            for (var x = low.x; x <= high.x; x++) {
                if (atomicLoad(&work[row + x / 32u]) & (1u << (x % 32u))) != 0u {
                    return true;
                }
            }
        }
    }
    return false;
}

@compute @workgroup_size(256)
fn zone(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let i = group_index(group) * GROUP + lane;
    let exists = i < min(atomicLoad(&work[SURVIVORS]), batch.survivors);
    var side_index = NONE;
    var near = false;
    if exists {
        side_index = survivors[i].side;
        near = is_near(side_index / 2u, 1u - side_index % 2u, survivors[i].position);
        survivors[i].is_near = u32(near);
        let facts = &pairs[side_index / 2u].sides[side_index % 2u];
        if ((*facts).flags & HAS_NORMALS) == 0u {
            let dims = (*facts).cell_dims;
            let low = pairs[side_index / 2u].overlap_min;
            let at = grid_cell(survivors[i].position, low, (*facts).cell_inv, dims);
            let cell = (*facts).cell_first + (at.z * dims.y + at.y) * dims.x + at.x;
            survivors[i].cell = cell;
            atomicAdd(&work[batch.cells_at + batch.cells + cell], 1u);
        }
    }
    // Most points of a workgroup are of one side: they are counted together.
    if lane == 0u {
        main_side = side_index;
    }
    workgroupBarrier();
    if near {
        if side_index == main_side {
            atomicAdd(&near_count, 1u);
        } else {
            atomicAdd(&work[batch.sides_at + side_index * SIDE_WORDS + NEAR_COUNT], 1u);
        }
    }
    workgroupBarrier();
    let count = atomicLoad(&near_count);
    if lane == 0u && count > 0u {
        atomicAdd(&work[batch.sides_at + main_side * SIDE_WORDS + NEAR_COUNT], count);
    }
}
