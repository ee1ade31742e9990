//! One cloud of a pair: its culled points, their normals and its image.

use super::columns::{Columns, Tiles, Touching};
use super::cull::{CullScratch, PointRadii, Survivors};
use super::exact::cast::{self, Rays};
use super::exact::cell_distances::CellDistances;
use super::exact::placed::Placed;
use super::first_look::cells::{CellImaging, Cells};
use super::fold::{FARTHEST_PIXEL, ViewFold};
use super::motion::core::BORDER;
use super::normals::sharpen::{SharpenScratch, sharpen};
use super::normals::{self, Neighborhood, NormalScratch};
use super::rect::{Footprint, Rect};
use super::room::Cost;
use super::scratch::Shared;
use super::splat::{DepthScale, Fragments, Imaging, SplatPoints};
use super::sweep;
use crate::contact::neighbors::Culled;
use crate::pair::plan::SidePlan;
use crate::pair::sampling::{AIM_SAMPLES, is_aim_sample};
use crate::stage::stage;
use crate::{Params, PointCloud, Tldi, VirtualCamera};
use glamx::{Mat3, Pose3, Vec3};

/// An even selection of the near points of a surface, in the frame of the query.
#[derive(Default)]
pub(super) struct NearSamples {
    pub(super) normals: Vec<Vec3>,
    /// Where they are, metres.
    pub(super) points: Vec<Vec3>,
}

impl NearSamples {
    /// Empties it, with room for twice as many as are wanted: a hash chooses them, and their number varies.
    pub(super) fn clear(&mut self) {
        for samples in [&mut self.normals, &mut self.points] {
            samples.clear();
            samples.reserve(2 * AIM_SAMPLES);
        }
    }
}

/// What one side holds, kept from call to call.
#[derive(Default)]
pub(super) struct Side {
    pub(super) points: Survivors,
    /// All points in reach of the other surface, if the pair is looked at several times and they are few.
    pub(super) held: Survivors,
    pub(super) is_held: bool,
    /// Those in a window or, while that is looked through, those of the look before.
    pub(super) window: Survivors,
    pub(super) cull: CullScratch,
    pub(super) columns: Columns,
    /// Indices of the near points.
    pub(super) near: Vec<u32>,
    pub(super) near_samples: NearSamples,
    /// Indices of the points that are modelled, and their normals in the view frame.
    pub(super) kept: Vec<u32>,
    kept_normals: Vec<Vec3>,
    /// Indices of the points whose positions decide those normals.
    pub(super) support: Vec<u32>,
    pub(super) normals: NormalScratch,
    sharpen: SharpenScratch,
    fragments: Fragments,
    cells: Cells,
    pub(super) cell_distances: CellDistances,
    /// Greatest depth of a sampled point inside an exact surface, metres.
    pub(super) deepest: f32,
    pub(super) image: Tldi,
}

/// A cloud that a camera looks at.
#[derive(Clone, Copy)]
pub(super) struct CloudView<'a> {
    pub(super) cloud: &'a PointCloud<'a>,
    pub(super) frame_from_cloud: &'a Pose3,
    pub(super) camera: &'a VirtualCamera,
    pub(super) params: &'a Params,
    /// Whether estimated normals are sharpened: not for casts, which take the pixel that is met first. Planes that are
    /// sharpened in part, at corners, stand out there.
    pub(super) sharpens: bool,
}

/// An exact surface that a camera looks at together with a cloud.
#[derive(Clone, Copy)]
pub(super) struct ExactView<'a> {
    pub(super) exact: Placed<'a>,
    pub(super) scope: Scope,
}

/// Where an exact surface is looked at.
#[derive(Clone, Copy)]
pub(super) enum Scope {
    /// In the cloud's columns, if the surface is within this many metres of it there.
    Near(f32),
    /// The same, up to this many metres before and behind the cloud.
    Ahead(f32),
    /// Where the cloud is not, too, and around; up to this many metres before and behind it.
    Everywhere(f32),
}

impl CloudView<'_> {
    /// Whether the normals beside an edge are those of its faces, and not means of both.
    fn knows_faces(&self) -> bool {
        match self.cloud.normals() {
            Some(_) => self.cloud.normals_oriented(),
            None => self.sharpens,
        }
    }
}

