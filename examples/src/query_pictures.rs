//! Pictures of one query: the layers of both images, the contact zone, the contact pixels.

use crate::query::{Answer, CloudQuery};
use crate::query_views::Views;
use std::collections::HashMap;
use tldi::glamx::{Pose3, Vec3};
use tldi::{CloudError, ContactPixel, Facing, KdTree, PointCloud, Tldi, VirtualCamera};
use tldi_pictures::sheet::{Key, Panel, sheet};
use tldi_pictures::viewpoint;
use tldi_pictures::{BODY_COLORS, Item, Picture, Scene, painted};

/// Width or height in picture pixels that panels are enlarged to, at most: a layer, and contact pixels.
const LAYER_EDGE: u32 = 320;
const CONTACTS_EDGE: u32 = 560;
/// Layers of an image that are shown.
const SHOWN_LAYERS: usize = 4;
/// Views of a pair whose contact pixels are shown.
const SHOWN_VIEWS: usize = 3;
/// Distance in mean radii up to which points are near the other cloud.
const ZONE_REACH: f32 = 6.0;
/// Where there is no cloud.
pub(crate) const NOTHING: [u8; 3] = [228, 231, 236];
/// Where a ray enters a body, leaves it, and where the cloud does not tell.
const ENTRY: [u8; 3] = [240, 140, 60];
const EXIT: [u8; 3] = [80, 140, 230];
const UNKNOWN: [u8; 3] = [190, 190, 190];
/// Behind contact pixels: both clouds are there, only one, only the other.
const BOTH: [u8; 3] = [196, 200, 206];
const ONLY: [[u8; 3]; 2] = [[226, 214, 204], [206, 216, 228]];
/// Full penetration, a full gap, and points of the solver.
pub(crate) const DEEP: [u8; 3] = [235, 30, 20];
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
    let views = 0..answer.result.axes.len().clamp(1, SHOWN_VIEWS);
    let panels = views
        .map(|view| contact_panel(query, answer, view))
        .collect();
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
        Key::new(
            WIDE,
            format!(
                "gap, up to {} counts",
                millimetres(answer.params.prediction)
            ),
        ),
        Key::new(SOLVER_POINT, "crosses: points for the solver"),
        Key::new(ONLY[0], "only A is there"),
        Key::new(ONLY[1], "only B is there"),
        Key::new(BOTH, "both are there, out of reach of each other"),
    ];
    sheet(&[panels], &legend)
}

/// The contact pixels of one view.
fn contact_panel(query: &CloudQuery, answer: &Answer, view: usize) -> Panel {
    let contacts: Vec<&ContactPixel> = (answer.result.contacts.iter())
        .filter(|contact| contact.view as usize == view)
        .collect();
    let views = Views::of_contacts(query, answer, view, &contacts);
    let images = views.images(query);
    // Of several on one pixel, the first.
    let at_pixel: HashMap<[i32; 2], &ContactPixel> = (contacts.iter().rev())
        .map(|contact| (contact.pixel, *contact))
        .collect();
    let mut picture = views.panel(CONTACTS_EDGE, |x, y| {
        let covered = (images.each_ref()).map(|image| !views.layers_at(image, [x, y]).is_empty());
        let Some(contact) = at_pixel.get(&[x, y]) else {
            return match covered {
                [true, true] => BOTH,
                [true, false] => ONLY[0],
                [false, true] => ONLY[1],
                _ => NOTHING,
            };
        };
        let strength = (contact.gap.abs() / answer.params.prediction).min(1.0);
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
}

/// A colour mixed with near-white, all of which is at a `share` of 1.
pub(crate) fn faded(color: [u8; 3], share: f32) -> [u8; 3] {
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
            let color = match across {
                0 => SOLVER_POINT,
                _ => [40, 20, 20],
            };
            for [dx, dy] in [[step, across], [across, step]] {
                set_pixel(picture, [u as i32 + dx, v as i32 + dy], color);
            }
        }
    }
}

/// Colours a pixel, if the picture has it.
pub(crate) fn set_pixel(picture: &mut Picture, [x, y]: [i32; 2], color: [u8; 3]) {
    let [width, height] = picture.size.map(|n| n as i32);
    if (0..width).contains(&x) && (0..height).contains(&y) {
        picture.rgb[(y * width + x) as usize] = color;
    }
}
