//! Rapier's own shapes as [`RaySurface`]s: where a ray enters and leaves them, and their distance
//! from a point.
//!
//! Rays and distances are computed here, in `f64` from the shapes' `f32` data. Parry's ray casts do
//! not suffice: they report only the first hit, turn normals towards the ray, and iterate in `f32`
//! on curved shapes.

mod convex;
mod distance;
mod line;
mod mesh;
mod sampled;
mod triangle;
mod voxels;

use distance::Projection;
use line::Line;
use rapier3d::glamx::{DVec3, Vec3};
use rapier3d::parry::shape::{
    Ball, Capsule, Cone, ConvexPolyhedron, Cuboid, Cylinder, HalfSpace, Segment, Shape, Triangle,
    TypedShape,
};
use tldi::{Aabb, RayHit, RaySurface};

/// One of rapier's shapes as rays see it, in the shape's own frame.
///
/// | shape | crossings | inside |
/// |---|---|---|
/// | ball, cuboid, capsule, cylinder, cone, convex polyhedron, their round versions, round triangle | entry and exit | yes |
/// | half-space | one | yes; bounds are infinite |
/// | voxels | outer faces only | yes |
/// | triangle mesh | every triangle, once; normals by winding | if it has `TriMeshFlags::ORIENTED`, or a half-edge topology without border; the signed distance is negative behind the normal in any case |
/// | height field, triangle | every triangle, once; a height field's normals point to +y | no; the signed distance is negative behind the normal |
/// | segment, polyline | none | no |
/// | any other | by repeated ray casts, see below | by the shape's own test |
///
/// Crossings are within `f32` rounding of the shape's size, divided by the cosine of the angle
/// between ray and normal. A ray through a shared edge or vertex of triangles crosses one of them,
/// as if it were shifted by an infinitesimal amount. At a silhouette it crosses none, or two of
/// opposite facing. So crossings of a closed mesh come in pairs.
///
/// For a custom shape, rays are cast repeatedly, each from just behind the last hit. Crossings
/// closer than 10⁻⁵ of its size are missed.
///
/// ```
/// use rapier3d::prelude::*;
/// use rapier3d_tldi::{ExactShape, RaySurface};
/// let ball = Ball::new(0.5);
/// let mut hits = Vec::new();
/// ExactShape(&ball).crossings(Vector::new(0.0, 2.0, 0.0), -Vector::Y, 10.0, &mut hits);
/// assert_eq!(hits.len(), 2);
/// assert_eq!((hits[0].distance, hits[0].normal), (1.5, Vector::Y));
/// assert_eq!((hits[1].distance, hits[1].normal), (2.5, -Vector::Y));
/// ```
#[derive(Clone, Copy)]
pub struct ExactShape<'a>(pub &'a dyn Shape);

