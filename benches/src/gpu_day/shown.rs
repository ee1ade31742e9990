//! A scene whose answers are drawn: contact pixels of both backends, and layers that these lie on.

use super::bodies::{Kind, Scene};
use crate::placements::{Placement, Source};
use tldi::glamx::Pose3;
use tldi::{
    Backend, ContactPixel, CpuBackend, PairQuery, PairResult, Surface, Tldi, VirtualCamera, build,
};
use tldi_wgpu::{Gpu, WgpuBackend};

/// A small body in a scan.
const PLACEMENT: Placement = Placement::BodyOnScan;
const POINTS: usize = 100_000;

/// What pictures show of both backends.
pub(crate) struct Shown {
    /// Name of the backend, and its contact pixels.
    pub(crate) contacts: [(&'static str, Vec<ContactPixel>); 2],
    /// Mean radius, metres.
    pub(crate) radius: f32,
    /// One row of pixels of the device's first view.
    pub(crate) section: Section,
}

/// A row of pixels. A place is its column, and its depth along the view in metres.
pub(crate) struct Section {
    /// The row.
    pub(crate) row: i32,
    /// Layers of both clouds, as the CPU draws them along the device's axis.
    pub(crate) layers: [Vec<[f64; 2]>; 2],
    /// Where the contacts that the device found are on both clouds.
    pub(crate) contacts: [Vec<[f64; 2]>; 2],
}

impl Shown {
    /// Compares the scene on both backends.
    pub(super) fn of(gpu: Gpu) -> anyhow::Result<Self> {
        let scene = Scene::new(PLACEMENT, POINTS, Kind::Bare, 1)?;
        let query = scene.query();
        let mut on_device = compared(&mut WgpuBackend::new(gpu)?, &query)?;
        let mut on_cpu = compared(&mut CpuBackend::without_first_look(), &query)?;
        let section = Section::of(&query, &on_device);
        Ok(Self {
            contacts: [
                ("device", std::mem::take(&mut on_device.contacts)),
                ("CPU", std::mem::take(&mut on_cpu.contacts)),
            ],
            radius: Source::Generated(POINTS).radius(PLACEMENT)?,
            section,
        })
    }
}

fn compared(backend: &mut dyn Backend, query: &PairQuery<'_>) -> anyhow::Result<PairResult> {
    let mut results = Vec::new();
    backend.compare(&[*query], &mut results)?;
    Ok(results.swap_remove(0))
}

impl Section {
    /// Of the row with the most contacts.
    fn of(query: &PairQuery<'_>, found: &PairResult) -> Self {
        let of_first_view = || found.contacts.iter().filter(|contact| contact.view == 0);
        let in_row = |row: i32| of_first_view().filter(move |contact| contact.pixel[1] == row);
        let rows = of_first_view().map(|contact| contact.pixel[1]);
        let row = rows.max_by_key(|row| in_row(*row).count()).unwrap_or(0);
        let axis = found.axes.first().copied().unwrap_or(tldi::glamx::Vec3::Z);
        let camera = VirtualCamera::along(axis, query.params.pixel_size);
        let columns = || in_row(row).map(|contact| contact.pixel[0]);
        // As many pixels again on both sides of the contacts.
        let (first, last) = (columns().min().unwrap_or(0), columns().max().unwrap_or(0));
        let beside = last - first + 1;
        let shown = first - beside..=last + beside;
        let layers = |surface: Surface<'_>, frame_from_cloud: &Pose3| match surface {
            Surface::Cloud(cloud) => {
                let image = build(cloud, frame_from_cloud, &camera, &query.params);
                let all = layers_in_row(&image, row).into_iter();
                all.filter(|[column, _]| shown.contains(&(*column as i32)))
                    .collect()
            }
            Surface::Exact(_) | Surface::Device(_) => Vec::new(),
        };
        let depth = |point| f64::from(camera.view_from_point(point).z);
        let places = |of: fn(&ContactPixel) -> tldi::glamx::Vec3| {
            let place = |c: &ContactPixel| [f64::from(c.pixel[0]), depth(of(c))];
            in_row(row).map(place).collect()
        };
        Self {
            row,
            layers: [
                layers(query.a, &Pose3::IDENTITY),
                layers(query.b, &query.a_from_b),
            ],
            contacts: [places(|c| c.point_a), places(|c| c.point_b)],
        }
    }
}

/// All layers of a row of an image.
fn layers_in_row(image: &Tldi, row: i32) -> Vec<[f64; 2]> {
    let [left, top] = image.origin;
    let row = u32::try_from(row - top).unwrap_or(u32::MAX);
    if row >= image.size[1] {
        return Vec::new();
    }
    let columns = 0..image.size[0];
    let of_column = |i: u32| {
        let column = f64::from(left + i as i32);
        let layers = image.layers_at(i, row).iter();
        layers.map(move |layer| [column, f64::from(layer.depth)])
    };
    columns.flat_map(of_column).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use tldi_tests::gpu_backend;

    /// The device's contacts lie on layers that the CPU drew: each within a tenth of a mean radius, five times what random
    /// pairs have.
    #[test]
    fn contacts_lie_on_layers() {
        let Some(backend) = gpu_backend() else {
            return;
        };
        let shown = Shown::of(backend.gpu().clone()).expect("the device works");
        let Section {
            layers, contacts, ..
        } = &shown.section;
        for (layers, contacts) in layers.iter().zip(contacts) {
            assert!(contacts.len() > 3 && layers.len() > contacts.len());
            for [column, depth] in contacts {
                let of_pixel = layers.iter().filter(|layer| layer[0] == *column);
                let nearest = of_pixel.map(|layer| (layer[1] - depth).abs());
                let nearest = nearest.fold(f64::MAX, f64::min);
                assert!(
                    nearest < 0.1 * f64::from(shown.radius),
                    "{column}: {nearest}"
                );
            }
        }
    }
}
