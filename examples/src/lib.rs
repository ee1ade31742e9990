//! What the runnable stories share: command-line options, generated scenes, loading, finding up,
//! spots to drop bodies on, the simulation, pictures and reports.

pub mod bodies;
pub mod cli;
mod collada;
pub mod contact_kinds;
pub mod depth;
pub mod devices;
pub mod drop;
mod faces;
pub mod gallop;
pub mod lidar;
pub mod load;
pub mod mesh;
mod numbers;
pub mod output;
pub mod pictures;
pub mod query;
pub mod query_pictures;
mod query_views;
mod random;
mod rays;
pub mod recording;
pub mod robot;
pub mod scan;
pub mod scene;
pub mod section_picture;
pub mod spots;
pub mod step_totals;
pub mod surface_sampling;
pub mod terrain;
pub mod up;
pub mod world;
