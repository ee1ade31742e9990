//! What is uploaded with every batch, with the layout of `shared/types.wgsl`.

use bytemuck::{Pod, Zeroable};
use tldi::glamx::{Mat3, Pose3, Quat, Vec3};
use tldi::plan::{DepthScale, PairPlan, SidePlan, ZoneGrid};
use tldi::{
    CameraPolicy, PairQuery, Params, PointCloud, Projection, Radii, Surface, Variant, View, plan,
};

/// Words of 32 bits, and bytes, of what only lives on the device.
pub(crate) const SURVIVOR_BYTES: u64 = 32;
pub(crate) const VIEW_BYTES: u64 = 144;
pub(crate) const SPLAT_BYTES: u64 = 64;
pub(crate) const LAYER_BYTES: u64 = 32;
pub(crate) const FRAGMENT_BYTES: u64 = 8;
pub(crate) const SAMPLE_SLOTS: u64 = 1024;
pub(crate) const SIDE_WORDS: u32 = 8;
pub(crate) const VIEW_WORDS: u32 = 16;
pub(crate) const PAIR_WORDS: u32 = 16;
pub(crate) const CONTACT_WORDS: u32 = 16;
pub(crate) const COUNTERS: u32 = 16;
/// Threads of a workgroup.
pub(crate) const GROUP: u32 = 256;

const FIXED_VIEW: u32 = 5;
const HAS_NORMALS: u32 = 1;
const ORIENTED: u32 = 2;
const RADII_DIFFER: u32 = 4;
const HAS_MIDDLE: u32 = 8;

/// See `Batch` in WGSL.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub(crate) struct BatchData {
    pub(crate) pairs: u32,
    pub(crate) items: u32,
    pub(crate) survivors: u32,
    pub(crate) tiles: u32,
    pub(crate) pixels: u32,
    pub(crate) splats: u32,
    pub(crate) fragments: u32,
    pub(crate) layers: u32,
    pub(crate) contacts: u32,
    pub(crate) cells: u32,
    pub(crate) sides_at: u32,
    pub(crate) views_at: u32,
    pub(crate) zone_at: u32,
    pub(crate) cells_at: u32,
    pub(crate) tiles_at: u32,
    pub(crate) pixels_at: u32,
}

/// See `Pair` in WGSL.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(crate) struct PairData {
    pub(crate) params: Params,
    overlap_min: [f32; 3],
    zone_inv_cell: f32,
    overlap_max: [f32; 3],
    column_reach: f32,
    zone_dims: [u32; 3],
    zone_row_words: u32,
    larger_from_a_x: [f32; 3],
    pub(crate) zone_first: u32,
    larger_from_a_y: [f32; 3],
    pub(crate) zone_words: u32,
    larger_from_a_z: [f32; 3],
    policy: u32,
    half_extents: [f32; 3],
    plainness: f32,
    toward_b: [f32; 3],
    has_last: u32,
    last_axis: [f32; 3],
    merge_steps: u32,
    view: [[f32; 4]; 3],
    image_size: [u32; 2],
    depth_step: f32,
    depth_inv_step: f32,
}

impl PairData {
    /// The pair's own data; the words of its zone begin at `zone_first`.
    pub(crate) fn new(query: &PairQuery, plan: &PairPlan, zone_first: u32) -> Self {
        let grid = ZoneGrid::new(&plan.overlap, plan.zone_reach);
        let row_words = grid.dims[0].div_ceil(32);
        let larger_from_a = rows(&plan.approach.larger_from_a);
        let scale = DepthScale::new(0.0, &query.params);
        let (policy, view_from_frame, image_size) = match query.view {
            View::Fixed(camera) => (FIXED_VIEW, camera.view_from_frame, camera.size),
            View::Aim { policy, .. } => (policy_number(policy), Pose3::IDENTITY, None),
        };
        Self {
            params: query.params,
            overlap_min: plan.overlap.min.to_array(),
            zone_inv_cell: grid.inv_cell,
            overlap_max: plan.overlap.max.to_array(),
            column_reach: plan.column_reach,
            zone_dims: grid.dims.map(|n| n as u32),
            zone_row_words: row_words as u32,
            larger_from_a_x: larger_from_a[0],
            zone_first,
            larger_from_a_y: larger_from_a[1],
            zone_words: (row_words * grid.dims[1] * grid.dims[2]) as u32,
            larger_from_a_z: larger_from_a[2],
            policy,
            half_extents: plan.approach.half_extents.to_array(),
            plainness: plan.approach.plainness(),
            toward_b: plan.approach.toward_b.to_array(),
            has_last: u32::from(plan.approach.last_axis.is_some()),
            last_axis: plan.approach.last_axis.unwrap_or(Vec3::ZERO).to_array(),
            merge_steps: scale.merge_steps(&query.params),
            view: pose_rows(&view_from_frame),
            image_size: image_size.unwrap_or([0, 0]),
            depth_step: scale.step,
            depth_inv_step: scale.inv_step,
        }
    }
}

