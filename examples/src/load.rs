//! Turns raw points into the clouds of a scan and of a body.

use crate::faces;
use crate::mesh::{self, Mesh};
use crate::numbers::median;
use crate::robot::link_spacing;
use crate::surface_sampling::SampledSurface;
use anyhow::Context;
use rayon::prelude::*;
use std::path::Path;
use tldi::glamx::{DVec3, Vec3};
use tldi::{Aabb, CloudBuilder, CloudError, KdTree, PointCloud};
use tldi_sources::{Format, RawCloud, ReadOptions};

/// Neighbours for the normals of a scan: enough to average the noise of a depth camera.
const SCAN_NORMAL_NEIGHBORS: usize = 24;
/// Neighbours for the normals of a body that brings none.
const BODY_NORMAL_NEIGHBORS: usize = 16;
/// Points that a mesh has along its longest side, as a scan and as a body: a room of 5 m gets a point every 2 cm, a box of
/// 20 cm every 3 mm. The number of points grows with the square: 350,000 on the walls of a cube, 22,000 on a body of that shape.
const SCAN_ACROSS: f32 = 240.0;
const BODY_ACROSS: f32 = 60.0;
/// Extents in metres that a body from a file is believed to have in earnest.
const PLAUSIBLE_BODY_SIZES: std::ops::RangeInclusive<f32> = 0.02..=1.0;
/// Least extent of a body in mean radii of the scan: a smaller one would lie in the noise.
const LEAST_BODY_RADII: f32 = 10.0;

/// A cloud, and what was subtracted from the coordinates of its file, in the unit of the cloud: place in the file =
/// `origin` + point.
pub struct Located {
    /// The points.
    pub cloud: PointCloud<'static>,
    /// Zero on axes where coordinates are small enough for `f32`.
    pub origin: DVec3,
}

/// Loads a scan, `scale` metres a unit of the file: colours, radii and normals of the file, else radii from
/// neighbours and normals by principal component analysis.
///
/// # Errors
/// Those of reading the file and of building the cloud, with the path.
pub fn scan_from_file(path: &Path, scale: f32) -> anyhow::Result<Located> {
    let raw = read(path, |extents| extents.max_element() / SCAN_ACROSS)
        .with_context(|| format!("cannot read the scan {}", path.display()))?
        .scaled(scale);
    let origin = raw.origin;
    let cloud = finish_scan(raw.into_builder())
        .with_context(|| format!("cannot use the scan {}", path.display()))?;
    Ok(Located { cloud, origin })
}

/// Reads a cloud or a mesh. Of a mesh with large faces, and of one whose file repeats corners, points on the faces are
/// taken, as far apart as `spacing` says for its extents.
fn read(path: &Path, spacing: impl Fn(Vec3) -> f32) -> anyhow::Result<RawCloud> {
    let is_mesh = mesh::is_mesh_file(path);
    let mut raw = if is_mesh {
        let Mesh { points, faces } = mesh::read_mesh(path)?;
        RawCloud {
            points,
            faces,
            ..RawCloud::default()
        }
    } else {
        tldi_sources::read(path, &ReadOptions::default())?
    };
    if !raw.faces.is_empty() {
        let corners = raw.points.iter().copied().filter(|p| p.is_finite());
        let spacing = spacing(corners.fold(Aabb::EMPTY, Aabb::including).extents());
        if is_mesh || faces::are_large(&raw, spacing) {
            let left_out = raw.faces.len() - faces::finite(&raw).count();
            if left_out > 0 {
                eprintln!(
                    "warning: {left_out} of {} faces of {} have corners that are not finite: they are left out",
                    raw.faces.len(),
                    path.display()
                );
            }
            raw = faces::sampled(raw, spacing)?;
            raw.has_unsigned_normals = raw.normals_disagree();
        }
    }
    if raw.has_unsigned_normals {
        eprintln!(
            "warning: normals of {} point to either side: their signs are not used",
            path.display()
        );
    }
    Ok(raw)
}

/// The cloud of a generated scene, made like that of a file: its exact normals are not used.
///
/// # Errors
/// Those of building the cloud.
pub fn scan_from_surface(surface: SampledSurface) -> Result<PointCloud<'static>, CloudError> {
    finish_scan(PointCloud::builder(surface.points).colors(surface.colors))
}

fn finish_scan(builder: CloudBuilder<'_>) -> Result<PointCloud<'static>, CloudError> {
    let cloud = builder
        .pca_normals(SCAN_NORMAL_NEIGHBORS)
        .spatial_order()
        .build()?;
    Ok(cloud.into_owned())
}

/// Loads a body, in the unit of the file.
///
/// # Errors
/// Those of reading the file and of building the cloud, with the path.
pub fn body_from_file(path: &Path) -> anyhow::Result<Located> {
    let spacing = |extents: Vec3| link_spacing(extents, extents.max_element() / BODY_ACROSS);
    let raw =
        read(path, spacing).with_context(|| format!("cannot read the body {}", path.display()))?;
    let origin = raw.origin;
    let cloud = raw
        .into_builder()
        .pca_normals(BODY_NORMAL_NEIGHBORS)
        .build()
        .with_context(|| format!("cannot use the body {}", path.display()))?
        .into_owned();
    Ok(Located { cloud, origin })
}

/// The cloud of a generated body.
///
/// # Errors
/// Those of building the cloud.
pub fn body_from_surface(surface: SampledSurface) -> Result<PointCloud<'static>, CloudError> {
    PointCloud::builder(surface.points)
        .normals(surface.normals)
        .knn_radii(7, 0.65)
        .build()
}