impl Side {
    /// Fills `near_samples` from the near points.
    pub(super) fn sample_normals(&mut self, cloud: &PointCloud, frame_from_cloud: &Pose3) {
        let _stage = stage!("aim");
        let step = self.near.len().div_ceil(AIM_SAMPLES) as u32;
        let index = &self.points.index;
        self.near_samples.clear();
        if let Some(known) = cloud.known_normals(false) {
            let rotation = Mat3::from_quat(frame_from_cloud.rotation);
            let normal = |i: u32| known[index[i as usize] as usize];
            let sampled = self.near.iter().copied();
            let sampled = sampled.filter(|&i| is_aim_sample(index[i as usize], step));
            self.kept.clear();
            self.kept
                .extend(sampled.filter(|&i| normal(i) != Vec3::ZERO));
            let normals = self.kept.iter().map(|&i| rotation * normal(i));
            self.near_samples.normals.extend(normals);
        } else {
            normals::estimate(
                &self.near,
                |i| self.points.point(i as usize),
                |k| is_aim_sample(index[self.near[k] as usize], step),
                &self.neighborhood(cloud),
                &mut self.normals,
                &mut self.kept,
                &mut self.near_samples.normals,
            );
        }
        self.place_samples();
    }

    /// Fills the points of `near_samples`, which are those in `kept`.
    pub(super) fn place_samples(&mut self) {
        let points = self.kept.iter().map(|&i| self.points.point(i as usize));
        self.near_samples.points.extend(points);
    }

    /// The culled points, if they are all that there are where `plan` says.
    pub(super) fn culled<'a>(&'a self, plan: &'a SidePlan) -> Option<Culled<'a>> {
        self.points.are_all().then_some(Culled {
            points: &self.points,
            region: &plan.region,
        })
    }

    /// Mean radius of the culled points, metres. If their reaches differ, it is that of the near points.
    pub(super) fn mean_radius(&self, cloud: &PointCloud) -> f32 {
        let radii = PointRadii::new(cloud, &self.points);
        match self.points.further.is_empty() || self.near.is_empty() {
            true => radii.mean(),
            false => radii.mean_of(&self.near),
        }
    }

    /// Mean radius of the cloud where the other surface is near, metres; in all of it where it is even.
    pub(super) fn near_radius(&self, cloud: &PointCloud) -> f32 {
        match self.points.further.is_empty() {
            true => cloud.mean_radius(),
            false => PointRadii::unscaled(cloud, &self.points).mean_of(&self.near),
        }
    }

    /// Moves the culled points into the view and returns what they cover.
    pub(super) fn project(&mut self, view: &CloudView) -> Option<Footprint> {
        let largest = PointRadii::new(view.cloud, &self.points).limit(view.cloud);
        self.columns.project(&self.points, largest, view.camera)
    }

    /// About how many fragments an image has in which so many points are drawn, the nearest at a depth of `near` metres.
    pub(super) fn fragments_in(
        &self,
        view: &CloudView,
        rect: &Rect,
        near: f32,
        drawn: usize,
    ) -> f32 {
        let edge = 2.0 * self.mean_radius(view.cloud) / view.camera.pixel_size_at(near);
        drawn as f32 * (edge * edge).min(rect.pixels() as f32)
    }

    /// What decides the normal at a point, if it is not given.
    pub(super) fn neighborhood(&self, cloud: &PointCloud) -> Neighborhood {
        Neighborhood {
            radius: normals::SUPPORT * self.mean_radius(cloud),
            noise: cloud.noise(),
        }
    }

    /// Radius in metres about a point in which others decide its normal; 0 where it is known.
    pub(super) fn support_radius(&self, cloud: &PointCloud) -> f32 {
        match cloud.known_normals(false) {
            Some(_) => 0.0,
            None => self.neighborhood(cloud).radius,
        }
    }

    /// The image, of the pixels of `rect`, of all points that were projected.
    pub(super) fn whole_image(&mut self, view: &CloudView, seen: &Footprint, rect: Rect) {
        let imaging = Imaging {
            camera: view.camera,
            params: view.params,
            rect,
            tiles: Tiles::new(&self.around(view, seen, Some(rect)).rect, seen.reach),
            scale: DepthScale::new(seen.near, view.params),
        };
        {
            let _stage = stage!("columns");
            self.columns.sort(&imaging.tiles, view.camera);
        }
        self.image(view, &imaging, None);
    }

    /// The part of what is seen that decides the pixels of `rect`: these, and where splats and neighbours of their
    /// points are. The rest may be as large as coordinates go.
    fn around(&self, view: &CloudView, seen: &Footprint, rect: Option<Rect>) -> Footprint {
        let support = self.support_radius(view.cloud) / seen.pixel_size;
        let border = (seen.reach + support).ceil().min(FARTHEST_PIXEL) as i32;
        let part = rect.and_then(|rect| rect.grown(border).intersection(&seen.rect));
        Footprint {
            rect: part.unwrap_or(seen.rect),
            ..*seen
        }
    }

