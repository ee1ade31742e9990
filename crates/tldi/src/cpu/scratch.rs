//! What one pair needs while it is compared, and the steps that all looks at it share.

use super::columns::{Tiles, Touching};
use super::compare::Seen;
use super::crossings::Crossings;
use super::exact::placed::Placed;
use super::first_look::window::Window;
use super::fold::ViewFold;
use super::motion::core::CoreScratch;
use super::motion::meeting::Meeting;
use super::pixel_column::Span;
use super::rect::Rect;
use super::room::{Cost, Room};
use super::side::{CloudView, ExactView, Scope, Side};
use super::splat::{DepthScale, Imaging};
use super::zone::{self, ZoneScratch, ZoneSide};
use crate::cloud::reach::LocalScale;
use crate::contact::patches::PatchScratch;
use crate::pair::plan::{PairPlan, SidePlan};
use crate::stage::stage;
use crate::view::approach::moved_along;
use crate::view::camera_policy::{self, MAX_VIEWS, seen_from_behind};
use crate::view::zone_normals::ZoneNormals;
use crate::{
    CameraPolicy, Looked, PairQuery, Params, PointCloud, RayHit, Surface, View, VirtualCamera,
    Work, paper,
};
use arrayvec::ArrayVec;
use glamx::{Pose3, Vec3};

/// Where two clouds meet in a view.
pub(super) struct MeetingRegion {
    pub(super) rect: Rect,
    tiles: Tiles,
    /// Least depth of both, metres.
    pub(super) near: f32,
}

/// What both sides of a view share, kept from call to call.
#[derive(Default)]
pub(super) struct Shared {
    pub(super) touching: Touching,
    pub(super) fold: ViewFold,
    /// Of all images of a comparison, or of a motion.
    pub(super) room: Room,
    pub(super) hits: Vec<RayHit>,
}

/// Two surfaces, as a camera looks at them.
#[derive(Clone, Copy)]
pub(super) struct Look<'a> {
    pub(super) surfaces: [Surface<'a>; 2],
    /// From the frame of the second surface into that of the first.
    pub(super) a_from_b: &'a Pose3,
    pub(super) camera: &'a VirtualCamera,
    /// Those of each surface: their merge gaps may differ.
    pub(super) params: [&'a Params; 2],
    /// See [`CloudView::sharpens`].
    pub(super) sharpens: bool,
}

impl<'a> Look<'a> {
    fn frame_from_surface(&self, side: usize) -> &'a Pose3 {
        [&Pose3::IDENTITY, self.a_from_b][side]
    }

    /// The first or the second surface, which is this cloud.
    pub(super) fn at_cloud(&self, side: usize, cloud: &'a PointCloud<'a>) -> CloudView<'a> {
        CloudView {
            cloud,
            frame_from_cloud: self.frame_from_surface(side),
            camera: self.camera,
            params: self.params[side],
            sharpens: self.sharpens,
        }
    }
}

/// Everything one pair needs while it is compared.
#[derive(Default)]
pub(super) struct Scratch {
    pub(super) a: Side,
    pub(super) b: Side,
    pub(super) core: CoreScratch,
    pub(super) meetings: Vec<Meeting>,
    zone: ZoneScratch,
    pub(super) shared: Shared,
    pub(super) scale: LocalScale,
    pub(super) crossings: Crossings,
    pub(super) paper: [paper::Scratch; 2],
    pub(super) patches: PatchScratch,
    /// Of the first look.
    pub(super) windows: Vec<Window>,
    /// Since it was cleared.
    pub(super) work: Work,
}

impl Scratch {
    /// Fills the culled points of both sides, one in as many as `strides` says, as `cull_side` does it. `false` if a
    /// cloud has no point in reach.
    pub(super) fn cull(
        &mut self,
        query: &PairQuery,
        plan: &PairPlan,
        strides: [usize; 2],
        cull_side: fn(&mut Side, &PointCloud, &SidePlan, usize),
    ) -> bool {
        let cull = |side: &mut Side, surface: Surface, plan: &SidePlan, stride| {
            if let Surface::Cloud(cloud) = surface {
                cull_side(side, cloud, plan, stride);
                !side.points.is_empty()
            } else {
                side.points.clear();
                true
            }
        };
        let (a, b) = (&mut self.a, &mut self.b);
        let [plan_a, plan_b] = &plan.sides;
        let (is_near_a, is_near_b) = rayon::join(
            || cull(a, query.a, plan_a, strides[0]),
            || cull(b, query.b, plan_b, strides[1]),
        );
        self.work.culled += self.a.points.len() + self.b.points.len();
        is_near_a && is_near_b
    }

