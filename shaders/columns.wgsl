// Stage `columns`: the culled points in each view, and the columns of pixels in which the surfaces
// can meet.

@group(0) @binding(1) var<storage, read> pairs: array<Pair>;
@group(0) @binding(6) var<storage, read_write> survivors: array<Survivor>;
@group(0) @binding(7) var<storage, read_write> views: array<View>;
@group(0) @binding(8) var<storage, read_write> work: array<atomic<u32>>;
@group(0) @binding(15) var<storage, read_write> groups: array<u32>;

// Greatest coordinates, and greatest negated ones, of the workgroup's main side in each view.
var<workgroup> bounds: array<atomic<u32>, 18>;
var<workgroup> main_side: u32;

// What the splats of each side cover in each view: bounds of the points.
@compute @workgroup_size(256)
fn columns_bounds(
    @builtin(workgroup_id) group: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = group_index(group) * GROUP + lane;
    let exists = i < min(atomicLoad(&work[SURVIVORS]), batch.survivors);
    var side = NONE;
    if exists {
        side = survivors[i].side;
    }
    if lane == 0u {
        main_side = side;
    }
    workgroupBarrier();
    if exists {
        for (var v = 0u; v < MAX_VIEWS; v++) {
            let view = side / 2u * MAX_VIEWS + v;
            if views[view].exists != DRAWN {
                continue;
            }
            let p = moved(views[view].view_x, views[view].view_y, views[view].view_z, survivors[i].position);
            let at = batch.views_at + view * VIEW_WORDS + 6u * (side % 2u);
            for (var k = 0u; k < 3u; k++) {
                if side == main_side {
                    atomicMax(&bounds[6u * v + k], ordered(p[k]));
                    atomicMax(&bounds[6u * v + 3u + k], ordered(-p[k]));
                } else {
                    atomicMax(&work[at + k], ordered(p[k]));
                    atomicMax(&work[at + 3u + k], ordered(-p[k]));
                }
            }
        }
    }
    workgroupBarrier();
    if lane < 18u && main_side != NONE {
        let key = atomicLoad(&bounds[lane]);
        let view = main_side / 2u * MAX_VIEWS + lane / 6u;
        if key > 0u {
            let at = batch.views_at + view * VIEW_WORDS + 6u * (main_side % 2u);
            atomicMax(&work[at + lane % 6u], key);
        }
    }
}

struct Footprint {
    first: vec2i,
    last: vec2i,
    near: f32,
    reach: f32,
    is_empty: bool,
}

fn largest_radius(side: u32, params: Params) -> f32 {
    let facts = &pairs[side / 2u].sides[side % 2u];
    let radius = (*facts).max_radius * (*facts).radius_scale;
    return splat_radius(radius, params.pixel_size);
}

fn footprint(view: u32, s: u32, params: Params) -> Footprint {
    let at = batch.views_at + view * VIEW_WORDS + 6u * s;
    let radius = largest_radius(view / MAX_VIEWS * 2u + s, params);
    let reach = radius / params.pixel_size;
    var seen: Footprint;
    seen.reach = reach;
    seen.is_empty = atomicLoad(&work[at]) == 0u;
    if seen.is_empty {
        return seen;
    }
    let high = vec2f(unordered(atomicLoad(&work[at])), unordered(atomicLoad(&work[at + 1u])));
    let low = -vec2f(unordered(atomicLoad(&work[at + 3u])), unordered(atomicLoad(&work[at + 4u])));
    seen.first = vec2i(floor(low / params.pixel_size - reach));
    seen.last = vec2i(floor(high / params.pixel_size + reach));
    seen.near = -unordered(atomicLoad(&work[at + 5u])) - radius;
    return seen;
}