    /// What an image is of in the columns in which the projected points are within `reach` metres of an
    /// exact surface and the surface covers them; `None` where they are nowhere.
    fn meet_exact<'a>(
        &mut self,
        view: &CloudView<'a>,
        seen: &Footprint,
        covered: Option<Rect>,
        exact: &Placed,
        reach: f32,
        shared: &mut Shared,
    ) -> Option<Imaging<'a>> {
        let _stage = stage!("columns");
        let seen = &self.around(view, seen, covered);
        let tiles = Tiles::new(&seen.rect, seen.reach);
        self.columns.sort(&tiles, view.camera);
        self.columns.reduce_both(&tiles);
        let support_px = self.support_radius(view.cloud) / seen.pixel_size;
        let reach = reach + tiles.half_diagonal() * seen.pixel_size;
        let (columns, cells) = (&self.columns, &self.cell_distances);
        let Shared { touching, fold, .. } = shared;
        let meets = |tile: usize| {
            let depths = columns.depths(tile);
            let middle = fold.place(tiles.middle(tile));
            exact.meets(cells, view.camera, middle, depths, reach)
        };
        let rect = touching.mark(&tiles, &seen.rect, support_px, meets)?;
        Some(Imaging {
            camera: view.camera,
            params: view.params,
            rect: rect.intersection(&covered.unwrap_or(rect))?,
            tiles,
            scale: DepthScale::new(seen.near, view.params),
        })
    }

    /// The image of the points that were sorted into tiles: all in view, or those in the tiles of
    /// `touching`.
    pub(super) fn image(
        &mut self,
        view: &CloudView,
        imaging: &Imaging,
        touching: Option<&Touching>,
    ) {
        self.keep(view, imaging, touching);
        let points = SplatPoints {
            columns: &self.columns,
            kept: &self.kept,
            normals: &self.kept_normals,
            oriented: view.cloud.normals_oriented(),
            radii: PointRadii::new(view.cloud, &self.points),
        };
        let index = |k: u32| self.points.index[self.kept[k as usize] as usize] as usize;
        let colors = view.cloud.colors();
        let color = colors.map(|colors| move |k| colors[index(k)]);
        let color = color.as_ref().map(|c| c as &dyn Fn(u32) -> [u8; 4]);
        self.image
            .begin(imaging.camera, imaging.rect.origin, imaging.rect.size);
        for band in 0..self.fragments.begin(&points, imaging) {
            self.fragments.splat_band(band, imaging);
            sweep::sweep(
                &mut self.fragments,
                points.oriented,
                view.knows_faces(),
                imaging.scale.merge_steps(view.params, view.cloud.noise()),
                color,
                imaging,
                &mut self.image,
            );
        }
    }

    /// The image of the points in the tiles of `touching`, from their sums.
    pub(super) fn image_of_cells(
        &mut self,
        view: &CloudView,
        imaging: &CellImaging,
        touching: &Touching,
    ) {
        let _stage = stage!("cells");
        self.columns.modelled(touching, &mut self.kept);
        let along = imaging.camera.view_from_frame.rotation * view.frame_from_cloud.rotation;
        let along = along.inverse() * Vec3::Z;
        let given = view
            .cloud
            .normals()
            .filter(|_| view.cloud.normals_oriented());
        let index = &self.points.index;
        let is_exit = given.map(|given| move |i: usize| given[index[i] as usize].dot(along) > 0.0);
        let exits = is_exit
            .as_ref()
            .map(|exits| exits as &dyn Fn(usize) -> bool);
        let (columns, kept) = (&self.columns, &self.kept[..]);
        let Self { cells, image, .. } = self;
        cells.image(columns, kept, exits, imaging, image);
    }

    /// Fills `kept` and `kept_normals`.
    fn keep(&mut self, view: &CloudView, imaging: &Imaging, touching: Option<&Touching>) {
        let _stage = stage!("normals");
        let rotation = view.camera.view_from_frame.rotation;
        if let Some(known) = view.cloud.known_normals(view.sharpens) {
            match touching {
                Some(touching) => self.columns.modelled(touching, &mut self.kept),
                None => self.columns.in_view(&imaging.tiles, &mut self.kept),
            }
            let view_from_cloud = Mat3::from_quat(rotation * view.frame_from_cloud.rotation);
            let points = &self.points;
            let normal = |i: u32| known[points.index[i as usize] as usize];
            self.kept.retain(|&i| normal(i) != Vec3::ZERO);
            let rotated = self.kept.iter().map(|&i| view_from_cloud * normal(i));
            self.kept_normals.clear();
            self.kept_normals.extend(rotated);
            return;
        }
        match touching {
            Some(touching) => self.columns.around(touching, &mut self.support),
            None => self.columns.in_view(&imaging.tiles, &mut self.support),
        }
        let support = &self.support;
        let wanted = |k: usize| {
            touching.is_none_or(|touching| self.columns.is_modelled(touching, support[k]))
        };
        let around = self.neighborhood(view.cloud);
        normals::estimate(
            support,
            |i| self.columns.view(i as usize),
            wanted,
            &around,
            &mut self.normals,
            &mut self.kept,
            &mut self.kept_normals,
        );
        if view.sharpens {
            let Self {
                normals,
                sharpen: scratch,
                kept_normals,
                ..
            } = self;
            sharpen(&around, normals, scratch, kept_normals);
        }
    }

    /// What the images of this cloud, of which so many points are drawn, and of an exact surface take.
    fn cost_with(&self, view: &CloudView, look: &ExactView, rect: &Rect, drawn: usize) -> Cost {
        // Seen by an orthographic camera: all depths are alike.
        let fragments = self.fragments_in(view, rect, 0.0, drawn);
        let pixels = rect.pixels() as f32;
        let rays = match look.scope {
            Scope::Everywhere(_) => pixels,
            Scope::Near(_) | Scope::Ahead(_) => pixels.min(fragments),
        };
        Cost::new(rect, self.points.len(), fragments).with_rays(rays)
    }

    /// Moves the culled points into the view. Returns what they cover, the part of it that an image of them and of an
    /// exact surface has, and what the surface covers, if that is known; `None` where nothing is in view, or there
    /// is no room for the image.
    fn project_with(
        &mut self,
        view: &CloudView,
        look: &ExactView,
        shared: &mut Shared,
    ) -> Option<(Footprint, Rect, Option<Rect>)> {
        let _stage = stage!("columns");
        let Shared { fold, room, .. } = shared;
        let mut seen = self.project(view)?;
        let border = match look.scope {
            Scope::Everywhere(_) => BORDER,
            Scope::Near(_) | Scope::Ahead(_) => 0,
        };
        seen.rect = seen.rect.grown(border);
        // Where the surface is not, nothing meets it.
        let mut covered = look.exact.covers(view.camera, BORDER + 1);
        let own = covered.unwrap_or(seen.rect);
        let mut rect = seen.rect.intersection(&own)?;
        fold.clear();
        let follows = view.camera.size.is_none();
        if follows && ViewFold::is_wanted(&rect, self.points.len()) {
            let reach = seen
                .reach
                .max(self.support_radius(view.cloud) / seen.pixel_size);
            fold.find(reach, seen.pixel_size, self.columns.across());
            self.columns.fold(fold, view.camera, &mut seen);
            seen.rect = seen.rect.grown(border);
            // What is a rectangle of the view is none of the folded image.
            covered = None;
            rect = seen.rect;
        }
        if follows && room.refuses(self.cost_with(view, look, &rect, self.points.len())) {
            return None;
        }
        seen.limit_depths(DepthScale::reach(view.params), || {
            self.columns.median_depth()
        });
        Some((seen, rect, covered))
    }

    /// Image of this cloud, and of an exact surface into `image` over the same pixels; `None`
    /// where nothing is in view, or there is no room for it.
    pub(super) fn look_with(
        &mut self,
        view: &CloudView,
        look: &ExactView,
        shared: &mut Shared,
        image: &mut Tldi,
    ) -> Option<()> {
        let (mut seen, rect, covered) = self.project_with(view, look, shared)?;
        let reach;
        (seen.rect, reach) = match look.scope {
            Scope::Near(reach) | Scope::Ahead(reach) => {
                let imaging = self.meet_exact(view, &seen, covered, &look.exact, reach, shared)?;
                self.image(view, &imaging, Some(&shared.touching));
                let through = match look.scope {
                    // The part that the cloud is deep in, doubled for places without samples.
                    Scope::Near(_) => 2.0 * self.deepest,
                    _ => reach,
                };
                (imaging.rect, through)
            }
            Scope::Everywhere(reach) => {
                self.whole_image(view, &seen, rect);
                (rect, reach)
            }
        };
        let Placed {
            surface,
            frame_from_surface,
        } = look.exact;
        // Rays must pass through all of the surface, or they would miss the deepest part.
        let extent = surface.bounds().extents().length();
        let through = if extent.is_finite() { extent } else { 0.0 };
        let margin = view.params.prediction + (seen.far - seen.near) + through + reach;
        let mut along = Footprint {
            near: seen.near - margin,
            far: seen.far + margin,
            ..seen
        };
        // Where they start decides to what their hits are rounded.
        along.limit_depths(DepthScale::reach(view.params), || {
            self.columns.median_depth()
        });
        let rays = Rays {
            camera: view.camera,
            rect: seen.rect,
            fold: &shared.fold,
            near: along.near,
            far: along.far,
            cover: (!matches!(look.scope, Scope::Everywhere(_))).then_some(&self.image),
        };
        cast::cast(surface, frame_from_surface, &rays, &mut shared.hits, image);
        let cost = self.cost_with(view, look, &rays.rect, self.kept.len());
        shared.room.take(cost);
        Some(())
    }
}
