//! What is uploaded with every batch, with the layout of `shared/types.wgsl`.

use crate::error::{GpuError, numbered};
use crate::resident::Place;
use bytemuck::{Pod, Zeroable};
use tldi::glamx::{Mat3, Pose3, Quat, Vec3};
use tldi::plan::{DepthScale, PairPlan, SidePlan, ZoneGrid};
use tldi::{Aabb, CameraPolicy, PairQuery, Params, Radii, Surface, View, plan};
use tldi_shaders::numbers::{
    self, FIXED_VIEW, HAS_NORMALS, IS_BODY, ORIENTED, RADII_DIFFER, WEIGHT_BITS,
};
pub(crate) use tldi_shaders::numbers::{
    CONTACT_WORDS, COUNTERS, FRAGMENTS_WRAPPED, GROUP, PAIR_WORDS, SIDE_WORDS, VIEW_WORDS,
};

/// Words of 32 bits, and bytes, of what only lives on the device.
pub(crate) const SURVIVOR_BYTES: u64 = 32;
pub(crate) const ENTRY_BYTES: u64 = 16;
pub(crate) const PLANE_BYTES: u64 = 32;
pub(crate) const VIEW_BYTES: u64 = 144;
pub(crate) const SPLAT_BYTES: u64 = 64;
pub(crate) const LAYER_BYTES: u64 = 32;
pub(crate) const FRAGMENT_BYTES: u64 = 8;
pub(crate) const TILE_BYTES: u64 = 3 * 4;
/// The begins and ends of both sides.
pub(crate) const PIXEL_BYTES: u64 = 4 * 4;
pub(crate) const SAMPLE_SLOTS: u64 = numbers::SAMPLE_SLOTS as u64;
pub(crate) const SAMPLE_BYTES: u64 = 32;
pub(crate) const MAX_VIEWS: u32 = plan::MAX_VIEWS as u32;
// The shaders have words, lanes and arrays for three.
const _: () = assert!(MAX_VIEWS == 3);

/// Splats that a fragment can number.
pub(crate) const MOST_SPLATS: u32 = 1 << (u32::BITS - WEIGHT_BITS);
/// Culled points of a batch. Each is a splat in three views at most, and those are counted in a word.
pub(crate) const MOST_SURVIVORS: u32 = 1 << 30;

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
    body_is_b: u32,
    lies: [f32; 3],
    padding_g: u32,
    motion: [f32; 3],
    padding_a: u32,
    body_middle: [f32; 3],
    padding_b: u32,
    body_half_extents: [f32; 3],
    padding_c: u32,
    body_from_a: [[f32; 4]; 3],
    view: [[f32; 4]; 3],
    image_size: [u32; 2],
    depth_step: f32,
    depth_inv_step: f32,
    pub(crate) sides: [SideData; 2],
}

impl PairData {
    /// The pair's own data, without its sides; the words of its zone begin at `zone_first`.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`] where the stages cannot number the zone's words.
    pub(crate) fn new(
        query: &PairQuery,
        plan: &PairPlan,
        zone_first: u64,
    ) -> Result<Self, GpuError> {
        let grid = ZoneGrid::new(&plan.overlap, plan.zone_reach);
        let row_words = grid.dims[0].div_ceil(32);
        let larger_from_a = rows(&plan.approach.larger_from_a);
        let scale = DepthScale::new(0.0, &query.params);
        let body = &plan.approach.body;
        let (policy, view_from_frame, image_size) = match query.view {
            View::Fixed(camera) => (FIXED_VIEW, camera.view_from_frame, camera.size),
            View::Aim { policy, .. } => (policy_number(policy), Pose3::IDENTITY, None),
        };
        let zone_words = (row_words * grid.dims[1]) as u64 * grid.dims[2] as u64;
        Ok(Self {
            params: query.params,
            overlap_min: plan.overlap.min.to_array(),
            zone_inv_cell: grid.inv_cell,
            overlap_max: plan.overlap.max.to_array(),
            column_reach: plan.column_reach,
            zone_dims: grid.dims.map(|n| n as u32),
            zone_row_words: row_words as u32,
            larger_from_a_x: larger_from_a[0],
            zone_first: numbered("work", zone_first)?,
            larger_from_a_y: larger_from_a[1],
            zone_words: numbered("work", zone_words)?,
            larger_from_a_z: larger_from_a[2],
            policy,
            half_extents: plan.approach.half_extents.to_array(),
            plainness: plan.approach.plainness(),
            toward_b: plan.approach.toward_b().to_array(),
            has_last: u32::from(plan.approach.last_axis.is_some()),
            last_axis: plan.approach.last_axis.unwrap_or(Vec3::ZERO).to_array(),
            body_is_b: u32::from(body.is_b),
            lies: plan.approach.lies.to_array(),
            padding_g: 0,
            motion: plan.approach.motion.to_array(),
            padding_a: 0,
            body_middle: body.middle.to_array(),
            padding_b: 0,
            body_half_extents: body.half_extents.to_array(),
            padding_c: 0,
            body_from_a: pose_rows(&Pose3::from_rotation(body.from_a)),
            view: pose_rows(&view_from_frame),
            image_size: image_size.unwrap_or([0, 0]),
            depth_step: scale.step,
            depth_inv_step: scale.inv_step,
            sides: Zeroable::zeroed(),
        })
    }
}

