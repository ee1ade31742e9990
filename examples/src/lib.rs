//! What the runnable stories share: command-line options, generated scenes, loading, finding up,
//! spots to drop bodies on, the simulation, pictures and reports.

pub mod cli;
mod collada;
pub mod contact_kinds;
pub mod depth;
pub mod devices;
mod faces;
pub mod gallop;
pub mod lidar;
pub mod load;
mod median;
pub mod mesh;
mod normal_signs;
pub mod output;
pub mod query;
pub mod query_pictures;
mod query_views;
mod random;
pub mod recording;
pub mod report;
pub mod robot;
pub mod scan;
pub mod scene;
pub mod simulation;
pub mod spots;
pub mod step_totals;
pub mod surface_sampling;
pub mod terrain;
pub mod up;
pub mod world;
