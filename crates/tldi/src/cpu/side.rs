//! One cloud of a pair: its culled points, their normals and its image.

use super::cast::{self, Rays};
use super::columns::{Columns, Tiles, Touching};
use super::cull::{CullScratch, PointRadii, Survivors};
use super::impact::BORDER;
use super::normals::{self, NormalScratch};
use super::rect::Footprint;
use super::splat::{DepthScale, Fragments, Imaging, SplatPoints};
use super::sweep;
use crate::plan::{AIM_SAMPLES, is_aim_sample};
use crate::{Params, PointCloud, RayHit, RaySurface, Tldi, VirtualCamera};
use glamx::{DVec3, Mat3, Pose3, Vec3};

/// What one side holds, kept from call to call.
#[derive(Default)]
pub(super) struct Side {
    pub(super) points: Survivors,
    pub(super) cull: CullScratch,
    pub(super) columns: Columns,
    /// Indices of the near points.
    pub(super) near: Vec<u32>,
    /// Normals of some of the near points, in the frame of the query.
    pub(super) near_normals: Vec<Vec3>,
    /// Indices of the points that are modelled, and their normals in the view frame.
    kept: Vec<u32>,
    kept_normals: Vec<Vec3>,
    /// Indices of the points whose positions decide those normals.
    support: Vec<u32>,
    normals: NormalScratch,
    fragments: Fragments,
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
}

/// An exact surface that a camera looks at together with a cloud.
#[derive(Clone, Copy)]
pub(super) struct ExactView<'a> {
    pub(super) surface: &'a dyn RaySurface,
    pub(super) frame_from_surface: &'a Pose3,
    /// How far beyond the cloud the surface is of interest, metres.
    pub(super) reach: f32,
    /// Whether it is looked at where the cloud is not, and around.
    pub(super) everywhere: bool,
}

impl CloudView<'_> {
    fn oriented(&self) -> bool {
        self.cloud.normals().is_some() && self.cloud.normals_oriented()
    }
}

impl Side {
    /// Fills `near_normals` from an even selection of the near points.
    pub(super) fn sample_normals(&mut self, cloud: &PointCloud, frame_from_cloud: &Pose3) {
        let step = self.near.len().div_ceil(AIM_SAMPLES) as u32;
        if let Some(given) = cloud.normals() {
            let rotation = Mat3::from_quat(frame_from_cloud.rotation);
            let indices = self.near.iter().map(|&i| self.points.index[i as usize]);
            let sampled = indices.filter(|&index| is_aim_sample(index, step));
            self.near_normals.clear();
            self.near_normals
                .extend(sampled.map(|index| rotation * given[index as usize]));
            return;
        }
        normals::estimate(
            &self.near,
            |i| self.points.point(i as usize),
            |k| is_aim_sample(self.points.index[self.near[k] as usize], step),
            normals::SUPPORT * PointRadii::new(cloud, &self.points).mean(),
            &mut self.normals,
            &mut self.kept,
            &mut self.near_normals,
        );
    }

    /// Mean of the cloud's near points, of which there are some, in the frame of the query, metres.
    pub(super) fn mean_of_near(&self) -> Vec3 {
        let near = self.near.iter().map(|&i| self.points.point(i as usize));
        (near.map(|p| p.as_dvec3()).sum::<DVec3>() / self.near.len() as f64).as_vec3()
    }

    /// Samples the culled points near an exact surface; its normals at the nearest points go to
    /// `surface_normals`. `false` where none is near.
    pub(super) fn near_exact(
        &mut self,
        cloud: &PointCloud,
        frame_from_cloud: &Pose3,
        surface: &dyn RaySurface,
        frame_from_surface: &Pose3,
        reach: f32,
        surface_normals: &mut Vec<Vec3>,
    ) -> bool {
        surface_normals.clear();
        self.near.clear();
        self.deepest = 0.0;
        let step = self.points.len().div_ceil(AIM_SAMPLES).max(1);
        for i in (0..self.points.len()).step_by(step) {
            let point = frame_from_surface.inverse_transform_point(self.points.point(i));
            let (distance, normal) = surface.project(point);
            self.deepest = self.deepest.max(-distance);
            if distance <= reach {
                self.near.push(i as u32);
                surface_normals.push(frame_from_surface.rotation * normal);
            }
        }
        if self.near.is_empty() {
            return false;
        }
        if cloud.normals().is_some() {
            self.sample_normals(cloud, frame_from_cloud);
        } else {
            // Neighbours are not among the samples.
            self.support.clear();
            self.support.extend(0..self.points.len() as u32);
            normals::estimate(
                &self.support,
                |i| self.points.point(i as usize),
                |k| self.near.binary_search(&(k as u32)).is_ok(),
                normals::SUPPORT * PointRadii::new(cloud, &self.points).mean(),
                &mut self.normals,
                &mut self.kept,
                &mut self.near_normals,
            );
        }
        true
    }

