// Stage `splat`: the fragments of every splat. A fragment is a key (class, depth and, in the
// lowest bit, whether it is steep), and the splat above its weight.

@group(0) @binding(7) var<storage, read_write> views: array<View>;
@group(0) @binding(8) var<storage, read_write> work: array<atomic<u32>>;
@group(0) @binding(11) var<storage, read_write> splats: array<Splat>;
@group(0) @binding(12) var<storage, read_write> fragments: array<vec2u>;

@compute @workgroup_size(256)
fn splat(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let k = group_index(group) * GROUP + lane;
    if k >= min(atomicLoad(&work[SPLATS]), batch.splats) {
        return;
    }
    let splat = splats[k];
    let view = splat.view_side / 2u;
    let s = splat.view_side % 2u;
    let inv_radius_squared = 1.0 / (splat.radius * splat.radius);
    let origin = views[view].rect_origin;
    for (var y = i32(splat.first.y); y <= splat.last.y; y++) {
        let row = views[view].first_pixel + u32(y) * views[view].rect_size.x;
        for (var x = i32(splat.first.x); x <= splat.last.x; x++) {
            let d = vec2f(origin + vec2i(x, y)) + 0.5 - splat.centre;
            let rise = clamp(dot(splat.slope, d), -splat.radius, splat.radius);
            let share = 1.0 - (dot(d, d) + rise * rise) * inv_radius_squared;
            let is_own = all(d > vec2f(-0.5)) && all(d <= vec2f(0.5));
            if !(share > 0.0) && !is_own {
                continue;
            }
            let depth = truncated(splat.depth + splat.steps * rise, MAX_DEPTH);
            let weight = truncated(1.0 + (MAX_WEIGHT - 1.0) * max(share, 0.0) * splat.facing, MAX_WEIGHT);
            let place = atomicAdd(&work[end_at(s, row + u32(x))], 1u);
            if place < batch.fragments {
                fragments[place] = vec2u(splat.class_bits | (depth & ~1u), (k << WEIGHT_BITS) | weight);
            }
        }
    }
}
