// Stage `alloc`: counts of fragments become the places of each pixel's fragments, in any order.

@group(0) @binding(8) var<storage, read_write> work: array<atomic<u32>>;
// A stage cannot write where its own size is read from.
@group(0) @binding(16) var<storage, read_write> splat_groups: array<u32>;

var<workgroup> total: atomic<u32>;
var<workgroup> base: u32;

@compute @workgroup_size(256)
fn alloc(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let k = group_index(group) * GROUP + lane;
    let pixels = min(atomicLoad(&work[PIXELS]), batch.pixels);
    let exists = k < 2u * pixels;
    let s = k / max(pixels, 1u);
    let pixel = k - s * pixels;
    var count = 0u;
    if exists {
        count = atomicLoad(&work[end_at(s, pixel)]);
    }
    let own = atomicAdd(&total, count);
    workgroupBarrier();
    if lane == 0u {
        let count_of_group = atomicLoad(&total);
        base = atomicAdd(&work[FRAGMENTS], count_of_group);
        if base > NONE - count_of_group {
            atomicStore(&work[FRAGMENTS_WRAPPED], 1u);
        }
    }
    workgroupBarrier();
    if exists {
        atomicStore(&work[begin_at(s, pixel)], base + own);
        atomicStore(&work[end_at(s, pixel)], base + own);
    }
    if k == 0u {
        let whole = (min(atomicLoad(&work[SPLATS]), batch.splats) + GROUP - 1u) / GROUP;
        let sizes = split_groups(whole);
        splat_groups[0] = sizes.x;
        splat_groups[1] = sizes.y;
        splat_groups[2] = sizes.z;
    }
}
