//! Shared by the tests of all packages: sampled shapes, oracles, random poses, real data.

mod accuracy;
mod backend;
mod data;
mod half_space;
mod host;
mod oracle;
mod overlaps;
mod pairs;
mod parity;
mod policy;
mod random;
mod shapes;
mod sheets;
mod skip;
mod way_out;

pub use accuracy::{
    ACCURACY_ROWS, ANGLE_BINS, ANGLE_STEP, AccuracyRow, CONTACT_SPACING, ContactCase,
    ContactClouds, ContactPair, ContactShape, DEEP_LIMIT, NORMAL_LIMIT, Regime, SHALLOW_LIMIT,
    measure_accuracy,
};
pub use backend::{compare_batch, compare_on, gpu_backend};
pub use data::{data_file, load_cloud, scale_to};
pub use half_space::HalfSpace;
pub use host::Host;
pub use oracle::{OracleFragment, OracleLayer, OracleSurface, oracle_layers};
pub use overlaps::{ClosedShape, Overlap, measure_overlaps};
pub use pairs::{aimed, aimed_clouds, compare, compare_clouds, deepest_contact, deepest_point};
pub use parity::{Difference, FIRM, PARITY_RADIUS, RandomPair, TURNED, pair_queries, random_pairs};
pub use policy::PolicyChoice;
pub use random::{random_pose, random_unit};
pub use shapes::{
    Samples, cloud_of, sampled_box, sampled_plane, sampled_ramp, sampled_sphere, sampled_torus,
};
pub use sheets::{Sheet, standard_normal};
pub use skip::{REQUIRE_DATA, REQUIRE_GPU, data_folder, say_skipped, skip, test_data};
pub use way_out::WayOut;
