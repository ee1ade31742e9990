// Places of views in what all of them share, one after the other.

var<workgroup> counts: array<u32, GROUP>;
var<workgroup> cursor: u32;

// Gives every view of `counts` its place; the last one's end is in `cursor`. Places begin at
// multiples of GROUP, so that all threads of a workgroup are in one view.
fn place(lane: u32) -> u32 {
    workgroupBarrier();
    if lane == 0u {
        var sum = cursor;
        for (var k = 0u; k < GROUP; k++) {
            let count = counts[k];
            counts[k] = sum;
            // More than any memory holds stays more.
            sum = select(sum + (count + GROUP - 1u) / GROUP * GROUP, 0xf0000000u, count > 0x10000000u || sum >= 0xf0000000u);
        }
        cursor = sum;
    }
    workgroupBarrier();
    return counts[lane];
}

fn set_groups(at: u32, count: u32) {
    let sizes = split_groups(count / GROUP);
    groups[at] = sizes.x;
    groups[at + 1u] = sizes.y;
    groups[at + 2u] = sizes.z;
}

// The image of every view: the pixels of its touching tiles. All threads of one workgroup call it.
fn place_images(lane: u32) {
    let view_total = batch.pairs * MAX_VIEWS;
    if lane == 0u {
        cursor = 0u;
    }
    for (var first = 0u; first < view_total; first += GROUP) {
        let view = first + lane;
        var count = 0u;
        var origin = vec2i();
        var size = vec2u();
        if view < view_total {
            let at = batch.views_at + view * VIEW_WORDS + TOUCHED;
            let end = vec2i(vec2u(atomicLoad(&work[at]), atomicLoad(&work[at + 1u])));
            if end.x > 0 {
                let low = vec2i(vec2u(
                    NONE - atomicLoad(&work[at + 2u]),
                    NONE - atomicLoad(&work[at + 3u]),
                ));
                let edge = views[view].tile_edge;
                let rect_end = views[view].rect_origin + vec2i(views[view].rect_size);
                origin = max(views[view].tile_origin + low * edge, views[view].rect_origin);
                let end_pixel = min(views[view].tile_origin + end * edge, rect_end);
                size = vec2u(max(end_pixel - origin, vec2i(0)));
                count = u32(min(f32(size.x) * f32(size.y), 4.0e9));
                if count < 0x10000000u {
                    count = size.x * size.y;
                }
            }
        }
        counts[lane] = count;
        let place_of_view = place(lane);
        if view < view_total {
            views[view].rect_origin = origin;
            views[view].rect_size = size;
            views[view].pixel_count = count;
            views[view].first_pixel = place_of_view;
        }
        workgroupBarrier();
    }
    if lane == 0u {
        atomicStore(&work[PIXELS], cursor);
        let fitting = select(cursor, 0u, cursor > batch.pixels);
        set_groups(PIXEL_GROUPS, 2u * fitting);
        set_groups(IMAGE_GROUPS, fitting);
    }
}