/// What a stage must know of a cloud beside its points.
pub(crate) struct CloudFacts {
    len: usize,
    mean_radius: f32,
    max_radius: f32,
    noise: f32,
    has_normals: bool,
    is_oriented: bool,
    radii_differ: bool,
}

impl CloudFacts {
    /// Of a cloud on the host, or on the device.
    pub(crate) fn of(surface: &Surface) -> Option<Self> {
        match surface {
            Surface::Cloud(cloud) => Some(Self {
                len: cloud.len(),
                mean_radius: cloud.mean_radius(),
                max_radius: cloud.max_radius(),
                noise: cloud.noise(),
                has_normals: cloud.normals().is_some(),
                is_oriented: cloud.normals_oriented(),
                radii_differ: matches!(cloud.radii(), Radii::PerPoint(_)),
            }),
            Surface::Device(cloud) => Some(Self {
                len: cloud.len,
                mean_radius: cloud.mean_radius,
                max_radius: cloud.max_radius,
                noise: 0.0,
                has_normals: false,
                is_oriented: false,
                radii_differ: true,
            }),
            Surface::Exact(_) => None,
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
    half_extents: [f32; 3],
    noise: f32,
    first_point: u32,
    first_normal: u32,
    radius_scale: f32,
    max_radius: f32,
    cell_dims: [u32; 3],
    pub(crate) cell_first: u32,
    cell_inv: f32,
    mean_radius: f32,
    merge_steps: u32,
    point_step: u32,
}

impl SideData {
    /// One side of a pair; its points are at `place`, its cells at `cell_first`.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`] where the stages cannot number its points or cells.
    pub(crate) fn new(
        cloud: &CloudFacts,
        side: &SidePlan,
        params: &Params,
        place: &Place,
        cell_first: u64,
    ) -> Result<Self, GpuError> {
        let stride = plan::stride(cloud.mean_radius, params.pixel_size);
        let radius_scale = (stride as f32).sqrt();
        let mut flags = 0;
        let mut set = |flag: u32, is_set: bool| flags |= flag * u32::from(is_set);
        set(HAS_NORMALS, cloud.has_normals);
        set(ORIENTED, cloud.has_normals && cloud.is_oriented);
        set(RADII_DIFFER, cloud.radii_differ);
        set(IS_BODY, side.body.is_some());
        let halves = |body: Aabb| (body.center(), 0.5 * body.extents());
        let (middle, half_extents) = side.body.map_or_else(Default::default, halves);
        let support = plan::SUPPORT * radius_scale * cloud.mean_radius;
        let cells = match cloud.has_normals {
            true => ZoneGrid::default(),
            false => ZoneGrid::of_neighbors(&side.region.overlap, support, cloud.len),
        };
        Ok(Self {
            frame_from_cloud: pose_rows(&side.frame_from_surface),
            other_from_frame: pose_rows(&side.region.other_from_frame),
            other_min: side.region.other_bounds.min.to_array(),
            stride: stride as u32,
            other_max: side.region.other_bounds.max.to_array(),
            len: numbered("points", cloud.len as u64)?,
            middle: middle.to_array(),
            flags,
            half_extents: half_extents.to_array(),
            noise: cloud.noise,
            first_point: place.first_point,
            first_normal: place.first_normal,
            radius_scale,
            max_radius: cloud.max_radius,
            cell_dims: cells.dims.map(|n| n as u32),
            cell_first: numbered("work", cell_first)?,
            cell_inv: cells.inv_cell,
            mean_radius: cloud.mean_radius,
            merge_steps: DepthScale::new(0.0, params).merge_steps(params, cloud.noise),
            point_step: place.point_step,
        })
    }

    /// Number of cells in which neighbours are looked for.
    pub(crate) fn cells(&self) -> u64 {
        self.cell_dims.iter().map(|&n| u64::from(n)).product()
    }
}

fn policy_number(policy: CameraPolicy) -> u32 {
    match policy {
        CameraPolicy::ContactZone => numbers::CONTACT_ZONE,
        CameraPolicy::AllDirections => numbers::ALL_DIRECTIONS,
        CameraPolicy::Motion => numbers::MOTION,
        CameraPolicy::Covariance => numbers::COVARIANCE,
        CameraPolicy::SmallestExtent => numbers::SMALLEST_EXTENT,
        CameraPolicy::LastNormal => numbers::LAST_NORMAL,
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sources::CameraData;
    use std::mem::{offset_of, size_of};

    /// Offset of each member of a WGSL struct, and its size.
    fn wgsl_layout(name: &str) -> (Vec<(String, u32)>, u32) {
        let stage = match name {
            "DepthCamera" => &tldi_shaders::UNPROJECT,
            _ => tldi_shaders::STAGES.last().expect("there are stages"),
        };
        let module = naga::front::wgsl::parse_str(stage.source).expect("it is valid");
        let (_, found) = (module.types.iter())
            .find(|(_, ty)| ty.name.as_deref() == Some(name))
            .unwrap_or_else(|| panic!("no struct {name}"));
        let naga::TypeInner::Struct { members, span } = &found.inner else {
            panic!("{name} is no struct");
        };
        let offset = |m: &naga::StructMember| (m.name.clone().unwrap_or_default(), m.offset);
        (members.iter().map(offset).collect(), *span)
    }

    macro_rules! assert_same_layout {
        ($name:literal, $type:ty, [$($rust:ident $wgsl:ident),+ $(,)?]) => {
            let (members, size) = wgsl_layout($name);
            let expected: Vec<(String, u32)> =
                vec![$((stringify!($wgsl).to_owned(), offset_of!($type, $rust) as u32)),+];
            let with_rows = |name: &str| name.ends_with("_y") || name.ends_with("_z");
            for member in &expected {
                assert!(members.contains(member), "{}: {member:?} {members:?}", $name);
            }
            // Further rows of matrices follow their first.
            for (name, _) in &members {
                let is_known = expected.iter().any(|(other, _)| other == name);
                assert!(is_known || with_rows(name) || name.starts_with("padding"), "{name}");
            }
            assert_eq!(size as usize, size_of::<$type>(), $name);
        };
    }

    /// What Rust writes is what WGSL reads, member by member.
    #[test]
    fn layouts_are_those_of_wgsl() {
        assert_same_layout!("Params", Params, [
            pixel_size pixel_size, merge_gap merge_gap, thickness thickness, prediction prediction,
            slope_damping slope_damping, rho rho, stack_segments stack_segments,
            variant variant,
        ]);
        assert_same_layout!("Batch", BatchData, [
            pairs pairs, items items, survivors survivors, tiles tiles, pixels pixels,
            splats splats, fragments fragments, layers layers, contacts contacts, cells cells,
            sides_at sides_at, views_at views_at, zone_at zone_at, cells_at cells_at,
            tiles_at tiles_at, pixels_at pixels_at,
        ]);
        assert_same_layout!("Pair", PairData, [
            params params, overlap_min overlap_min, zone_inv_cell zone_inv_cell,
            overlap_max overlap_max, column_reach column_reach, zone_dims zone_dims,
            zone_row_words zone_row_words, larger_from_a_x larger_from_a_x,
            zone_first zone_first, larger_from_a_y larger_from_a_y, zone_words zone_words,
            larger_from_a_z larger_from_a_z, policy policy, half_extents half_extents,
            plainness plainness, toward_b toward_b, has_last has_last, last_axis last_axis,
            body_is_b body_is_b, lies lies, motion motion, body_middle body_middle, body_half_extents body_half_extents, body_from_a body_from_a_x, view view_x, image_size image_size,
            depth_step depth_step, depth_inv_step depth_inv_step, sides sides,
        ]);
        assert_same_layout!("Side", SideData, [
            frame_from_cloud frame_from_cloud_x, other_from_frame other_from_frame_x,
            other_min other_min, stride stride, other_max other_max, len len, middle middle,
            flags flags, half_extents half_extents, noise noise, first_point first_point, first_normal first_normal,
            radius_scale radius_scale, max_radius max_radius, cell_dims cell_dims,
            cell_first cell_first, cell_inv cell_inv, mean_radius mean_radius,
            merge_steps merge_steps, point_step point_step,
        ]);
        assert_same_layout!("DepthCamera", CameraData, [
            size size, focal_px focal_px, principal_px principal_px, metres_per_unit metres_per_unit, near near,
            far far, radius_px radius_px, first_point first_point,
        ]);
    }

    /// What only lives on the device takes as many bytes as are set aside for it.
    #[test]
    fn sizes_are_those_of_wgsl() {
        for (name, bytes) in [
            ("Survivor", SURVIVOR_BYTES),
            ("Entry", ENTRY_BYTES),
            ("Sample", SAMPLE_BYTES),
            ("Plane", PLANE_BYTES),
            ("View", VIEW_BYTES),
            ("Splat", SPLAT_BYTES),
            ("Layer", LAYER_BYTES),
        ] {
            assert_eq!(u64::from(wgsl_layout(name).1), bytes, "{name}");
        }
    }

    /// A fragment's word holds the last splat's number and the greatest weight, and gives both back
    /// as the stages take it apart.
    #[test]
    fn a_fragment_holds_every_splat_and_weight() {
        let constants = plan::stage_constants();
        let (_, most_weight) = (constants.iter().find(|(name, _)| *name == "MAX_WEIGHT"))
            .expect("the CPU has a greatest weight");
        let weight = *most_weight as u32;
        assert!(weight < 1 << WEIGHT_BITS, "{weight}");
        let word = ((MOST_SPLATS - 1) << WEIGHT_BITS) | weight;
        assert_eq!(word >> WEIGHT_BITS, MOST_SPLATS - 1);
        assert_eq!(word & ((1 << WEIGHT_BITS) - 1), weight);
        assert_eq!(u64::from(MOST_SPLATS) << WEIGHT_BITS, 1 << 32);
    }
}
