//! Brute-force counterparts of the stages, written from their descriptions and sharing no code
//! with them.

use tldi::glamx::{DVec2, DVec3, Vec3};
use tldi::{Params, PointCloud};

/// One splat in one pixel, as the description of the oriented variant has it.
#[derive(Clone, Copy, Debug)]
pub struct OracleFragment {
    /// Depth of the tangent plane at the pixel's centre, slope damped, metres.
    pub depth: f64,
    /// Relative weight.
    pub weight: f64,
    /// 0 entry, 1 exit or unoriented, 2 edge-on.
    pub class: u8,
    /// Where the splat's point is, pixels.
    pub centre: DVec2,
    /// Unit normal.
    pub normal: DVec3,
}

/// A layer of a pixel, in metres along the view.
#[derive(Clone, Copy, Debug)]
pub struct OracleLayer {
    /// Of the nearest fragment.
    pub near: f64,
    /// Of the farthest.
    pub far: f64,
    /// What the layer is taken for.
    pub surface: OracleSurface,
}

/// The mean of the fragments of a layer or, where their normals differ, of those on the face that the ray meets.
#[derive(Clone, Copy, Debug)]
pub struct OracleSurface {
    /// Metres.
    pub depth: f64,
    /// Unit length.
    pub normal: DVec3,
}

/// The layers of pixel `(i, j)` of an orthographic camera that looks along
/// +z with pixel edges of `params.pixel_size`: every splat of the cloud is tried (O(points)); of a
/// class those that follow each other within the merge gap, or a thickness where one is steep, are a layer.
///
/// `None` where a decision (covered or not, which class, merged or not) is closer than `f32` can
/// tell: there the oracle knows no better than what it judges. The surface alone is not a number where
/// that holds for the face at a crease.
pub fn oracle_layers(
    cloud: &PointCloud,
    i: i32,
    j: i32,
    params: &Params,
) -> Option<Vec<OracleLayer>> {
    let pixel = f64::from(params.pixel_size);
    let normals = cloud.normals().expect("the oracle needs normals");
    let mut fragments = Vec::new();
    for (k, p) in cloud.points().iter().copied().enumerate() {
        fragments.extend(fragment(cloud, p, normals[k], k, [i, j], pixel, params)?);
    }
    fragments.sort_by(|f, g| {
        (f.class, f.depth)
            .partial_cmp(&(g.class, g.depth))
            .expect("finite")
    });
    let face_on = f64::from(params.merge_gap) + 0.8 * f64::from(cloud.noise());
    let steep = face_on.max(f64::from(params.thickness));
    let is_steep = |f: &OracleFragment| f.normal.z.abs() < 0.8;
    let gap = |f: &OracleFragment, g: &OracleFragment| match is_steep(f) || is_steep(g) {
        true => steep,
        false => face_on,
    };
    // Depths are rounded to even steps of a thickness / 4096; equal ones have no order.
    let rounding = 1e-3 * steep;
    let is_close = |f: &OracleFragment, g: &OracleFragment| {
        let apart = g.depth - f.depth;
        f.class == g.class
            && ((apart - gap(f, g)).abs() < rounding
                || is_steep(f) != is_steep(g) && apart < rounding)
    };
    if fragments
        .windows(2)
        .any(|pair| is_close(&pair[0], &pair[1]))
    {
        return None;
    }
    let follows = |f: &OracleFragment, g: &OracleFragment| {
        f.class == g.class && g.depth - f.depth <= gap(f, g)
    };
    let runs: Vec<&[OracleFragment]> = fragments.chunk_by(follows).collect();
    let mut layers: Vec<_> = runs
        .iter()
        .map(|run| {
            let near = run.iter().map(|f| f.depth).fold(f64::INFINITY, f64::min);
            let far = run
                .iter()
                .map(|f| f.depth)
                .fold(f64::NEG_INFINITY, f64::max);
            OracleLayer {
                near,
                far,
                surface: surface(run),
            }
        })
        .collect();
    layers.sort_by(|a, b| a.near.total_cmp(&b.near));
    Some(layers)
}

