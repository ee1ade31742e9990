//! Pictures of one query: the layers of both images, a cut through them, the contact zone, the contact
//! pixels.

use crate::query::{Answer, CloudQuery};
use tldi::glamx::{Pose3, Vec3};
use tldi::{
    CloudError, ContactPixel, Facing, KdTree, Layer, Params, PointCloud, Tldi, VirtualCamera,
};
use tldi_pictures::sheet::{Key, Panel, sheet};
use tldi_pictures::viewpoint;
use tldi_pictures::{BODY_COLORS, Item, Paint, Picture, Scene, painted};

/// Most pixels along an edge of a layer's panel before it is enlarged.
const PANEL_PIXELS: u32 = 320;
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
    let item = |cloud, scene_from_cloud, color| Item {
        cloud,
        scene_from_cloud,
        paint: Paint::Body(color),
    };
    Scene {
        items: vec![
            item(a, Pose3::IDENTITY, BODY_COLORS[0]),
            item(b, query.a_from_b, BODY_COLORS[1]),
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

/// A cut through both images along a row of pixels, seen from the side: the rays go down. Dark: the
/// surface of each layer; medium: what was merged into it, from nearest to farthest; pale: between a layer
/// where the ray enters a body and the next where it leaves it, red where that is so of both. The row is
/// that with most contact pixels, or the middle one.
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
    let rgb = (0..height)
        .flat_map(|y| (0..width).map(move |x| (x, y)))
        // A gap between the columns shows the rays.
        .map(|(x, y)| match x % enlarged {
            0 if enlarged > 2 => NOTHING,
            _ => color_at(&columns[(x / enlarged) as usize], y),
        })
        .collect();
    let picture = Picture {
        size: [width, height],
        rgb,
    };
    let legend = [
        Key::new(SIDES[0], "surface of A in each layer, pale inside of A"),
        Key::new(SIDES[1], "surface of B, and inside of it"),
        Key::new(faded(DEEP, 0.3), "inside both: penetration"),
    ];
    let caption = "one row of pixels from the side: the rays go down".to_owned();
    sheet(&[vec![Panel { picture, caption }]], &legend)
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

/// A rectangle of a view's pixels that both images are shown in.
struct Views {
    camera: VirtualCamera,
    params: Params,
    origin: [i32; 2],
    size: [u32; 2],
    /// Nearest and farthest depth of both clouds, metres.
    depths: [f32; 2],
}

impl Views {
    /// All of both clouds, in coarser pixels than the query's where there would be too many.
    fn new(query: &CloudQuery, answer: &Answer) -> Self {
        let axis = axis_of(query, answer, 0);
        let fine = Self::around(query, axis, answer.params.pixel_size, answer.params);
        let deep = (fine.depths[1] - fine.depths[0]) / answer.params.pixel_size;
        let pixels = deep.max(fine.size[0].max(fine.size[1]) as f32);
        let pixel_size = answer.params.pixel_size * (pixels / PANEL_PIXELS as f32).max(1.0);
        let params = answer.params.with_pixel_size(pixel_size);
        Self::around(query, axis, pixel_size, params)
    }

    /// The contact pixels of a view and their surroundings, in the query's pixels, as far as a panel holds them.
    fn of_contacts(
        query: &CloudQuery,
        answer: &Answer,
        view: usize,
        contacts: &[&ContactPixel],
    ) -> Self {
        let axis = axis_of(query, answer, view);
        let mut views = Self::around(query, axis, answer.params.pixel_size, answer.params);
        if contacts.is_empty() {
            return Self::new(query, answer);
        }
        // As many as a panel holds, around the middle one of them.
        let range = |k: usize| {
            let mut pixels: Vec<i32> = contacts.iter().map(|contact| contact.pixel[k]).collect();
            pixels.sort_unstable();
            let middle = pixels[pixels.len() / 2];
            let half = PANEL_PIXELS as i32 / 2;
            let shown = |p: i32| p.clamp(middle.saturating_sub(half), middle.saturating_add(half));
            (shown(pixels[0]), shown(pixels[pixels.len() - 1]))
        };
        for k in 0..2 {
            let (least, most) = range(k);
            let margin = 6 + (most - least) / 4;
            views.origin[k] = least - margin;
            views.size[k] = (most - least + 1 + 2 * margin) as u32;
        }
        views
    }

    fn around(query: &CloudQuery, axis: Vec3, pixel_size: f32, params: Params) -> Self {
        let camera = VirtualCamera::along(axis, pixel_size);
        let seen = |bounds: tldi::Aabb, pose: &Pose3| {
            bounds.transformed(&(camera.view_from_frame * *pose))
        };
        let both = seen(query.a.bounds(), &Pose3::IDENTITY)
            .merged(seen(query.b.bounds(), &query.a_from_b));
        let low = [both.min.x, both.min.y].map(|c| (c / pixel_size).floor() as i32 - 2);
        let high = [both.max.x, both.max.y].map(|c| (c / pixel_size).ceil() as i32 + 2);
        Self {
            camera,
            params,
            origin: low,
            size: [0, 1].map(|k| (high[k] - low[k]).max(1) as u32),
            depths: [both.min.z, both.max.z],
        }
    }

    /// Of the pixels of the rectangle, which are counted from its first one.
    fn images(&self, query: &CloudQuery) -> [Tldi; 2] {
        let mut camera = self.camera;
        let first = self.origin.map(|c| c as f32 * self.params.pixel_size);
        camera.view_from_frame.translation -= Vec3::new(first[0], first[1], 0.0);
        camera.size = Some(self.size);
        let poses = [Pose3::IDENTITY, query.a_from_b];
        [(&query.a, poses[0]), (&query.b, poses[1])]
            .map(|(cloud, pose)| tldi::build(cloud, &pose, &camera, &self.params))
    }

    /// The layers of an image at a pixel of the view.
    fn layers_at<'a>(&self, image: &'a Tldi, pixel: [i32; 2]) -> &'a [Layer] {
        let [i, j] = [0, 1].map(|k| pixel[k] - self.origin[k] - image.origin[k]);
        let inside = i >= 0 && j >= 0 && i < image.size[0] as i32 && j < image.size[1] as i32;
        if inside {
            image.layers_at(i as u32, j as u32)
        } else {
            &[]
        }
    }

    /// Picture pixels along the edge of a pixel of the view, in a panel of up to `edge` picture pixels.
    fn enlargement(&self, edge: u32) -> u32 {
        (edge / self.size[0].max(self.size[1])).max(1)
    }

    /// A picture of the rectangle, enlarged up to `edge` picture pixels; `color` gets columns and rows
    /// of the view.
    fn panel(&self, edge: u32, color: impl Fn(i32, i32) -> [u8; 3]) -> Picture {
        let enlarged = self.enlargement(edge);
        let size = self.size.map(|n| n * enlarged);
        let colors: Vec<[u8; 3]> = (0..self.size[1] as i32)
            .flat_map(|j| (0..self.size[0] as i32).map(move |i| (i, j)))
            .map(|(i, j)| color(self.origin[0] + i, self.origin[1] + j))
            .collect();
        let rgb = (0..size[1])
            .flat_map(|y| (0..size[0]).map(move |x| (x, y)))
            .map(|(x, y)| colors[(y / enlarged * self.size[0] + x / enlarged) as usize])
            .collect();
        Picture { size, rgb }
    }
}

/// The axis of a view or, for clouds that are out of reach of each other, from `b` to `a`.
fn axis_of(query: &CloudQuery, answer: &Answer, view: usize) -> Vec3 {
    let apart = query.a.bounds().center() - query.a_from_b * query.b.bounds().center();
    let axes = &answer.result.axes;
    axes.get(view)
        .copied()
        .unwrap_or_else(|| apart.normalize_or(Vec3::Z))
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
