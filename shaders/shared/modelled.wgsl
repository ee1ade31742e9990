// Which of the culled points are in the columns that matter.

fn position_in(view: u32, i: u32) -> vec3f {
    return moved(views[view].view_x, views[view].view_y, views[view].view_z, survivors[i].position);
}

// Whether a point is in a tile that touches, or next to one.
fn is_modelled(view: u32, p: vec3f, pixel_size: f32) -> bool {
    let scale = 1.0 / (pixel_size * f32(views[view].tile_edge));
    let t = p.xy * scale - vec2f(views[view].tile_origin) / f32(views[view].tile_edge);
    let dims = views[view].tile_dims;
    if !(all(t >= vec2f(0.0)) && all(t < vec2f(dims))) {
        return false;
    }
    let own = vec2u(t);
    let low = max(own, vec2u(1u)) - 1u;
    let high = min(own + 1u, dims - 1u);
    let touch = batch.tiles_at + 2u * batch.tiles + views[view].first_tile;
    for (var y = low.y; y <= high.y; y++) {
        for (var x = low.x; x <= high.x; x++) {
            if atomicLoad(&work[touch + y * dims.x + x]) != 0u {
                return true;
            }
        }
    }
    return false;
}