    /// Moves the culled points into the view and returns what they cover.
    pub(super) fn project(&mut self, view: &CloudView) -> Option<Footprint> {
        let largest = PointRadii::new(view.cloud, &self.points).limit(view.cloud);
        self.columns.project(&self.points, largest, view.camera)
    }

    /// Radius in metres about a point in which others decide its normal; 0 where it is given.
    pub(super) fn support(&self, view: &CloudView) -> f32 {
        match view.cloud.normals() {
            Some(_) => 0.0,
            None => normals::SUPPORT * PointRadii::new(view.cloud, &self.points).mean(),
        }
    }

    /// The image of all points that were projected.
    pub(super) fn whole_image(&mut self, view: &CloudView, seen: &Footprint) {
        let imaging = Imaging {
            camera: view.camera,
            params: view.params,
            rect: seen.rect,
            tiles: Tiles::new(&seen.rect, seen.reach),
            scale: DepthScale::new(seen.near, view.params),
        };
        self.columns.sort(&imaging.tiles, view.camera);
        self.image(view, &imaging, None);
    }

    /// The image of the points that were sorted into tiles: all in view, or those in the tiles of
    /// `touching`.
    pub(super) fn image(
        &mut self,
        view: &CloudView,
        imaging: &Imaging,
        touching: Option<&Touching>,
    ) {
        match touching {
            Some(touching) => self.columns.modelled(touching, &mut self.kept),
            None => self.columns.in_view(&mut self.kept),
        }
        self.normals_of_kept(view, touching);
        let points = SplatPoints {
            columns: &self.columns,
            kept: &self.kept,
            normals: &self.kept_normals,
            oriented: view.oriented(),
            radii: PointRadii::new(view.cloud, &self.points),
        };
        let index = |k: u32| self.points.index[self.kept[k as usize] as usize] as usize;
        let colors = view.cloud.colors();
        let color = colors.map(|colors| move |k| colors[index(k)]);
        let color = color.as_ref().map(|c| c as &dyn Fn(u32) -> [u8; 4]);
        self.image
            .begin(imaging.camera, imaging.rect.origin, imaging.rect.size);
        for band in 0..self.fragments.begin(&points, imaging) {
            self.fragments.splat_band(band, &points, imaging);
            sweep::sweep(
                &mut self.fragments,
                points.oriented,
                color,
                imaging,
                &mut self.image,
            );
        }
    }

    fn normals_of_kept(&mut self, view: &CloudView, touching: Option<&Touching>) {
        let rotation = view.camera.view_from_frame.rotation;
        if let Some(given) = view.cloud.normals() {
            let view_from_cloud = Mat3::from_quat(rotation * view.frame_from_cloud.rotation);
            let index = |i: u32| self.points.index[i as usize] as usize;
            let rotated = self.kept.iter().map(|&i| view_from_cloud * given[index(i)]);
            self.kept_normals.clear();
            self.kept_normals.extend(rotated);
            return;
        }
        match touching {
            Some(touching) => self.columns.around(touching, &mut self.support),
            None => self.support.clone_from(&self.kept),
        }
        let support = &self.support;
        let wanted = |k: usize| {
            touching.is_none_or(|touching| self.columns.is_modelled(touching, support[k]))
        };
        normals::estimate(
            support,
            |i| self.columns.view(i as usize),
            wanted,
            normals::SUPPORT * PointRadii::new(view.cloud, &self.points).mean(),
            &mut self.normals,
            &mut self.kept,
            &mut self.kept_normals,
        );
    }

    /// Image of this cloud, and of an exact surface into `image` over the same pixels; `None`
    /// where nothing is in view.
    pub(super) fn look_with(
        &mut self,
        view: &CloudView,
        exact: &ExactView,
        hits: &mut Vec<RayHit>,
        image: &mut Tldi,
    ) -> Option<()> {
        let mut seen = self.project(view)?;
        if exact.everywhere {
            seen.rect = seen.rect.grown(BORDER);
        }
        self.whole_image(view, &seen);
        // Rays must pass through all of the surface, or what is deepest would be missed.
        let extent = exact.surface.bounds().extents().length();
        let through = if extent.is_finite() { extent } else { 0.0 };
        let margin = view.params.prediction + (seen.far - seen.near) + through + exact.reach;
        let rays = Rays {
            camera: view.camera,
            rect: seen.rect,
            near: seen.near - margin,
            far: seen.far + margin,
            cover: (!exact.everywhere).then_some(&self.image),
        };
        cast::cast(exact.surface, exact.frame_from_surface, &rays, hits, image);
        Some(())
    }
}
