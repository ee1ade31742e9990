//! Shared by the tests of all packages: sampled shapes, oracles, random poses, real data.

mod data;
mod oracle;
mod pairs;
mod random;
mod shapes;

pub use data::{data_file, load_cloud};
pub use oracle::{OracleFragment, oracle_layers};
pub use pairs::{aimed, compare, compare_clouds, deepest_point};
pub use random::{random_pose, random_unit};
pub use shapes::{Samples, sampled_box, sampled_plane, sampled_sphere};
