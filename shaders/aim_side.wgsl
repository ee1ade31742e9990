// Stage `aim`: on which side of `a` the body `b` lies, see `oriented` in `camera_policy.rs`. It reads the sums of `aim.wgsl`.

// Bits of the classes of points in the sums of places.
const FACES_AXIS: u32 = 1u;
const FACES_OPPOSITE: u32 = 2u;
const FACES: u32 = 3u;
const ALL: u32 = 7u;

fn facing_count(s: u32) -> f32 {
    return f32(atomicLoad(&place_count[3u * s]) + atomicLoad(&place_count[3u * s + 1u]));
}

// Mean of n·axis over the normals that face it or its opposite, if they tell the outside.
fn mean_along(pair: u32, s: u32) -> f32 {
    let side = 2u * pair + s;
    let count = facing_count(s);
    if (pairs[pair].sides[s].flags & ORIENTED) == 0u || count < LEAST_SHARE * f32(sample_count(side)) {
        return 0.0;
    }
    return f32(atomicLoad(&facing_sum[s])) / STEPS / max(count, 1.0);
}

fn overlap_diagonal(pair: u32) -> f32 {
    return max(length(pairs[pair].overlap_max - pairs[pair].overlap_min), 1.0e-30);
}

// Where points of a side are along the axis from the least corner of the overlap, metres.
struct PlaceAlong {
    mean: f32,
    scatter: f32,
    // Whether these points are enough.
    exists: bool,
}

fn place_along(pair: u32, s: u32, classes: u32) -> PlaceAlong {
    var count = 0.0;
    var sum = 0.0;
    var squares = 0.0;
    for (var c = 0u; c < 3u; c++) {
        if (classes & (1u << c)) != 0u {
            count += f32(atomicLoad(&place_count[3u * s + c]));
            sum += f32(atomicLoad(&place_sum[3u * s + c]));
            squares += f32(atomicLoad(&place_squares[3u * s + c]));
        }
    }
    let scale = 1.0 / (STEPS * max(count, 1.0));
    let mean = scale * sum;
    let diagonal = overlap_diagonal(pair);
    return PlaceAlong(
        diagonal * mean,
        diagonal * sqrt(max(scale * squares - mean * mean, 0.0)),
        count > 0.0 && count >= LEAST_SHARE * f32(sample_count(2u * pair + s)),
    );
}

// Of the points that face the axis (`sign` 1) or its opposite (-1); of all, if the outside is not known.
fn facing_place(pair: u32, s: u32, sign: f32) -> PlaceAlong {
    let is_oriented = (pairs[pair].sides[s].flags & ORIENTED) != 0u;
    let facing = select(FACES_OPPOSITE, FACES_AXIS, sign > 0.0);
    return place_along(pair, s, select(ALL, facing, is_oriented));
}

// Whether the axis points from `b` towards `a` (1) or the other way (-1), as far as the near points tell; or 0.
fn side_by_places(pair: u32) -> i32 {
    let flags = vec2u(pairs[pair].sides[0].flags, pairs[pair].sides[1].flags) & vec2u(ORIENTED);
    if flags.x != flags.y {
        return 0;
    }
    let a_ahead = facing_place(pair, 0u, -1.0);
    let b_ahead = facing_place(pair, 1u, 1.0);
    let a_back = facing_place(pair, 0u, 1.0);
    let b_back = facing_place(pair, 1u, -1.0);
    let is_ahead = a_ahead.exists && b_ahead.exists;
    let is_back = a_back.exists && b_back.exists;
    if is_ahead && is_back {
        let further = 0.5 * (a_ahead.mean - b_ahead.mean + a_back.mean - b_back.mean);
        let scatter = max(a_ahead.scatter + b_ahead.scatter, a_back.scatter + b_back.scatter);
        return select(0, select(-1, 1, further > 0.0), abs(further) > scatter);
    }
    return i32(is_ahead) - i32(is_back);
}

