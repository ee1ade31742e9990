//! What the stories draw and record: things by their names.

use tldi::glamx::{Pose3, Vec3};
use tldi::{CloudError, PointCloud};
use tldi_pictures::{Item, Scene, thinned};

/// Columns and rows of a picture.
pub const PICTURE_SIZE: [u32; 2] = [1280, 720];
/// Those of an animation: a page shows it at this size, and four times the pixels make four times the file.
pub const ANIMATION_SIZE: [u32; 2] = [640, 360];
/// Radius in mean radii up to which points of a scan are drawn.
const LARGEST_DRAWN_RADIUS: f32 = 3.0;

/// A name, and what has it.
pub type Entity<'a> = (String, Item<'a>);

/// A scan to be drawn. Lone points, such as a depth camera's flying pixels, have far larger radii than others; they
/// become smaller, so as not to hide what is behind them.
///
/// # Errors
/// None for a scan that is valid.
pub fn drawable(scan: &PointCloud<'_>) -> Result<PointCloud<'static>, CloudError> {
    let most = LARGEST_DRAWN_RADIUS * scan.mean_radius();
    thinned(scan, 1, |radius| radius.min(most))
}

/// Bodies, numbered from 1, in one colour after the other.
pub fn bodies<'a>(
    clouds: impl Iterator<Item = &'a PointCloud<'static>>,
    scene_from_body: &[Pose3],
    colors: &[[f32; 3]],
) -> impl Iterator<Item = Entity<'a>> {
    let colors = colors.iter().cycle();
    (clouds.zip(scene_from_body).zip(colors).enumerate()).map(|(k, ((cloud, pose), color))| {
        let name = format!("bodies/{}", k + 1);
        (name, Item::body(cloud, *pose, *color))
    })
}

/// A scene with these things. `up` is a unit vector, `detail` the size in metres of what it is about.
pub fn scene<'a>(things: impl IntoIterator<Item = Entity<'a>>, up: Vec3, detail: f32) -> Scene<'a> {
    Scene {
        items: things.into_iter().map(|(_, item)| item).collect(),
        up,
        detail,
    }
}
