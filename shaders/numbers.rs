//! The numbers that the host and the stages share, each defined once.

/// Declares them as constants of Rust, and the same ones as WGSL in `numbers_wgsl!`.
macro_rules! numbers {
    ($($(#[$doc:meta])+ $name:ident = $value:literal;)+) => {
        $($(#[$doc])+ pub const $name: u32 = $value;)+

        macro_rules! numbers_wgsl {
            () => {
                concat!($("const ", stringify!($name), ": u32 = ", $value, "u;\n"),+)
            };
        }
    };
}

numbers! {
    /// Threads of a workgroup.
    GROUP = 256;
    /// Most workgroups of a dispatch along x. The rest goes along y.
    MAX_GROUPS = 65_535;

    /// Normals that one side can hold for `aim`: chosen by a hash, they are a few more than `AIM_SAMPLES` at times.
    SAMPLE_SLOTS = 1024;
    /// Bits of a fragment's weight. The other bits of its word are the number of its splat.
    WEIGHT_BITS = 8;

    /// The pair's camera is given. The values of `Pair.policy` before it are the variants of `tldi::CameraPolicy`.
    FIXED_VIEW = 6;
    /// `CameraPolicy::ContactZone`.
    CONTACT_ZONE = 0;
    /// `CameraPolicy::AllDirections`.
    ALL_DIRECTIONS = 1;
    /// `CameraPolicy::Motion`.
    MOTION = 2;
    /// `CameraPolicy::Covariance`.
    COVARIANCE = 3;
    /// `CameraPolicy::SmallestExtent`.
    SMALLEST_EXTENT = 4;
    /// `CameraPolicy::LastNormal`.
    LAST_NORMAL = 5;

    /// Bit of `Side.flags`: the cloud has normals.
    HAS_NORMALS = 1;
    /// Bit of `Side.flags`: its normals point outward.
    ORIENTED = 2;
    /// Bit of `Side.flags`: each point has a radius of its own.
    RADII_DIFFER = 4;
    /// Bit of `Side.flags`: it is the smaller surface of the pair.
    IS_BODY = 8;

    /// Words of the counters at the start of the arena. A counter goes on beyond the capacity: it tells what was needed.
    COUNTERS = 16;
    /// Counter of the culled points.
    SURVIVORS = 0;
    /// Counter of the tiles.
    TILES = 1;
    /// Counter of the pixels.
    PIXELS = 2;
    /// Counter of the splats.
    SPLATS = 3;
    /// Counter of the fragments.
    FRAGMENTS = 4;
    /// Counter of the layers.
    LAYERS = 5;
    /// Counter of the contact pixels.
    CONTACTS = 6;
    /// Counter of the points in the order of the cells in which neighbours are looked for.
    ENTRIES = 7;
    /// 1 where there are more fragments than a word counts.
    FRAGMENTS_WRAPPED = 8;

    /// Words of a side in the arena.
    SIDE_WORDS = 8;
    /// Words of a view in the arena: greatest and least coordinates of what is seen of each side, as ordered numbers (the
    /// least ones negated), and the touching tiles' bounds likewise.
    VIEW_WORDS = 16;

    /// Words of a pair in what is read back.
    PAIR_WORDS = 29;
    /// Word of a pair: signs of a crossing.
    CROSSINGS = 0;
    /// Word of a pair: the least gap, negated, as an ordered number; 0 where there is none.
    GAP = 1;
    /// Word of a pair: whether a pixel has too many fragments.
    CROWDED = 2;
    /// Word of a pair: number of its views.
    VIEWS = 3;
    /// Word of a pair: the first view's axis, and those of the others behind it.
    AXES = 4;
    /// Word of a pair: whether `b` is on the other side than the first view's axis says, and those of the others behind it.
    BEYOND = 13;
    /// Word of a pair: the first view's ways out, and those of the others behind them.
    WAYS = 16;
    /// Ways out of a view, as ordered numbers; 0 where no pixel shows both surfaces.
    VIEW_WAYS = 4;
    /// Word of a pair: number of its spare views, whose axes and ways out stand behind those of the others.
    SPARE = 28;
    /// Of the ways out of a view: against and along the axis, by all layers.
    ALL_WAYS = 0;
    /// The same by the layers that face the view.
    FACE_WAYS = 2;
    /// Words of a contact pixel in what is read back. The first one is the number of its view among those of all pairs.
    CONTACT_WORDS = 12;
    /// Words of a contact pixel: column and row.
    CONTACT_PIXEL = 1;
    /// Words of a contact pixel: depths of both surfaces.
    CONTACT_DEPTHS = 3;
    /// Word of a contact pixel: the gap.
    CONTACT_GAP = 5;
    /// Words of a contact pixel: normals of both surfaces.
    CONTACT_NORMALS = 6;

    /// Word of the indirect dispatch over tiles.
    TILE_GROUPS = 0;
    /// Word of the indirect dispatch over the pixels of both sides.
    PIXEL_GROUPS = 3;
    /// Word of the indirect dispatch over pixels.
    IMAGE_GROUPS = 6;
}
