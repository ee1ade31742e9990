//! The stages of the GPU backend in WGSL, under the names of the CPU backend's stages.
//!
//! One file a stage; what they share is in `shared/` and put in front. [`numbers`] are those that the host shares. The
//! numbers of the CPU's stages are overrides, which `tldi-wgpu` fills.

#[macro_use]
pub mod numbers;

/// One compute stage: an entry point of a shader.
#[derive(Clone, Copy, Debug)]
pub struct Stage {
    /// Name of the stage and of its entry point.
    pub name: &'static str,
    /// WGSL, complete.
    pub source: &'static str,
    /// Bindings of group 0 that the entry point uses.
    pub bindings: &'static [u32],
}

/// A stage of a batch: the numbers, `types` and `math` in front of its own files.
macro_rules! shader {
    ($($file:literal),+) => {
        concat!(
            numbers_wgsl!(),
            include_str!("shared/types.wgsl"),
            include_str!("shared/math.wgsl"),
            $(include_str!($file)),+
        )
    };
}

const CULL: &str = shader!("cull.wgsl");
const ZONE: &str = shader!("zone.wgsl");
const NORMALS_ALLOC: &str = shader!("normals_alloc.wgsl");
const NORMALS_SORT: &str = shader!("normals_sort.wgsl");
const NORMALS: &str = shader!(
    "shared/eigen.wgsl",
    "shared/bare_normal.wgsl",
    "shared/modelled.wgsl",
    "shared/places.wgsl",
    "normals.wgsl"
);
const NORMALS_SHARPEN: &str = shader!(
    "shared/eigen.wgsl",
    "shared/bare_normal.wgsl",
    "normals_sharpen.wgsl"
);
const SAMPLE: &str = shader!(
    "shared/eigen.wgsl",
    "shared/bare_normal.wgsl",
    "shared/given_normal.wgsl",
    "sample.wgsl"
);
const AIM: &str = shader!(
    "shared/eigen.wgsl",
    "shared/view_along.wgsl",
    "aim_side.wgsl",
    "aim.wgsl"
);
const FURTHER: &str = shader!("shared/view_along.wgsl", "further.wgsl");
const COLUMNS: &str = shader!("shared/places.wgsl", "shared/view_of.wgsl", "columns.wgsl");
const MARK: &str = shader!(
    "shared/given_normal.wgsl",
    "shared/modelled.wgsl",
    "shared/pixels.wgsl",
    "mark.wgsl"
);
const ALLOC: &str = shader!("shared/pixels.wgsl", "alloc.wgsl");
const SPLAT: &str = shader!("shared/pixels.wgsl", "splat.wgsl");
const SWEEP: &str = shader!("shared/pixels.wgsl", "shared/view_of.wgsl", "sweep.wgsl");
const WAYS_OUT: &str = shader!("shared/pixels.wgsl", "shared/view_of.wgsl", "ways_out.wgsl");
const COMPARE: &str = shader!(
    "shared/pixels.wgsl",
    "shared/view_of.wgsl",
    "rims.wgsl",
    "compare.wgsl"
);

const fn stage(name: &'static str, source: &'static str, bindings: &'static [u32]) -> Stage {
    Stage {
        name,
        source,
        bindings,
    }
}

/// Points from a depth image, before a batch. Bindings: camera, depths, points.
pub const UNPROJECT: Stage = stage(
    "unproject",
    concat!(numbers_wgsl!(), include_str!("unproject.wgsl")),
    &[0, 1, 2],
);

/// The stages of a batch, in their order. [`FURTHER_FROM`] and what follows run again where a pair needs further views.
///
/// ```
/// let names: Vec<_> = tldi_shaders::STAGES.iter().map(|stage| stage.name).collect();
/// assert_eq!((names[0], names[names.len() - 1]), ("cull", "compare"));
/// assert_eq!(names[tldi_shaders::FURTHER_FROM], "further");
/// ```
pub const STAGES: &[Stage] = &[
    stage("cull", CULL, &[0, 1, 3, 4, 6, 8]),
    stage("zone", ZONE, &[0, 1, 6, 8]),
    stage("normals_alloc", NORMALS_ALLOC, &[0, 8]),
    stage("normals_sort", NORMALS_SORT, &[0, 6, 8, 9]),
    stage("sample", SAMPLE, &[0, 1, 5, 6, 8, 9, 10]),
    stage("aim", AIM, &[0, 1, 7, 8, 10, 14]),
    stage("further", FURTHER, &[0, 1, 7, 8, 14]),
    stage("columns_bounds", COLUMNS, &[0, 6, 7, 8]),
    stage("columns_tiles", COLUMNS, &[0, 1, 7, 8, 15]),
    stage("columns_depths", COLUMNS, &[0, 1, 6, 7, 8]),
    stage("columns_touch", COLUMNS, &[0, 1, 7, 8]),
    stage("columns_pixels", COLUMNS, &[0, 7, 8, 15]),
    stage("normals", NORMALS, &[0, 1, 6, 7, 8, 9, 15, 17]),
    stage("normals_sharpen", NORMALS_SHARPEN, &[0, 1, 2, 6, 8, 9, 17]),
    stage("normals_settle", NORMALS_SHARPEN, &[0, 1, 2, 6, 8, 9, 17]),
    stage("mark", MARK, &[0, 1, 5, 6, 7, 8, 11, 17]),
    stage("alloc", ALLOC, &[0, 8, 16]),
    stage("splat", SPLAT, &[0, 7, 8, 11, 12]),
    stage("sweep", SWEEP, &[0, 1, 7, 8, 11, 12, 13, 14]),
    stage("ways_out", WAYS_OUT, &[0, 7, 8, 13, 14]),
    stage("compare", COMPARE, &[0, 1, 7, 8, 13, 14]),
];

/// Index in [`STAGES`] of the one that begins a round of further views.
pub const FURTHER_FROM: usize = 6;
