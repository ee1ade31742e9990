//! The code of the README and of the pages in `docs`, compiled and run as tests.
//! `tests/doc_pages.rs` checks that no page with code is missing here.

/// The code of one page.
macro_rules! page {
    ($name:ident, $path:literal) => {
        #[doc = include_str!($path)]
        struct $name;
    };
}

page!(Readme, "../../../README.md");
page!(Choosing, "../../../docs/choosing.md");
page!(DepthCamera, "../../../docs/depth_camera.md");
page!(Gallop, "../../../docs/gallop.md");
page!(InYourApp, "../../../docs/in_your_app.md");
page!(LidarStream, "../../../docs/lidar_stream.md");
page!(RobotInScan, "../../../docs/robot_in_scan.md");
page!(Streams, "../../../docs/streams.md");
page!(TwoClouds, "../../../docs/two_clouds.md");
