#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use proptest::prelude::*;
use trical_model::pose::rotation_zyx;

use super::*;

fn v(x: f64, y: f64, z: f64) -> V3 {
    V3::new(x, y, z)
}

fn at(x: f64, y: f64, z: f64) -> Pose {
    Pose { rotation: Matrix3::identity(), translation: v(x, y, z) }
}

#[test]
fn capsules_are_as_far_apart_as_their_axes_less_both_radii() {
    let a = Solid::capsule(v(0.0, 0.0, 0.0), v(1.0, 0.0, 0.0), 0.1);
    let b = Solid::capsule(v(0.0, -1.0, 0.0), v(0.0, 1.0, 0.0), 0.05);
    // axes cross at right angles 0.5 m apart
    assert!((distance(&at(0.0, 0.0, 0.5), &a, &at(0.5, 0.0, 0.0), &b) - 0.35).abs() < 1e-15);
    // end to end
    assert!((distance(&at(0.0, 0.0, 0.0), &a, &at(3.0, 0.0, 0.0), &b) - (2.0 - 0.15)).abs() < 1e-15);
    // parallel and shifted along: 3-4-5
    let c = Solid::capsule(v(0.0, 0.0, 0.0), v(1.0, 0.0, 0.0), 0.0);
    assert!((distance(&at(0.0, 0.0, 0.0), &a, &at(4.0, 4.0, 0.0), &c) - (5.0 - 0.1)).abs() < 1e-15);
}

#[test]
fn overlapping_capsules_have_a_negative_distance() {
    let a = Solid::capsule(v(0.0, 0.0, 0.0), v(1.0, 0.0, 0.0), 0.1);
    assert!((distance(&at(0.0, 0.0, 0.0), &a, &at(0.0, 0.15, 0.0), &a) + 0.05).abs() < 1e-15);
}

#[test]
fn a_capsule_over_a_face_an_edge_and_a_corner_of_a_box() {
    let block = Solid::cuboid(Pose::identity(), v(2.0, 2.0, 2.0), 0.0);
    let above = Solid::capsule(v(-5.0, 0.2, 1.5), v(5.0, 0.2, 1.5), 0.1);
    assert!((distance(&at(0.0, 0.0, 0.0), &above, &at(0.0, 0.0, 0.0), &block) - 0.4).abs() < 1e-15);
    // across the edge x = z = 1 at 45 degrees: sqrt 2 times half a metre off
    let edge = Solid::capsule(v(1.5, -3.0, 1.5), v(1.5, 3.0, 1.5), 0.1);
    assert!(
        (distance(&at(0.0, 0.0, 0.0), &edge, &at(0.0, 0.0, 0.0), &block) - (0.5_f64.hypot(0.5) - 0.1)).abs() < 1e-15
    );
    let corner = Solid::sphere(v(2.0, 2.0, 2.0), 0.2);
    assert!((distance(&at(0.0, 0.0, 0.0), &corner, &at(0.0, 0.0, 0.0), &block) - (3.0_f64.sqrt() - 0.2)).abs() < 1e-15);
    // wholly inside is a contact
    let inside = Solid::sphere(v(0.1, 0.0, 0.0), 0.01);
    assert!(distance(&at(0.0, 0.0, 0.0), &inside, &at(0.0, 0.0, 0.0), &block) < 0.0);
}

#[test]
fn a_cylinder_by_parry_is_right_within_the_slack() {
    let drum = Solid::cylinder(v(0.0, 0.0, 0.0), v(0.0, 0.0, 1.0), 0.3).unwrap();
    let ball = Solid::sphere(v(0.0, 0.0, 0.0), 0.1);
    for (place, expected) in
        [(v(1.0, 0.0, 0.5), 0.6), (v(0.0, 0.0, 1.5), 0.4), (v(0.6, 0.0, 1.4), 0.3_f64.hypot(0.4) - 0.1)]
    {
        let found = distance(&at(0.0, 0.0, 0.0), &drum, &at(place.x, place.y, place.z), &ball);
        assert!(found <= expected + 1e-9 && found > expected - 1.2 * GJK_SLACK, "{found} {expected}");
    }
    assert!(distance(&at(0.0, 0.0, 0.0), &drum, &at(0.0, 0.0, 0.5), &ball) < 0.0);
}

