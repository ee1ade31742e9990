//! Mass properties of a cloud: of the solid it encloses, or of the shell it samples.

mod orient;
mod surfel;
mod surfels;

use rapier3d::glamx::{DMat3, DSymmetricEigen3, DVec3, Vec3};
use rapier3d::prelude::MassProperties;
use surfel::Surfel;
use tldi::{CloudError, PointCloud};

/// Which part of a cloud has mass.
///
/// ```
/// use rapier3d::prelude::*;
/// use rapier3d_tldi::prelude::*;
/// // A flat sheet of 1 m², 2 mm of steel.
/// let points: Vec<Vector> = (0..441)
///     .map(|i| 0.05 * Vector::new((i % 21) as f32, 0.0, (i / 21) as f32))
///     .collect();
/// let sheet = PointCloud::builder(points).radius(0.05).build()?;
/// let shape = PointCloudShape::with_mass_model(sheet, MassModel::Shell { thickness: 0.002 })?;
/// let plate = cloud_collider(shape).density(7850.0).build();
/// let kilograms = plate.mass();
/// // 15.7 kg for 1 m². At the rim, patches reach up to 1.5 radii farther: at most 1.15² m².
/// assert!((15.6..20.8).contains(&kilograms), "{kilograms}");
/// # Ok::<(), CloudError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum MassModel {
    /// The solid that the points enclose. A cloud that encloses nothing (open, or inside out)
    /// counts as a shell with a thickness of 2 mean radii.
    #[default]
    Solid,
    /// A sheet of even thickness along the sampled surface.
    Shell {
        /// Thickness of the sheet in metres; finite and greater than 0.
        thickness: f32,
    },
}

impl MassModel {
    /// Refuses what would have no mass.
    pub(crate) fn check(self) -> Result<(), CloudError> {
        match self {
            Self::Shell { thickness } if !(thickness.is_finite() && thickness > 0.0) => {
                Err(CloudError::BadParameter {
                    parameter: "thickness",
                    value: thickness,
                    expected: "metres of a sheet, finite and greater than 0",
                })
            }
            _ => Ok(()),
        }
    }
}

/// A surface counts as closed if the vectors of its areas (area times outward normal), which
/// cancel on a closed surface, add up to less than this part of the area. A sphere without a cap
/// of 26° (5 % of its area) is still closed, and a cube without 29 % of one side. Half or twice: no test of masses
/// fails.
const LEAST_OPEN: f64 = 0.05;

/// A plate of thickness t has a volume of t / 2 for each m² of its two sides. If that is less than
/// this many mean radii, the cloud is a sheet, and only its noise has two sides. Half or twice: no test of masses
/// fails.
const SHEET: f64 = 0.1;

/// Mass properties of `cloud` at a density of 1 kg/m³, in the cloud's own frame.
///
/// Each point stands for one small flat patch: its Voronoi cell among its neighbours, in its
/// tangent plane, within 1.5 radii and up to the planes of neighbours across a sharp edge.
/// Integrals over the solid become sums over the patches by Gauss's theorem, ∫ x dV = ½ ∮ x² n dA
/// and the like. If the cloud has no normals, planes are fitted to 13 points. If normals are not
/// oriented, neighbours are made to agree, and each connected part counts as filled. So a cavity
/// without given normals counts as mass.
///
/// Error, as measured in the tests (volume; the inertia's is about the same):
///
/// | points | oriented normals | none |
/// |---|---|---|
/// | random on a sphere or a box, 5,000 | 0.5 % | 0.5 %; 1.5 % (box) |
/// | random on a wall 2 spacings thick | 1 % | 8 %; thinner ones pass for sheets |
/// | vertices of a scanned body, 30,000 and 86,000 | 0.8 % | 1.7 % and 2.8 % |
/// | even grid on a cube, 21 along an edge | – | 4 % |
///
/// ```
/// use rapier3d_tldi::{MassModel, PointCloud, tldi::glamx::Vec3, unit_mass_properties};
/// // A ball of 1 m, evenly sampled (a Fibonacci lattice).
/// let normals: Vec<Vec3> = (0..5000)
///     .map(|i| {
///         let (y, turn) = (1.0 - (i as f32 + 0.5) / 2500.0, 2.399963 * i as f32);
///         let r = (1.0 - y * y).sqrt();
///         Vec3::new(r * turn.cos(), y, r * turn.sin())
///     })
///     .collect();
/// let points: Vec<Vec3> = normals.iter().map(|n| 0.5 * *n).collect();
/// let ball = PointCloud::builder(points).normals(normals).build()?;
/// let volume = unit_mass_properties(&ball, MassModel::Solid)?.mass(); // at 1 kg/m³
/// assert!((volume / (std::f32::consts::PI / 6.0) - 1.0).abs() < 0.01);
/// # Ok::<(), rapier3d_tldi::CloudError>(())
/// ```
///
/// Clouds of more than 100,000 points are thinned to about that number. Cost: 16 nearest neighbours
/// of each point, in parallel, about 5 µs a point and core. The result does not depend on the
/// number of threads.
///
/// # Errors
/// [`CloudError::BadParameter`] for a shell whose thickness is not finite, or not greater than 0.
pub fn unit_mass_properties(
    cloud: &PointCloud<'_>,
    model: MassModel,
) -> Result<MassProperties, CloudError> {
    model.check()?;
    Ok(mass_properties(cloud, model))
}

