// Stage `cull`: the points of one cloud inside the overlap of both bounds, in the frame of the
// query; and the cells of the zone's grid that hold them. A workgroup takes one block of one side.

@group(0) @binding(1) var<storage, read> pairs: array<Pair>;
// Side, and first point in its cloud.
@group(0) @binding(3) var<storage, read> items: array<vec2u>;
@group(0) @binding(4) var<storage, read> points: array<f32>;
@group(0) @binding(6) var<storage, read_write> survivors: array<Survivor>;
@group(0) @binding(8) var<storage, read_write> work: array<atomic<u32>>;

var<workgroup> kept: atomic<u32>;
var<workgroup> radii: atomic<u32>;
var<workgroup> first: u32;

// Whether all are numbers, and none is infinite, by their bits: of comparisons, a driver may take it that they are.
fn are_finite(v: vec4f) -> bool {
    return all((bitcast<vec4u>(v) & vec4u(0x7fffffffu)) < vec4u(0x7f800000u));
}

@compute @workgroup_size(256)
fn cull(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let item_index = group_index(group);
    let exists = item_index < batch.items;
    let item = items[min(item_index, batch.items - 1u)];
    let side_index = item.x;
    let pair_index = side_index / 2u;
    let facts = &pairs[pair_index].sides[side_index % 2u];
    let stride = (*facts).stride;
    // See `tldi::plan::first_taken`.
    let offset = hash(item.y / BLOCK) % stride + lane * stride;
    let index = item.y + offset;
    var is_kept = exists && offset < BLOCK && index < (*facts).len;
    var position = vec3f();
    var radius = 0.0;
    if is_kept {
        let at = (*facts).first_point + index * (*facts).point_step;
        // Where radii are equal, the points have none of their own.
        radius = (*facts).max_radius;
        if ((*facts).flags & RADII_DIFFER) != 0u {
            radius = points[at + 3u];
        }
        // The host does not know the points that only the device has.
        let in_cloud = vec3f(points[at], points[at + 1u], points[at + 2u]);
        is_kept = are_finite(vec4f(in_cloud, radius)) && radius > 0.0;
        radius = min(radius, (*facts).max_radius);
        position = moved(
            (*facts).frame_from_cloud_x,
            (*facts).frame_from_cloud_y,
            (*facts).frame_from_cloud_z,
            in_cloud,
        );
        let in_other = moved(
            (*facts).other_from_frame_x,
            (*facts).other_from_frame_y,
            (*facts).other_from_frame_z,
            position,
        );
        is_kept = is_kept && is_within(position, pairs[pair_index].overlap_min, pairs[pair_index].overlap_max)
            && is_within(in_other, (*facts).other_min, (*facts).other_max);
    }
    var own = 0u;
    if is_kept {
        own = atomicAdd(&kept, 1u);
        if ((*facts).flags & RADII_DIFFER) != 0u {
            atomicAdd(&radii, u32(radius / (*facts).max_radius * RADIUS_STEPS));
        }
    }
    workgroupBarrier();
    if lane == 0u {
        let count = atomicLoad(&kept);
        let sum = atomicLoad(&radii);
        let state = batch.sides_at + side_index * SIDE_WORDS;
        if count > 0u {
            first = atomicAdd(&work[SURVIVORS], count);
            atomicAdd(&work[state + KEPT_COUNT], count);
        }
        if sum > 0u {
            atomicAdd(&work[state + RADIUS_LOW], sum & 0xffffu);
            atomicAdd(&work[state + RADIUS_HIGH], sum >> 16u);
        }
    }
    workgroupBarrier();
    let slot = first + own;
    if !is_kept || slot >= batch.survivors {
        return;
    }
    let scaled = radius * (*facts).radius_scale;
    survivors[slot] = Survivor(position, scaled, side_index, index, NONE, 0u);
    let dims = pairs[pair_index].zone_dims;
    let cell = grid_cell(position, pairs[pair_index].overlap_min, pairs[pair_index].zone_inv_cell, dims);
    let row = (cell.z * dims.y + cell.y) * pairs[pair_index].zone_row_words;
    let of_side = (side_index % 2u) * pairs[pair_index].zone_words;
    let word = batch.zone_at + pairs[pair_index].zone_first + of_side + row + cell.x / 32u;
    atomicOr(&work[word], 1u << (cell.x % 32u));
}
