//! The wall of `fetch-reach-wall`.

use glam::DVec3;

use super::kinematics::Frames;

/// A box that the arm cannot enter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wall {
    /// Lowest corner in metres.
    pub low: DVec3,
    /// Highest corner in metres.
    pub high: DVec3,
}

/// Stands on the table between the left and the right half of the goal region: 2 cm thick, from
/// before the arm's shoulder to beyond its reach, and 5.5 cm higher than the highest goal. So no
/// straight line leads to the other half, nor does sliding along the wall towards the goal; the way
/// is over the top.
pub const WALL: Wall =
    Wall { low: DVec3::new(1.0, 0.739_101, 0.4), high: DVec3::new(1.8, 0.759_101, 0.74) };

/// A ball around the arm's centre line.
pub struct Sphere {
    /// The link that it is fixed to.
    pub link: usize,
    /// Distance of its centre from the joint along the link, in metres.
    pub along: f64,
    /// Metres.
    pub radius: f64,
}

const fn sphere(link: usize, along: f64) -> Sphere {
    Sphere { link, along, radius: RADIUS }
}

/// Radius of the arm in metres.
pub const RADIUS: f64 = 0.03;

/// The arm from the shoulder to the fingertips, by balls at most 4.5 cm apart.
pub static SPHERES: [Sphere; 22] = [
    sphere(1, 0.199),
    sphere(2, 0.02),
    sphere(2, 0.06),
    sphere(2, 0.10),
    sphere(3, 0.007),
    sphere(3, 0.03),
    sphere(3, 0.06),
    sphere(3, 0.10),
    sphere(3, 0.14),
    sphere(3, 0.18),
    sphere(4, 0.023),
    sphere(4, 0.063),
    sphere(4, 0.103),
    sphere(5, 0.015),
    sphere(5, 0.055),
    sphere(5, 0.095),
    sphere(5, 0.135),
    sphere(6, 0.0365),
    sphere(6, 0.0765),
    sphere(6, 0.1165),
    sphere(6, 0.1515),
    sphere(6, 0.1764),
];

impl Sphere {
    /// Returns its centre in metres.
    pub fn centre(&self, frames: &Frames) -> DVec3 {
        frames.origins[self.link] + frames.turns[self.link].x_axis * self.along
    }
}

impl Wall {
    /// Returns the y of its middle in metres.
    pub fn middle(&self) -> f64 {
        f64::midpoint(self.low.y, self.high.y)
    }

    /// Returns the distance in metres from `at` to the box, negative inside, and the direction away
    /// from it; `None` if it is far away.
    pub fn distance(&self, at: DVec3) -> Option<(f64, DVec3)> {
        let off = at - at.clamp(self.low, self.high);
        let squared = off.length_squared();
        if squared > 4.0 * RADIUS * RADIUS {
            None
        } else if squared > 0.0 {
            let distance = squared.sqrt();
            Some((distance, off / distance))
        } else {
            // Inside: out through the nearer of the two large faces, as the box is flat.
            let (left, right) = (at.y - self.low.y, self.high.y - at.y);
            Some(if left < right { (-left, -DVec3::Y) } else { (-right, DVec3::Y) })
        }
    }
}
