//! What the surface of a shape consists of: flat triangles, and triangles around curved solids.

use super::error::SampleError;
use super::winding;
use crate::ExactShape;
use crate::narrow_phase::parts::{part, part_count};
use rapier3d::glamx::{DVec3, Vec3};
use rapier3d::math::Pose;
use rapier3d::parry::shape::{Shape, TypedShape};
use tldi::RaySurface;

/// Vector areas of a mesh without gaps sum up to nothing. Up to this part of its area counts as nothing:
/// small holes do not open it. Half or twice: no row of `overlaps` changes.
const OPEN_MESH: f64 = 0.01;

/// How far the box about a curved solid is from it, in parts of its size: far enough to tell directions.
/// Half or twice: 3 of 300 overlaps are falsely deep instead of 4.
const BOX_MARGIN: f32 = 1e-3;

/// How far inside of a curved solid normals are taken, in parts of its size: ten steps of `f32`. Half or
/// twice: no row of `overlaps` changes.
const INSIDE: f32 = 1e-6;

/// Distance to another part of a compound, in parts of its size, that counts as none. Half: no test fails; twice:
/// that of samples, which must be even and close the surface.
const SAME_PLACE: f32 = 1e-5;

/// A piece of a surface: the image of a triangle under a map that lengthens nothing.
pub(super) struct Patch<'a> {
    /// In the frame of the part.
    pub(super) corners: [Vec3; 3],
    kind: Kind<'a>,
    /// From the frame of the part into that of the shape.
    shape_from_part: Pose,
}

enum Kind<'a> {
    /// The triangle itself.
    Flat { normal: Vec3 },
    /// The places of a convex solid that are nearest to those of the triangle, which is outside.
    Around {
        solid: ExactShape<'a>,
        /// How far inside of it normals are taken, metres.
        inside: f32,
    },
}

impl Patch<'_> {
    /// Place and outward normal, in the frame of the shape, of a place of the triangle.
    pub(super) fn at(&self, q: Vec3) -> (Vec3, Vec3) {
        let (place, normal) = match &self.kind {
            Kind::Flat { normal } => (q, *normal),
            Kind::Around { solid, inside } => {
                let (distance, towards) = solid.project(q);
                // Outside an edge it is the normal of neither face, just inside that of the nearer one.
                let (_, normal) = solid.project(q - (distance + inside) * towards);
                (q - distance * towards, normal)
            }
        };
        (
            self.shape_from_part * place,
            self.shape_from_part.rotation * normal,
        )
    }

    /// Area of the triangle in square metres: at least that of the surface.
    pub(super) fn area(&self) -> f64 {
        vector_area(&self.corners).length()
    }
}

pub(super) fn vector_area(corners: &[Vec3; 3]) -> DVec3 {
    let [a, b, c] = corners.map(|corner| corner.as_dvec3());
    0.5 * (b - a).cross(c - a)
}

/// The patches of each part of a shape.
pub(super) fn patches_of(shape: &dyn Shape) -> Result<Vec<Vec<Patch<'_>>>, SampleError> {
    (0..part_count(shape))
        .map(|i| {
            let (pose, part) = part(shape, i);
            patches_of_part(part, pose.copied().unwrap_or(Pose::IDENTITY))
        })
        .collect()
}

fn patches_of_part(part: &dyn Shape, pose: Pose) -> Result<Vec<Patch<'_>>, SampleError> {
    let (vertices, faces) = match part.as_typed_shape() {
        TypedShape::Cuboid(s) => s.to_trimesh(),
        TypedShape::ConvexPolyhedron(s) => s.to_trimesh(),
        TypedShape::Voxels(s) => s.to_trimesh(),
        TypedShape::TriMesh(s) => (s.vertices().to_vec(), s.indices().to_vec()),
        TypedShape::Triangle(s) => (s.vertices().to_vec(), vec![[0, 1, 2]]),
        TypedShape::HeightField(s) => s.to_trimesh(),
        TypedShape::Ball(_)
        | TypedShape::Capsule(_)
        | TypedShape::Cylinder(_)
        | TypedShape::Cone(_)
        | TypedShape::RoundCuboid(_)
        | TypedShape::RoundTriangle(_)
        | TypedShape::RoundCylinder(_)
        | TypedShape::RoundCone(_)
        | TypedShape::RoundConvexPolyhedron(_) => return around(part, pose),
        TypedShape::HalfSpace(_)
        | TypedShape::Segment(_)
        | TypedShape::Polyline(_)
        | TypedShape::Compound(_) => {
            let shape = format!("{:?}", part.shape_type());
            return Err(SampleError::NoSurface { shape });
        }
        // A cloud that is asked for its type warns of a dispatcher that does not know it.
        TypedShape::Custom(_) => {
            let shape = "Custom".to_owned();
            return Err(SampleError::NoSurface { shape });
        }
    };
    flat(&vertices, &faces, pose)
}

