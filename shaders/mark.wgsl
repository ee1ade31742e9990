// Stage `mark`: the points in the columns that matter become splats, and the pixels that these may
// cover are counted.

@group(0) @binding(1) var<storage, read> pairs: array<Pair>;
@group(0) @binding(5) var<storage, read> normals: array<f32>;
@group(0) @binding(6) var<storage, read_write> survivors: array<Survivor>;
@group(0) @binding(7) var<storage, read_write> views: array<View>;
@group(0) @binding(8) var<storage, read_write> work: array<atomic<u32>>;
@group(0) @binding(11) var<storage, read_write> splats: array<Splat>;
@group(0) @binding(17) var<storage, read_write> planes: array<Plane>;

var<workgroup> total: atomic<u32>;
var<workgroup> base: u32;

fn is_bare(side: u32) -> bool {
    return (pairs[side / 2u].sides[side % 2u].flags & HAS_NORMALS) == 0u;
}

fn normal_of(i: u32) -> vec3f {
    let side = survivors[i].side;
    if is_bare(side) {
        return planes[i].normal;
    }
    return given_normal(side, survivors[i].index);
}

fn splat_of(view: u32, i: u32, normal_in_frame: vec3f) -> Splat {
    let side = survivors[i].side;
    let pair = side / 2u;
    let params = pairs[pair].params;
    let p = position_in(view, i);
    let normal = turned(views[view].view_x, views[view].view_y, views[view].view_z, normal_in_frame);
    let oriented = (pairs[pair].sides[side % 2u].flags & (HAS_NORMALS | ORIENTED)) == (HAS_NORMALS | ORIENTED);
    var splat: Splat;
    splat.class_bits = u32(!oriented || normal.z > 0.0);
    splat.steps = params.slope_damping * params.pixel_size * pairs[pair].depth_inv_step;
    if is_edge_on(normal) {
        splat.class_bits = 2u;
        splat.steps = 0.0;
    }
    splat.class_bits = (splat.class_bits << DEPTH_BITS) | u32(abs(normal.z) < STEEP);
    let steepest = vec2f(1.0e18);
    splat.slope = select(
        vec2f(0.0),
        clamp(normal.xy * (-1.0 / normal.z), -steepest, steepest),
        abs(normal.z) > 1.0e-30,
    );
    splat.centre = p.xy / params.pixel_size;
    splat.radius = splat_radius(survivors[i].radius, params.pixel_size) / params.pixel_size;
    splat.depth = (p.z - views[view].depth_zero) * pairs[pair].depth_inv_step;
    splat.facing = abs(normal.z);
    // Centres at i + 0.5 within reach, and the pixel that holds the point.
    let own = floor(splat.centre);
    let low = min(ceil(splat.centre - splat.radius - 0.5), own);
    let high = max(floor(splat.centre + splat.radius - 0.5), own);
    let origin = vec2f(views[view].rect_origin);
    let size = vec2f(views[view].rect_size);
    splat.first = vec2u(
        truncated(low.x - origin.x, size.x),
        truncated(low.y - origin.y, size.y),
    );
    splat.last = vec2i(vec2u(
        truncated(high.x - origin.x + 1.0, size.x),
        truncated(high.y - origin.y + 1.0, size.y),
    )) - 1;
    splat.view_side = 2u * view + side % 2u;
    // Unoriented normals are taken as facing the camera.
    let sign = select(1.0, -1.0, !oriented && normal.z > 0.0);
    let steps = vec3i(sign * normal * NORMAL_STEPS);
    splat.normal_xy = (u32(steps.x) & 0xffffu) | (u32(steps.y) << 16u);
    splat.normal_z = u32(steps.z);
    return splat;
}

@compute @workgroup_size(256)
fn mark(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let i = group_index(group) * GROUP + lane;
    let fits = atomicLoad(&work[TILES]) <= batch.tiles && atomicLoad(&work[PIXELS]) <= batch.pixels;
    let exists = fits && i < min(atomicLoad(&work[SURVIVORS]), batch.survivors);
    // One bit a view.
    var modelled = 0u;
    if exists && !(is_bare(survivors[i].side) && planes[i].stands_out > 0u) {
        let pair = survivors[i].side / 2u;
        for (var v = 0u; v < MAX_VIEWS; v++) {
            let view = pair * MAX_VIEWS + v;
            if views[view].exists != DRAWN || views[view].pixel_count == 0u {
                continue;
            }
            let p = position_in(view, i);
            modelled |= u32(is_modelled(view, p, pairs[pair].params.pixel_size)) << v;
        }
    }
    let own = atomicAdd(&total, countOneBits(modelled));
    workgroupBarrier();
    if lane == 0u {
        base = atomicAdd(&work[SPLATS], atomicLoad(&total));
    }
    workgroupBarrier();
    if modelled == 0u {
        return;
    }
    let normal = normal_of(i);
    var slot = base + own;
    for (var v = 0u; v < MAX_VIEWS; v++) {
        if (modelled & (1u << v)) == 0u {
            continue;
        }
        let view = survivors[i].side / 2u * MAX_VIEWS + v;
        let splat = splat_of(view, i, normal);
        if slot < batch.splats {
            splats[slot] = splat;
        }
        slot++;
        for (var y = i32(splat.first.y); y <= splat.last.y; y++) {
            let row = views[view].first_pixel + u32(y) * views[view].rect_size.x;
            for (var x = i32(splat.first.x); x <= splat.last.x; x++) {
                atomicAdd(&work[end_at(splat.view_side % 2u, row + u32(x))], 1u);
            }
        }
    }
}
