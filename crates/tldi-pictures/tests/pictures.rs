//! What is seen in the pictures of a scene, and from where.

use std::f32::consts::FRAC_PI_2;
use tldi::glamx::{Pose3, Quat, Vec3};
use tldi::{PointCloud, VirtualCamera};
use tldi_pictures::viewpoint;
use tldi_pictures::{Item, Paint, Picture, Scene};

const SIZE: [u32; 2] = [320, 180];
/// Distance of neighbouring points, metres.
const SPACING: f32 = 0.02;

/// Points of a rectangle with corners at `corner`, `corner + u` and `corner + v`.
fn rectangle(corner: Vec3, u: Vec3, v: Vec3) -> Vec<Vec3> {
    let [columns, rows] = [u, v].map(|edge| (edge.length() / SPACING) as usize);
    (0..columns * rows)
        .map(|k| {
            let [i, j] = [k % columns, k / columns].map(|k| k as f32);
            corner + u * (i / columns as f32) + v * (j / rows as f32)
        })
        .collect()
}

fn cloud(points: Vec<Vec3>) -> PointCloud<'static> {
    let builder = PointCloud::builder(points).radius(SPACING).pca_normals(12);
    builder.build().unwrap().into_owned()
}

/// A level square about the origin, metres.
fn square(edge: f32) -> Vec<Vec3> {
    let corner = Vec3::new(-0.5 * edge, -0.5 * edge, 0.0);
    rectangle(corner, edge * Vec3::X, edge * Vec3::Y)
}

fn item<'a>(cloud: &'a PointCloud<'static>, at: Vec3, paint: Paint) -> Item<'a> {
    Item {
        cloud,
        scene_from_cloud: Pose3::from_translation(at),
        paint,
    }
}

fn scene<'a>(items: &[Item<'a>]) -> Scene<'a> {
    Scene {
        items: items.to_vec(),
        up: Vec3::Z,
        detail: 0.3,
    }
}

const RED: Paint = Paint::Body([0.9, 0.1, 0.1]);
const BLUE: Paint = Paint::Body([0.1, 0.1, 0.9]);

fn is_red([r, g, b]: [u8; 3]) -> bool {
    i32::from(r) > 60 + i32::from(g.max(b))
}

fn is_blue([r, g, b]: [u8; 3]) -> bool {
    i32::from(b) > 60 + i32::from(r.max(g))
}

/// The colour where a point of the scene is seen; `None` outside the picture.
fn seen_at(picture: &Picture, camera: &VirtualCamera, point: Vec3) -> Option<[u8; 3]> {
    let view = camera.view_from_point(point);
    let [x, y] = camera.pixel_from_view(view).map(|c| c.floor() as i64);
    let [width, height] = picture.size.map(i64::from);
    let inside = (0..width).contains(&x) && (0..height).contains(&y) && view.z > 0.0;
    inside.then(|| picture.rgb[(y * width + x) as usize])
}

/// A camera 4 m over the origin, almost straight down.
fn from_above() -> VirtualCamera {
    let eye = Vec3::new(0.0, -0.4, 4.0);
    VirtualCamera::perspective(eye, Vec3::ZERO, Vec3::Z, 0.8, SIZE, 0.1, 100.0)
}

#[test]
fn the_nearest_cloud_is_seen_and_shades_what_is_below() {
    let (floor, tile) = (cloud(square(3.0)), cloud(square(0.4)));
    let items = [
        item(&floor, Vec3::ZERO, Paint::Scan),
        item(&tile, 0.3 * Vec3::Z, RED),
        // Under the red one.
        item(&tile, Vec3::new(0.1, 0.0, 0.15), BLUE),
    ];
    let camera = from_above();
    let contact = Vec3::new(-1.0, 0.3, 0.0);
    let mut reversed = items;
    reversed.reverse();
    for order in [items, reversed] {
        let picture = scene(&order).draw(&camera, &[contact]);
        assert_eq!(picture.size, SIZE);
        let seen = |p: Vec3| seen_at(&picture, &camera, p).expect("it is in view");
        assert!(is_red(seen(Vec3::new(0.05, 0.0, 0.3))));
        assert!(is_blue(seen(Vec3::new(0.26, 0.0, 0.15))));
        for beside in [Vec3::new(-0.5, 0.0, 0.0), Vec3::new(0.8, 0.3, 0.0)] {
            let color = seen(beside);
            assert!(!is_red(color) && !is_blue(color), "{color:?}");
        }
        // The mark of a contact.
        assert_eq!(seen(contact), [255, 230, 40]);
    }
    // The tile's shadow makes some of the floor darker than the same floor without it.
    let bare = scene(&[items[0]]).draw(&camera, &[]);
    let with_tile = scene(&items[..2]).draw(&camera, &[]);
    let brightness = |c: &[u8; 3]| c.iter().map(|v| i32::from(*v)).sum::<i32>();
    let darker = (bare.rgb.iter().zip(&with_tile.rgb))
        .filter(|(before, after)| !is_red(**after) && brightness(after) + 40 < brightness(before));
    assert!(darker.count() > 50);
}

