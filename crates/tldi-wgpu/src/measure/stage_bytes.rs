//! What stages must move: their floor.

use crate::counters::Counters;
use crate::layout::{
    CONTACT_WORDS, ENTRY_BYTES, FRAGMENT_BYTES, LAYER_BYTES, PIXEL_BYTES, PLANE_BYTES,
    SAMPLE_BYTES, SAMPLE_SLOTS, SPLAT_BYTES, SURVIVOR_BYTES,
};
use crate::pipelines::is_needed;
use crate::upload::Upload;

/// What each stage that runs must read and write at least where so much was counted, bytes.
pub(crate) fn stage_bytes(upload: &Upload, counted: &Counters) -> Vec<(&'static str, u64)> {
    let times = |count: u32, bytes: u64| u64::from(count) * bytes;
    let survivors = times(counted.survivors, SURVIVOR_BYTES);
    let tiles = times(counted.tiles, 4);
    let pixels = times(counted.pixels, PIXEL_BYTES);
    let fragments = times(counted.fragments, FRAGMENT_BYTES);
    let splats = times(counted.splats, SPLAT_BYTES);
    let layers = times(counted.layers, LAYER_BYTES);
    let bare = upload.has_bare_sides();
    let entries = times(if bare { counted.survivors } else { 0 }, ENTRY_BYTES);
    let normals = times(counted.survivors, if bare { PLANE_BYTES } else { 12 });
    let all = [
        ("cull", 12 * upload.points() as u64 + survivors),
        ("zone", 2 * survivors),
        ("normals_alloc", upload.cell_bytes()),
        ("normals_sort", survivors + entries),
        ("sample", survivors),
        (
            "aim",
            2 * SAMPLE_BYTES * SAMPLE_SLOTS * upload.pairs.len() as u64,
        ),
        ("columns_bounds", survivors),
        ("columns_tiles", 0),
        ("columns_depths", survivors + 2 * tiles),
        ("columns_touch", 3 * tiles),
        ("columns_pixels", 0),
        ("normals", survivors + entries + normals),
        ("normals_sharpen", survivors + entries + 2 * normals),
        ("normals_settle", survivors + entries + 2 * normals),
        ("mark", survivors + normals + splats + pixels),
        ("alloc", 2 * pixels),
        ("splat", splats + fragments),
        ("sweep", fragments + splats + layers + pixels),
        ("ways_out", layers + pixels),
        (
            "compare",
            layers + pixels + times(counted.contacts, 4 * u64::from(CONTACT_WORDS)),
        ),
    ];
    let runs = |stage: &(&str, u64)| is_needed(stage.0, bare);
    all.into_iter().filter(runs).collect()
}
