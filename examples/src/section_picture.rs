//! A picture of how points become layers: a row of pixels from the side.

use crate::query::{Answer, CloudQuery};
use crate::query_pictures::{DEEP, NOTHING, faded, set_pixel};
use crate::query_views::Views;
use std::collections::HashMap;
use tldi::glamx::{Pose3, Vec3};
use tldi::{Facing, Layer, PointCloud};
use tldi_pictures::Picture;
use tldi_pictures::sheet::{Key, Panel, sheet};

/// Width in picture pixels that the row is enlarged to, at most.
const WIDTH: u32 = 960;
/// A and B, and half the width of the line of a surface, in picture pixels.
const SIDES: [[u8; 3]; 2] = [[214, 92, 30], [40, 116, 200]];
const SURFACE_LINE: f32 = 1.6;
/// A point, its radius in picture pixels, and the width of the line between points and layers.
const POINT: [u8; 3] = [40, 44, 52];
const POINT_DOT: f32 = 2.0;
const DIVIDER: u32 = 2;

/// How points become layers: a row of pixels from the side. The rays go down.
///
/// The left half shows the points in the row, each as a disc. The right half shows the layers. Dark is the
/// surface of a layer, medium the fragments merged into it, from nearest to farthest. Pale is inside a body, red
/// inside both. The row is the one with most contact pixels, or the middle one.
pub fn section(query: &CloudQuery, answer: &Answer) -> Picture {
    let views = Views::new(query, answer);
    let images = views.images(query);
    let row = fullest_row(&views, answer);
    let x_of = |column: u32| views.origin[0] + column as i32;
    let columns: Vec<[&[Layer]; 2]> = (0..views.size[0])
        .map(|column| (images.each_ref()).map(|image| views.layers_at(image, [x_of(column), row])))
        .collect();
    let section = Section::new(&views, row, &columns);
    let mut picture = section.layers(&columns);
    let poses = [Pose3::IDENTITY, query.a_from_b];
    for ((cloud, pose), color) in [&query.a, &query.b].into_iter().zip(poses).zip(SIDES) {
        let view_from_cloud = views.camera.view_from_frame * pose;
        section.draw_points(&mut picture, cloud, &view_from_cloud, color);
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

/// The row with most contact pixels of the first view, in the rows of `views`, or else the middle one.
fn fullest_row(views: &Views, answer: &Answer) -> i32 {
    let by_query = answer.params.pixel_size / views.params.pixel_size;
    let contacts = (answer.result.contacts.iter()).filter(|contact| contact.view == 0);
    let mut counts: HashMap<i32, usize> = HashMap::new();
    for contact in contacts {
        let row = ((contact.pixel[1] as f32 + 0.5) * by_query).floor() as i32;
        *counts.entry(row).or_default() += 1;
    }
    let fullest = counts
        .into_iter()
        .max_by_key(|(row, count)| (*count, -*row));
    let middle = views.origin[1] + views.size[1] as i32 / 2;
    fullest.map_or(middle, |(row, _)| row)
}

/// How a row is enlarged.
struct Section<'a> {
    views: &'a Views,
    row: i32,
    /// Depth of the first layer, metres.
    near: f32,
    /// Columns and rows of the picture.
    size: [u32; 2],
    /// Picture pixels along the edge of a pixel of the view.
    enlarged: u32,
    /// Picture pixels a metre, along the rays as across them.
    scale: f32,
    /// Picture pixels above the first layer and below the last one.
    margin: f32,
}

impl<'a> Section<'a> {
    fn new(views: &'a Views, row: i32, columns: &[[&[Layer]; 2]]) -> Self {
        let ends = columns.iter().flatten().copied().flatten();
        let (near, far) = ends.fold((f32::MAX, f32::MIN), |(near, far), layer| {
            (near.min(layer.near), far.max(layer.far))
        });
        let enlarged = views.enlargement(WIDTH);
        let scale = enlarged as f32 / views.params.pixel_size;
        let margin = 4.0 * enlarged as f32;
        let height = ((far - near).max(0.0) * scale + 2.0 * margin) as u32;
        Self {
            views,
            row,
            near,
            size: [views.size[0] * enlarged, height],
            enlarged,
            scale,
            margin,
        }
    }

    /// The layers, in the right half.
    fn layers(&self, columns: &[[&[Layer]; 2]]) -> Picture {
        let [width, height] = self.size;
        let middle = width / 2;
        let rgb = (0..height)
            .flat_map(|y| (0..width).map(move |x| (x, y)))
            // A gap between the columns shows the rays.
            .map(|(x, y)| match x % self.enlarged {
                _ if x < middle => NOTHING,
                _ if x < middle + DIVIDER => POINT,
                0 if self.enlarged > 2 => NOTHING,
                _ => self.color_at(&columns[(x / self.enlarged) as usize], y),
            })
            .collect();
        let size = self.size;
        Picture { size, rgb }
    }

    /// The colour of layers in a row of the picture.
    fn color_at(&self, layers: &[&[Layer]; 2], y: u32) -> [u8; 3] {
        let depth = self.near + (y as f32 + 0.5 - self.margin) / self.scale;
        let half_line = SURFACE_LINE / self.scale;
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
    }

    /// Draws the points of the row into the left half, each with its disc from the side.
    fn draw_points(
        &self,
        picture: &mut Picture,
        cloud: &PointCloud<'_>,
        view_from_cloud: &Pose3,
        color: [u8; 3],
    ) {
        let middle = self.size[0] / 2;
        for i in 0..cloud.len() {
            let point = *view_from_cloud * cloud.point(i);
            let [u, v] = self.views.camera.pixel_from_view(point);
            let x = (u - self.views.origin[0] as f32) * self.enlarged as f32;
            let is_in_row = (v - self.row as f32 - 0.5).abs() <= 0.5;
            if !is_in_row || x >= middle as f32 {
                continue;
            }
            let y = (point.z - self.near) * self.scale + self.margin;
            if let Some(normals) = cloud.normals() {
                // Where the disc's plane cuts that of the picture.
                let along = (view_from_cloud.rotation * normals[i])
                    .cross(Vec3::Y)
                    .normalize_or_zero();
                let radius = cloud.radius(i) * self.scale;
                for step in 0..=(4.0 * radius) as u32 {
                    let t = 0.5 * step as f32 - radius;
                    let place = [x + t * along.x, y + t * along.z];
                    dot(picture, place, 0.5 * SURFACE_LINE, color);
                }
            }
            dot(picture, [x, y], POINT_DOT, POINT);
        }
    }
}

/// Fills a disc of `radius` picture pixels, as far as it is in the picture.
fn dot(picture: &mut Picture, [u, v]: [f32; 2], radius: f32, color: [u8; 3]) {
    let around = |c: f32| (c - radius).floor() as i32..=(c + radius).ceil() as i32;
    for (x, y) in around(v).flat_map(|y| around(u).map(move |x| (x, y))) {
        if (x as f32 + 0.5 - u).hypot(y as f32 + 0.5 - v) <= radius {
            set_pixel(picture, [x, y], color);
        }
    }
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
