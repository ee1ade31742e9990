// Which view a pixel is of, by bisection: places are in the order of the views.

fn view_of_pixel(pixel: u32) -> u32 {
    var low = 0u;
    var high = batch.pairs * MAX_VIEWS;
    // Ends: the middle is between them, so that they come closer.
    while high - low > 1u {
        let middle = (low + high) / 2u;
        if views[middle].first_pixel <= pixel {
            low = middle;
        } else {
            high = middle;
        }
    }
    return low;
}
