// Stage `aim`: the views of a pair, see `camera_policy.rs`. A workgroup takes a pair; sums over the
// normals are integers and do not depend on their order.

@group(0) @binding(1) var<storage, read> pairs: array<Pair>;
@group(0) @binding(7) var<storage, read_write> views: array<View>;
@group(0) @binding(8) var<storage, read_write> work: array<atomic<u32>>;
@group(0) @binding(10) var<storage, read_write> samples: array<vec4f>;
@group(0) @binding(14) var<storage, read_write> found: array<atomic<u32>>;

const LANES: u32 = 64u;
// Steps of the sums: 2^20. SAMPLE_SLOTS = 1024 of them stay below 2^31.
const STEPS: f32 = 1048576.0;

// Σ n nᵀ (xx, yy, zz, xy, xz, yz) of each side.
var<workgroup> moments: array<atomic<i32>, 12>;
// Of each side: normals not seen by earlier views, those that face the axis, Σ n·axis over these.
var<workgroup> unseen_count: array<atomic<u32>, 2>;
var<workgroup> facing_count: array<atomic<u32>, 2>;
var<workgroup> facing_sum: array<atomic<i32>, 2>;

var<workgroup> axis: vec3f;
var<workgroup> is_done: bool;
// No normals: the axis is what it is.
var<workgroup> is_forced: bool;
// The last axis is asked about in place of the proposed one.
var<workgroup> is_again: bool;
var<workgroup> view_count: u32;
var<workgroup> seen: array<vec3f, 3>;

fn sample_count(side: u32) -> u32 {
    let state = batch.sides_at + side * SIDE_WORDS;
    return min(atomicLoad(&work[state + SAMPLE_COUNT]), SAMPLE_SLOTS);
}

fn is_unseen(normal: vec3f) -> bool {
    for (var k = 0u; k < view_count; k++) {
        if abs(dot(seen[k], normal)) >= WELL_SEEN {
            return false;
        }
    }
    return true;
}

// What the earlier views do not see of a normal.
fn rest_of(normal: vec3f) -> vec3f {
    var n = normal;
    for (var k = 0u; k < view_count; k++) {
        n -= dot(n, seen[k]) * seen[k];
    }
    return n;
}

// Mean over both sides' normals of n nᵀ.
fn zone_covariance(pair: u32) -> Symmetric {
    var m = Symmetric();
    for (var s = 0u; s < 2u; s++) {
        let scale = 1.0 / (STEPS * f32(max(sample_count(2u * pair + s), 1u)));
        m.diagonal += scale * vec3f(
            f32(atomicLoad(&moments[6u * s])),
            f32(atomicLoad(&moments[6u * s + 1u])),
            f32(atomicLoad(&moments[6u * s + 2u])),
        );
        m.rest += scale * vec3f(
            f32(atomicLoad(&moments[6u * s + 3u])),
            f32(atomicLoad(&moments[6u * s + 4u])),
            f32(atomicLoad(&moments[6u * s + 5u])),
        );
    }
    return m;
}

fn with_outer(m: Symmetric, weight: f32, v: vec3f) -> Symmetric {
    return Symmetric(
        m.diagonal + weight * v * v,
        m.rest + weight * vec3f(v.x * v.y, v.x * v.z, v.y * v.z),
    );
}

// Mean of n·axis over the normals that face it or its opposite, if they tell the outside.
fn mean_along(pair: u32, s: u32) -> f32 {
    let side = 2u * pair + s;
    let count = f32(atomicLoad(&facing_count[s]));
    if (pairs[pair].sides[s].flags & ORIENTED) == 0u || count < LEAST_SHARE * f32(sample_count(side)) {
        return 0.0;
    }
    return f32(atomicLoad(&facing_sum[s])) / STEPS / max(count, 1.0);
}

// 1: true, -1: false, 0: inconclusive.
fn conclusive(sign: f32) -> i32 {
    return select(0, select(-1, 1, sign > 0.0), abs(sign) >= CONCLUSIVE);
}