/// See `Side` in WGSL.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(crate) struct SideData {
    frame_from_cloud: [[f32; 4]; 3],
    other_from_frame: [[f32; 4]; 3],
    other_min: [f32; 3],
    stride: u32,
    other_max: [f32; 3],
    len: u32,
    middle: [f32; 3],
    flags: u32,
    first_point: u32,
    first_normal: u32,
    radius_scale: f32,
    max_radius: f32,
    cell_dims: [u32; 3],
    pub(crate) cell_first: u32,
    cell_inv: f32,
    mean_radius: f32,
    padding: [u32; 2],
}

impl SideData {
    /// One side of a pair; its points are at `first_point` of the device's, its cells at
    /// `cell_first`.
    pub(crate) fn new(
        cloud: &PointCloud,
        side: &SidePlan,
        params: &Params,
        [first_point, first_normal]: [u32; 2],
        cell_first: u32,
    ) -> Self {
        let stride = plan::stride(cloud, params.pixel_size);
        let radius_scale = (stride as f32).sqrt();
        let mut flags = 0;
        let mut set = |flag: u32, is_set: bool| flags |= flag * u32::from(is_set);
        set(HAS_NORMALS, cloud.normals().is_some());
        set(ORIENTED, cloud.normals_oriented());
        set(RADII_DIFFER, matches!(cloud.radii(), Radii::PerPoint(_)));
        set(HAS_MIDDLE, side.middle.is_some());
        let cell = plan::SUPPORT * radius_scale * cloud.mean_radius();
        let (cell, cell_dims) = match cloud.normals() {
            Some(_) => (cell, [0; 3]),
            None => cells(side.region.overlap.extents(), cell, cloud.len()),
        };
        Self {
            frame_from_cloud: pose_rows(&side.frame_from_surface),
            other_from_frame: pose_rows(&side.region.other_from_frame),
            other_min: side.region.other_bounds.min.to_array(),
            stride: stride as u32,
            other_max: side.region.other_bounds.max.to_array(),
            len: cloud.len() as u32,
            middle: side.middle.unwrap_or(Vec3::ZERO).to_array(),
            flags,
            first_point,
            first_normal,
            radius_scale,
            max_radius: cloud.max_radius(),
            cell_dims,
            cell_first,
            cell_inv: 1.0 / cell,
            mean_radius: cloud.mean_radius(),
            padding: [0; 2],
        }
    }

    /// Number of cells in which neighbours are looked for.
    pub(crate) fn cells(&self) -> u32 {
        self.cell_dims.iter().product()
    }
}

/// Most cells per point in which neighbours are looked for: see the CPU's stage `normals`.
const CELLS_PER_POINT: usize = 16;

/// Edge and numbers of cells over `extents`, of at least `cell` metres.
fn cells(extents: Vec3, cell: f32, points: usize) -> (f32, [u32; 3]) {
    let limit = (CELLS_PER_POINT * points + 4096) as f32;
    let dims = |cell: f32| (extents / cell).floor() + Vec3::ONE;
    let mut cell = cell;
    while dims(cell).element_product() > limit {
        cell *= 1.26; // a third of an octave: twice fewer cells
    }
    (cell, dims(cell).to_array().map(|n| n as u32))
}

fn policy_number(policy: CameraPolicy) -> u32 {
    match policy {
        CameraPolicy::ContactZone => 0,
        CameraPolicy::Motion => 1,
        CameraPolicy::Covariance => 2,
        CameraPolicy::SmallestExtent => 3,
        CameraPolicy::LastNormal => 4,
    }
}

fn rows(rotation: &Quat) -> [[f32; 3]; 3] {
    let m = Mat3::from_quat(*rotation);
    [m.row(0), m.row(1), m.row(2)].map(|row| row.to_array())
}

fn pose_rows(pose: &Pose3) -> [[f32; 4]; 3] {
    let t = pose.translation.to_array();
    let r = rows(&pose.rotation);
    [0, 1, 2].map(|k| [r[k][0], r[k][1], r[k][2], t[k]])
}

/// Whether the device takes a pair: two clouds, oriented splats and an orthographic view. All else
/// is compared by the CPU backend.
pub(crate) fn is_for_device(query: &PairQuery) -> bool {
    let is_orthographic = match query.view {
        View::Fixed(camera) => matches!(
            camera.projection,
            Projection::Orthographic { pixel_size } if pixel_size == query.params.pixel_size
        ),
        View::Aim { .. } => true,
    };
    let is_cloud = |surface| matches!(surface, Surface::Cloud(_));
    is_orthographic
        && is_cloud(query.a)
        && is_cloud(query.b)
        && query.params.variant() == Variant::Oriented
}
