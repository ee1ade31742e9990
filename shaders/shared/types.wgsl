// What all stages share: the batch, its pairs and sides, their views, and the arena of counters.
// Layouts are those of `tldi::Params` and of `tldi-wgpu`'s `layout` module. Numbers that the host shares are in
// `numbers.rs`.

// Numbers of the CPU's stages, filled from `tldi::plan::stage_constants`.
override BLOCK: u32;
override AIM_SAMPLES: u32;
override SUPPORT: f32;
override MAX_CANDIDATES: u32;
override LEAST_PLANAR: f32;
override ON_PLANE: f32;
override OF_NOISE: f32;
override STANDS_OUT: f32;
override OFF_PLANE: f32;
override FLAT_PLANE: f32;
override LEAST_RADIUS_PX: f32;
override EDGE_ON: f32;
override NORMAL_STEPS: f32;
override CREASED: f32;
override LEAST_OF_LAYER: f32;
override MOST_FACES: u32;
override BEND_STEPS: f32;
override MOST_ASIDE: f32;
override BEND_SHIFT: u32;
override SAME_FACE: f32;
override MAX_WEIGHT: f32;
override DEPTH_BITS: u32;
override MAX_DEPTH: f32;
override DEPTH_STEPS: u32;
override STEEP: f32;
override FACING: f32;
override FARTHEST: f32;
override BESIDE: f32;
override SWAPPED: u32;
override PIERCED: u32;
override CROSSED: u32;
override MAX_VIEWS: u32;
override WELL_SEEN: f32;
override SUPPORTED: f32;
override LEAST_SHARE: f32;
override CONCLUSIVE: f32;
override HINT_WEIGHT: f32;
override MEMORY_WEIGHT: f32;
override ALIKE: f32;
override TURNS: u32;
override FLAT: f32;
override AXIS_HYSTERESIS: f32;
override PLAINLY: f32;
override CROSSING: f32;

// A culled point in the order of the cells in which neighbours are looked for.
struct Entry {
    position: vec3f,
    // Index of the survivor, and NEAR.
    id: u32,
}

const NEAR: u32 = 0x80000000u;

// What is not a number of anything.
const NONE: u32 = 0xffffffffu;
const INFINITE: f32 = 3.0e38;

struct Params {
    pixel_size: f32,
    merge_gap: f32,
    thickness: f32,
    prediction: f32,
    slope_damping: f32,
    rho: f32,
    stack_segments: u32,
    variant: u32,
}

// Sizes of the batch, capacities in elements, and where the parts of the arena begin, in words.
struct Batch {
    pairs: u32,
    items: u32,
    survivors: u32,
    tiles: u32,
    pixels: u32,
    splats: u32,
    fragments: u32,
    layers: u32,
    contacts: u32,
    cells: u32,
    sides_at: u32,
    views_at: u32,
    zone_at: u32,
    cells_at: u32,
    tiles_at: u32,
    pixels_at: u32,
}

// Rigid motions are the rows of a matrix, the translation last.
struct Side {
    frame_from_cloud_x: vec4f,
    frame_from_cloud_y: vec4f,
    frame_from_cloud_z: vec4f,
    other_from_frame_x: vec4f,
    other_from_frame_y: vec4f,
    other_from_frame_z: vec4f,
    other_min: vec3f,
    stride: u32,
    other_max: vec3f,
    len: u32,
    // Of its bounds, in its own frame; if it is a body.
    middle: vec3f,
    flags: u32,
    half_extents: vec3f,
    // Told standard deviation of the points, metres.
    noise: f32,
    // Word of the first point's x.
    first_point: u32,
    first_normal: u32,
    // Of every n-th point: they are scaled to cover the surface.
    radius_scale: f32,
    // Of all points of the cloud, not scaled.
    max_radius: f32,
    cell_dims: vec3u,
    cell_first: u32,
    cell_inv: f32,
    mean_radius: f32,
    merge_steps: u32,
    // Words from a point to the next one; the radius is the fourth.
    point_step: u32,
}

// One of the near points of a side, in the frame of `a`.
struct Sample {
    normal: vec3f,
    padding_a: u32,
    point: vec3f,
    padding_b: u32,
}