/// The distance function of a convex solid.
enum Convex<'a> {
    Ball(&'a Ball),
    Cuboid(&'a Cuboid),
    Capsule(&'a Capsule),
    Cylinder(&'a Cylinder),
    Cone(&'a Cone),
    Polyhedron(&'a ConvexPolyhedron),
    Triangle(&'a Triangle),
    Segment(&'a Segment),
}

impl Convex<'_> {
    fn project(&self, point: DVec3) -> Projection {
        match self {
            Self::Ball(s) => distance::ball(point, s.radius.into()),
            Self::Cuboid(s) => distance::cuboid(point, s.half_extents.as_dvec3()),
            Self::Capsule(s) => distance::rounded(
                distance::segment(point, s.segment.a.as_dvec3(), s.segment.b.as_dvec3()),
                s.radius,
            ),
            Self::Cylinder(s) => distance::cylinder(point, s.half_height.into(), s.radius.into()),
            Self::Cone(s) => distance::cone(point, s.half_height.into(), s.radius.into()),
            Self::Polyhedron(s) => convex::project_on_polyhedron(s, point),
            Self::Triangle(s) => distance::triangle(point, triangle::vertices(s)),
            Self::Segment(s) => distance::segment(point, s.a.as_dvec3(), s.b.as_dvec3()),
        }
    }
}

/// How a shape is seen.
enum Kind<'a> {
    /// A convex solid grown by a border in metres.
    Solid(Convex<'a>, f32),
    HalfSpace(&'a HalfSpace),
    Triangle(&'a Triangle),
    Segment(&'a Segment),
    TriMesh(&'a rapier3d::parry::shape::TriMesh),
    HeightField(&'a rapier3d::parry::shape::HeightField),
    Voxels(&'a rapier3d::parry::shape::Voxels),
    Polyline(&'a dyn Shape),
    Other(&'a dyn Shape),
}

impl<'a> ExactShape<'a> {
    fn kind(&self) -> Kind<'a> {
        use Kind::Solid;
        match self.0.as_typed_shape() {
            TypedShape::Ball(s) => Solid(Convex::Ball(s), 0.0),
            TypedShape::Cuboid(s) => Solid(Convex::Cuboid(s), 0.0),
            TypedShape::Capsule(s) => Solid(Convex::Capsule(s), 0.0),
            TypedShape::Cylinder(s) => Solid(Convex::Cylinder(s), 0.0),
            TypedShape::Cone(s) => Solid(Convex::Cone(s), 0.0),
            TypedShape::ConvexPolyhedron(s) => Solid(Convex::Polyhedron(s), 0.0),
            TypedShape::RoundCuboid(s) => Solid(Convex::Cuboid(&s.inner_shape), s.border_radius),
            TypedShape::RoundCylinder(s) => {
                Solid(Convex::Cylinder(&s.inner_shape), s.border_radius)
            }
            TypedShape::RoundCone(s) => Solid(Convex::Cone(&s.inner_shape), s.border_radius),
            TypedShape::RoundConvexPolyhedron(s) => {
                Solid(Convex::Polyhedron(&s.inner_shape), s.border_radius)
            }
            TypedShape::RoundTriangle(s) => {
                Solid(Convex::Triangle(&s.inner_shape), s.border_radius)
            }
            TypedShape::HalfSpace(s) => Kind::HalfSpace(s),
            TypedShape::Triangle(s) => Kind::Triangle(s),
            TypedShape::Segment(s) => Kind::Segment(s),
            TypedShape::TriMesh(s) => Kind::TriMesh(s),
            TypedShape::HeightField(s) => Kind::HeightField(s),
            TypedShape::Voxels(s) => Kind::Voxels(s),
            TypedShape::Polyline(s) => Kind::Polyline(s),
            TypedShape::Compound(_) | TypedShape::Custom(_) => Kind::Other(self.0),
        }
    }
}

impl RaySurface for ExactShape<'_> {
    fn bounds(&self) -> Aabb {
        if let Kind::HalfSpace(_) = self.kind() {
            return Aabb {
                min: Vec3::NEG_INFINITY,
                max: Vec3::INFINITY,
            };
        }
        let aabb = self.0.compute_local_aabb();
        Aabb {
            min: aabb.mins,
            max: aabb.maxs,
        }
    }

    fn crossings(&self, origin: Vec3, direction: Vec3, max_distance: f32, hits: &mut Vec<RayHit>) {
        let Some(line) = Line::new(origin, direction, max_distance) else {
            return;
        };
        let first = hits.len();
        match self.kind() {
            Kind::Solid(Convex::Ball(s), _) => convex::ball(s, &line, hits),
            Kind::Solid(Convex::Cuboid(s), 0.0) => convex::cuboid(s, &line, hits),
            Kind::Solid(Convex::Polyhedron(s), 0.0) => convex::polyhedron(s, &line, hits),
            Kind::Solid(convex, border) => {
                let sphere = self.0.compute_local_bounding_sphere();
                convex::by_distance(
                    |point| distance::rounded(convex.project(point), border),
                    sphere.center.as_dvec3(),
                    sphere.radius.into(),
                    &line,
                    hits,
                );
            }
            Kind::HalfSpace(s) => convex::half_space(s, &line, hits),
            Kind::Triangle(s) => mesh::cross_triangle(s, &line, hits),
            Kind::TriMesh(s) => mesh::cross_trimesh(s, &line, hits),
            Kind::HeightField(s) => mesh::cross_height_field(s, &line, hits),
            Kind::Voxels(s) => voxels::crossings(s, &line, hits),
            Kind::Segment(_) | Kind::Polyline(_) => {}
            Kind::Other(s) => sampled::crossings(s, &line, hits),
        }
        hits[first..].sort_by(|a, b| a.distance.total_cmp(&b.distance));
    }

    /// A point that is not finite is infinitely far.
    fn project(&self, point: Vec3) -> (f32, Vec3) {
        if !point.is_finite() {
            return (f32::INFINITY, Vec3::Y);
        }
        let p = point.as_dvec3();
        let (distance, normal) = match self.kind() {
            Kind::Solid(convex, border) => distance::rounded(convex.project(p), border),
            Kind::HalfSpace(s) => {
                let normal = s.normal.as_dvec3();
                (normal.dot(p), normal)
            }
            Kind::Triangle(s) => mesh::project_on_triangle(s, p),
            Kind::Segment(s) => Convex::Segment(s).project(p),
            Kind::TriMesh(s) => mesh::project_on_trimesh(s, p),
            Kind::HeightField(s) => mesh::project_on_height_field(s, p),
            Kind::Voxels(s) => voxels::project(s, point),
            Kind::Polyline(s) | Kind::Other(s) => sampled::project(s, point),
        };
        (distance as f32, normal.as_vec3())
    }

    fn is_closed(&self) -> bool {
        match self.kind() {
            Kind::Solid(..) | Kind::HalfSpace(_) | Kind::Voxels(_) => true,
            Kind::TriMesh(s) => mesh::is_closed(s),
            Kind::Triangle(_) | Kind::Segment(_) | Kind::HeightField(_) | Kind::Polyline(_) => {
                false
            }
            Kind::Other(s) => s.is_convex(),
        }
    }
}
