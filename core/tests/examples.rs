//! The examples do what their titles promise.

#[path = "../examples/body_to_abaqus.rs"]
mod body_to_abaqus;
#[path = "../examples/silhouettes_to_hull.rs"]
mod silhouettes_to_hull;
#[path = "../examples/sphere_between_plates.rs"]
mod sphere_between_plates;

#[test]
fn the_hull_of_a_ball_is_a_little_larger_than_the_ball() {
    let ratio = silhouettes_to_hull::run().unwrap();
    // A slice of 50 sides: tan(π/50)·50/π = 1.0013; the rest is the grid's and the pixels'.
    assert!((1.0..1.004).contains(&ratio), "{ratio}");
}

#[test]
fn a_body_becomes_an_abaqus_deck_of_well_shaped_tetrahedra() {
    let (deck, least_deg) = body_to_abaqus::run().unwrap();
    assert!(least_deg > 18.0, "{least_deg}");
    for part in ["*NODE", "*ELEMENT", "C3D4", "TOP", "BOTTOM"] {
        assert!(deck.to_uppercase().contains(part), "{part}");
    }
}

#[test]
fn a_sphere_follows_the_form_for_two_plates() {
    let ratio = sphere_between_plates::run().unwrap();
    assert!((ratio - 1.0).abs() < 0.04, "{ratio}");
}
