//! Symmetric 7 x 7 systems on fixed arrays.

use super::model::{JOINTS, Joints};

/// A 7 x 7 matrix by rows.
pub type Matrix = [Joints; JOINTS];

/// Returns the dot product.
#[inline]
pub fn dot(a: &Joints, b: &Joints) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Returns `m x`.
#[inline]
pub fn product(m: &Matrix, x: &Joints) -> Joints {
    std::array::from_fn(|i| dot(&m[i], x))
}

/// Adds `weight * row rowᵀ` to the lower triangle of `m`.
#[inline]
pub fn add_outer(m: &mut Matrix, row: &Joints, weight: f64) {
    for i in 0..JOINTS {
        let scaled = weight * row[i];
        for j in 0..=i {
            m[i][j] += scaled * row[j];
        }
    }
}

/// Adds `scale * x` to `to`.
#[inline]
pub fn add_scaled(to: &mut Joints, scale: f64, x: &Joints) {
    for (to, x) in to.iter_mut().zip(x) {
        *to += scale * x;
    }
}

/// Solves `m x = b` for a positive definite `m`, whose lower triangle is read, by Cholesky's
/// factorisation.
#[inline]
pub fn solve(mut m: Matrix, mut b: Joints) -> Joints {
    // m becomes L with 1 / L_ii on the diagonal.
    for i in 0..JOINTS {
        for j in 0..i {
            let sum: f64 = (0..j).map(|k| m[i][k] * m[j][k]).sum();
            m[i][j] = (m[i][j] - sum) * m[j][j];
        }
        let sum: f64 = (0..i).map(|k| m[i][k] * m[i][k]).sum();
        m[i][i] = 1.0 / (m[i][i] - sum).sqrt();
    }
    for i in 0..JOINTS {
        let sum: f64 = (0..i).map(|k| m[i][k] * b[k]).sum();
        b[i] = (b[i] - sum) * m[i][i];
    }
    for i in (0..JOINTS).rev() {
        let sum: f64 = (i + 1..JOINTS).map(|k| m[k][i] * b[k]).sum();
        b[i] = (b[i] - sum) * m[i][i];
    }
    b
}
