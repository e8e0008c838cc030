//! Three-vectors and three-by-three matrices of lanes.

use super::Lane;

/// Three-vector of lanes.
pub(crate) type V3<T> = [T; 3];
/// Three-by-three matrix of lanes, row by row.
pub(crate) type M3<T> = [[T; 3]; 3];

#[inline(always)]
pub(crate) fn add<T: Lane>(a: V3<T>, b: V3<T>) -> V3<T> {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

#[inline(always)]
pub(crate) fn sub<T: Lane>(a: V3<T>, b: V3<T>) -> V3<T> {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
pub(crate) fn scale<T: Lane>(a: V3<T>, s: T) -> V3<T> {
    [a[0] * s, a[1] * s, a[2] * s]
}

/// a + b s.
#[inline(always)]
pub(crate) fn add_scaled<T: Lane>(a: V3<T>, b: V3<T>, s: T) -> V3<T> {
    [b[0].mul_add(s, a[0]), b[1].mul_add(s, a[1]), b[2].mul_add(s, a[2])]
}

/// a × b.
#[inline(always)]
pub(crate) fn cross<T: Lane>(a: V3<T>, b: V3<T>) -> V3<T> {
    [
        a[1].mul_add(b[2], -(a[2] * b[1])),
        a[2].mul_add(b[0], -(a[0] * b[2])),
        a[0].mul_add(b[1], -(a[1] * b[0])),
    ]
}

/// c − a × b.
#[inline(always)]
pub(crate) fn sub_cross<T: Lane>(c: V3<T>, a: V3<T>, b: V3<T>) -> V3<T> {
    [
        (-a[1]).mul_add(b[2], a[2].mul_add(b[1], c[0])),
        (-a[2]).mul_add(b[0], a[0].mul_add(b[2], c[1])),
        (-a[0]).mul_add(b[1], a[1].mul_add(b[0], c[2])),
    ]
}

#[inline(always)]
pub(crate) fn dot<T: Lane>(a: V3<T>, b: V3<T>) -> T {
    a[2].mul_add(b[2], a[1].mul_add(b[1], a[0] * b[0]))
}

/// c + a · b.
#[inline(always)]
fn add_dot<T: Lane>(c: T, a: V3<T>, b: V3<T>) -> T {
    a[2].mul_add(b[2], a[1].mul_add(b[1], a[0].mul_add(b[0], c)))
}

/// The same numbers in every lane of vectors like `like`.
#[inline(always)]
pub(crate) fn splat3<T: Lane>(like: T, a: [f64; 3]) -> V3<T> {
    [like.splat(a[0]), like.splat(a[1]), like.splat(a[2])]
}

/// M a.
#[inline(always)]
pub(crate) fn mul<T: Lane>(m: &M3<T>, a: V3<T>) -> V3<T> {
    [dot(m[0], a), dot(m[1], a), dot(m[2], a)]
}

/// c + M a.
#[inline(always)]
pub(crate) fn add_mul<T: Lane>(c: V3<T>, m: &M3<T>, a: V3<T>) -> V3<T> {
    [add_dot(c[0], m[0], a), add_dot(c[1], m[1], a), add_dot(c[2], m[2], a)]
}

/// c − M a.
#[inline(always)]
pub(crate) fn sub_mul<T: Lane>(c: V3<T>, m: &M3<T>, a: V3<T>) -> V3<T> {
    let minus = [-a[0], -a[1], -a[2]];
    add_mul(c, m, minus)
}

/// Mᵀ a.
#[inline(always)]
pub(crate) fn tmul<T: Lane>(m: &M3<T>, a: V3<T>) -> V3<T> {
    add_scaled(add_scaled(scale(m[0], a[0]), m[1], a[1]), m[2], a[2])
}

/// Mᵀ a + c.
#[inline(always)]
fn tmul_add<T: Lane>(m: &M3<T>, a: V3<T>, c: V3<T>) -> V3<T> {
    add_scaled(add_scaled(add_scaled(c, m[0], a[0]), m[1], a[1]), m[2], a[2])
}

/// Mᵀ.
#[inline(always)]
pub(crate) fn transposed<T: Lane>(m: &M3<T>) -> M3<T> {
    [
        [m[0][0], m[1][0], m[2][0]],
        [m[0][1], m[1][1], m[2][1]],
        [m[0][2], m[1][2], m[2][2]],
    ]
}

/// A B.
#[inline(always)]
pub(crate) fn mat_mul<T: Lane>(a: &M3<T>, b: &M3<T>) -> M3<T> {
    [tmul(b, a[0]), tmul(b, a[1]), tmul(b, a[2])]
}

/// A + s B.
#[inline(always)]
pub(crate) fn mat_axpy<T: Lane>(a: &M3<T>, s: T, b: &M3<T>) -> M3<T> {
    [
        add_scaled(a[0], b[0], s),
        add_scaled(a[1], b[1], s),
        add_scaled(a[2], b[2], s),
    ]
}

/// −A.
#[inline(always)]
pub(crate) fn negative<T: Lane>(a: &M3<T>) -> M3<T> {
    [
        [-a[0][0], -a[0][1], -a[0][2]],
        [-a[1][0], -a[1][1], -a[1][2]],
        [-a[2][0], -a[2][1], -a[2][2]],
    ]
}

/// s A.
#[inline(always)]
pub(crate) fn mat_scale<T: Lane>(s: T, a: &M3<T>) -> M3<T> {
    [scale(a[0], s), scale(a[1], s), scale(a[2], s)]
}

/// A B + C.
#[inline(always)]
pub(crate) fn mat_mul_add<T: Lane>(a: &M3<T>, b: &M3<T>, c: &M3<T>) -> M3<T> {
    [
        tmul_add(b, a[0], c[0]),
        tmul_add(b, a[1], c[1]),
        tmul_add(b, a[2], c[2]),
    ]
}

/// The cross-product matrix `[a×]`.
#[inline(always)]
pub(crate) fn skew<T: Lane>(a: V3<T>) -> M3<T> {
    let zero = a[0].splat(0.0);
    [[zero, -a[2], a[1]], [a[2], zero, -a[0]], [-a[1], a[0], zero]]
}

/// Zero matrix of lanes like `like`.
#[inline(always)]
pub(crate) fn zero3<T: Lane>(like: T) -> M3<T> {
    [[like.splat(0.0); 3]; 3]
}

/// Three numbers in a row.
#[inline(always)]
pub(crate) fn three<T: Copy, const N: usize>(x: &[T; N], from: usize) -> V3<T> {
    [x[from], x[from + 1], x[from + 2]]
}
