//! Pictures of one query: the layers of both images, the contact zone, the contact pixels.

use crate::load;
use crate::query::{Answer, CloudQuery};
use crate::render::{BODY_COLORS, Item, Paint, Picture, Scene};
use crate::viewpoint;
use tldi::glamx::{Pose3, Vec3};
use tldi::{
    CloudError, ContactPixel, Facing, KdTree, Layer, Params, PointCloud, Tldi, VirtualCamera,
};

/// Most pixels along an edge of a layer's panel before it is enlarged.
const PANEL_PIXELS: u32 = 320;
/// Width or height in picture pixels that panels are enlarged to, at most.
const PANEL_EDGE: u32 = 320;
/// Layers of an image that are shown.
const SHOWN_LAYERS: usize = 4;
/// Views of a pair whose contact pixels are shown.
const SHOWN_VIEWS: usize = 3;
/// Distance in mean radii up to which points are near the other cloud.
const ZONE_REACH: f32 = 6.0;
/// Space between panels in picture pixels.
const PANEL_SPACE: u32 = 8;
const PAPER: [u8; 3] = [250, 250, 250];
const NOTHING: [u8; 3] = [228, 231, 236];

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
        load::painted(cloud, |i| {
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
    let rows = images.each_ref().map(|image| {
        (0..columns)
            .map(|k| views.panel(|x, y| layer_color(image, &views, [x, y], k)))
            .collect::<Vec<_>>()
    });
    mosaic(&rows)
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
        let mut picture = views.panel(|x, y| {
            let covered = images
                .each_ref()
                .map(|image| !views.layers_at(image, [x, y]).is_empty());
            let Some(contact) = contacts.iter().find(|c| c.pixel == [x, y]) else {
                return match covered {
                    [true, true] => [196, 200, 206],
                    [true, false] => [226, 214, 204],
                    [false, true] => [206, 216, 228],
                    _ => NOTHING,
                };
            };
            let strength = (contact.gap.abs() / scale).min(1.0);
            let faded =
                |full: u8| (f32::from(full) + (235.0 - f32::from(full)) * (1.0 - strength)) as u8;
            if contact.gap < 0.0 {
                [235, faded(30), faded(20)]
            } else {
                [faded(30), faded(90), 235]
            }
        });
        let enlarged = views.enlargement();
        for contact in &answer.report.contacts {
            let seen = views.camera.view_from_point(Vec3::from(contact.point));
            let [u, v] = views.camera.pixel_from_view(seen);
            let place = [u - views.origin[0] as f32, v - views.origin[1] as f32];
            cross(&mut picture, place.map(|c| c * enlarged as f32));
        }
        picture
    });
    mosaic(&[panels.collect()])
}

fn layer_color(image: &Tldi, views: &Views, [x, y]: [i32; 2], k: usize) -> [u8; 3] {
    let Some(layer) = views.layers_at(image, [x, y]).get(k) else {
        return NOTHING;
    };
    let full = match layer.facing {
        Facing::Entry => [240.0, 140.0, 60.0],
        Facing::Exit => [80.0, 140.0, 230.0],
        Facing::Unknown => [190.0, 190.0, 190.0],
    };
    let [near, far] = views.depths;
    let farness = (layer.depth - near) / (far - near).max(1e-9);
    let light = (1.0 - 0.5 * farness) * (0.55 + 0.45 * layer.normal.z.abs());
    full.map(|c| (c * light) as u8)
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
        let pixels = fine.size[0].max(fine.size[1]);
        let pixel_size = answer.params.pixel_size * (pixels as f32 / PANEL_PIXELS as f32).max(1.0);
        let params = answer.params.with_pixel_size(pixel_size);
        Self::around(query, axis, pixel_size, params)
    }

    /// The contact pixels of a view and their surroundings, in the query's pixels.
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
        let range = |k: usize| {
            let pixels = contacts.iter().map(|contact| contact.pixel[k]);
            pixels.fold((i32::MAX, i32::MIN), |(least, most), p| {
                (least.min(p), most.max(p))
            })
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

    fn images(&self, query: &CloudQuery) -> [Tldi; 2] {
        let poses = [Pose3::IDENTITY, query.a_from_b];
        [(&query.a, poses[0]), (&query.b, poses[1])]
            .map(|(cloud, pose)| tldi::build(cloud, &pose, &self.camera, &self.params))
    }

    /// The layers of an image at a pixel of the view.
    fn layers_at<'a>(&self, image: &'a Tldi, pixel: [i32; 2]) -> &'a [Layer] {
        let [i, j] = [0, 1].map(|k| pixel[k] - image.origin[k]);
        let inside = i >= 0 && j >= 0 && i < image.size[0] as i32 && j < image.size[1] as i32;
        if inside {
            image.layers_at(i as u32, j as u32)
        } else {
            &[]
        }
    }

    /// Picture pixels along the edge of a pixel of the view.
    fn enlargement(&self) -> u32 {
        (PANEL_EDGE / self.size[0].max(self.size[1])).max(1)
    }

    /// A picture of the rectangle; `color` gets columns and rows of the view.
    fn panel(&self, color: impl Fn(i32, i32) -> [u8; 3]) -> Picture {
        let enlarged = self.enlargement();
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

/// Panels in rows, with space between them.
fn mosaic(rows: &[Vec<Picture>]) -> Picture {
    let width_of = |row: &Vec<Picture>| {
        let panels: u32 = row.iter().map(|panel| panel.size[0] + PANEL_SPACE).sum();
        panels + PANEL_SPACE
    };
    let height_of = |row: &Vec<Picture>| row.iter().map(|panel| panel.size[1]).max().unwrap_or(0);
    let width = rows.iter().map(width_of).max().unwrap_or(1);
    let heights = rows.iter().map(|row| height_of(row) + PANEL_SPACE);
    let height = heights.sum::<u32>() + PANEL_SPACE;
    let mut rgb = vec![PAPER; (width * height) as usize];
    let mut top = PANEL_SPACE;
    for row in rows {
        let mut left = PANEL_SPACE;
        for panel in row {
            let [columns, panel_rows] = panel.size;
            for y in 0..panel_rows {
                let from = (y * columns) as usize;
                let to = ((top + y) * width + left) as usize;
                rgb[to..to + columns as usize]
                    .copy_from_slice(&panel.rgb[from..from + columns as usize]);
            }
            left += columns + PANEL_SPACE;
        }
        top += height_of(row) + PANEL_SPACE;
    }
    Picture {
        size: [width, height],
        rgb,
    }
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
                        [255, 230, 40]
                    } else {
                        [40, 20, 20]
                    };
                    picture.rgb[(y * width + x) as usize] = color;
                }
            }
        }
    }
}