/// The faces of a mesh, with normals on their [`outside`].
fn flat<'a>(
    vertices: &[Vec3],
    faces: &[[u32; 3]],
    pose: Pose,
) -> Result<Vec<Patch<'a>>, SampleError> {
    let mut triangles: Vec<[Vec3; 3]> = (faces.iter())
        .map(|face| face.map(|i| vertices[i as usize]))
        .collect();
    let finite = |triangle: &[Vec3; 3]| triangle.iter().all(|corner| corner.is_finite());
    if let Some(face) = triangles.iter().position(|triangle| !finite(triangle)) {
        return Err(SampleError::NotFinite { face });
    }
    winding::make_agree(&mut triangles);
    let outside = outside(&triangles);
    let patch = |corners: [Vec3; 3]| {
        let normal = (outside * vector_area(&corners)).try_normalize()?.as_vec3();
        Some(Patch {
            corners,
            kind: Kind::Flat { normal },
            shape_from_part: pose,
        })
    };
    Ok(triangles.into_iter().filter_map(patch).collect())
}

/// −1 if the triangles enclose a volume and wind clockwise as seen from outside, else 1.
fn outside(triangles: &[[Vec3; 3]]) -> f64 {
    let areas = || triangles.iter().map(vector_area);
    let area: f64 = areas().map(DVec3::length).sum();
    if areas().sum::<DVec3>().length() > OPEN_MESH * area {
        return 1.0;
    }
    let middle = triangles
        .iter()
        .flatten()
        .map(|p| p.as_dvec3())
        .sum::<DVec3>()
        / (3 * triangles.len().max(1)) as f64;
    let volume: f64 = (triangles.iter())
        .map(|corners| corners.map(|corner| corner.as_dvec3() - middle))
        .map(|[a, b, c]| a.dot(b.cross(c)))
        .sum();
    if volume < 0.0 { -1.0 } else { 1.0 }
}

/// The box about a convex solid, twelve triangles.
fn around(solid: &dyn Shape, pose: Pose) -> Result<Vec<Patch<'_>>, SampleError> {
    let bounds = solid.compute_local_aabb();
    if !(bounds.mins.is_finite() && bounds.maxs.is_finite()) {
        return Err(SampleError::NotFinite { face: 0 });
    }
    let center = bounds.center();
    let half = bounds.half_extents();
    let size = half.max_element();
    let half = half + Vec3::splat(BOX_MARGIN * size);
    let mut patches = Vec::with_capacity(12);
    for axis in 0..3 {
        for sign in [-1.0, 1.0] {
            let corner = |u: f32, v: f32| {
                let mut corner = Vec3::ZERO;
                (corner[axis], corner[(axis + 1) % 3], corner[(axis + 2) % 3]) = (sign, u, v);
                center + half * corner
            };
            let [a, b, c, d] =
                [(-1., -1.), (1., -1.), (1., 1.), (-1., 1.)].map(|(u, v)| corner(u, v));
            patches.extend([[a, b, c], [a, c, d]].map(|corners| Patch {
                corners,
                kind: Kind::Around {
                    solid: ExactShape(solid),
                    inside: INSIDE * size,
                },
                shape_from_part: pose,
            }));
        }
    }
    Ok(patches)
}

/// How much of a piece of a part's surface other parts of the shape hide: all that is within so many metres of `place`, a
/// place of the piece with this outward normal. 0 where the place is not hidden. Where two parts touch face to face
/// there is no surface.
pub(super) fn hidden_around(
    shape: &dyn Shape,
    own: usize,
    patch: &Patch<'_>,
    piece: &[Vec3; 3],
    (place, normal): (Vec3, Vec3),
) -> f32 {
    let mut depth = 0.0_f32;
    for other in (0..part_count(shape)).filter(|i| *i as usize != own) {
        let (Some(pose), part) = part(shape, other) else {
            continue;
        };
        let surface = ExactShape(part);
        if !surface.is_closed() {
            continue;
        }
        let touching = SAME_PLACE * part.compute_local_bounding_sphere().radius;
        let project = |place: Vec3| surface.project(pose.inverse_transform_point(place));
        let (distance, outward) = project(place);
        let is_inside = distance < -touching;
        let touches = distance <= touching && (pose.rotation * outward).dot(normal) < -0.99;
        if !(is_inside || touches) {
            continue;
        }
        // A convex part holds all of a flat piece if it holds its corners.
        let holds = |corner: &Vec3| project(patch.at(*corner).0).0 <= touching;
        if part.is_convex() && matches!(patch.kind, Kind::Flat { .. }) && piece.iter().all(holds) {
            return f32::INFINITY;
        }
        depth = depth.max(if is_inside {
            -distance
        } else {
            f32::MIN_POSITIVE
        });
    }
    depth
}