// Mean of the near points of the larger surface, if that may be a sheet; w is 1 then.
fn sheet_of(pair: u32) -> vec4f {
    let side = 2u * pair + (1u - pairs[pair].body_is_b);
    if (pairs[pair].sides[side % 2u].flags & ORIENTED) != 0u {
        return vec4f();
    }
    let state = batch.sides_at + side * SIDE_WORDS;
    let low = pairs[pair].overlap_min;
    let extents = pairs[pair].overlap_max - low;
    let count = f32(max(atomicLoad(&work[state + NEAR_COUNT]), 1u));
    var mean = vec3f();
    for (var k = 0u; k < 3u; k++) {
        let upper = f32(atomicLoad(&work[state + NEAR_HIGH + k]));
        let lower = f32(atomicLoad(&work[state + NEAR_LOW + k]));
        mean[k] = (upper * 65536.0 + lower) / count / PLACE_STEPS;
    }
    return vec4f(low + mean * extents, 1.0);
}

// How far along the axis `b`, off by `offset`, is from `a`, from the sheet to the body's middle or the
// opposite, in half extents of the body.
fn share_along(pair: u32, sheet: vec4f, offset: vec3f) -> f32 {
    let toward_body = pairs[pair].body_middle - sheet.xyz;
    let toward_b = select(-toward_body, toward_body, pairs[pair].body_is_b != 0u);
    let in_body = vec3f(
        dot(pairs[pair].body_from_a_x, axis),
        dot(pairs[pair].body_from_a_y, axis),
        dot(pairs[pair].body_from_a_z, axis),
    );
    let half = dot(pairs[pair].body_half_extents, abs(in_body));
    return dot(toward_b + offset, axis) / max(half, 1e-30);
}

// Whether `b`, off by `offset`, is plainly on the side of `a` that the axis points away from (1), or
// on the other (-1): by where it lies at the sheet, or by where the bounds meet.
fn side_of(pair: u32, sheet: vec4f, offset: vec3f) -> i32 {
    var along = dot(pairs[pair].lies + offset, axis);
    let in_larger = vec3f(
        dot(pairs[pair].larger_from_a_x, axis),
        dot(pairs[pair].larger_from_a_y, axis),
        dot(pairs[pair].larger_from_a_z, axis),
    );
    var most = dot(pairs[pair].half_extents, abs(in_larger));
    if sheet.w > 0.0 {
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
        by_memory = conclusive(dot(axis, pairs[pair].last_axis));
    }
    // What was remembered may plainly not be.
    let contradicted = sheet.w > 0.0 && now == -by_memory && before != by_memory;
    by_memory = select(by_memory, 0, contradicted);
    let of_a = mean_along(pair, 0u);
    let of_b = mean_along(pair, 1u);
    let by_both = select(0, conclusive(of_b), conclusive(of_b) == conclusive(-of_a));
    let is_crossing = abs(dot(motion, axis)) >= CROSSING * length(motion);
    let by_place = select(now, before, is_crossing && before != 0);
    // The bounds of a sheet that is not level in its own frame hold a body on either side of it.
    var by_position = -dot(axis, unit_or(pairs[pair].toward_b, vec3f()));
    if sheet.w > 0.0 {
        by_position = -share_along(pair, sheet, -motion);
    }
    var told = by_memory;
    told = select(by_both, told, told != 0);
    told = select(by_place, told, told != 0);
    told = select(conclusive(of_b - of_a), told, told != 0);
    told = select(conclusive(by_position), told, told != 0);
    return select(2 * told, select(-1, 1, by_position >= 0.0), told == 0);
}

