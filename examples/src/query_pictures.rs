//! Pictures of one query: the layers of both images, a cut through them, the contact zone, the contact
//! pixels.

use crate::query::{Answer, CloudQuery};
use crate::query_views::Views;
use tldi::glamx::{Pose3, Vec3};
use tldi::{CloudError, ContactPixel, Facing, KdTree, Layer, PointCloud, Tldi, VirtualCamera};
use tldi_pictures::sheet::{Key, Panel, sheet};
use tldi_pictures::viewpoint;
use tldi_pictures::{BODY_COLORS, Item, Picture, Scene, painted};

/// Width or height in picture pixels that panels are enlarged to, at most: a layer, contact pixels, and
/// the width of a section.
const LAYER_EDGE: u32 = 320;
const CONTACTS_EDGE: u32 = 560;
const SECTION_WIDTH: u32 = 960;
/// Layers of an image that are shown.
const SHOWN_LAYERS: usize = 4;
/// Views of a pair whose contact pixels are shown.
const SHOWN_VIEWS: usize = 3;
/// Distance in mean radii up to which points are near the other cloud.
const ZONE_REACH: f32 = 6.0;
const NOTHING: [u8; 3] = [228, 231, 236];
/// Where a ray enters a body, leaves it, and where the cloud does not tell.
const ENTRY: [u8; 3] = [240, 140, 60];
const EXIT: [u8; 3] = [80, 140, 230];
const UNKNOWN: [u8; 3] = [190, 190, 190];
/// Behind contact pixels: both clouds are there, only one, only the other.
const BOTH: [u8; 3] = [196, 200, 206];
const ONLY: [[u8; 3]; 2] = [[226, 214, 204], [206, 216, 228]];
/// A and B in a section, and half the width of the line of a surface there, in picture pixels.
const SIDES: [[u8; 3]; 2] = [[214, 92, 30], [40, 116, 200]];
const SURFACE_LINE: f32 = 1.6;
/// A point of a section, its radius in picture pixels, and the width of the line between points and layers.
const POINT: [u8; 3] = [40, 44, 52];
const POINT_DOT: f32 = 2.0;
const DIVIDER: u32 = 2;
/// Full penetration, a full gap, and points of the solver.
const DEEP: [u8; 3] = [235, 30, 20];
const WIDE: [u8; 3] = [30, 90, 235];
const SOLVER_POINT: [u8; 3] = [255, 230, 40];

/// A camera that sees both clouds, for pictures of `size`.
pub fn camera(query: &CloudQuery, size: [u32; 2]) -> VirtualCamera {
    viewpoint::choose(&placed([&query.a, &query.b], query), &[], size)
}

/// Both clouds as they are placed, with a dot at each contact.
pub fn scene(query: &CloudQuery, answer: &Answer, camera: &VirtualCamera) -> Picture {
    let contacts: Vec<Vec3> = (answer.report.contacts.iter())
        .map(|contact| Vec3::from(contact.point))
        .collect();
    placed([&query.a, &query.b], query).draw(camera, &contacts)
}

/// The contact zone: of each cloud the points near the other one are in full colour.
///
/// # Errors
/// [`CloudError`]; not for valid clouds.
pub fn zone(
    query: &CloudQuery,
    answer: &Answer,
    camera: &VirtualCamera,
) -> Result<Picture, CloudError> {
    let reach = ZONE_REACH * answer.report.mean_radius;
    let tinted = |cloud: &PointCloud<'_>,
                  other: &PointCloud<'_>,
                  other_from_cloud: Pose3,
                  color: [f32; 3]| {
        let tree = KdTree::new(other);
        painted(cloud, |i| {
            let place = other_from_cloud * cloud.point(i);
            let strength = if tree.nearest(place, reach).is_some() {
                1.0
            } else {
                0.15
            };
            let [r, g, b] = color.map(|c| (255.0 * (0.8 + (c - 0.8) * strength)) as u8);
            [r, g, b, 255]
        })
    };
    let [a_color, b_color] = [BODY_COLORS[0], BODY_COLORS[1]];
    let a = tinted(&query.a, &query.b, query.a_from_b.inverse(), a_color)?;
    let b = tinted(&query.b, &query.a, query.a_from_b, b_color)?;
    Ok(placed([&a, &b], query).draw(camera, &[]))
}

