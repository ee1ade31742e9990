// Stage `aim`: the views of a pair, see `camera_policy.rs`. A workgroup takes a pair; sums over the
// normals are integers and do not depend on their order.

@group(0) @binding(1) var<storage, read> pairs: array<Pair>;
@group(0) @binding(7) var<storage, read_write> views: array<View>;
@group(0) @binding(8) var<storage, read_write> work: array<atomic<u32>>;
@group(0) @binding(10) var<storage, read_write> samples: array<Sample>;
@group(0) @binding(14) var<storage, read_write> found: array<atomic<u32>>;

const LANES: u32 = 64u;
// Steps of the sums: 2^20. SAMPLE_SLOTS = 1024 of them stay below 2^31.
const STEPS: f32 = 1048576.0;

// Σ n nᵀ (xx, yy, zz, xy, xz, yz) of each side.
var<workgroup> moments: array<atomic<i32>, 12>;
// Of each side: normals not seen by earlier views, Σ (n·axis)³ n over these, Σ n·axis over those that face the axis or
// its opposite.
var<workgroup> unseen_count: array<atomic<u32>, 2>;
var<workgroup> turned_sum: array<atomic<i32>, 6>;
var<workgroup> facing_sum: array<atomic<i32>, 2>;
// Of each side the points that face the axis, its opposite, and neither: how many, Σ of their places along the axis from
// the least corner of the overlap, in shares of its diagonal, and Σ of the squares of these.
var<workgroup> place_count: array<atomic<u32>, 6>;
var<workgroup> place_sum: array<atomic<i32>, 6>;
var<workgroup> place_squares: array<atomic<i32>, 6>;

var<workgroup> axis: vec3f;
var<workgroup> is_done: bool;
// Another direction has nearly as much of the normals: the axis turns to a face.
var<workgroup> is_turning: bool;
var<workgroup> proposed: vec3f;
// No normals: the axis is what it is.
var<workgroup> is_forced: bool;
// The last axis is asked about in place of the proposed one.
var<workgroup> is_again: bool;
var<workgroup> view_count: u32;
// Only one surface faces this view, or an earlier one.
var<workgroup> is_spare: bool;
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
        axis = select(pairs[pair].larger_from_a_z, pairs[pair].larger_from_a_y, is_y);
        axis = select(axis, pairs[pair].larger_from_a_x, is_x);
        return;
    }
    if policy == LAST_NORMAL && has_last {
        axis = unit_or(pairs[pair].last_axis, up);
        return;
    }
    let of_normals = zone_covariance(pair);
    var covariance = of_normals;
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
    // Between faces an axis sees no contact well, but more of where surfaces cross.
    let turns = policy != COVARIANCE && policy != ALL_DIRECTIONS;
    is_turning = turns && is_one_of_alike(of_normals);
    proposed = axis;
}

fn times(m: Symmetric, v: vec3f) -> vec3f {
    return m.diagonal * v + vec3f(
        m.rest.x * v.y + m.rest.y * v.z,
        m.rest.x * v.x + m.rest.z * v.z,
        m.rest.y * v.x + m.rest.z * v.y,
    );
}

// Whether another direction across the axis has nearly as much of the normals' covariance.
fn is_one_of_alike(covariance: Symmetric) -> bool {
    let w = times(covariance, axis);
    let along = dot(axis, w);
    let crossed = vec3f(
        axis.x * w.y + axis.y * w.x,
        axis.x * w.z + axis.z * w.x,
        axis.y * w.z + axis.z * w.y,
    );
    var across = Symmetric(covariance.diagonal - 2.0 * axis * w, covariance.rest - crossed);
    across = with_outer(across, along, axis);
    let d = across.diagonal;
    if !(d.x + d.y + d.z > 0.0) {
        return false;
    }
    let other = eigenvector(across, true);
    return dot(other, times(covariance, other)) >= ALIKE * along;
}

// One step of the axis towards the face that it is nearest to; after the last one back, if there are no faces.
fn turn_to_face(pair: u32, step: u32) {
    var sum = vec3f();
    for (var s = 0u; s < 2u; s++) {
        let of_side = vec3f(
            f32(atomicLoad(&turned_sum[3u * s])),
            f32(atomicLoad(&turned_sum[3u * s + 1u])),
            f32(atomicLoad(&turned_sum[3u * s + 2u])),
        );
        sum += of_side / (STEPS * f32(max(sample_count(2u * pair + s), 1u)));
    }
    let flatness = dot(sum, axis) / dot(axis, times(zone_covariance(pair), axis));
    axis = unit_or(sum, axis);
    if step + 1u == TURNS && !(flatness >= FLAT) {
        axis = proposed;
    }
}