// The axis of the next view, before its sign is known.
fn propose(pair: u32, turn: u32) {
    let policy = pairs[pair].policy;
    let has_last = pairs[pair].has_last != 0u;
    let up = vec3f(0.0, 0.0, 1.0);
    if policy == FIXED_VIEW {
        axis = pairs[pair].view_z.xyz;
        return;
    }
    if policy == MOTION {
        axis = unit_or(-pairs[pair].toward_b, up);
        return;
    }
    if policy == SMALLEST_EXTENT {
        let e = pairs[pair].half_extents;
        let is_x = e.x <= e.y && e.x <= e.z;
        let is_y = !is_x && e.y <= e.z;
        axis = vec3f(f32(is_x), f32(is_y), f32(!is_x && !is_y));
        return;
    }
    if policy == LAST_NORMAL && has_last {
        axis = unit_or(pairs[pair].last_axis, up);
        return;
    }
    var covariance = zone_covariance(pair);
    if policy != COVARIANCE && turn == 0u {
        let direction = unit_or(pairs[pair].toward_b, vec3f());
        covariance = with_outer(covariance, HINT_WEIGHT * pairs[pair].plainness, direction);
        if has_last {
            covariance = with_outer(covariance, MEMORY_WEIGHT, pairs[pair].last_axis);
        }
    }
    let d = covariance.diagonal;
    if !(d.x + d.y + d.z > 0.0) {
        // Nothing tells: along the approach, once.
        is_forced = turn == 0u;
        is_done = turn > 0u;
        axis = unit_or(-pairs[pair].toward_b, up);
        if has_last {
            axis = unit_or(pairs[pair].last_axis, up);
        }
        return;
    }
    axis = eigenvector(covariance, true);
    if policy != COVARIANCE && turn == 0u && has_last
        && abs(dot(axis, pairs[pair].last_axis)) >= cos(AXIS_HYSTERESIS) {
        axis = pairs[pair].last_axis;
    }
}

// Whether both sides have enough that an earlier view does not see and this one does.
fn is_worthwhile(pair: u32) -> bool {
    let a = f32(max(sample_count(2u * pair), 1u));
    let b = f32(max(sample_count(2u * pair + 1u), 1u));
    let left_a = f32(atomicLoad(&unseen_count[0])) / a;
    let left_b = f32(atomicLoad(&unseen_count[1])) / b;
    return max(left_a, left_b) >= LEAST_SHARE
        && f32(atomicLoad(&facing_count[0])) / a >= LEAST_SHARE
        && f32(atomicLoad(&facing_count[1])) / b >= LEAST_SHARE;
}

// Takes the proposed view, if it tells something.
fn decide(pair: u32, turn: u32) {
    let policy = pairs[pair].policy;
    let is_zone = policy == CONTACT_ZONE || policy == ALL_DIRECTIONS
        || (policy == LAST_NORMAL && pairs[pair].has_last == 0u);
    if turn > 0u && (!is_zone || !is_worthwhile(pair)) {
        is_done = true;
        return;
    }
    var told = 2;
    if policy != FIXED_VIEW && !is_forced {
        told = orientation(pair);
    }
    if turn == 0u && is_zone && abs(told) < 2 && pairs[pair].has_last != 0u && !is_again {
        // A body half way through a rough sheet seems to be beside its rim.
        axis = pairs[pair].last_axis;
        is_again = true;
        return;
    }
    is_again = false;
    if turn > 0u && abs(told) < 2 {
        // A guess at the side would turn a gap into a penetration.
        is_done = true;
        return;
    }
    let sign = select(-1.0, 1.0, told > 0);
    axis = sign * axis;
    seen[view_count] = axis;
    push_view(pair, sign);
    view_count += 1u;
    is_done = !is_zone || is_forced;
}