fn placed<'a>([a, b]: [&'a PointCloud<'a>; 2], query: &CloudQuery) -> Scene<'a> {
    let radius = |cloud: &PointCloud<'_>| 0.5 * cloud.bounds().extents().length();
    Scene {
        items: vec![
            Item::body(a, Pose3::IDENTITY, BODY_COLORS[0]),
            Item::body(b, query.a_from_b, BODY_COLORS[1]),
        ],
        up: Vec3::Y,
        // The frame holds 2.2 of these around each cloud's middle.
        detail: 0.34 * radius(a).max(radius(b)),
    }
}

/// The layers of both images side by side, as the query's first view sees them: a row for each
/// cloud, the nearest layer first. Orange: the ray enters the body; blue: it leaves it; grey:
/// the cloud does not tell. The nearer, the brighter.
pub fn layers(query: &CloudQuery, answer: &Answer) -> Picture {
    let views = Views::new(query, answer);
    let images = views.images(query);
    let shown = images.each_ref().map(|image| image.max_layers());
    let columns = shown[0].max(shown[1]).clamp(1, SHOWN_LAYERS);
    let rows = ["A", "B"].into_iter().zip(&images).map(|(name, image)| {
        let panel = |k: usize| {
            let picture = views.panel(LAYER_EDGE, |x, y| layer_color(image, &views, [x, y], k));
            let caption = format!("{name}, layer {}", k + 1);
            Panel { picture, caption }
        };
        (0..columns).map(panel).collect::<Vec<_>>()
    });
    let legend = [
        Key::new(ENTRY, "the ray enters the body; the nearer, the brighter"),
        Key::new(EXIT, "the ray leaves it"),
        Key::new(UNKNOWN, "the cloud does not tell, or the ray grazes it"),
    ];
    sheet(&rows.collect::<Vec<_>>(), &legend)
}

/// The pixels in which the surfaces are close, for each view: red where they penetrate, the deeper
/// the stronger, blue where there is a gap; behind them the outlines of both clouds; a yellow cross
/// where the solver gets a point.
pub fn contact_pixels(query: &CloudQuery, answer: &Answer) -> Picture {
    let scale = answer.params.prediction;
    let panels = (0..answer.result.axes.len().clamp(1, SHOWN_VIEWS)).map(|view| {
        let contacts: Vec<&ContactPixel> = (answer.result.contacts.iter())
            .filter(|contact| contact.view as usize == view)
            .collect();
        let views = Views::of_contacts(query, answer, view, &contacts);
        let images = views.images(query);
        let mut picture = views.panel(CONTACTS_EDGE, |x, y| {
            let covered = images
                .each_ref()
                .map(|image| !views.layers_at(image, [x, y]).is_empty());
            let Some(contact) = contacts.iter().find(|c| c.pixel == [x, y]) else {
                return match covered {
                    [true, true] => BOTH,
                    [true, false] => ONLY[0],
                    [false, true] => ONLY[1],
                    _ => NOTHING,
                };
            };
            let strength = (contact.gap.abs() / scale).min(1.0);
            let full = if contact.gap < 0.0 { DEEP } else { WIDE };
            faded(full, 1.0 - strength)
        });
        let enlarged = views.enlargement(CONTACTS_EDGE);
        for contact in &answer.report.contacts {
            let seen = views.camera.view_from_point(Vec3::from(contact.point));
            let [u, v] = views.camera.pixel_from_view(seen);
            let place = [u - views.origin[0] as f32, v - views.origin[1] as f32];
            cross(&mut picture, place.map(|c| c * enlarged as f32));
        }
        let caption = format!("view {}, {} contact pixels", view + 1, contacts.len());
        Panel { picture, caption }
    });
    let panels = panels.collect();
    let millimetres = |metres: f32| format!("{:.1} mm", 1e3 * metres);
    let deepest = answer.result.contacts.iter().map(|contact| -contact.gap);
    let legend = [
        Key::new(
            DEEP,
            format!(
                "penetration, at most {}",
                millimetres(deepest.fold(0.0, f32::max))
            ),
        ),
        Key::new(WIDE, format!("gap, up to {} counts", millimetres(scale))),
        Key::new(SOLVER_POINT, "crosses: points for the solver"),
        Key::new(ONLY[0], "only A is there"),
        Key::new(ONLY[1], "only B is there"),
        Key::new(BOTH, "both are there, out of reach of each other"),
    ];
    sheet(&[panels], &legend)
}