// 1: true, -1: false, 0: inconclusive.
fn conclusive(sign: f32) -> i32 {
    return select(0, select(-1, 1, sign > 0.0), abs(sign) >= CONCLUSIVE);
}

// Where along the axis the larger surface faces it or its opposite, if that may be a sheet.
struct Sheet {
    along: f32,
    exists: bool,
}

fn sheet_of(pair: u32) -> Sheet {
    let s = 1u - pairs[pair].body_is_b;
    let faces = place_along(pair, s, FACES);
    let all = place_along(pair, s, ALL);
    let along = select(all.mean, faces.mean, faces.exists);
    return Sheet(
        dot(pairs[pair].overlap_min, axis) + along,
        (pairs[pair].sides[s].flags & ORIENTED) == 0u,
    );
}

// How far along the axis `b`, off by `offset`, is from `a`, from the sheet to the body's middle or the
// opposite, in half extents of the body.
fn share_along(pair: u32, sheet: Sheet, offset: vec3f) -> f32 {
    let toward_body = dot(pairs[pair].body_middle, axis) - sheet.along;
    let toward_b = select(-toward_body, toward_body, pairs[pair].body_is_b != 0u);
    let in_body = vec3f(
        dot(pairs[pair].body_from_a_x, axis),
        dot(pairs[pair].body_from_a_y, axis),
        dot(pairs[pair].body_from_a_z, axis),
    );
    let half = dot(pairs[pair].body_half_extents, abs(in_body));
    return (toward_b + dot(offset, axis)) / max(half, 1e-30);
}

// Whether `b`, off by `offset`, is plainly on the side of `a` that the axis points away from (1), or
// on the other (-1): by where it lies at the sheet, or by where the bounds meet.
fn side_of(pair: u32, sheet: Sheet, offset: vec3f) -> i32 {
    var along = dot(pairs[pair].lies + offset, axis);
    let in_larger = vec3f(
        dot(pairs[pair].larger_from_a_x, axis),
        dot(pairs[pair].larger_from_a_y, axis),
        dot(pairs[pair].larger_from_a_z, axis),
    );
    var most = dot(pairs[pair].half_extents, abs(in_larger));
    if sheet.exists {
        along = share_along(pair, sheet, offset);
        most = PLAINLY;
    }
    return select(0, select(-1, 1, along < 0.0), abs(along) > most);
}

// Whether the axis points from `b` towards `a`, and not the other way: 1 or -1; twice that where
// something told.
fn orientation(pair: u32) -> i32 {
    let sheet = sheet_of(pair);
    let motion = pairs[pair].motion;
    let now = side_of(pair, sheet, vec3f());
    let before = side_of(pair, sheet, -motion);
    var by_memory = 0;
    if pairs[pair].has_last != 0u {
        let remembered = dot(axis, pairs[pair].last_axis);
        by_memory = select(0, select(-1, 1, remembered > 0.0), abs(remembered) >= WELL_SEEN);
    }
    let by_places = side_by_places(pair);
    by_memory = select(by_memory, 0, by_places == -by_memory);
    let of_a = mean_along(pair, 0u);
    let of_b = mean_along(pair, 1u);
    let is_crossing = abs(dot(motion, axis)) >= CROSSING * length(motion);
    let by_place = select(now, before, is_crossing && before != 0);
    // The bounds of a sheet that is not level in its own frame hold a body on either side of it.
    var by_position = -dot(axis, unit_or(pairs[pair].toward_b, vec3f()));
    if sheet.exists {
        by_position = -share_along(pair, sheet, -motion);
    }
    var told = by_memory;
    told = select(by_places, told, told != 0);
    told = select(by_place, told, told != 0);
    told = select(conclusive(of_b - of_a), told, told != 0);
    told = select(conclusive(by_position), told, told != 0);
    // Where `b` moves along the axis, it comes from where that points away from.
    let moves = dot(motion, axis);
    let guess = select(by_position, moves, moves != 0.0);
    return select(2 * told, select(-1, 1, guess >= 0.0), told == 0);
}
