// Which view a tile or a pixel is of, by bisection: places are in the order of the views.
fn view_of(place: u32, is_tile: bool) -> u32 {
    var low = 0u;
    var high = batch.pairs * MAX_VIEWS;
    // Ends: the middle is between them, so that they come closer.
    while high - low > 1u {
        let middle = (low + high) / 2u;
        if select(views[middle].first_pixel, views[middle].first_tile, is_tile) <= place {
            low = middle;
        } else {
            high = middle;
        }
    }
    return low;
}