/// How points become layers: a row of pixels from the side. The rays go down.
///
/// The left half shows the points in the row, each as a disc. The right half shows the layers. Dark is the
/// surface of a layer, medium the fragments merged into it, from nearest to farthest. Pale is inside a body, red
/// inside both. The row is the one with most contact pixels, or the middle one.
pub fn section(query: &CloudQuery, answer: &Answer) -> Picture {
    let views = Views::new(query, answer);
    let images = views.images(query);
    let row = section_row(&views, answer);
    let x_of = |column: u32| views.origin[0] + column as i32;
    let columns: Vec<[&[Layer]; 2]> = (0..views.size[0])
        .map(|column| (images.each_ref()).map(|image| views.layers_at(image, [x_of(column), row])))
        .collect();
    let ends = columns.iter().flatten().copied().flatten();
    let (near, far) = ends.fold((f32::MAX, f32::MIN), |(near, far), layer| {
        (near.min(layer.near), far.max(layer.far))
    });
    let enlarged = views.enlargement(SECTION_WIDTH);
    // As many picture pixels a metre along the rays as across them.
    let scale = enlarged as f32 / views.params.pixel_size;
    let margin = 4.0 * enlarged as f32;
    let height = ((far - near).max(0.0) * scale + 2.0 * margin) as u32;
    let color_at = |layers: &[&[Layer]; 2], y: u32| {
        let depth = near + (y as f32 + 0.5 - margin) / scale;
        let half_line = SURFACE_LINE / scale;
        let of_surface = (layers.iter().zip(SIDES))
            .find(|(layers, _)| layers.iter().any(|l| (l.depth - depth).abs() < half_line));
        let of_layer = (layers.iter().zip(SIDES))
            .find(|(layers, _)| layers.iter().any(|l| (l.near..=l.far).contains(&depth)));
        match (of_surface, of_layer, layers.map(|l| is_inside(l, depth))) {
            (Some((_, color)), ..) => color,
            (_, Some((_, color)), _) => faded(color, 0.5),
            (.., [true, true]) => faded(DEEP, 0.3),
            (.., [true, false]) => faded(SIDES[0], 0.8),
            (.., [false, true]) => faded(SIDES[1], 0.8),
            _ => NOTHING,
        }
    };
    let width = views.size[0] * enlarged;
    let middle = width / 2;
    let rgb = (0..height)
        .flat_map(|y| (0..width).map(move |x| (x, y)))
        // A gap between the columns shows the rays.
        .map(|(x, y)| match x % enlarged {
            _ if x < middle => NOTHING,
            _ if x < middle + DIVIDER => POINT,
            0 if enlarged > 2 => NOTHING,
            _ => color_at(&columns[(x / enlarged) as usize], y),
        })
        .collect();
    let mut picture = Picture {
        size: [width, height],
        rgb,
    };
    let poses = [Pose3::IDENTITY, query.a_from_b];
    for ((cloud, pose), color) in [&query.a, &query.b].into_iter().zip(poses).zip(SIDES) {
        let place = |point: Vec3| {
            let [u, v] = views.camera.pixel_from_view(point);
            let x = (u - views.origin[0] as f32) * enlarged as f32;
            let is_in_row = (v - row as f32 - 0.5).abs() <= 0.5;
            (is_in_row && x < middle as f32).then_some([x, (point.z - near) * scale + margin])
        };
        discs(
            &mut picture,
            cloud,
            &(views.camera.view_from_frame * pose),
            scale,
            color,
            place,
        );
    }
    let legend = [
        Key::new(
            POINT,
            "left: points near the row, each a disc; right: layers",
        ),
        Key::new(SIDES[0], "surface of A in each layer, pale inside of A"),
        Key::new(SIDES[1], "surface of B, and inside of it"),
        Key::new(faded(DEEP, 0.3), "inside both: penetration"),
    ];
    let caption =
        "points become layers: one row of pixels from the side, the rays go down".to_owned();
    sheet(&[vec![Panel { picture, caption }]], &legend)
}

