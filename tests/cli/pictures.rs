//! Photographs and cameras that cannot be used.

use crate::kit::{Lab, SIZE, VIEWS, files, pictures, read};
use grainrig::session::State;
use image::{DynamicImage, GenericImage as _, ImageFormat, Rgb, RgbImage};
use std::io::Cursor;

fn jpeg(picture: RgbImage) -> Vec<u8> {
    let mut out = Cursor::new(Vec::new());
    DynamicImage::from(picture).write_to(&mut out, ImageFormat::Jpeg).unwrap();
    out.into_inner()
}

/// An import of the small photographs with one of them replaced; nothing of it must stay.
#[track_caller]
fn refused(bad: &[u8], parts: &[&str]) {
    let lab = Lab::new();
    let photos = lab.photos("photos");
    std::fs::write(photos.join("photo_2.jpg"), bad).unwrap();
    lab.import("photos", &[]).fails(1, parts).fails(1, &["photo_2.jpg"]);
    assert!(!lab.path("data").exists() || files(&lab.path("data")).is_empty());
}

/// As [`refused`], but the picture only fails the computation: the session stays, with every picture in it.
#[track_caller]
fn taken_in_but_not_computed(bad: &[u8], parts: &[&str]) {
    let lab = Lab::new();
    let photos = lab.photos("photos");
    std::fs::write(photos.join("photo_2.jpg"), bad).unwrap();
    lab.import("photos", &[]).fails(1, parts);
    let recording = lab.recording("photos");
    assert_eq!((recording.state(), recording.views().len()), (State::Failed, VIEWS));
    assert_eq!(recording.frame(2).unwrap().bytes, bad);
    lab.assert_sound("photos");
}

#[test]
fn a_cut_off_photograph_is_named_with_its_size_and_nothing_is_imported() {
    let whole = &pictures()[2];
    let cut = whole.len() * 2 / 3;
    refused(&whole[..cut], &[&format!("{cut} bytes"), "FF D9", "cut off", "copy it again"]);
}

#[test]
fn an_empty_photograph_is_refused() {
    refused(b"", &["0 bytes", "remove the file"]);
}

#[test]
fn a_file_that_is_no_picture_is_refused_whatever_its_name() {
    refused(b"GIF89a, or so it says", &["neither JPEG, PNG nor TIFF"]);
}

#[test]
fn a_photograph_of_another_size_is_refused_with_both_sizes() {
    let other = jpeg(RgbImage::from_pixel(200, 100, Rgb([200; 3])));
    refused(&other, &["200 × 100 px", "324 × 216 px", "one camera setting"]);
}

#[test]
fn a_photograph_without_a_grain_names_its_view_and_keeps_the_session() {
    let empty = jpeg(RgbImage::from_pixel(SIZE[0], SIZE[1], Rgb([200; 3])));
    taken_in_but_not_computed(&empty, &["error: view 2: "]);
}

#[test]
fn a_grain_cut_by_the_border_names_the_side_and_keeps_the_session() {
    let seen = image::load_from_memory(&pictures()[2]).unwrap().into_rgb8();
    let mut moved = RgbImage::from_pixel(SIZE[0], SIZE[1], *seen.get_pixel(2, 2));
    // The grain stands in the middle: half of it leaves the picture.
    let middle = SIZE[0] / 2;
    let right = image::imageops::crop_imm(&seen, middle, 0, SIZE[0] - middle, SIZE[1]).to_image();
    moved.copy_from(&right, 0, 0).unwrap();
    taken_in_but_not_computed(&jpeg(moved), &["view 2: ", "left border", "centre the grain"]);
}

#[test]
fn a_folder_that_is_missing_or_matches_nothing_is_named() {
    let lab = Lab::new();
    lab.photos("photos");
    lab.import("nowhere", &[]).fails(1, &["nowhere", "folder of photographs"]);
    lab.import("nowhere", &["--name", "n"]).fails(1, &["nowhere", "check the path"]);
    lab.import("photos", &["--pattern", "*.png"]).fails(1, &["\"*.png\"", "5 files: photo_0.jpg", "change"]);
    lab.import("photos", &["--pattern", "{"]).fails(2, &["pattern"]);
    lab.import("small.toml", &["--name", "n"]).fails(1, &["small.toml"]);
    assert!(!lab.path("data").exists());
}

#[test]
fn a_closing_view_beyond_the_pictures_is_refused_with_their_numbers() {
    let lab = Lab::new();
    lab.photos("photos");
    let base = ["--config", "small.toml", "import", "photos", "--step-deg", "45", "--mm-per-px", "0.009"];
    lab.run(&[&base[..], &["--closing-view", "5"]].concat()).fails(2, &["closing_view is 5", "0 to 4"]);
    lab.run(&[&base[..], &["--closing-view", "-1"]].concat()).fails(2, &["--closing-view"]);
}