#[test]
fn a_hull_of_a_cubes_corners_is_the_cube_and_a_flat_one_is_none() {
    let corners = Solid::cuboid(Pose::identity(), v(1.0, 1.0, 1.0), 0.0).corners();
    let hull = Solid::hull(&corners, 0.0).unwrap();
    let rod = Solid::capsule(v(-1.0, 0.0, 0.0), v(1.0, 0.0, 0.0), 0.1);
    let found = distance(&at(0.0, 0.0, 0.0), &hull, &at(0.0, 0.0, 1.0), &rod);
    assert!((found - 0.4).abs() < 1.2 * GJK_SLACK, "{found}");
    assert!(distance(&at(0.0, 0.0, 0.0), &hull, &at(0.0, 0.0, 0.0), &Solid::sphere(v(0.0, 0.0, 0.0), 0.01)) < 0.0);
    assert!(Solid::hull(&corners[..4], 0.0).is_none());
    assert!(Solid::hull(&[v(1.0, 1.0, 1.0); 5], 0.0).is_none());
    assert!(Solid::hull(&[], 0.0).is_none());
}

fn point() -> impl Strategy<Value = V3> {
    prop::array::uniform3(-1.0..1.0_f64).prop_map(V3::from)
}

proptest! {
    /// Against brute force over a grid of points of the segment: never more than the grid says, and close to it.
    #[test]
    fn segment_to_box_agrees_with_brute_force(a in point(), b in point(), h in prop::array::uniform3(0.01..0.8_f64)) {
        let half = V3::from(h);
        let to_box = |p: V3| V3::from_fn(|i, _| (p[i].abs() - half[i]).max(0.0)).norm();
        let brute = (0..=2000)
            .map(|k| to_box(a + (b - a) * f64::from(k) / 2000.0))
            .fold(f64::INFINITY, f64::min);
        let found = distance_segment_box(&a, &b, &half);
        prop_assert!(found <= brute + 1e-12, "{found} {brute}");
        prop_assert!(found >= brute - (b - a).norm() / 4000.0 - 1e-12, "{found} {brute}");
    }

    #[test]
    fn segment_to_segment_agrees_with_brute_force(a in point(), b in point(), c in point(), d in point()) {
        let mut brute = f64::INFINITY;
        for i in 0..=60 {
            for j in 0..=60 {
                let p = a + (b - a) * f64::from(i) / 60.0;
                let q = c + (d - c) * f64::from(j) / 60.0;
                brute = brute.min((p - q).norm());
            }
        }
        let found = distance_segment_segment(&a, &b, &c, &d);
        prop_assert!(found <= brute + 1e-12);
        prop_assert!(found >= brute - ((b - a).norm() + (d - c).norm()) / 120.0 - 1e-12);
    }

    /// Nothing depends on where the bodies stand together, nor on their order.
    #[test]
    fn distance_does_not_change_when_all_is_moved(
        a in point(), b in point(), c in point(), r in prop::array::uniform3(-3.0..3.0_f64), t in point(),
    ) {
        let solids = [
            Solid::capsule(a, b, 0.05),
            Solid::cuboid(pose_zyx(c, r), V3::new(0.3, 0.2, 0.5), 0.0),
            Solid::sphere(c, 0.02),
        ];
        let moved = Pose { rotation: rotation_zyx(r[1], r[2], r[0]), translation: t };
        let still = Pose { rotation: rotation_zyx(0.3, -0.2, 0.1), translation: v(0.5, 0.1, -0.2) };
        for (s, u) in [(&solids[0], &solids[1]), (&solids[0], &solids[2]), (&solids[1], &solids[2])] {
            let plain = distance(&Pose::identity(), s, &still, u);
            prop_assert!((plain - distance(&moved, s, &moved.compose(&still), u)).abs() < 1e-9);
            prop_assert!((plain - distance(&still, u, &Pose::identity(), s)).abs() < 1e-12);
        }
    }
}