/// The same for a model that was checked.
pub(crate) fn mass_properties(cloud: &PointCloud<'_>, model: MassModel) -> MassProperties {
    let surfels = surfels::surfels(cloud);
    let thickness = match model {
        MassModel::Shell { thickness } => thickness,
        MassModel::Solid => {
            if let Some(moments) = solid(&surfels, cloud.mean_radius().into()) {
                return moments.properties();
            }
            2.0 * cloud.mean_radius()
        }
    };
    shell(&surfels, thickness.into()).properties()
}

/// Volume and its moments about the origin.
struct Moments {
    /// ∫ dV in m³.
    volume: f64,
    /// ∫ x dV in m⁴.
    first: DVec3,
    /// ∫ x xᵀ dV in m⁵.
    second: DMat3,
    /// Where the origin of the moments lies in the cloud's frame.
    origin: DVec3,
}

impl Moments {
    /// Zero, about a point near the middle, so that sums lose no digits far from the cloud's origin.
    fn about_middle(surfels: &[Surfel]) -> Self {
        Self {
            volume: 0.0,
            first: DVec3::ZERO,
            second: DMat3::ZERO,
            origin: surfels.iter().map(|s| s.position).sum::<DVec3>() / surfels.len() as f64,
        }
    }

    /// ∫ x xᵀ dV about the centre of mass, in m⁵.
    fn central(&self) -> DMat3 {
        self.second - outer(self.first, self.first) * self.volume.recip()
    }

    fn properties(&self) -> MassProperties {
        let center = self.first / self.volume;
        let central = self.central();
        let trace = central.x_axis.x + central.y_axis.y + central.z_axis.z;
        let inertia = DMat3::from_diagonal(DVec3::splat(trace)) - central;
        // The axes are found of a matrix near 1: of large clouds the squares of moments are beyond f32.
        let scale = trace.log2().floor().exp2().recip();
        let near_one = (inertia * scale).as_mat3();
        let center = (self.origin + center).as_vec3();
        let mut properties =
            MassProperties::with_inertia_matrix(center, self.volume as f32, near_one);
        properties.inv_principal_inertia *= scale as f32;
        if !properties.inv_principal_inertia.is_finite() {
            properties.inv_principal_inertia = Vec3::ZERO; // as rapier's own for what is too small
        }
        properties
    }
}

/// The matrix a bᵀ.
fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

/// The moments of a sheet.
fn shell(surfels: &[Surfel], thickness: f64) -> Moments {
    let mut moments = Moments::about_middle(surfels);
    for surfel in surfels {
        let volume = surfel.area * thickness;
        let p = surfel.position - moments.origin;
        moments.volume += volume;
        moments.first += volume * p;
        // A patch has an extent of its own, which alone keeps a single point's inertia above zero.
        let within = DMat3::IDENTITY - outer(surfel.normal, surfel.normal);
        let spread = surfel.area / (4.0 * std::f64::consts::PI);
        moments.second += (outer(p, p) + within * spread) * volume;
    }
    moments
}

/// The moments of the enclosed solid, or `None` if the surfels do not enclose one.
fn solid(surfels: &[Surfel], mean_radius: f64) -> Option<Moments> {
    let mut moments = Moments::about_middle(surfels);
    let mut area = 0.0;
    let mut vector_area = DVec3::ZERO;
    for surfel in surfels {
        let p = surfel.position - moments.origin;
        let flux = surfel.area * surfel.normal;
        area += surfel.area;
        vector_area += flux;
        moments.volume += p.dot(flux) / 3.0;
        moments.first += 0.5 * p * p * flux;
        // ∫ x² dV = ⅓ ∮ x³ n_x dA; ∫ xy dV = ½ ∮ x² y n_x dA = ½ ∮ x y² n_y dA: their mean.
        let squares = p * p * flux;
        let second = &mut moments.second;
        for i in 0..3 {
            second.col_mut(i)[i] += p[i] * squares[i] / 3.0;
            let j = (i + 1) % 3;
            let product = 0.25 * (squares[i] * p[j] + squares[j] * p[i]);
            second.col_mut(i)[j] += product;
            second.col_mut(j)[i] += product;
        }
    }
    let closed =
        vector_area.length() < LEAST_OPEN * area && moments.volume > SHEET * mean_radius * area;
    // A few points can pass for closed; a solid has an extent along every axis.
    let extents = DSymmetricEigen3::new(moments.central()).eigenvalues;
    (closed && extents.min_element() > 0.0).then_some(moments)
}