#[test]
fn a_camera_file_must_have_a_camera_for_each_picture_and_be_text() {
    let lab = Lab::new();
    lab.photos("photos");
    let import = |file: &str| lab.run(&["--config", "small.toml", "import", "photos", "--cameras", file]);
    let row = "100,0,0,160,0,0,-100,110,0,1,0,100\n";
    import(&lab.write("three.csv", row.repeat(3))).fails(1, &["3 cameras", "5 pictures"]);
    let named = format!("photo_0.jpg,{row}photo_1.jpg,{row}");
    import(&lab.write("named.csv", named))
        .fails(1, &["no camera for photo_2.jpg", "photo_0.jpg, photo_1.jpg"]);
    import(&lab.write("empty.csv", "")).fails(1, &["no cameras"]);
    import(&lab.write("nan.csv", row.replace("160", "nan").repeat(5))).fails(1, &["line 1", "nan"]);
    import(&lab.write("par.txt", "5\nphoto_0.jpg 1 2 3\n")).fails(1, &["5 cameras", "1 lines"]);
    let garbage: Vec<u8> = (0..=255).cycle().take(5000).collect();
    import(&lab.write("garbage.txt", garbage)).fails(1, &["garbage.txt", "no text"]);
    import("nowhere.txt").fails(1, &["nowhere.txt", "check the path"]);
    assert!(!lab.path("data").exists());
}

#[test]
fn a_background_that_does_not_fit_is_refused() {
    let lab = Lab::new();
    lab.photos("photos");
    let small = lab.write("empty.jpg", jpeg(RgbImage::from_pixel(64, 64, Rgb([200; 3]))));
    lab.import("photos", &["--background", &small]).fails(1, &["64 × 64 px", "324 × 216 px"]);
    lab.import("photos", &["--background", "nowhere.jpg"]).fails(1, &["nowhere.jpg"]);
    assert!(!lab.path("data").exists());
}

#[test]
fn a_bad_picture_of_the_camera_is_taken_again_and_never_kept() {
    let lab = Lab::new();
    for fault in ["truncate_frame_at = 1", "empty_frame_at = 1"] {
        let name = fault.split('_').next().unwrap();
        let faults = format!("faults = {{ {fault} }}");
        let config = lab.config(&[("simulated", &faults)]);
        lab.run(&["--config", &config, "capture", name]).succeeds();
        assert_eq!(files(&lab.session(name).join("frames")).len(), VIEWS);
        lab.assert_sound(name);
    }
}

#[test]
fn a_camera_that_keeps_failing_ends_the_run_and_what_was_captured_is_resumed() {
    let lab = Lab::new();
    let cases: [(&str, &[&str]); 3] = [
        ("truncate_frame_at = 3", &["view 3: 1 of 1 pictures were bad", "cut off"]),
        ("empty_frame_at = 3", &["view 3: 1 of 1 pictures were bad", "0 bytes"]),
        ("fail_capture_at = 3", &["view 3: "]),
    ];
    for (fault, parts) in cases {
        let name = fault.split('_').next().unwrap();
        let faults = format!("faults = {{ {fault} }}");
        let config = lab.config(&[("plan", "retakes = 0"), ("simulated", &faults)]);
        lab.run(&["--config", &config, "capture", name]).fails(1, parts);
        let recording = lab.recording(name);
        assert_eq!((recording.state(), recording.views().len()), (State::Failed, 3));
        lab.assert_sound(name);
        let before: Vec<_> = recording.views().map(|v| v.sha256.clone()).collect();
        // The fault is at the fourth exposure of a process: two views are left.
        lab.run(&["resume", name]).succeeds();
        let after = lab.recording(name);
        assert_eq!((after.state(), after.views().len()), (State::Complete, VIEWS));
        assert!(after.views().map(|v| v.sha256.clone()).collect::<Vec<_>>().starts_with(&before));
        lab.assert_sound(name);
    }
}

#[test]
fn photographs_that_are_good_are_imported_byte_for_byte() {
    let lab = Lab::new();
    let photos = lab.photos("photos");
    lab.import("photos", &[]).succeeds();
    let recording = lab.recording("photos");
    for n in 0..VIEWS {
        assert_eq!(recording.frame(n).unwrap().bytes, read(&photos.join(format!("photo_{n}.jpg"))));
    }
    assert_eq!(recording.state(), State::Complete);
    lab.assert_sound("photos");
}