struct Pair {
    params: Params,
    overlap_min: vec3f,
    zone_inv_cell: f32,
    overlap_max: vec3f,
    column_reach: f32,
    zone_dims: vec3u,
    // Of 32 bits, of a row along x.
    zone_row_words: u32,
    larger_from_a_x: vec3f,
    // Word of the first cell of `a`; those of `b` follow.
    zone_first: u32,
    larger_from_a_y: vec3f,
    zone_words: u32,
    larger_from_a_z: vec3f,
    policy: u32,
    half_extents: vec3f,
    plainness: f32,
    toward_b: vec3f,
    has_last: u32,
    last_axis: vec3f,
    body_is_b: u32,
    lies: vec3f,
    padding_g: u32,
    motion: vec3f,
    padding_a: u32,
    body_middle: vec3f,
    padding_b: u32,
    body_half_extents: vec3f,
    padding_c: u32,
    body_from_a_x: vec3f,
    padding_d: u32,
    body_from_a_y: vec3f,
    padding_e: u32,
    body_from_a_z: vec3f,
    padding_f: u32,
    view_x: vec4f,
    view_y: vec4f,
    view_z: vec4f,
    image_size: vec2u,
    depth_step: f32,
    depth_inv_step: f32,
    // Of `a`, then of `b`.
    sides: array<Side, 2>,
}

// A point that passed the cull.
struct Survivor {
    // In the frame of the query, metres.
    position: vec3f,
    radius: f32,
    side: u32,
    // In its cloud.
    index: u32,
    cell: u32,
    is_near: u32,
}

// The plane of a point's neighbourhood, as on the CPU.
struct Plane {
    normal: vec3f,
    variance: f32,
    height: f32,
    // Whether the point is modelled.
    is_needed: u32,
    // Whether it lies far beside the surface that its neighbours are on.
    stands_out: u32,
    padding: u32,
}

struct View {
    view_x: vec4f,
    view_y: vec4f,
    view_z: vec4f,
    axis: vec3f,
    exists: u32,
    // Depths between which `a` and `b` lie, if they are bodies.
    near: vec2f,
    flags: u32,
    depth_zero: f32,
    tile_origin: vec2i,
    tile_edge: i32,
    first_tile: u32,
    tile_dims: vec2u,
    tile_count: u32,
    first_pixel: u32,
    rect_origin: vec2i,
    rect_size: vec2u,
    pixel_count: u32,
    padding: u32,
    far: vec2f,
}

// Values of `View.exists`. What is known is not drawn in this round.
const MISSING: u32 = 0u;
const DRAWN: u32 = 1u;
const KNOWN: u32 = 2u;

// Bits of `View.flags`: for `a`, then for `b`.
const BODY: u32 = 1u;
const FROM_BEHIND: u32 = 4u;
// This view only looks for crossings.
const IS_FURTHER: u32 = 16u;

// One oriented disc; see the CPU's `Splat`. Pixels are relative to the image.
struct Splat {
    centre: vec2f,
    slope: vec2f,
    depth: f32,
    steps: f32,
    radius: f32,
    facing: f32,
    first: vec2u,
    last: vec2i,
    // View and side: 2 * view + side.
    view_side: u32,
    class_bits: u32,
    normal_xy: u32,
    normal_z: u32,
}

struct Layer {
    normal: vec3f,
    facing: i32,
    near: f32,
    far: f32,
    depth: f32,
    agreement: f32,
}

const ENTRY: i32 = -1;
const UNKNOWN: i32 = 0;
const EXIT: i32 = 1;

// Words of a side in the arena, SIDE_WORDS in all.
const KEPT_COUNT: u32 = 0u;
const NEAR_COUNT: u32 = 1u;
const RADIUS_LOW: u32 = 2u;
const RADIUS_HIGH: u32 = 3u;
const SAMPLE_COUNT: u32 = 4u;

// Words of a view in the arena from which on the bounds of its touching tiles are.
const TOUCHED: u32 = 12u;

// Steps of the sum of radii, in shares of the largest: 2^20.
const RADIUS_STEPS: f32 = 1048576.0;

@group(0) @binding(0) var<uniform> batch: Batch;