/// The size in metres of a body whose file gives it `file_size`, in a scan with points of
/// `scan_radius`: the file's own where that is plausible and not lost in the scan, else 0.2 m or
/// the 10 radii that the scan resolves.
///
/// ```
/// use tldi_examples::load::default_size;
/// assert_eq!(default_size(0.156, 0.008), 0.156); // a model in metres
/// assert_eq!(default_size(150.9, 0.008), 0.2); // a model in units of its own
/// assert_eq!(default_size(0.156, 0.07), 0.7); // too small for a coarse outdoor scan
/// ```
pub fn default_size(file_size: f32, scan_radius: f32) -> f32 {
    if PLAUSIBLE_BODY_SIZES.contains(&file_size) && file_size >= LEAST_BODY_RADII * scan_radius {
        file_size
    } else {
        f32::max(0.2, LEAST_BODY_RADII * scan_radius)
    }
}

/// Times the median radius of a cloud beyond which a point is on no surface: its seven nearest neighbours are
/// that much farther away than those of other points. Half of it would take coarse parts of an uneven scan;
/// with twice of it, dust in the air would stay as splats as large as a hand.
const ON_NO_SURFACE: f32 = 8.0;

/// Neighbours that are asked whether a point is among theirs: as many as radii are made of.
const NEIGHBORS: usize = 7;

/// The points of a scan that lie on a surface, by index. The points of a surface are neighbours of each other. Dust far
/// from everything has a radius many times that of others. A speck just over a surface is none of the seven nearest of
/// its own seven nearest. Either would be a splat as large as its distance: a foot's way into it is no depth.
pub fn on_surfaces(scan: &PointCloud<'_>) -> Vec<bool> {
    let radii = (0..scan.len()).map(|i| scan.radius(i));
    let most = ON_NO_SURFACE * median(radii).unwrap_or_default();
    let tree = KdTree::new(scan);
    let neighbors_of = |i: usize| {
        let mut near = Vec::with_capacity(NEIGHBORS + 1);
        // The point itself is one of those nearest to it.
        tree.k_nearest(scan.point(i), NEIGHBORS + 1, &mut near);
        near.into_iter().map(|n| n.index).filter(move |n| *n != i)
    };
    let neighbors: Vec<Vec<usize>> = (0..scan.len())
        .into_par_iter()
        .map(|i| neighbors_of(i).take(NEIGHBORS).collect())
        .collect();
    let is_of_theirs = |i: usize| neighbors[i].iter().any(|n| neighbors[*n].contains(&i));
    (0..scan.len())
        .map(|i| scan.radius(i) <= most && is_of_theirs(i))
        .collect()
}

/// Radius in metres of the ball around the origin that holds a cloud.
pub fn ball_radius(cloud: &PointCloud<'_>) -> f32 {
    let distances = cloud.points().iter().map(|p| p.length());
    distances.fold(0.0, f32::max)
}

/// The cloud moved so that its bounds are centred on its origin, and scaled so that its largest
/// extent is `size` metres.
///
/// # Errors
/// [`CloudError`] if the cloud cannot have that size.
pub fn resized(cloud: &PointCloud<'_>, size: f32) -> Result<PointCloud<'static>, CloudError> {
    let center = cloud.bounds().center();
    let scale = size / cloud.bounds().extents().max_element();
    let all: Vec<usize> = (0..cloud.len()).collect();
    subset(
        cloud,
        &all,
        |p| scale * (p - center),
        |radius| scale * radius,
    )
}

/// The points of a cloud with these indices, with their normals and colours, at another place and with
/// another radius. `place` must not turn the cloud. Normals that do not know their side do not know it then either.
///
/// # Errors
/// [`CloudError`] if there is none, or places or radii are refused.
pub fn subset(
    cloud: &PointCloud<'_>,
    indices: &[usize],
    place: impl Fn(Vec3) -> Vec3,
    radius: impl Fn(f32) -> f32,
) -> Result<PointCloud<'static>, CloudError> {
    let kept = || indices.iter().copied();
    let points: Vec<Vec3> = kept().map(|i| place(cloud.point(i))).collect();
    let radii: Vec<f32> = kept().map(|i| radius(cloud.radius(i))).collect();
    let mut builder = PointCloud::builder(points).radii(radii);
    if let Some(normals) = cloud.normals() {
        let normals: Vec<Vec3> = kept().map(|i| normals[i]).collect();
        builder = match cloud.normals_oriented() {
            true => builder.normals(normals),
            false => builder.unoriented_normals(normals),
        };
    }
    if let Some(colors) = cloud.colors() {
        builder = builder.colors(kept().map(|i| colors[i]).collect::<Vec<_>>());
    }
    Ok(builder.build()?.into_owned())
}

/// The name of a file without its folder and the extensions of known formats.
pub fn stem(path: &Path) -> String {
    let mut rest = Path::new(path.file_name().unwrap_or_default());
    let is_known = |path: &Path| {
        let packed = path
            .extension()
            .is_some_and(|end| end.eq_ignore_ascii_case("gz"));
        packed || mesh::is_mesh_file(path) || Format::from_extension(path).is_some()
    };
    while let Some(stem) = rest.file_stem().filter(|_| is_known(rest)) {
        rest = Path::new(stem);
    }
    rest.to_string_lossy().into_owned()
}