    /// Finds the near points of both sides and their normals; `false` where nothing is near.
    pub(super) fn zone(&mut self, query: &PairQuery, plan: &PairPlan) -> bool {
        let reach = plan.zone_reach;
        let (a_from_a, a_from_b) = (&Pose3::IDENTITY, &query.a_from_b);
        let Self { a, b, zone, .. } = self;
        a.near.clear();
        b.near.clear();
        let is_empty = |side: &Side, surface: &Surface| {
            matches!(surface, Surface::Cloud(_)) && side.points.is_empty()
        };
        if is_empty(a, &query.a) || is_empty(b, &query.b) {
            return false;
        }
        let placed = |surface, frame_from_surface| Placed {
            surface,
            frame_from_surface,
        };
        match (query.a, query.b) {
            (Surface::Cloud(cloud_a), Surface::Cloud(cloud_b)) => {
                let zone_side = |points, cloud: &PointCloud| ZoneSide {
                    points,
                    mean_radius: cloud.mean_radius(),
                };
                let sides = [zone_side(&a.points, cloud_a), zone_side(&b.points, cloud_b)];
                zone::zone(sides, &plan.overlap, reach, zone, &mut a.near, &mut b.near);
                if a.near.is_empty() || b.near.is_empty() {
                    return false;
                }
                rayon::join(
                    || a.sample_normals(cloud_a, a_from_a),
                    || b.sample_normals(cloud_b, a_from_b),
                );
                true
            }
            (Surface::Cloud(cloud), Surface::Exact(surface)) => {
                let (of_surface, exact) = (&mut b.near_samples, placed(surface, a_from_b));
                a.near_exact(cloud, a_from_a, &exact, reach, of_surface)
            }
            (Surface::Exact(surface), Surface::Cloud(cloud)) => {
                let (of_surface, exact) = (&mut a.near_samples, placed(surface, a_from_a));
                b.near_exact(cloud, a_from_b, &exact, reach, of_surface)
            }
            _ => false, // refused
        }
    }

    /// How coarse the surfaces are where they are near each other; as the parameters say, where the camera is given.
    pub(super) fn local_scale(&self, query: &PairQuery) -> LocalScale {
        let near = [(&self.a, query.a), (&self.b, query.b)].map(|(side, surface)| match surface {
            Surface::Cloud(cloud) => side.near_radius(cloud),
            Surface::Exact(_) | Surface::Device(_) => 0.0,
        });
        match query.view {
            View::Fixed(_) => LocalScale::AS_TOLD,
            View::Aim { .. } => LocalScale::new(&query.params, [&query.a, &query.b], near),
        }
    }

    /// Fills `axes` with the view axes of the near points and their normals; returns the spare ones.
    pub(super) fn aim(
        &self,
        query: &PairQuery,
        plan: &PairPlan,
        policy: CameraPolicy,
        axes: &mut Vec<Vec3>,
    ) -> ArrayVec<Vec3, MAX_VIEWS> {
        let _stage = stage!("aim");
        camera_policy::aim(policy, self.zone_normals(query), &plan.approach, axes)
    }