/// Not a number where the rounding of weights and normals decides.
fn surface(run: &[OracleFragment]) -> OracleSurface {
    let weight = |f: &OracleFragment| f.weight;
    let mean = |run: &[&OracleFragment]| {
        let depth: f64 = run.iter().map(|f| f.weight * f.depth).sum();
        let normal: DVec3 = run.iter().map(|f| f.weight * f.normal).sum();
        OracleSurface {
            depth: depth / run.iter().map(|f| f.weight).sum::<f64>(),
            normal: normal.normalize(),
        }
    };
    let unclear = OracleSurface {
        depth: f64::NAN,
        normal: DVec3::NAN,
    };
    let all: Vec<_> = run.iter().collect();
    let total = run.iter().map(weight).sum::<f64>();
    let normal: DVec3 = run.iter().map(|f| f.weight * f.normal).sum();
    let length = normal.length() / total;
    // Two faces that differ by 35°, the smaller with 0.3 of the weight.
    let (least, cosine) = (0.3, 0.82);
    let creased = f64::sqrt(1.0 - 2.0 * least * (1.0 - least) * (1.0 - cosine));
    if (length - creased).abs() < 0.002 {
        return unclear;
    }
    if length > creased {
        return mean(&all);
    }
    let mut faces: Vec<OracleFragment> = Vec::new();
    for _ in 0..3 {
        let is_left = |f: &&OracleFragment| faces.iter().all(|g| f.normal.dot(g.normal) < cosine);
        let left: Vec<_> = run.iter().filter(is_left).collect();
        let most = left.iter().map(|f| f.weight).fold(0.0, f64::max);
        let heaviest: Vec<_> = left.iter().filter(|f| f.weight > most - 1.01).collect();
        match heaviest[..] {
            [] => break,
            [face] => faces.push(**face),
            _ => return unclear,
        }
        let face = faces[faces.len() - 1].normal;
        let is_unclear = |f: &OracleFragment| (f.normal.dot(face) - cosine).abs() < 0.001;
        if run.iter().any(is_unclear) {
            return unclear;
        }
    }
    // Normals that lean apart, as at an edge, or together.
    let heaviest = faces[0];
    let bend: f64 = run
        .iter()
        .map(|f| {
            let aside = (f.centre - heaviest.centre).clamp(DVec2::splat(-4.0), DVec2::splat(4.0));
            aside.dot((f.normal - heaviest.normal).truncate())
        })
        .sum();
    // Places count in sixteenths of a pixel, normals in 256ths.
    let is_bend_unclear = bend.abs() < 0.05 * (run.len() as f64).sqrt();
    let (first, last) = (run[0].depth, run[run.len() - 1].depth);
    let (mut met, mut is_unclear) = (None::<OracleSurface>, false);
    for face in faces {
        let on_face = |f: &&OracleFragment| f.normal.dot(face.normal) > cosine;
        let of_face: Vec<_> = run.iter().filter(on_face).collect();
        let share = of_face.iter().map(|f| f.weight).sum::<f64>() / total;
        let of_face = mean(&of_face);
        let Some(so_far) = met else {
            met = Some(of_face);
            continue;
        };
        // At an edge the ray passes the planes of the other faces outside the body, in a groove inside.
        let outwards = bend * heaviest.normal.z;
        let is_inwards = (of_face.depth - so_far.depth) * outwards < 0.0;
        // Weights count in 255ths.
        let is_close = (of_face.depth - so_far.depth).abs() < 0.01 * (last - first);
        is_unclear |=
            (share - least).abs() < 0.003 || share > least && (is_close || is_bend_unclear);
        if share > least && is_inwards {
            met = Some(of_face);
        }
    }
    met.filter(|_| !is_unclear).unwrap_or(unclear)
}

/// The outer `None` is "too close to tell".
fn fragment(
    cloud: &PointCloud,
    p: Vec3,
    n: Vec3,
    k: usize,
    [i, j]: [i32; 2],
    pixel: f64,
    params: &Params,
) -> Option<Option<OracleFragment>> {
    let (p, n) = (p.as_dvec3(), n.as_dvec3());
    let radius = f64::from(cloud.radius(k)).max(0.75 * pixel);
    let dx = (f64::from(i) + 0.5) * pixel - p.x;
    let dy = (f64::from(j) + 0.5) * pixel - p.y;
    let rise = -(n.x * dx + n.y * dy) / n.z;
    let rise = if rise.is_finite() {
        rise.clamp(-radius, radius)
    } else {
        0.0
    };
    let share = 1.0 - (dx * dx + dy * dy + rise * rise) / (radius * radius);
    let near_rim = |c: f64| (c - c.round()).abs() < 1e-5;
    if share.abs() < 1e-4
        || (n.z.abs() - 0.2).abs() < 1e-5
        || (dx.abs().max(dy.abs()) < pixel && (near_rim(p.x / pixel) || near_rim(p.y / pixel)))
    {
        return None;
    }
    let own = (p.x / pixel).floor() == f64::from(i) && (p.y / pixel).floor() == f64::from(j);
    if share <= 0.0 && !own {
        return Some(None);
    }
    let class = match n.z {
        z if z.abs() < 0.2 => 2,
        z if cloud.normals_oriented() && z <= 0.0 => 0,
        _ => 1,
    };
    // What is edge-on has the depth of its point.
    let slope_share = match class {
        2 => 0.0,
        _ => f64::from(params.slope_damping),
    };
    Some(Some(OracleFragment {
        depth: p.z + slope_share * rise,
        weight: (1.0 + 254.0 * share.max(0.0) * n.z.abs()).floor(),
        class,
        centre: p.truncate() / pixel,
        normal: n,
    }))
}
