//! The part of a view that a picture of a query shows.

use crate::query::{Answer, CloudQuery};
use tldi::glamx::{Pose3, Vec3};
use tldi::{ContactPixel, Layer, Params, Tldi, VirtualCamera};
use tldi_pictures::Picture;

/// Most pixels along an edge of a layer's panel before it is enlarged.
const PANEL_PIXELS: u32 = 320;

/// A rectangle of a view's pixels that both images are shown in.
pub(crate) struct Views {
    pub(crate) camera: VirtualCamera,
    pub(crate) params: Params,
    pub(crate) origin: [i32; 2],
    pub(crate) size: [u32; 2],
    /// Nearest and farthest depth of both clouds, metres.
    pub(crate) depths: [f32; 2],
}

impl Views {
    /// All of both clouds, in coarser pixels than the query's where there would be too many.
    pub(crate) fn new(query: &CloudQuery, answer: &Answer) -> Self {
        let axis = axis_of(query, answer, 0);
        let fine = Self::around(query, axis, answer.params.pixel_size, answer.params);
        let deep = (fine.depths[1] - fine.depths[0]) / answer.params.pixel_size;
        let pixels = deep.max(fine.size[0].max(fine.size[1]) as f32);
        let pixel_size = answer.params.pixel_size * (pixels / PANEL_PIXELS as f32).max(1.0);
        let params = answer.params.with_pixel_size(pixel_size);
        Self::around(query, axis, pixel_size, params)
    }

    /// The contact pixels of a view and their surroundings, in the query's pixels, as far as a panel holds them.
    pub(crate) fn of_contacts(
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
    pub(crate) fn images(&self, query: &CloudQuery) -> [Tldi; 2] {
        let mut camera = self.camera;
        let first = self.origin.map(|c| c as f32 * self.params.pixel_size);
        camera.view_from_frame.translation -= Vec3::new(first[0], first[1], 0.0);
        camera.size = Some(self.size);
        let poses = [Pose3::IDENTITY, query.a_from_b];
        [(&query.a, poses[0]), (&query.b, poses[1])]
            .map(|(cloud, pose)| tldi::build(cloud, &pose, &camera, &self.params))
    }

    /// The layers of an image at a pixel of the view.
    pub(crate) fn layers_at<'a>(&self, image: &'a Tldi, pixel: [i32; 2]) -> &'a [Layer] {
        let [i, j] = [0, 1].map(|k| pixel[k] - self.origin[k] - image.origin[k]);
        let inside = i >= 0 && j >= 0 && i < image.size[0] as i32 && j < image.size[1] as i32;
        if inside {
            image.layers_at(i as u32, j as u32)
        } else {
            &[]
        }
    }

    /// Picture pixels along the edge of a pixel of the view, in a panel of up to `edge` picture pixels.
    pub(crate) fn enlargement(&self, edge: u32) -> u32 {
        (edge / self.size[0].max(self.size[1])).max(1)
    }

    /// A picture of the rectangle, enlarged up to `edge` picture pixels; `color` gets columns and rows
    /// of the view.
    pub(crate) fn panel(&self, edge: u32, color: impl Fn(i32, i32) -> [u8; 3]) -> Picture {
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