/// Draws the points that have a `place` in the picture, each with its disc from the side, `scale` picture pixels a
/// metre.
fn discs(
    picture: &mut Picture,
    cloud: &PointCloud<'_>,
    view_from_cloud: &Pose3,
    scale: f32,
    color: [u8; 3],
    place: impl Fn(Vec3) -> Option<[f32; 2]>,
) {
    for i in 0..cloud.len() {
        let Some([x, y]) = place(*view_from_cloud * cloud.point(i)) else {
            continue;
        };
        if let Some(normals) = cloud.normals() {
            // Where the disc's plane cuts that of the picture.
            let along = (view_from_cloud.rotation * normals[i])
                .cross(Vec3::Y)
                .normalize_or_zero();
            let radius = cloud.radius(i) * scale;
            for step in 0..=(4.0 * radius) as u32 {
                let t = 0.5 * step as f32 - radius;
                dot(
                    picture,
                    [x + t * along.x, y + t * along.z],
                    0.5 * SURFACE_LINE,
                    color,
                );
            }
        }
        dot(picture, [x, y], POINT_DOT, POINT);
    }
}

/// Fills a disc of `radius` picture pixels, as far as it is in the picture.
fn dot(picture: &mut Picture, [u, v]: [f32; 2], radius: f32, color: [u8; 3]) {
    let [width, height] = picture.size.map(|n| n as i32);
    let around = |c: f32| (c - radius).floor() as i32..=(c + radius).ceil() as i32;
    for (x, y) in around(v).flat_map(|y| around(u).map(move |x| (x, y))) {
        let is_inside = (0..width).contains(&x) && (0..height).contains(&y);
        if is_inside && (x as f32 + 0.5 - u).hypot(y as f32 + 0.5 - v) <= radius {
            picture.rgb[(y * width + x) as usize] = color;
        }
    }
}

/// The row with most contact pixels of the first view, in the rows of `views`, or else the middle one.
fn section_row(views: &Views, answer: &Answer) -> i32 {
    let by_query = answer.params.pixel_size / views.params.pixel_size;
    let contacts = (answer.result.contacts.iter()).filter(|contact| contact.view == 0);
    let rows: Vec<i32> = contacts
        .map(|contact| ((contact.pixel[1] as f32 + 0.5) * by_query).floor() as i32)
        .collect();
    let count = |row: i32| rows.iter().filter(|other| **other == row).count();
    let fullest = rows.iter().copied().max_by_key(|row| (count(*row), -*row));
    fullest.unwrap_or(views.origin[1] + views.size[1] as i32 / 2)
}

/// Whether a ray is inside a body at a depth: past a layer where it enters, before the next where it
/// leaves.
fn is_inside(layers: &[Layer], depth: f32) -> bool {
    layers.windows(2).any(|pair| {
        pair[0].facing == Facing::Entry
            && pair[1].facing == Facing::Exit
            && (pair[0].depth..pair[1].depth).contains(&depth)
    })
}

/// A colour mixed with near-white, all of which is at a `share` of 1.
fn faded(color: [u8; 3], share: f32) -> [u8; 3] {
    color.map(|c| (f32::from(c) + (240.0 - f32::from(c)) * share) as u8)
}

fn layer_color(image: &Tldi, views: &Views, [x, y]: [i32; 2], k: usize) -> [u8; 3] {
    let Some(layer) = views.layers_at(image, [x, y]).get(k) else {
        return NOTHING;
    };
    let full = match layer.facing {
        Facing::Entry => ENTRY,
        Facing::Exit => EXIT,
        Facing::Unknown => UNKNOWN,
    };
    let [near, far] = views.depths;
    let farness = (layer.depth - near) / (far - near).max(1e-9);
    let light = (1.0 - 0.5 * farness) * (0.55 + 0.45 * layer.normal.z.abs());
    full.map(|c| (f32::from(c) * light) as u8)
}

fn cross(picture: &mut Picture, [u, v]: [f32; 2]) {
    const ARM: i32 = 5;
    for step in -ARM..=ARM {
        for across in -1..=1 {
            for [dx, dy] in [[step, across], [across, step]] {
                let (x, y) = (u as i32 + dx, v as i32 + dy);
                let [width, height] = picture.size.map(|n| n as i32);
                if (0..width).contains(&x) && (0..height).contains(&y) {
                    let color = if across == 0 {
                        SOLVER_POINT
                    } else {
                        [40, 20, 20]
                    };
                    picture.rgb[(y * width + x) as usize] = color;
                }
            }
        }
    }
}
