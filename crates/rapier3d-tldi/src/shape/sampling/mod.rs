//! Point clouds of rapier's shapes.

mod error;
mod patch;
mod scatter;
mod winding;

pub use error::SampleError;
use patch::{Patch, patches_of};
use rapier3d::parry::shape::Shape;
use scatter::Scatter;
use tldi::PointCloud;
use tldi::glamx::Vec3;

/// Most squares of the spacing that a surface is sampled with: some ten million points.
const MOST_SQUARES: f64 = 8_388_608.0; // 2²³

/// The surface of a shape as a cloud: points `spacing` metres apart, with normals and a radius that
/// closes it.
///
/// - **Even**: no two points on one side of the surface are nearer to each other than 0.8 × `spacing`,
///   and no place of the surface is farther from a point on its side than `spacing`, which is the
///   radius of all points: some 1.1 points a square of the spacing (Poisson-disc sampling). Points whose
///   normals are 90° or more apart lie on different sides: a plate has both its faces, a box
///   points of two faces along its edges. In a compound, places within 0.1 × `spacing` of where a surface
///   dips into another part may be left out.
/// - **Exact**: points are on the shape's surface, up to rounding in `f32`, and so are normals; those of a mesh
///   are the normals of its faces.
/// - **Outward**, where the shape is solid. The faces of a mesh without gaps tell its inside, whichever
///   way they wind. Those of an open one are taken to run anticlockwise as seen from outside,
///   and a height field's outside is +y. Faces of a mesh that share edges are made to wind alike, as most of their area does. Inside of other parts of a compound there are no points.
///
/// Faces without area are passed over. The same shape and spacing give the same points. Time and memory are
/// in proportion to area / spacing².
///
/// # Errors
/// [`SampleError`]: half-spaces, segments, polylines and custom shapes have no surface to sample, and places farther than
/// 2¹⁹ spacings from the origin cannot be told apart.
///
/// ```
/// use rapier3d::prelude::*;
/// use rapier3d_tldi::{cloud_collider, prelude::*, sample_shape};
/// let capsule = SharedShape::capsule_y(0.2, 0.1);
/// let cloud = sample_shape(&*capsule, 0.02)?;
/// let on_surface = |p: Vector| ((p - p.clamp(-0.2 * Vector::Y, 0.2 * Vector::Y)).length() - 0.1).abs();
/// assert!(cloud.points().iter().all(|&p| on_surface(p) < 1e-6));
/// assert_eq!((cloud.mean_radius(), cloud.normals_oriented()), (0.02, true));
/// let collider = cloud_collider(PointCloudShape::new(cloud)); // to be inserted
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn sample_shape(shape: &dyn Shape, spacing: f32) -> Result<PointCloud<'static>, SampleError> {
    if !(spacing.is_finite() && spacing > 0.0) {
        return Err(SampleError::BadSpacing { spacing });
    }
    let parts = patches_of(shape)?;
    let area: f64 = parts.iter().flatten().map(Patch::area).sum();
    if area > MOST_SQUARES * f64::from(spacing).powi(2) {
        return Err(SampleError::TooFine {
            spacing,
            area,
            least: (area / MOST_SQUARES).sqrt() as f32,
        });
    }
    // A cloud refuses coordinates that are coarser than its spacing. Pieces would be halved for ever there.
    let corners: Vec<Vec3> = parts.iter().flatten().flat_map(|p| p.corners).collect();
    if !corners.is_empty() {
        PointCloud::builder(corners).radius(spacing).build()?;
    }
    let mut scatter = Scatter::new(spacing);
    for (part, patches) in parts.iter().enumerate() {
        for patch in patches {
            scatter.cover(patch, |piece, at| {
                patch::hidden_around(shape, part, patch, piece, at)
            });
        }
    }
    let (points, normals) = scatter.finish();
    if points.is_empty() {
        return Err(SampleError::NoSurface {
            shape: format!("{:?}", shape.shape_type()),
        });
    }
    let cloud = PointCloud::builder(points).normals(normals).radius(spacing);
    Ok(cloud.build()?)
}
