//! Clouds made from other clouds, to be drawn.

use tldi::glamx::Vec3;
use tldi::{CloudError, PointCloud};

/// Every `step`-th point of a cloud (0 counts as 1), with its normal, its colour and another radius. All normals count as
/// known to point outward: to be drawn, not to collide.
///
/// # Errors
/// [`CloudError`] if the radii are refused.
///
/// ```
/// use tldi::{PointCloud, glamx::Vec3};
/// let cloud = PointCloud::builder(vec![Vec3::ZERO, Vec3::X, Vec3::Y]).radius(0.5).build()?;
/// let half = tldi_pictures::thinned(&cloud, 2, |radius| 2.0 * radius)?;
/// assert_eq!((half.len(), half.point(1), half.radius(1)), (2, Vec3::Y, 1.0));
/// assert_eq!(tldi_pictures::thinned(&cloud, 0, |radius| radius)?.len(), 3);
/// # Ok::<(), tldi::CloudError>(())
/// ```
pub fn thinned(
    cloud: &PointCloud<'_>,
    step: usize,
    radius: impl Fn(f32) -> f32,
) -> Result<PointCloud<'static>, CloudError> {
    let kept = || (0..cloud.len()).step_by(step.max(1));
    let points: Vec<Vec3> = kept().map(|i| cloud.point(i)).collect();
    let radii: Vec<f32> = kept().map(|i| radius(cloud.radius(i))).collect();
    let mut builder = PointCloud::builder(points).radii(radii);
    if let Some(normals) = cloud.normals() {
        builder = builder.normals(kept().map(|i| normals[i]).collect::<Vec<_>>());
    }
    if let Some(colors) = cloud.colors() {
        builder = builder.colors(kept().map(|i| colors[i]).collect::<Vec<_>>());
    }
    builder.build()
}

/// The cloud with a colour (red, green, blue, alpha) for each point, to be drawn, as [`thinned`].
///
/// # Errors
/// [`CloudError`]; not for a cloud that was valid.
pub fn painted(
    cloud: &PointCloud<'_>,
    color: impl Fn(usize) -> [u8; 4],
) -> Result<PointCloud<'static>, CloudError> {
    let points: Vec<Vec3> = cloud.points().to_vec();
    let radii: Vec<f32> = (0..cloud.len()).map(|i| cloud.radius(i)).collect();
    let colors: Vec<[u8; 4]> = (0..cloud.len()).map(color).collect();
    let mut builder = PointCloud::builder(points).radii(radii).colors(colors);
    if let Some(normals) = cloud.normals() {
        builder = builder.normals(normals.to_vec());
    }
    builder.build()
}
