//! The code of the README and of the pages in `docs`, compiled and run as tests.

/// The code of one page.
macro_rules! page {
    ($name:ident, $path:literal) => {
        #[doc = include_str!($path)]
        struct $name;
    };
}

page!(Readme, "../../../README.md");
page!(Choosing, "../../../docs/choosing.md");
page!(InYourApp, "../../../docs/in_your_app.md");
page!(TwoClouds, "../../../docs/two_clouds.md");