    /// What is known about a view besides its images and their folding.
    pub(super) fn seen<'a>(
        &self,
        query: &PairQuery,
        plan: &'a PairPlan,
        camera: &VirtualCamera,
        axes: &'a [Vec3],
        view: usize,
    ) -> Seen<'a> {
        let span = |side: &SidePlan| {
            let body = side
                .body?
                .transformed(&(camera.view_from_frame * side.frame_from_surface));
            Some(Span {
                near: body.min.z,
                far: body.max.z,
            })
        };
        let is_told = matches!(query.view, View::Fixed(_))
            || plan.approach.last_axis.is_some()
            || query.a.is_oriented()
            || query.b.is_oriented();
        Seen {
            axes,
            view,
            bodies: [span(&plan.sides[0]), span(&plan.sides[1])],
            from_behind: seen_from_behind(camera.axis(), &self.zone_normals(query)),
            tells_facing: query.a.is_oriented() && query.b.is_oriented(),
            moved: (!is_told).then(|| moved_along(plan.approach.motion, axes[view])),
            fold: None,
            regions: [(query.a, 0), (query.b, 1)].map(|(surface, side)| match surface {
                Surface::Cloud(_) => Some(&plan.sides[side].region),
                Surface::Exact(_) | Surface::Device(_) => None,
            }),
        }
    }

    fn zone_normals(&self, query: &PairQuery) -> [ZoneNormals<'_>; 2] {
        [(&self.a, query.a), (&self.b, query.b)].map(|(side, surface)| ZoneNormals {
            normals: &side.near_samples.normals,
            points: &side.near_samples.points,
            oriented: surface.is_oriented(),
        })
    }

    /// What both images hold, and how many points they are of.
    pub(super) fn looked(&self, query: &PairQuery) -> Looked {
        let mut looked = Looked::default();
        for (side, surface) in [(&self.a, query.a), (&self.b, query.b)] {
            if let Surface::Cloud(_) = surface {
                looked.points += side.kept.len();
            }
            looked.pixels += side.image.pixel_count();
            looked.layers += side.image.layers().len();
        }
        looked
    }

    /// Builds both images: of two clouds in the tiles where their depth ranges come within `reach` metres, of an exact
    /// surface in the `scope`. `None` if there is nothing to see, or no room for it.
    pub(super) fn look_at(&mut self, look: &Look, reach: f32, scope: Scope) -> Option<()> {
        let exact = |side: usize, surface| ExactView {
            exact: Placed {
                surface,
                frame_from_surface: look.frame_from_surface(side),
            },
            scope,
        };
        let Self { a, b, shared, .. } = self;
        match look.surfaces {
            [Surface::Cloud(a), Surface::Cloud(b)] => {
                self.look_at_clouds(&look.at_cloud(0, a), &look.at_cloud(1, b), reach)
            }
            [Surface::Cloud(cloud), Surface::Exact(surface)] => a.look_with(
                &look.at_cloud(0, cloud),
                &exact(1, surface),
                shared,
                &mut b.image,
            ),
            [Surface::Exact(surface), Surface::Cloud(cloud)] => b.look_with(
                &look.at_cloud(1, cloud),
                &exact(0, surface),
                shared,
                &mut a.image,
            ),
            _ => None, // refused
        }
    }

    fn look_at_clouds(&mut self, a: &CloudView, b: &CloudView, reach: f32) -> Option<()> {
        let support = (self.a.support_radius(a.cloud)).max(self.b.support_radius(b.cloud));
        let MeetingRegion { rect, tiles, near } = self.meet(a, b, reach, support)?;
        let (side_a, side_b) = (&mut self.a, &mut self.b);
        let touching = &self.shared.touching;
        let imaging = Imaging {
            camera: a.camera,
            params: a.params,
            rect,
            tiles,
            scale: DepthScale::new(near, a.params),
        };
        rayon::join(
            || side_a.image(a, &imaging, Some(touching)),
            || side_b.image(b, &imaging, Some(touching)),
        );
        let [drawn_a, drawn_b] = [&self.a, &self.b].map(|side| side.kept.len());
        let cost = self.cost([a, b], &rect, near, [drawn_a, drawn_b]);
        self.shared.room.take(cost);
        Some(())
    }

    /// What the images of two clouds take, of so many drawn points each, the nearest at a depth of `near` metres.
    fn cost(&self, [a, b]: [&CloudView; 2], rect: &Rect, near: f32, drawn: [usize; 2]) -> Cost {
        let of_a = self.a.fragments_in(a, rect, near, drawn[0]);
        let fragments = of_a + self.b.fragments_in(b, rect, near, drawn[1]);
        Cost::new(rect, self.a.points.len() + self.b.points.len(), fragments)
    }

    /// Moves what was culled into the view and finds the tiles in which `a` is less than `reach` metres behind
    /// `b`, and those within `support` metres around; `None` if there are none.
    pub(super) fn meet(
        &mut self,
        a: &CloudView,
        b: &CloudView,
        reach: f32,
        support: f32,
    ) -> Option<MeetingRegion> {
        let _stage = stage!("columns");
        let (camera, params) = (a.camera, a.params);
        let (side_a, side_b) = (&mut self.a, &mut self.b);
        let (seen_a, seen_b) = rayon::join(|| side_a.project(a), || side_b.project(b));
        let (mut seen_a, mut seen_b) = (seen_a?, seen_b?);
        let mut rect = seen_a.rect.intersection(&seen_b.rect)?;
        let count = side_a.points.len() + side_b.points.len();
        let fold = &mut self.shared.fold;
        fold.clear();
        if camera.size.is_none() && ViewFold::is_wanted(&rect, count) {
            let support = (side_a.support_radius(a.cloud)).max(side_b.support_radius(b.cloud))
                / seen_a.pixel_size;
            let reach = seen_a.reach.max(seen_b.reach).max(support);
            let points = side_a.columns.across().chain(side_b.columns.across());
            fold.find(reach, seen_a.pixel_size, points);
            side_a.columns.fold(fold, camera, &mut seen_a);
            side_b.columns.fold(fold, camera, &mut seen_b);
            rect = seen_a.rect.intersection(&seen_b.rect)?;
        }
        let all = [side_a.points.len(), side_b.points.len()];
        let cost = self.cost([a, b], &rect, seen_a.near.min(seen_b.near), all);
        if camera.size.is_none() && self.shared.room.refuses(cost) {
            return None;
        }
        let (side_a, side_b) = (&mut self.a, &mut self.b);
        for (seen, side) in [(&mut seen_a, &*side_a), (&mut seen_b, &*side_b)] {
            seen.limit_depths(DepthScale::reach(params), || side.columns.median_depth());
        }
        let tiles = Tiles::new(&rect, seen_a.reach.max(seen_b.reach));
        let sort = |side: &mut Side, sign: f32| {
            side.columns.sort(&tiles, camera);
            side.columns.reduce(&tiles, sign);
        };
        rayon::join(|| sort(side_a, 1.0), || sort(side_b, -1.0));
        let support_px = support / seen_a.pixel_size.min(seen_b.pixel_size);
        let (columns_a, columns_b) = (&side_a.columns, &side_b.columns);
        let meet = |tile: usize| columns_a.meet(columns_b, tile, reach);
        let rect = (self.shared.touching).mark(&tiles, &rect, support_px, meet)?;
        let near = seen_a.near.min(seen_b.near);
        Some(MeetingRegion { rect, tiles, near })
    }
}
