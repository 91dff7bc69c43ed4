//! A rigid motion between two frames.

use crate::geometry::{Point, Projection, Vector};
use nalgebra::{Matrix4, UnitQuaternion, Vector6};

/// A rigid motion from the frame of one pose to that of another: first the turn, then the shift.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion {
    /// The turn about the first frame's origin.
    pub rotation: UnitQuaternion<f64>,
    /// Where the first frame's origin goes, mm.
    pub translation_mm: Vector,
}

impl Motion {
    /// The motion that moves nothing.
    pub fn identity() -> Self {
        Self { rotation: UnitQuaternion::identity(), translation_mm: Vector::zeros() }
    }

    /// The turn that also takes the point `from` to the point `to`.
    pub fn taking(rotation: UnitQuaternion<f64>, from: &Point, to: &Point) -> Self {
        Self { rotation, translation_mm: to.coords - rotation * from.coords }
    }

    /// The image of a point.
    #[inline]
    pub fn transform(&self, p: &Point) -> Point {
        self.rotation * p + self.translation_mm
    }

    /// The motion back.
    #[must_use]
    pub fn inverse(&self) -> Self {
        let rotation = self.rotation.inverse();
        Self { rotation, translation_mm: -(rotation * self.translation_mm) }
    }

    /// The camera that sees a moved point where `camera` saw it before it was moved.
    pub fn camera(&self, camera: &Projection) -> Projection {
        let back = self.inverse();
        let mut matrix = Matrix4::identity();
        matrix.fixed_view_mut::<3, 3>(0, 0).copy_from(back.rotation.to_rotation_matrix().matrix());
        matrix.fixed_view_mut::<3, 1>(0, 3).copy_from(&back.translation_mm);
        Projection::new(camera.matrix * matrix)
    }

    /// The motion followed by a small one: a turn (the first three numbers, radians) about a point, and a shift (mm).
    pub(super) fn stepped(&self, step: &Vector6<f64>, about: &Point) -> Self {
        let turn = UnitQuaternion::from_scaled_axis(Vector::new(step[0], step[1], step[2]));
        let shift = Vector::new(step[3], step[4], step[5]);
        Self {
            rotation: turn * self.rotation,
            translation_mm: turn * (self.translation_mm - about.coords) + about.coords + shift,
        }
    }

    /// The angle by which the turns of two motions differ, radians.
    pub fn apart_rad(&self, other: &Self) -> f64 {
        self.rotation.angle_to(&other.rotation)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix3x4;

    fn motion() -> Motion {
        let rotation = UnitQuaternion::from_euler_angles(0.3, -1.1, 2.0);
        Motion { rotation, translation_mm: Vector::new(0.4, -0.2, 1.5) }
    }

    #[test]
    fn a_moved_camera_sees_the_moved_place_where_it_was() {
        let m = Matrix3x4::new(230., 3., 4., 120., -5., 2., -231., 140., 0.01, 0.02, 0., 1.);
        let (camera, p) = (Projection::new(m), Point::new(0.1, 0.5, -0.3));
        let (want, got) = (camera.project(&p), motion().camera(&camera).project(&motion().transform(&p)));
        let ([a, b], [c, d]) = (want.unwrap(), got.unwrap());
        assert!((a - c).hypot(b - d) < 1e-9);
        assert!((motion().inverse().transform(&motion().transform(&p)) - p).norm() < 1e-12);
    }

    #[test]
    fn a_step_turns_about_its_place_and_shifts() {
        let about = motion().transform(&Point::new(0.2, 0.3, 0.4));
        let step = Vector6::new(0.01, -0.02, 0.03, 1.0, 2.0, 3.0);
        let after = motion().stepped(&step, &about).transform(&Point::new(0.2, 0.3, 0.4));
        assert!((after - about - Vector::new(1.0, 2.0, 3.0)).norm() < 1e-12);
        assert!(
            (motion().stepped(&step, &about).apart_rad(&motion()) - step.fixed_rows::<3>(0).norm()).abs()
                < 1e-9
        );
    }
}