// Keeps the last axis, if the proposed one is close to it.
fn keep_last(pair: u32, turn: u32) {
    let policy = pairs[pair].policy;
    let is_zone = policy == CONTACT_ZONE || policy == ALL_DIRECTIONS;
    if is_zone && turn == 0u && !is_forced && pairs[pair].has_last != 0u
        && abs(dot(axis, pairs[pair].last_axis)) >= cos(AXIS_HYSTERESIS) {
        axis = pairs[pair].last_axis;
    }
}

// Whether a side has enough that no earlier view sees. Where one of both has too little that faces the axis, it is spare.
fn is_worthwhile(pair: u32) -> bool {
    let a = f32(max(sample_count(2u * pair), 1u));
    let b = f32(max(sample_count(2u * pair + 1u), 1u));
    let left_a = f32(atomicLoad(&unseen_count[0])) / a;
    let left_b = f32(atomicLoad(&unseen_count[1])) / b;
    is_spare = is_spare || min(facing_count(0u) / a, facing_count(1u) / b) < LEAST_SHARE;
    return max(left_a, left_b) >= LEAST_SHARE;
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
        if ((*facts).flags & IS_BODY) != 0u {
            let x = (*facts).frame_from_cloud_x;
            let y = (*facts).frame_from_cloud_y;
            let z = (*facts).frame_from_cloud_z;
            let depth = view.view_z.x * x + view.view_z.y * y + view.view_z.z * z;
            let middle = dot(depth.xyz, (*facts).middle) + depth.w + view.view_z.w;
            let half_depth = dot(abs(depth.xyz), (*facts).half_extents);
            view.near[s] = middle - half_depth;
            view.far[s] = middle + half_depth;
            view.flags |= BODY << s;
        }
        let along = sign * mean_along(pair, s);
        if select(along, -along, s == 1u) >= CONCLUSIVE {
            view.flags |= FROM_BEHIND << s;
        }
    }
    let index = pair * MAX_VIEWS + view_count;
    let at = pair * PAIR_WORDS;
    if is_spare {
        view.exists = MISSING;
        atomicAdd(&found[at + SPARE], 1u);
    } else {
        atomicStore(&found[at + VIEWS], view_count + 1u);
    }
    views[index] = view;
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
        is_turning = false;
        is_spare = false;
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
                    let normal = samples[side * SAMPLE_SLOTS + k].normal;
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
            is_turning = false;
            propose(pair, turn);
        }
        for (var step = 0u; step < TURNS; step++) {
            workgroupBarrier();
            if lane < 6u {
                atomicStore(&turned_sum[lane], 0);
            }
            workgroupBarrier();
            if !is_done && is_turning {
                for (var s = 0u; s < 2u; s++) {
                    let side = 2u * pair + s;
                    let count = sample_count(side);
                    for (var k = lane; k < count; k += LANES) {
                        let normal = samples[side * SAMPLE_SLOTS + k].normal;
                        if is_unseen(normal) {
                            let n = rest_of(normal);
                            let along = dot(n, axis);
                            let t = vec3i(round_to_steps(along * along * along * n));
                            for (var c = 0u; c < 3u; c++) {
                                atomicAdd(&turned_sum[3u * s + c], t[c]);
                            }
                        }
                    }
                }
            }
            workgroupBarrier();
            if lane == 0u && !is_done && is_turning {
                turn_to_face(pair, step);
            }
        }
        workgroupBarrier();
        if lane == 0u && !is_done {
            keep_last(pair, turn);
        }
        for (var attempt = 0u; attempt < 2u; attempt++) {
            workgroupBarrier();
            let is_asked = !is_done && (attempt == 0u || is_again);
            if lane < 2u {
                atomicStore(&facing_sum[lane], 0);
            }
            if lane < 6u {
                atomicStore(&place_count[lane], 0u);
                atomicStore(&place_sum[lane], 0);
                atomicStore(&place_squares[lane], 0);
            }
            workgroupBarrier();
            if is_asked {
                let low = pairs[pair].overlap_min;
                let diagonal = overlap_diagonal(pair);
                for (var s = 0u; s < 2u; s++) {
                    let side = 2u * pair + s;
                    let count = sample_count(side);
                    for (var k = lane; k < count; k += LANES) {
                        let sample = samples[side * SAMPLE_SLOTS + k];
                        let along = dot(sample.normal, axis);
                        let is_facing = abs(along) >= SUPPORTED;
                        if is_facing {
                            atomicAdd(&facing_sum[s], i32(round(along * STEPS)));
                        }
                        let at = 3u * s + select(2u, select(1u, 0u, along > 0.0), is_facing);
                        let place = clamp(dot(sample.point - low, axis) / diagonal, -1.0, 1.0);
                        atomicAdd(&place_count[at], 1u);
                        atomicAdd(&place_sum[at], i32(round(place * STEPS)));
                        atomicAdd(&place_squares[at], i32(round(place * place * STEPS)));
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
