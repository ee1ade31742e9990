//! What a file holds, before it becomes a cloud.

use crate::depth::OrganizedCloud;
use crate::normal_signs::are_mixed;
use std::fmt;
use tldi::glamx::{DVec3, Vec3};
use tldi::{CloudBuilder, PointCloud};

/// Points of a file with the attributes it gives them, in its own order and units.
///
/// Nothing is filtered: points may be NaN or infinite, normals zero, faces degenerate; the builder
/// of [`PointCloud`] deals with that. Attributes, where there, have one entry for each point.
#[derive(Clone, Default, PartialEq)]
pub struct RawCloud {
    /// Positions relative to [`origin`](Self::origin), in units of the file.
    pub points: Vec<Vec3>,
    /// Normals as the file gives them: not checked for length, orientation or finiteness. `None`
    /// if the file has none; [`vertex_normals`](Self::vertex_normals) are never put here.
    pub normals: Option<Vec<Vec3>>,
    /// Red, green, blue, alpha; opaque where the file has no alpha.
    ///
    /// Colours of more than 8 bits are reduced to 8: integers from 0 to 65535, or from 0 to 255 if
    /// none in the file is above 255; reals likewise, or from 0 to 1 if none is above 1.
    pub colors: Option<Vec<[u8; 4]>>,
    /// Radius of the ball around each point, in units of the file.
    pub radii: Option<Vec<f32>>,
    /// Whether the sign of the normals means nothing: those of Gaussian splats are their shortest axes, and those that
    /// [disagree](Self::normals_disagree) were estimated.
    pub has_unsigned_normals: bool,
    /// Gaussian splats of which no point was made, since they are fainter than
    /// [`ReadOptions::least_opacity`](crate::ReadOptions::least_opacity), or have no extent.
    pub left_out: u64,
    /// Triangles: indices of points, all in range. Polygons are cut into fans.
    pub faces: Vec<[u32; 3]>,
    /// What was subtracted from the file's coordinates, in `f64`, before they were narrowed to
    /// `f32`: position in the file = `origin` + point.
    ///
    /// Unless [`ReadOptions::origin`](crate::ReadOptions::origin) fixes it, it is zero on each axis,
    /// with one exception: the file's type of number is wider than `f32` (always so in text and LAS), and the
    /// median of the first 1,024 coordinates is farther than 4,096 units from zero, where steps of `f32`
    /// reach half a millimetre in metres. There it is that median, rounded to a whole number. Put it into the pose of the body.
    pub origin: DVec3,
    /// Where the sensor was, relative to `origin`, if the file tells it for all points together: `VIEWPOINT` of a PCD
    /// file, or the pose of an E57 file's only scan. Where these do not turn, they count only for points that
    /// come in rows and columns, or in spherical coordinates: else they may be the shift of a merged cloud, as
    /// CloudCompare writes it.
    pub viewpoint: Option<Vec3>,
    /// Columns and rows, if the points come in several rows, one after the other: `WIDTH` and `HEIGHT` of PCD files,
    /// `width` and `height` of messages. See [`organized`](Self::organized).
    pub size: Option<[usize; 2]>,
}

impl RawCloud {
    /// Normals of the vertices from the faces around them, weighted by area: unit length, on the
    /// side from which the corners run anticlockwise, which is outside for meshes in the usual
    /// winding. `None` if there are no faces; zero for points that belong to no face, or whose
    /// faces cancel out.
    ///
    /// Linear in points and faces.
    ///
    /// ```
    /// use tldi_sources::RawCloud;
    /// use tldi::glamx::Vec3;
    /// let triangle = RawCloud {
    ///     points: vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::ONE],
    ///     faces: vec![[0, 1, 2]],
    ///     ..Default::default()
    /// };
    /// let normals = triangle.vertex_normals().unwrap();
    /// assert_eq!(normals, [Vec3::Z, Vec3::Z, Vec3::Z, Vec3::ZERO]);
    /// ```
    pub fn vertex_normals(&self) -> Option<Vec<Vec3>> {
        if self.faces.is_empty() {
            return None;
        }
        // In f64: the areas of fine meshes, squares of small edges, stay far from underflow.
        let mut sums = vec![DVec3::ZERO; self.points.len()];
        for face in &self.faces {
            let corners = face.map(|i| self.points.get(i as usize).map(|p| p.as_dvec3()));
            let [Some(a), Some(b), Some(c)] = corners else {
                continue;
            };
            // Twice the area, along the normal.
            let weighted = (b - a).cross(c - a);
            if weighted.is_finite() {
                for &i in face {
                    sums[i as usize] += weighted;
                }
            }
        }
        let unit = |sum: &DVec3| sum.normalize_or_zero().as_vec3();
        Some(sums.iter().map(unit).collect())
    }

