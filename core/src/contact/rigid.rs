//! The rigid-body motion of a deforming body, which damping must not hold back.

use super::body::BLOCK;
use super::lanes::Node;
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

/// The rigid motion that has a body's momentum and moment of momentum.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rigid {
    center: Vector3<f64>,
    velocity: Vector3<f64>,
    /// Angular velocity, rad/s.
    spin: Vector3<f64>,
}

/// Sums over nodes, about the origin.
#[derive(Debug, Clone, Copy)]
struct Sums {
    mass: f64,
    /// Mass times position.
    first: Vector3<f64>,
    /// Mass times position times position.
    second: Matrix3<f64>,
    momentum: Vector3<f64>,
    moment: Vector3<f64>,
}

impl Rigid {
    /// Nodes are added block by block, and blocks in their order: the same bits on any number of threads.
    pub(super) fn of(mass: &[f64], positions: &[Node], velocities: &[Node]) -> Self {
        let blocks: Vec<Sums> = (mass.par_chunks(BLOCK))
            .zip(positions.par_chunks(BLOCK))
            .zip(velocities.par_chunks(BLOCK))
            .map(|((mass, positions), velocities)| Sums::of(mass, positions, velocities))
            .collect();
        let mut all = Sums::none();
        blocks.iter().for_each(|b| all.add(b));
        let center = all.first / all.mass;
        let velocity = all.momentum / all.mass;
        let second = all.second - all.mass * center * center.transpose();
        let inertia = Matrix3::identity() * second.trace() - second;
        let moment = all.moment - center.cross(&all.momentum);
        // Nodes on one line have no inertia about it, and no spin to speak of.
        let spin = inertia.try_inverse().map_or_else(Vector3::zeros, |i| i * moment);
        Self { center, velocity, spin }
    }

    /// The velocity at a position, mm/s.
    #[inline]
    pub(super) fn at(&self, position: &Node) -> Node {
        (self.velocity + self.spin.cross(&(Vector3::from(*position) - self.center))).into()
    }
}

impl Sums {
    fn none() -> Self {
        let zero = Vector3::zeros();
        Self { mass: 0.0, first: zero, second: Matrix3::zeros(), momentum: zero, moment: zero }
    }

    fn of(mass: &[f64], positions: &[Node], velocities: &[Node]) -> Self {
        let mut sums = Self::none();
        for ((m, x), v) in mass.iter().zip(positions).zip(velocities) {
            let (x, v) = (Vector3::from(*x), Vector3::from(*v));
            sums.mass += m;
            sums.first += *m * x;
            sums.second += *m * x * x.transpose();
            sums.momentum += *m * v;
            sums.moment += *m * x.cross(&v);
        }
        sums
    }

    fn add(&mut self, other: &Self) {
        self.mass += other.mass;
        self.first += other.first;
        self.second += other.second;
        self.momentum += other.momentum;
        self.moment += other.moment;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rigid_motion_is_found_and_a_stretch_has_none() {
        let mass: Vec<f64> = (0..3000).map(|i| 1.0 + 0.3 * f64::from(i % 7)).collect();
        let positions: Vec<Node> = (0..3000)
            .map(f64::from)
            .map(|i| [0.3 + (0.7 * i).sin(), 0.8 * (1.3 * i).cos(), 0.5 * (2.1 * i).sin() - 0.2])
            .collect();
        let (velocity, spin) = (Vector3::new(1.0, -2.0, 0.5), Vector3::new(0.3, 0.7, -1.1));
        let moving: Vec<Node> =
            positions.iter().map(|x| (velocity + spin.cross(&Vector3::from(*x))).into()).collect();
        let rigid = Rigid::of(&mass, &positions, &moving);
        for (x, v) in positions.iter().zip(&moving) {
            assert!((Vector3::from(rigid.at(x)) - Vector3::from(*v)).norm() < 1e-12);
        }
        // Away from the centre of mass at a rate that is the same everywhere.
        let center = rigid.center;
        let stretch: Vec<Node> = positions.iter().map(|x| (Vector3::from(*x) - center).into()).collect();
        let rigid = Rigid::of(&mass, &positions, &stretch);
        assert!(rigid.velocity.norm() < 1e-12 && rigid.spin.norm() < 1e-12, "{rigid:?}");
    }
}