/// What lies far below another surface is a faint ring, what lies just below it a dot: a contact is always between
/// two surfaces.
#[test]
fn contacts_that_something_hides_are_rings() {
    let (floor, tile) = (cloud(square(3.0)), cloud(square(0.4)));
    let items = [
        item(&floor, Vec3::ZERO, Paint::Scan),
        item(&tile, 0.3 * Vec3::Z, RED),
    ];
    let camera = from_above();
    let bare = scene(&items).draw(&camera, &[]);
    let yellow = [255, 230, 40];
    // Under the tile: on the floor, and 2 cm below the tile itself, of 30 cm of detail.
    for (height, is_hidden) in [(0.0, true), (0.28, false)] {
        let contact = Vec3::new(0.0, 0.0, height);
        let picture = scene(&items).draw(&camera, &[contact]);
        let at = seen_at(&picture, &camera, contact).expect("it is in view");
        let under = seen_at(&bare, &camera, contact).expect("it is in view");
        let changed = picture.rgb.iter().zip(&bare.rgb).filter(|(a, b)| a != b);
        let (dots, rest): (Vec<_>, Vec<_>) = changed.partition(|(color, _)| **color == yellow);
        assert_eq!(at, if is_hidden { under } else { yellow });
        assert_eq!(dots.is_empty(), is_hidden, "{} pixels", dots.len());
        // The ring, or the dark rim of the dot.
        assert!(rest.len() > 8, "{} pixels", rest.len());
    }
}

/// Parallel rays see the same from however far behind: lights, and marks of contacts.
#[test]
fn a_camera_of_parallel_rays_sees_the_same_from_everywhere() {
    let (floor, tile) = (cloud(square(3.0)), cloud(square(0.4)));
    let middle = Vec3::new(1.5, 0.75, 0.0);
    let from_behind = |away: f32| {
        let at = |height: f32| middle + (height - away) * Vec3::Z;
        let items = [item(&floor, at(0.0), BLUE), item(&tile, at(0.3), RED)];
        let mut camera = VirtualCamera::along(-Vec3::Z, 3.0 / SIZE[0] as f32);
        camera.size = Some(SIZE);
        // The image begins at the view frame's origin.
        let seen = camera.view_from_point(middle);
        let shift = Vec3::new(1.5 - seen.x, 0.75 - seen.y, 0.0);
        camera.view_from_frame.translation += shift;
        scene(&items).draw(&camera, &[at(0.31)])
    };
    // Depths below 0, and above it.
    let [before, behind] = [-8.0, 8.0].map(from_behind);
    assert!(before.rgb.contains(&[255, 230, 40]));
    let differ = |(a, b): &(&[u8; 3], &[u8; 3])| (0..3).any(|c| a[c].abs_diff(b[c]) > 8);
    let differing = before.rgb.iter().zip(&behind.rgb).filter(differ).count();
    assert!(differing * 100 < before.rgb.len(), "{differing} pixels");
}

/// Contacts that a picture does not hold leave no mark, however far they are beside it.
#[test]
fn contacts_beside_the_picture_leave_no_mark() {
    let tile = cloud(square(0.4));
    let items = [item(&tile, 4.0 * Vec3::Z, RED)];
    let camera = VirtualCamera::perspective(Vec3::ZERO, Vec3::Z, -Vec3::Y, 0.8, SIZE, 0.1, 100.0);
    let plain = scene(&items).draw(&camera, &[]);
    let beside = |aside: f32, depth: f32| {
        [
            Vec3::new(aside, -aside, depth),
            Vec3::new(-aside, aside, depth),
        ]
    };
    let contacts = [
        beside(1.0, 1e-9),
        beside(1e12, 1.0),
        [Vec3::NAN, Vec3::splat(f32::MAX)],
    ];
    let picture = scene(&items).draw(&camera, contacts.as_flattened());
    assert_eq!(picture, plain);
}

#[test]
fn png_files_hold_the_picture() {
    let tile = cloud(square(0.4));
    let items = [item(&tile, Vec3::ZERO, RED)];
    let picture = scene(&items).draw(&from_above(), &[]);
    let bytes = picture.to_png().unwrap();
    let mut reader = png::Decoder::new(std::io::Cursor::new(bytes))
        .read_info()
        .unwrap();
    let mut rgb = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut rgb).unwrap();
    assert_eq!([info.width, info.height], SIZE);
    assert_eq!(rgb, picture.rgb.as_flattened());
}

/// Walls on three sides of the bodies: the view is from the fourth, or over the walls, with all
/// places in the picture.
#[test]
fn a_view_is_chosen_that_sees_the_bodies() {
    let mut points = square(3.0);
    for (corner, along) in [
        (Vec3::new(-0.6, -0.6, 0.0), 1.2 * Vec3::X),
        (Vec3::new(-0.6, 0.6, 0.0), 1.2 * Vec3::X),
        (Vec3::new(-0.6, -0.6, 0.0), 1.2 * Vec3::Y),
    ] {
        points.extend(rectangle(corner, along, 1.2 * Vec3::Z));
    }
    let tile = cloud(square(0.3));
    for quarter_turns in 0..4 {
        let turn = Quat::from_rotation_z(FRAC_PI_2 * quarter_turns as f32);
        let room = cloud(points.iter().map(|p| turn * *p).collect());
        let places = [-0.2, 0.2].map(|y| turn * Vec3::new(-0.2, y, 0.1));
        let later = turn * Vec3::new(0.3, 0.0, 2.0);
        let items = [
            item(&room, Vec3::ZERO, Paint::Scan),
            item(&tile, places[0], RED),
            item(&tile, places[1], BLUE),
        ];
        let scene = scene(&items);
        let camera = viewpoint::choose(&scene, &[later], SIZE);
        assert_eq!(camera.size, Some(SIZE));
        let picture = scene.draw(&camera, &[]);
        let color = |p| seen_at(&picture, &camera, p).expect("it is in the picture");
        let [red, blue] = places.map(color);
        assert!(is_red(red) && is_blue(blue), "{red:?} {blue:?}");
        color(later);
        // Up is up in the picture.
        let row = |p: Vec3| camera.pixel_from_view(camera.view_from_point(p))[1];
        assert!(row(later) < row(later - 0.5 * Vec3::Z));
    }
}