    /// The same in metres, from a file whose unit is `metres` long: points, radii, viewpoint and origin.
    ///
    /// ```
    /// use tldi_sources::RawCloud;
    /// use tldi::glamx::{DVec3, Vec3};
    /// let cloud = RawCloud {
    ///     points: vec![Vec3::X * 100.0],
    ///     radii: Some(vec![2.0]),
    ///     viewpoint: Some(Vec3::Y * 4.0),
    ///     origin: DVec3::Z * 8.0,
    ///     ..Default::default()
    /// };
    /// let metres = cloud.scaled(0.25); // a unit of 25 cm
    /// assert_eq!(metres.points, [Vec3::X * 25.0]);
    /// assert_eq!((metres.radii, metres.viewpoint), (Some(vec![0.5]), Some(Vec3::Y)));
    /// assert_eq!(metres.origin, DVec3::Z * 2.0);
    /// ```
    pub fn scaled(mut self, metres: f32) -> Self {
        for point in self.points.iter_mut().chain(&mut self.viewpoint) {
            *point *= metres;
        }
        for radius in self.radii.iter_mut().flatten() {
            *radius *= metres;
        }
        self.origin *= f64::from(metres);
        self
    }

    /// The points as the frame of a sensor, if they come in rows and columns: seen from the viewpoint or, where the
    /// file tells none, from `sensor`, which is relative to [`origin`](Self::origin). Messages of ROS are in the
    /// frame of the sensor: zero.
    pub fn organized(&self, sensor: Vec3) -> Option<OrganizedCloud<'_>> {
        OrganizedCloud::new(&self.points, self.size?, self.viewpoint.unwrap_or(sensor))
    }

    /// Whether more than 5 % of the normals point to the other side than those around them, so that their signs mean nothing:
    /// programs estimate normals without turning them outward. [`read`](crate::read()) asks this, too. Cost: a search for the
    /// eight nearest points of each; none without normals.
    ///
    /// ```
    /// use tldi_sources::RawCloud;
    /// use tldi::glamx::Vec3;
    /// let points: Vec<Vec3> = (0..400).map(|k| Vec3::new((k % 20) as f32, 0.0, (k / 20) as f32)).collect();
    /// let normals = (0..400).map(|k| if k % 3 == 0 { -Vec3::Y } else { Vec3::Y }).collect();
    /// let mut cloud = RawCloud { points, normals: Some(normals), ..Default::default() };
    /// assert!(cloud.normals_disagree());
    /// cloud.normals = Some(vec![Vec3::Y; 400]);
    /// assert!(!cloud.normals_disagree());
    /// ```
    pub fn normals_disagree(&self) -> bool {
        let normals = self.normals.as_ref();
        normals.is_some_and(|normals| are_mixed(&self.points, normals))
    }

    /// Hands points, colours, radii, normals and viewpoint to the builder of a cloud.
    ///
    /// The normals are those of the file or else, if there are faces, the
    /// [`vertex_normals`](Self::vertex_normals); none are given if not one is usable. Radii are
    /// given only if all are finite and greater than zero; what the caller sets on the builder
    /// replaces them.
    ///
    /// ```
    /// use tldi_sources::RawCloud;
    /// use tldi::glamx::Vec3;
    /// let raw = RawCloud { points: vec![Vec3::ZERO, Vec3::X], ..Default::default() };
    /// let cloud = raw.into_builder().radius(0.5).build()?;
    /// assert_eq!(cloud.len(), 2);
    /// # Ok::<(), tldi::CloudError>(())
    /// ```
    pub fn into_builder(mut self) -> CloudBuilder<'static> {
        let usable = |normals: &Vec<Vec3>| {
            normals
                .iter()
                .any(|n| n.is_finite() && n.length_squared() > 0.0)
        };
        let from_file = self.normals.take().filter(usable);
        let is_unsigned = self.has_unsigned_normals && from_file.is_some();
        let normals = from_file.or_else(|| self.vertex_normals().filter(usable));
        let mut builder = PointCloud::builder(self.points);
        if let Some(normals) = normals {
            builder = if is_unsigned {
                builder.unoriented_normals(normals)
            } else {
                builder.normals(normals)
            };
        }
        if let Some(colors) = self.colors {
            builder = builder.colors(colors);
        }
        if let Some(radii) = self.radii
            && radii.iter().all(|r| r.is_finite() && *r > 0.0)
        {
            builder = builder.radii(radii);
        }
        if let Some(viewpoint) = self.viewpoint {
            builder = builder.viewpoint(viewpoint);
        }
        builder
    }
}

impl fmt::Debug for RawCloud {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("RawCloud")
            .field("points", &self.points.len())
            .field("normals", &self.normals.is_some())
            .field("colors", &self.colors.is_some())
            .field("radii", &self.radii.is_some())
            .field("has_unsigned_normals", &self.has_unsigned_normals)
            .field("left_out", &self.left_out)
            .field("faces", &self.faces.len())
            .field("origin", &self.origin)
            .field("viewpoint", &self.viewpoint)
            .field("size", &self.size)
            .finish()
    }
}
