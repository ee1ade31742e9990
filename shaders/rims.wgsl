// Where a surface ends in its rim: part of the stage `compare`. See the CPU's.

// What a layer faces that the other surface can meet.
fn met_facing(is_in_front: bool) -> i32 {
    return select(ENTRY, EXIT, is_in_front);
}

// How far out layer `k` reaches: behind, if its surface is in front of the other one, and else in front. Metres.
fn reach_of(k: u32, is_in_front: bool) -> f32 {
    return select(-layers[k].near, layers[k].far, is_in_front);
}

// Whether a point of side `s`, in the view, is more than a thickness within what was culled.
fn is_within_culled(s: u32, view: u32, point: vec3f) -> bool {
    let pair = &pairs[view / MAX_VIEWS];
    let facts = &(*pair).sides[s];
    let inner = (*pair).params.thickness;
    let camera = &views[view];
    let off = point - vec3f((*camera).view_x.w, (*camera).view_y.w, (*camera).view_z.w);
    let in_frame = off.x * (*camera).view_x.xyz + off.y * (*camera).view_y.xyz + off.z * (*camera).view_z.xyz;
    let in_other = moved(
        (*facts).other_from_frame_x,
        (*facts).other_from_frame_y,
        (*facts).other_from_frame_z,
        in_frame,
    );
    return is_within(in_frame, (*pair).overlap_min + inner, (*pair).overlap_max - inner)
        && is_within(in_other, (*facts).other_min + inner, (*facts).other_max - inner);
}

// Whether layer `k`, the outermost of side `s` in a pixel, is a rim.
fn is_rim(s: u32, k: u32, is_in_front: bool, place: Place, view: u32) -> bool {
    let normal = layers[k].normal;
    if !is_steep(normal) {
        return false;
    }
    let pixel_size = pairs[view / MAX_VIEWS].params.pixel_size;
    let thickness = pairs[view / MAX_VIEWS].params.thickness;
    let reach = reach_of(k, is_in_front);
    let down = select(-normal.xy, normal.xy, (normal.z < 0.0) == is_in_front);
    let least = BESIDE * length(down);
    for (var dj = -1; dj <= 1; dj++) {
        for (var di = -1; di <= 1; di++) {
            let p = place.at + vec2i(di, dj);
            if any(p < vec2i(0)) || any(p >= place.size) {
                continue;
            }
            let along = dot(down, vec2f(f32(di), f32(dj)));
            // A wall that is seen edge-on may lean to either side.
            let is_down = along >= least || (is_edge_on(normal) && -along >= least) || (di == 0 && dj == 0);
            let next = column(s, place.first + u32(p.y * place.size.x + p.x));
            for (var n = next.begin; n < next.end; n++) {
                let beyond = reach_of(n, is_in_front) - reach;
                let goes_on = is_down && beyond > 0.0;
                let is_met = layers[n].facing == met_facing(is_in_front);
                if is_met || select(beyond > -thickness, goes_on, is_steep(layers[n].normal)) {
                    return false;
                }
            }
        }
    }
    let at = vec2f(views[view].rect_origin + place.at) + 0.5;
    return is_within_culled(s, view, vec3f(at * pixel_size, select(-reach, reach, is_in_front)));
}
