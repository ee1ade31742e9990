// Eigenvectors of symmetric 3 x 3 matrices (xx, xy, xz, yy, yz, zz) by Jacobi's rotations.

struct Symmetric {
    diagonal: vec3f,
    // xy, xz, yz
    rest: vec3f,
}

// The unit eigenvector of the least eigenvalue, or of the greatest.
fn eigenvector(matrix: Symmetric, greatest: bool) -> vec3f {
    let scale = max(
        max(max(abs(matrix.diagonal.x), abs(matrix.diagonal.y)), abs(matrix.diagonal.z)),
        max(max(abs(matrix.rest.x), abs(matrix.rest.y)), abs(matrix.rest.z)),
    );
    if !(scale > 0.0) {
        return vec3f(0.0, 0.0, 1.0);
    }
    var m = array<array<f32, 3>, 3>(
        array<f32, 3>(matrix.diagonal.x / scale, matrix.rest.x / scale, matrix.rest.y / scale),
        array<f32, 3>(matrix.rest.x / scale, matrix.diagonal.y / scale, matrix.rest.z / scale),
        array<f32, 3>(matrix.rest.y / scale, matrix.rest.z / scale, matrix.diagonal.z / scale),
    );
    // Columns are the eigenvectors.
    var v = array<vec3f, 3>(vec3f(1.0, 0.0, 0.0), vec3f(0.0, 1.0, 0.0), vec3f(0.0, 0.0, 1.0));
    for (var sweep = 0u; sweep < 6u; sweep++) {
        for (var k = 0u; k < 3u; k++) {
            let p = k / 2u;
            let q = 1u + (k + 1u) / 2u;
            let off = m[p][q];
            if abs(off) < 1.0e-12 {
                continue;
            }
            let theta = (m[q][q] - m[p][p]) / (2.0 * off);
            let t = select(-1.0, 1.0, theta >= 0.0) / (abs(theta) + sqrt(theta * theta + 1.0));
            let c = inverseSqrt(t * t + 1.0);
            let s = t * c;
            let r = 3u - p - q;
            let rp = m[r][p];
            let rq = m[r][q];
            m[p][p] -= t * off;
            m[q][q] += t * off;
            m[p][q] = 0.0;
            m[q][p] = 0.0;
            m[r][p] = c * rp - s * rq;
            m[p][r] = m[r][p];
            m[r][q] = s * rp + c * rq;
            m[q][r] = m[r][q];
            let vp = v[p];
            v[p] = c * vp - s * v[q];
            v[q] = s * vp + c * v[q];
        }
    }
    var best = 0u;
    for (var k = 1u; k < 3u; k++) {
        let is_better = select(m[k][k] < m[best][best], m[k][k] > m[best][best], greatest);
        best = select(best, k, is_better);
    }
    return normalize(v[best]);
}