// The tiles of every view. One workgroup.
@compute @workgroup_size(256)
fn columns_tiles(@builtin(local_invocation_index) lane: u32) {
    let view_total = batch.pairs * MAX_VIEWS;
    if lane == 0u {
        cursor = 0u;
    }
    for (var first = 0u; first < view_total; first += GROUP) {
        let view = first + lane;
        var count = 0u;
        var rect_first = vec2i();
        var rect_last = vec2i(-1);
        var edge = 1;
        var dims = vec2u();
        if view < view_total && views[view].exists == DRAWN {
            let params = pairs[view / MAX_VIEWS].params;
            let a = footprint(view, 0u, params);
            let b = footprint(view, 1u, params);
            if !a.is_empty && !b.is_empty {
                rect_first = max(a.first, b.first);
                rect_last = min(a.last, b.last);
                let size = vec2i(pairs[view / MAX_VIEWS].image_size);
                if size.x > 0 {
                    rect_first = max(rect_first, vec2i(0));
                    rect_last = min(rect_last, size - 1);
                }
                views[view].depth_zero = min(a.near, b.near);
                edge = i32(ceil(max(a.reach, b.reach)));
            }
            if all(rect_first <= rect_last) {
                let size = rect_last - rect_first + 1;
                dims = vec2u((size + edge - 1) / edge) + 2u;
                count = u32(min(f32(dims.x) * f32(dims.y), 4.0e9));
                if count < 0x10000000u {
                    count = dims.x * dims.y;
                }
            }
        }
        counts[lane] = count;
        let place_of_view = place(lane);
        if view < view_total {
            views[view].tile_origin = rect_first - edge;
            views[view].tile_edge = edge;
            views[view].tile_dims = dims;
            views[view].tile_count = count;
            views[view].first_tile = place_of_view;
            views[view].rect_origin = rect_first;
            views[view].rect_size = vec2u(max(rect_last - rect_first + 1, vec2i(0)));
        }
        workgroupBarrier();
    }
    if lane == 0u {
        atomicStore(&work[TILES], cursor);
        set_groups(TILE_GROUPS, select(cursor, 0u, cursor > batch.tiles));
    }
}

fn tile_of(view: u32, p: vec3f, pixel_size: f32) -> u32 {
    let scale = 1.0 / (pixel_size * f32(views[view].tile_edge));
    let t = p.xy * scale - vec2f(views[view].tile_origin) / f32(views[view].tile_edge);
    let size = vec2f(views[view].tile_dims);
    if all(t >= vec2f(0.0)) && all(t < size) {
        return u32(t.y) * views[view].tile_dims.x + u32(t.x);
    }
    return NONE;
}

// Each tile's least depth of `a`, and least negated one of `b`.
@compute @workgroup_size(256)
fn columns_depths(
    @builtin(workgroup_id) group: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = group_index(group) * GROUP + lane;
    if i >= min(atomicLoad(&work[SURVIVORS]), batch.survivors)
        || atomicLoad(&work[TILES]) > batch.tiles {
        return;
    }
    let side = survivors[i].side;
    let params = pairs[side / 2u].params;
    for (var v = 0u; v < MAX_VIEWS; v++) {
        let view = side / 2u * MAX_VIEWS + v;
        if views[view].exists != DRAWN {
            continue;
        }
        let p = moved(views[view].view_x, views[view].view_y, views[view].view_z, survivors[i].position);
        let tile = tile_of(view, p, params.pixel_size);
        if tile != NONE {
            let depth = select(p.z, -p.z, side % 2u == 1u);
            let at = batch.tiles_at + side % 2u * batch.tiles + views[view].first_tile + tile;
            atomicMax(&work[at], ordered(-depth));
        }
    }
}

var<workgroup> touched: array<atomic<u32>, 4>;

// Least depth in a tile and its neighbours.
fn least_depth(at: u32, k: u32, width: u32) -> f32 {
    var key = 0u;
    for (var y = 0u; y < 3u; y++) {
        for (var x = 0u; x < 3u; x++) {
            key = max(key, atomicLoad(&work[at + k + y * width + x - width - 1u]));
        }
    }
    return select(-unordered(key), INFINITE, key == 0u);
}

// Marks the tiles in which the surfaces are within reach, and bounds them.
@compute @workgroup_size(256)
fn columns_touch(
    @builtin(workgroup_id) group: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let tile = group_index(group) * GROUP + lane;
    let exists = tile < min(atomicLoad(&work[TILES]), batch.tiles);
    let view = view_of(tile, true);
    let k = tile - views[view].first_tile;
    let dims = views[view].tile_dims;
    if exists && k < views[view].tile_count {
        let x = k % dims.x;
        let y = k / dims.x;
        if x > 0u && y > 0u && x + 1u < dims.x && y + 1u < dims.y {
            let at = batch.tiles_at + views[view].first_tile;
            let a = least_depth(at, k, dims.x);
            let b = least_depth(at + batch.tiles, k, dims.x);
            if a + b <= pairs[view / MAX_VIEWS].column_reach {
                atomicStore(&work[at + 2u * batch.tiles + k], 1u);
                atomicMax(&touched[0], x + 1u);
                atomicMax(&touched[1], y + 1u);
                atomicMax(&touched[2], NONE - x);
                atomicMax(&touched[3], NONE - y);
            }
        }
    }
    workgroupBarrier();
    if lane < 4u {
        let key = atomicLoad(&touched[lane]);
        if key > 0u {
            atomicMax(&work[batch.views_at + view * VIEW_WORDS + TOUCHED + lane], key);
        }
    }
}

// The images. One workgroup. Where clouds have no normals, `normals` does it.
@compute @workgroup_size(256)
fn columns_pixels(@builtin(local_invocation_index) lane: u32) {
    place_images(lane);
}
