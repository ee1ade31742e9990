// Where the pixels of both sides' images are in the arena: their cursors (ends), then their begins.

fn end_at(s: u32, pixel: u32) -> u32 {
    return batch.pixels_at + s * batch.pixels + pixel;
}

fn begin_at(s: u32, pixel: u32) -> u32 {
    return batch.pixels_at + (2u + s) * batch.pixels + pixel;
}