fn push_view(pair: u32, sign: f32) {
    var view = view_along(axis);
    if pairs[pair].policy == FIXED_VIEW {
        view.view_x = pairs[pair].view_x;
        view.view_y = pairs[pair].view_y;
        view.view_z = pairs[pair].view_z;
    }
    for (var s = 0u; s < 2u; s++) {
        let facts = &pairs[pair].sides[s];
        let middle = dot(view.view_z.xyz, (*facts).middle) + view.view_z.w;
        view.middles[s] = middle;
        if ((*facts).flags & HAS_MIDDLE) != 0u {
            view.flags |= MIDDLE_KNOWN << s;
        }
        let along = sign * mean_along(pair, s);
        if select(along, -along, s == 1u) >= CONCLUSIVE {
            view.flags |= FROM_BEHIND << s;
        }
    }
    let index = pair * MAX_VIEWS + view_count;
    views[index] = view;
    let at = pair * PAIR_WORDS;
    atomicStore(&found[at + VIEWS], view_count + 1u);
    for (var k = 0u; k < 3u; k++) {
        atomicStore(&found[at + AXES + 3u * view_count + k], bitcast<u32>(axis[k]));
    }
}

@compute @workgroup_size(64)
fn aim(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let pair = min(group_index(group), batch.pairs - 1u);
    let exists = group_index(group) < batch.pairs;
    // Nothing is found yet. Workgroups beyond the last pair leave it alone.
    if exists && lane < MAX_VIEWS {
        views[pair * MAX_VIEWS + lane].exists = MISSING;
    }
    if exists && lane < PAIR_WORDS {
        atomicStore(&found[pair * PAIR_WORDS + lane], 0u);
    }
    storageBarrier();
    if lane == 0u {
        let near_a = atomicLoad(&work[batch.sides_at + 2u * pair * SIDE_WORDS + NEAR_COUNT]);
        let near_b = atomicLoad(&work[batch.sides_at + (2u * pair + 1u) * SIDE_WORDS + NEAR_COUNT]);
        is_done = near_a == 0u || near_b == 0u || !exists;
        is_forced = false;
        is_again = false;
        view_count = 0u;
    }
    for (var turn = 0u; turn < MAX_VIEWS; turn++) {
        workgroupBarrier();
        if lane < 12u {
            atomicStore(&moments[lane], 0);
        }
        if lane < 2u {
            atomicStore(&unseen_count[lane], 0u);
        }
        workgroupBarrier();
        if !is_done {
            for (var s = 0u; s < 2u; s++) {
                let side = 2u * pair + s;
                let count = sample_count(side);
                for (var k = lane; k < count; k += LANES) {
                    let normal = samples[side * SAMPLE_SLOTS + k].xyz;
                    if is_unseen(normal) {
                        let n = rest_of(normal);
                        let d = vec3i(round_to_steps(n * n));
                        let r = vec3i(round_to_steps(vec3f(n.x * n.y, n.x * n.z, n.y * n.z)));
                        for (var c = 0u; c < 3u; c++) {
                            atomicAdd(&moments[6u * s + c], d[c]);
                            atomicAdd(&moments[6u * s + 3u + c], r[c]);
                        }
                        atomicAdd(&unseen_count[s], 1u);
                    }
                }
            }
        }
        workgroupBarrier();
        if lane == 0u && !is_done {
            propose(pair, turn);
        }
        for (var attempt = 0u; attempt < 2u; attempt++) {
            workgroupBarrier();
            let is_asked = !is_done && (attempt == 0u || is_again);
            if lane < 2u {
                atomicStore(&facing_count[lane], 0u);
                atomicStore(&facing_sum[lane], 0);
            }
            workgroupBarrier();
            if is_asked {
                for (var s = 0u; s < 2u; s++) {
                    let side = 2u * pair + s;
                    let count = sample_count(side);
                    for (var k = lane; k < count; k += LANES) {
                        let along = dot(samples[side * SAMPLE_SLOTS + k].xyz, axis);
                        if abs(along) >= SUPPORTED {
                            atomicAdd(&facing_count[s], 1u);
                            atomicAdd(&facing_sum[s], i32(round(along * STEPS)));
                        }
                    }
                }
            }
            workgroupBarrier();
            if lane == 0u && is_asked {
                decide(pair, turn);
            }
        }
    }
}

fn round_to_steps(v: vec3f) -> vec3f {
    return round(v * STEPS);
}
